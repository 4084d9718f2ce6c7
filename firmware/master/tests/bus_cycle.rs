//! Bus cycle, enumeration, arming, supervision and stops, against fake nodes.

mod common;

use common::{CYCLE_US, Rig, decode, emit};
use proptest::prelude::*;
use wheeleg_master::command::Command;
use wheeleg_master::config::{SwitchFrame, WheelDrive};
use wheeleg_master::contact::{Sector, Side};
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::event::{Event, HoldReason};
use wheeleg_master::setpoint::Phase;
use wheeleg_master::{Master, MasterConfig};
use wheeleg_protocol::{
    Address, BoardKind, Fault, InputBits, Message, NackReason, NodeMode, SCHEMA_HASH, SyncFlags,
};
use wheeleg_units::PositionMm;

#[test]
fn cycle_counter_and_time_advance_and_wrap() {
    let mut master = Master::new(MasterConfig::default()).unwrap();
    let mut last = None;
    for k in 0..70_000_u64 {
        let now = k * CYCLE_US + 4_294_000_000;
        let bytes = master.cycle(now);
        if !(65_500..65_600).contains(&k) && k > 10 {
            continue;
        }
        let Some((_, Message::Sync(sync))) = decode(&bytes) else {
            panic!()
        };
        assert_eq!(sync.cycle, (k + 1) as u16, "advances by one and wraps");
        assert_eq!(sync.master_time_us, now as u32);
        if let Some((at, cycle)) = last
            && at + 1 == k
        {
            assert_eq!(sync.cycle.wrapping_sub(cycle), 1);
        }
        last = Some((k, sync.cycle));
    }
}

#[test]
fn every_node_is_identified_then_armed_with_wheel_setup() {
    let mut rig = Rig::new(MasterConfig::default());
    assert!(!rig.master.is_ready());
    rig.arm();
    for node in 1..=8 {
        assert!(rig.saw(|event| *event == Event::NodeReady(node)), "{node}");
        assert_eq!(rig.node(node).mode, NodeMode::Armed);
    }
    // 180 mm/s and 600 mm/s² in the chip's units at 520 µs a sample:
    // 99 314 counts/s → 51.64 → 52; 331 045 counts/s² → 0.08951·256 = 22.9 → 23.
    let requests = rig.node(7).requests.clone();
    assert!(requests.iter().any(|m| matches!(m,
        Message::WheelMaxSpeed(speed) if speed.speed.get() == 52)));
    assert!(requests.iter().any(|m| matches!(m,
        Message::WheelAcceleration(a) if a.acceleration.raw() == 23)));
    assert!(
        !rig.node(1)
            .requests
            .iter()
            .any(|m| matches!(m, Message::WheelMode(_)))
    );
}

#[test]
fn schema_mismatch_refuses_arming_and_names_both() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.node(5).schema_hash = 0x1234;
    rig.run(60);
    let mismatch = Event::SchemaMismatch {
        node: 5,
        master: SCHEMA_HASH,
        theirs: 0x1234,
    };
    assert!(rig.saw(|event| *event == mismatch));
    let ticket = rig.submit(Command::Arm);
    rig.run(20);
    assert_eq!(
        rig.refusal(ticket),
        Some(Refusal::SchemaMismatch {
            node: 5,
            master: SCHEMA_HASH,
            theirs: 0x1234
        })
    );
    for node in 1..=8 {
        assert_eq!(rig.node(node).mode, NodeMode::Idle);
    }
}

#[test]
fn misplaced_board_and_missing_node_refuse_arming() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.node(7).board = BoardKind::Joint;
    rig.run(60);
    let ticket = rig.submit(Command::Arm);
    rig.run(3);
    assert_eq!(rig.refusal(ticket), Some(Refusal::WrongRole { node: 7 }));

    let mut rig = Rig::new(MasterConfig::default());
    rig.node(2).silent = true;
    rig.run(60);
    let ticket = rig.submit(Command::Arm);
    rig.run(3);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NodeMissing { node: 2 }));
    // The absent node keeps nobody else from being identified.
    for node in [1, 3, 4, 5, 6, 7, 8] {
        assert!(rig.saw(|event| *event == Event::NodeReady(node)), "{node}");
    }
}

#[test]
fn one_refusal_while_arming_disarms_the_others() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.node(6).refuse_arm = true;
    rig.run(60);
    let ticket = rig.submit(Command::Arm);
    rig.run(40);
    assert_eq!(
        rig.refusal(ticket),
        Some(Refusal::NodeRefused {
            node: 6,
            reason: NackReason::FaultLatched
        })
    );
    for node in 1..=8 {
        assert_eq!(rig.node(node).mode, NodeMode::Idle, "{node}");
    }
    assert!(!rig.master.is_armed());
}

