//! Dispatcher: routing by code, deadlines, duplicates, queues.

use wheeleg_master::behaviour::Behaviours;
use wheeleg_master::command::{Command, CommandCode, CorrectionKind, Layer, TABLE, write_markdown};
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::{DEADLINE_MAX_US, Refusal, Reject, Request};
use wheeleg_master::event::{EVENT_DEPTH, Event, Events, HoldReason};
use wheeleg_master::fifo::{POLICIES, WhenFull, push_drop_oldest, take_newest};
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_master::layer1::params::GaitParams;
use wheeleg_master::layer1::walk::WalkOrder;
use wheeleg_master::{Master, MasterConfig};
use wheeleg_units::{PositionMm, VelocityMmS};

fn all() -> Vec<Command> {
    let joint = 2;
    let side = Side::Right;
    vec![
        Command::JointReference {
            joint,
            stroke_mm: PositionMm::ZERO,
        },
        Command::TransmitPosition { joint },
        Command::OpenAllValves { joint },
        Command::EmergencyBrake { joint },
        Command::SelectCorrection {
            joint,
            correction: CorrectionKind::Id,
        },
        Command::BlowThrough { joint },
        Command::WheelReference {
            travel_mm: PositionMm::ZERO,
        },
        Command::WheelSpeed {
            side,
            speed_mm_s: VelocityMmS::from_int(100),
        },
        Command::WheelAcceleration {
            side,
            acceleration_mm_s2: fixed::types::I16F16::lit("600"),
        },
        Command::WheelFilter {
            side,
            a: 0xE5,
            b: 0x40,
            k: 0x40,
        },
        Command::Arm,
        Command::Disarm,
        Command::ClearFault,
        Command::EmergencyStop,
        Command::Commission,
        Command::TakeControl,
        Command::ReleaseControl,
        Command::SetBehaviours(Behaviours::ALL),
        Command::ReadParameter { node: 1, id: 1 },
        Command::WriteParameter {
            node: 1,
            id: 1,
            raw: 0,
        },
        Command::SaveParameters { node: 1 },
        Command::Stand,
        Command::Hold,
        Command::StartGait,
        Command::StopGait,
        Command::SetGait(GaitParams::default()),
        Command::FootTrajectory {
            side,
            shape: FootShape::default(),
        },
        Command::Walk(WalkOrder::default()),
    ]
}

#[test]
fn every_code_names_the_layer_that_answers_it() {
    let commands = all();
    assert_eq!(commands.len(), TABLE.len());
    for (command, row) in commands.into_iter().zip(TABLE) {
        assert_eq!(command.code(), row.code, "{}", row.name);
        let range = row.code as u16 >> 8;
        let layer = match range {
            1 => Layer::Zero,
            2 => Layer::One,
            other => panic!("range {other}"),
        };
        assert_eq!(row.code.layer(), layer);
        // The layer named by the code is the one that stops answering when its queue is full.
        if matches!(
            row.code,
            CommandCode::EmergencyStop | CommandCode::TakeControl | CommandCode::ReleaseControl
        ) {
            // Not queued, or not allowed for this client (`operator.rs`).
            continue;
        }
        let mut master = Master::new(MasterConfig::default()).unwrap();
        for _ in 0..8 {
            master.submit(command, 0).unwrap();
        }
        assert_eq!(master.submit(command, 0), Err(Reject::QueueFull { layer }));
        let other = match layer {
            Layer::Zero => Command::StartGait,
            Layer::One => Command::Arm,
        };
        assert!(
            master.submit(other, 0).is_ok(),
            "the other layer still answers"
        );
    }
    assert_eq!(Layer::of_code(0x00FF), None);
    assert_eq!(Layer::of_code(0x0100), Some(Layer::Zero));
    assert_eq!(Layer::of_code(0x01FF), Some(Layer::Zero));
    assert_eq!(Layer::of_code(0x0200), Some(Layer::One));
    assert_eq!(Layer::of_code(0x0300), None);
}

#[test]
fn documentation_is_generated_from_the_table() {
    let mut page = String::new();
    write_markdown(&mut page).unwrap();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let committed = std::fs::read_to_string(format!("{root}/docs/reference/commands.md"));
    assert!(
        committed.unwrap() == page,
        "write it anew: cargo run --release -- commands --markdown > docs/reference/commands.md"
    );
    let file = std::fs::read_to_string(format!("{root}/firmware/master/COMMANDS.md")).unwrap();
    for policy in POLICIES {
        let row = format!(
            "| {} | {} | {:?} |",
            policy.name, policy.depth, policy.when_full
        );
        assert!(file.contains(&row), "{row} {}|", policy.why);
    }
}

fn request(client: u8, id: u32, deadline_us: u64) -> Request {
    Request {
        client,
        id,
        deadline_us,
        command: Command::Disarm,
    }
}