#[test]
fn a_silent_node_is_lost_after_three_cycles_and_the_rest_hold() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.stand();
    let ticket = rig.submit(Command::StartGait);
    rig.run(60);
    let strokes: Vec<_> = rig.nodes[..6].iter().map(|node| node.position).collect();
    rig.node(4).silent = true;
    rig.run(3);
    assert!(!rig.saw(|event| matches!(event, Event::NodeLost(_))));
    let sync = rig.cycle();
    assert!(rig.saw(|event| *event == Event::NodeLost(4)));
    assert!(rig.saw(|event| *event == Event::Hold(HoldReason::NodeLost(4))));
    // In that very SYNC the references freeze at the strokes measured, and the wheels are withdrawn.
    for joint in [1, 2, 3, 5, 6] {
        let slot = sync.slots.joint(Address::joint(joint).unwrap()).unwrap();
        let moved = i64::from(slot.reference.raw()) - strokes[usize::from(joint) - 1];
        assert!(moved.abs() <= 3 * rig.node(joint).rate, "{joint}");
        assert!(slot.next.is_none());
    }
    assert!(sync.slots.wheel(Address::wheel(7).unwrap()).is_none());
    assert_eq!(
        sync.flags,
        SyncFlags::NONE,
        "no supply dump for a lost node"
    );
    rig.run(12);
    for node in [1, 2, 3, 5, 6, 7, 8] {
        assert_eq!(rig.node(node).mode, NodeMode::Hold, "{node}");
    }
    assert_eq!(rig.refusal(ticket), Some(Refusal::Interrupted));
    // It stays latched when the node returns.
    rig.node(4).silent = false;
    rig.run(50);
    assert!(rig.saw(|event| *event == Event::NodeBack(4)));
    assert_eq!(rig.master.layer0().hold(), Some(HoldReason::NodeLost(4)));
    let ticket = rig.submit(Command::Arm);
    rig.run(3);
    assert_eq!(rig.refusal(ticket), Some(Refusal::Latched));
    let ticket = rig.submit(Command::ClearFault);
    rig.run(20);
    assert!(rig.done(ticket));
    rig.arm();
}

#[test]
fn a_node_that_repeats_an_old_reply_is_lost_too() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.arm();
    rig.node(3).echo_offset = 1;
    rig.run(4);
    assert!(rig.saw(|event| *event == Event::NodeLost(3)));
    assert!(rig.last_record.unwrap().counters.stale_replies >= 3);
}

#[test]
fn two_missed_cycles_are_no_loss() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.arm();
    for _ in 0..10 {
        rig.node(3).silent = true;
        rig.run(2);
        rig.node(3).silent = false;
        rig.run(1);
    }
    assert!(!rig.saw(|event| matches!(event, Event::NodeLost(_))));
    assert!(rig.master.is_armed());
    assert_eq!(rig.last_record.unwrap().counters.missed[2], 20);
}

#[test]
fn emergency_stop_sets_the_bit_until_cleared_and_never_queues() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.arm();
    // Fill the queue of layer 0 first.
    while rig.master.submit(Command::Disarm, rig.now_us).is_ok() {}
    let ticket = rig.submit(Command::EmergencyStop);
    let sync = rig.cycle();
    assert!(sync.flags.contains(SyncFlags::ESTOP));
    assert!(rig.done(ticket));
    for _ in 0..30 {
        assert!(rig.cycle().flags.contains(SyncFlags::ESTOP));
    }
    let ticket = rig.submit(Command::Arm);
    rig.run(2);
    assert_eq!(rig.refusal(ticket), Some(Refusal::Latched));
    rig.submit(Command::ClearFault);
    assert!(!rig.cycle().flags.contains(SyncFlags::ESTOP));
}

#[test]
fn node_fault_and_supply_loss_hold_all() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.arm();
    rig.node(2).faults = Fault::SensorRange.into();
    rig.run(2);
    let reason = HoldReason::NodeFault {
        node: 2,
        faults: 1 << 4,
    };
    assert!(rig.saw(|event| *event == Event::Hold(reason)));

    let mut rig = Rig::new(MasterConfig::default());
    rig.arm();
    rig.node(7).inputs = InputBits::NONE;
    rig.run(2);
    assert!(rig.saw(|event| *event == Event::Hold(HoldReason::SupplyLost)));
    assert!(!rig.master.is_armed());
}

#[test]
fn a_stalled_layer_one_is_held_for_a_tenth_of_a_second() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.stand();
    rig.submit(Command::StartGait);
    rig.run(60);
    let vertical = Address::joint(3).unwrap();
    let before = rig.last_sync.unwrap().slots.joint(vertical).unwrap();
    rig.master.set_layer1_enabled(false);
    for _ in 0..10 {
        let slot = rig.cycle().slots.joint(vertical).unwrap();
        assert_eq!(slot.reference, before.reference, "last reference held");
        assert!(slot.track && slot.next.is_none());
        assert!(!rig.saw(|event| matches!(event, Event::Hold(_))));
    }
    rig.cycle();
    assert!(rig.saw(|event| *event == Event::Hold(HoldReason::LayerOneStalled)));
    // It comes back: still latched.
    rig.master.set_layer1_enabled(true);
    rig.run(5);
    assert!(!rig.master.is_armed());
}

#[test]
fn direct_references_reach_their_slot_only_while_nothing_moves() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.run(30);
    let stroke_mm = PositionMm::from_int(33);
    let command = Command::JointReference {
        joint: 5,
        stroke_mm,
    };
    let ticket = rig.submit(command);
    rig.run(1);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NotArmed));
    rig.arm();
    rig.submit(command);
    let sync = rig.cycle();
    for joint in 1..=6 {
        let slot = sync.slots.joint(Address::joint(joint).unwrap()).unwrap();
        assert_eq!(slot.track, joint == 5);
        if joint == 5 {
            assert_eq!(slot.reference, stroke_mm);
        } else {
            assert_eq!(slot.reference.to_f64(), 60.0, "kept where it is");
        }
    }
    let ticket = rig.submit(Command::JointReference {
        joint: 5,
        stroke_mm: PositionMm::from_int(181),
    });
    rig.run(1);
    assert!(matches!(rig.refusal(ticket), Some(Refusal::Parameter(_))));
    let ticket = rig.submit(Command::JointReference {
        joint: 7,
        stroke_mm,
    });
    rig.run(1);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NoSuchJoint { joint: 7 }));
    rig.submit(Command::Stand);
    rig.run(2);
    let ticket = rig.submit(command);
    rig.run(1);
    assert_eq!(rig.refusal(ticket), Some(Refusal::Moving));
}

#[test]
fn wheel_moves_start_at_the_last_reference_and_wrap() {
    for drive in [WheelDrive::Profile, WheelDrive::Stream] {
        let mut rig = Rig::new(MasterConfig {
            wheel_drive: drive,
            ..MasterConfig::default()
        });
        rig.arm();
        // The fake encoder starts 608 counts below the wrap.
        for k in 1..=3_i64 {
            rig.submit(Command::WheelReference {
                travel_mm: PositionMm::from_int(100),
            });
            let sync = rig.cycle();
            // 100 mm = 55 174.2 counts.
            let expected = 8_388_000 + k * 55_174 - (1 << 24);
            for wheel in [7, 8] {
                let slot = sync.slots.wheel(Address::wheel(wheel).unwrap()).unwrap();
                assert!(
                    (i64::from(slot.reference.get()) - expected).abs() <= k,
                    "{k}"
                );
            }
            rig.run(30);
        }
        let travelled = rig.master.layer0().odometry().travel_um();
        assert!((travelled - 300_000).abs() < 10, "{travelled}");
    }
}

#[test]
fn user_requests_are_answered_by_the_node() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.run(60);
    let ticket = rig.submit(Command::TransmitPosition { joint: 4 });
    rig.run(2);
    assert!(rig.done(ticket));
    let stroke_mm = PositionMm::from_int(60);
    assert!(rig.saw(|event| *event
        == Event::Position {
            joint: 4,
            stroke_mm
        }));
    rig.node(4).silent = true;
    let ticket = rig.submit(Command::TransmitPosition { joint: 4 });
    rig.run(12);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NoAnswer { node: 4 }));
}

#[test]
fn emergency_brake_of_one_joint_stops_motion_and_keeps_the_others() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.stand();
    let gait = rig.submit(Command::StartGait);
    rig.run(60);
    let brake = rig.submit(Command::EmergencyBrake { joint: 3 });
    rig.run(5);
    assert!(rig.done(brake));
    assert_eq!(rig.refusal(gait), Some(Refusal::Interrupted));
    assert_eq!(rig.node(3).mode, NodeMode::Hold);
    for node in [1, 2, 4, 5, 6] {
        assert_eq!(rig.node(node).mode, NodeMode::Tracking, "{node}");
    }
    assert_eq!(rig.last_record.unwrap().phase, Phase::Idle);
}