#[test]
fn late_far_repeated_and_reordered_commands_are_refused() {
    let mut master = Master::new(MasterConfig::default()).unwrap();
    let now = 5_000_000;
    let mut submit = |request: Request| master.submit_request(request, now).map(|t| t.id);
    assert_eq!(submit(request(1, 10, now)), Ok(10), "just in time");
    assert_eq!(
        submit(request(1, 11, now - 1)),
        Err(Reject::Expired { late_us: 1 })
    );
    assert_eq!(submit(request(1, 11, now)), Err(Reject::Duplicate));
    assert_eq!(
        submit(request(1, 9, now)),
        Err(Reject::OutOfOrder { last: 11 })
    );
    assert_eq!(submit(request(0, 9, now)), Ok(9), "each client on its own");
    assert_eq!(
        submit(request(1, 12, now + DEADLINE_MAX_US + 1)),
        Err(Reject::DeadlineTooFar)
    );
    assert_eq!(submit(request(4, 1, now)), Err(Reject::UnknownClient));
    // A client that reconnects may start again.
    assert_eq!(
        submit(request(0, 1, now)),
        Err(Reject::OutOfOrder { last: 9 })
    );
    master.open_session(0);
    assert!(master.submit_request(request(0, 1, now), now).is_ok());
    // Numbers wrap.
    let mut master = Master::new(MasterConfig::default()).unwrap();
    for id in [u32::MAX, 0] {
        let ticket = master.submit_request(request(0, id, now), now).unwrap();
        assert_eq!(ticket.id, id);
    }
}

#[test]
fn an_old_emergency_stop_is_obeyed() {
    let mut master = Master::new(MasterConfig::default()).unwrap();
    let stop = Request {
        command: Command::EmergencyStop,
        ..request(1, 1, 0)
    };
    assert!(master.submit_request(stop, 60_000_000).is_ok());
    assert_eq!(master.layer0().hold(), Some(HoldReason::EmergencyStop));
}

#[test]
fn a_repeated_overtaken_or_early_emergency_stop_is_obeyed() {
    let now = 5_000_000;
    for (id, deadline_us) in [(10, now), (9, now), (11, now + DEADLINE_MAX_US + 1)] {
        let mut master = Master::new(MasterConfig::default()).unwrap();
        master.submit_request(request(1, 10, now), now).unwrap();
        let stop = Request {
            command: Command::EmergencyStop,
            ..request(1, id, deadline_us)
        };
        assert!(master.submit_request(stop, now).is_ok(), "{id}");
        assert_eq!(master.layer0().hold(), Some(HoldReason::EmergencyStop));
        // The client's count does not go back.
        assert_eq!(
            master.submit_request(request(1, 10, now), now).err(),
            Some(if id == 11 {
                Reject::OutOfOrder { last: 11 }
            } else {
                Reject::Duplicate
            })
        );
    }
}

#[test]
fn what_waited_through_a_stall_expires_in_the_queue() {
    let mut master = Master::new(MasterConfig::default()).unwrap();
    let ticket = master
        .submit_request(
            Request {
                command: Command::Stand,
                ..request(1, 1, 20_000)
            },
            0,
        )
        .unwrap();
    master.set_layer1_enabled(false);
    master.cycle(10_000);
    master.cycle(20_000);
    master.set_layer1_enabled(true);
    master.cycle(30_000);
    let event = std::iter::from_fn(|| master.take_event()).map(|(_, event)| event);
    let refused = Event::Refused {
        ticket,
        reason: Refusal::Expired,
    };
    assert!(event.into_iter().any(|event| event == refused));
}

#[test]
fn full_queues_answer_as_documented() {
    let mut queue = heapless::spsc::Queue::<u8, 4>::new();
    let lost: u32 = (0..5).map(|i| push_drop_oldest(&mut queue, i)).sum();
    assert_eq!((lost, queue.len()), (2, 3));
    assert_eq!(queue.iter().copied().collect::<Vec<_>>(), [2, 3, 4]);
    assert_eq!(take_newest(&mut queue), Some(4));
    assert_eq!(take_newest(&mut queue), None);
    assert_eq!(push_drop_oldest(&mut queue, 9), 0);
    assert_eq!(
        POLICIES.map(|policy| (policy.depth, policy.when_full)),
        [
            (8, WhenFull::Reject),
            (8, WhenFull::Reject),
            (2, WhenFull::HoldLast),
            (2, WhenFull::DropOldest),
            (32, WhenFull::DropOldest),
        ]
    );
    let mut events = Events::new();
    for node in 0..40 {
        events.push(0, Event::NodeReady(node));
    }
    assert_eq!(events.lost(), 40 - EVENT_DEPTH as u32);
    assert_eq!(events.pop(), Some((0, Event::NodeReady(8))));
}