#[test]
fn touch_sides_are_those_of_the_robot_on_both_legs() {
    // (bit in the leg's frame, side on the left leg, side on the right leg)
    let cases = [
        (InputBits::FOOT_FRONT, Sector::Front, Sector::Front),
        (InputBits::FOOT_LEFT, Sector::Left, Sector::Right),
        (InputBits::FOOT_REAR, Sector::Rear, Sector::Rear),
        (InputBits::FOOT_RIGHT, Sector::Right, Sector::Left),
    ];
    for (bit, left, right) in cases {
        for (frame, right) in [(SwitchFrame::Leg, right), (SwitchFrame::Robot, left)] {
            let mut rig = Rig::new(MasterConfig {
                switch_frame: frame,
                ..MasterConfig::default()
            });
            rig.run(10);
            rig.node(3).inputs = bit;
            rig.node(6).inputs = bit;
            rig.run(2);
            for (side, sector) in [(Side::Left, left), (Side::Right, right)] {
                let sector = Some(sector);
                assert!(rig.saw(|event| *event == Event::TouchDown { side, sector }));
            }
            rig.node(3).inputs = InputBits::NONE;
            rig.run(2);
            assert!(rig.saw(|event| *event == Event::LiftOff(Side::Left)));
            assert!(!rig.saw(|event| *event == Event::LiftOff(Side::Right)));
        }
    }
}

#[test]
fn telemetry_drops_the_oldest_and_counts() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.keep_telemetry = true;
    rig.run(101);
    let mut records = Vec::new();
    while let Some(record) = rig.master.take_telemetry() {
        records.push(record);
    }
    assert_eq!(records.len(), 32);
    // Cycles 1..=100 are over; the last 32 remain and the 68 before are lost.
    assert_eq!(records[0].cycle, 69);
    assert_eq!(records[31].cycle, 100);
    rig.keep_telemetry = false;
    rig.cycle();
    assert_eq!(rig.last_record.unwrap().counters.lost_records, 68);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever comes from the bus: no panic, never armed without a command, no
    /// set-point in any slot.
    #[test]
    fn arbitrary_bytes_never_arm(
        chunks in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 0..20),
        replies in prop::collection::vec((any::<[u8; 16]>(), 1_u8..=8, 0_u8..=0xFF, any::<u16>()), 0..20),
    ) {
        let mut master = Master::new(MasterConfig::default()).unwrap();
        let mut now = 0;
        let mut replies = replies.into_iter();
        for chunk in chunks {
            let sync = decode(&master.cycle(now)).unwrap().1;
            let Message::Sync(sync) = sync else { panic!() };
            prop_assert_eq!(sync.slots, wheeleg_protocol::SyncSlots::NONE);
            prop_assert_eq!(sync.flags, SyncFlags::NONE);
            master.on_bus_bytes(&chunk, now + 500);
            // Sound frames with arbitrary contents, so that the CRC does not hide the handlers.
            for (payload, from, kind, sequence) in replies.by_ref().take(4) {
                let header = wheeleg_protocol::Header {
                    version: wheeleg_protocol::VERSION,
                    message_type: kind,
                    source: Address::new(from).unwrap(),
                    destination: Address::MASTER,
                    sequence,
                };
                let mut out = [0; wheeleg_protocol::MAX_ENCODED];
                let len = wheeleg_protocol::MessageType::from_code(kind)
                    .map_or(16, |t| t.payload_len().min(16));
                let bytes = wheeleg_protocol::encode(&header, &payload[..len], &mut out).unwrap();
                master.on_bus_bytes(bytes, now + 1_500);
            }
            let _ = master.next_acyclic(now + 4_000);
            now += CYCLE_US;
            prop_assert!(!master.is_armed());
        }
    }
}

#[test]
fn answers_to_nobody_are_counted_and_ignored() {
    let mut rig = Rig::new(MasterConfig::default());
    rig.run(60);
    let ack = Message::from(wheeleg_protocol::Ack { request: 0x11 });
    let bytes = emit(&ack, Address::joint(1).unwrap(), 999);
    rig.master.on_bus_bytes(&bytes, rig.now_us);
    rig.run(2);
    assert_eq!(rig.last_record.unwrap().counters.unexpected, 1);
    assert!(!rig.master.is_armed());
}
