//! Bus cycle, enumeration, arming, supervision and stops, against fake nodes.

use crate::common::{CYCLE_US, FakeNode, TestRig, decode, emit};
use fixed::types::I16F16;
use proptest::prelude::*;
use wheeleg_master::command::Command;
use wheeleg_master::config::{SwitchFrame, WheelDrive};
use wheeleg_master::contact::{Sector, Side};
use wheeleg_master::dispatcher::{Refusal, Ticket};
use wheeleg_master::event::Event;
use wheeleg_master::layer0::odometry::WheelGeometry;
use wheeleg_master::layer0::wheels::WheelUnits;
use wheeleg_master::layer1::params::GaitParams;
use wheeleg_master::{Master, MasterConfig};
use wheeleg_protocol::{
    Address, BoardKind, InputBits, Limit, LimitBits, Message, NackReason, NodeMode, SCHEMA_HASH,
    SyncFlags,
};
use wheeleg_units::{PositionMm, VelocityMmS, WheelCount};

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
    let mut rig = TestRig::new(MasterConfig::default());
    assert!(!rig.master.is_ready());
    rig.arm();
    for node in 1..=8 {
        assert!(rig.saw(|event| *event == Event::NodeReady(node)), "{node}");
        assert_eq!(rig.node(node).mode, NodeMode::Armed);
    }
    // 180 mm/s and 600 mm/s² in the chip's units at 520 µs per sample:
    // 19 863 counts/s → 10.33 → 10; 66 209 counts/s² → 0.017903·256 = 4.58 → 5.
    let requests = rig.node(7).requests.clone();
    assert!(requests.iter().any(|m| matches!(m,
        Message::WheelMaxSpeed(speed) if speed.speed.get() == 10)));
    assert!(requests.iter().any(|m| matches!(m,
        Message::WheelAcceleration(a) if a.acceleration.raw() == 5)));
    assert!(
        !rig.node(1)
            .requests
            .iter()
            .any(|m| matches!(m, Message::WheelMode(_)))
    );
}

/// With a limit below the streamed speed the wheels fall behind their references, and the stop at the end of a push
/// becomes a jolt.
#[test]
fn the_limit_of_a_streamed_wheel_is_above_all_that_is_streamed() {
    let mut rig = TestRig::new(MasterConfig {
        wheel_drive: WheelDrive::Stream,
        ..MasterConfig::default()
    });
    rig.arm();
    // 150 mm/s and 0.175 rad/s at 0.28 m: 199 mm/s, above the 180 mm/s of a push. With 110.35 counts/mm and 520 µs this
    // makes 11.42 counts, rounded up plus one.
    assert_eq!(profiles(&mut rig), [[13, 5], [13, 5]]);
    let faster = GaitParams {
        push_speed_mm_s: VelocityMmS::from_int(250),
        ..GaitParams::default()
    };
    rig.submit(Command::SetGait(faster));
    rig.run(20);
    // 14.35 counts.
    assert_eq!(profiles(&mut rig), [[13, 5, 16, 5], [13, 5, 16, 5]]);
}

/// Speeds and accelerations sent to both wheels, in order.
fn profiles(rig: &mut TestRig) -> [Vec<u16>; 2] {
    [7, 8].map(|node| {
        let told = rig.node(node).requests.iter().filter_map(|m| match m {
            Message::WheelMaxSpeed(speed) => Some(u16::from(speed.speed.get())),
            Message::WheelAcceleration(a) => Some(a.acceleration.raw()),
            _ => None,
        });
        told.collect()
    })
}

#[test]
fn new_gait_parameters_reach_the_wheels_profiles() {
    let gait = |speed: i16, acceleration: i16| GaitParams {
        push_speed_mm_s: VelocityMmS::from_int(speed),
        push_acceleration_mm_s2: I16F16::from_num(acceleration),
        ..GaitParams::default()
    };
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    assert_eq!(profiles(&mut rig), [[10, 5], [10, 5]]);
    // Armed: sent immediately, once, and only if something has changed.
    let set = rig.submit(Command::SetGait(gait(360, 1200)));
    rig.run(20);
    assert!(rig.done(set));
    assert_eq!(profiles(&mut rig), [[10, 5, 21, 9], [10, 5, 21, 9]]);
    // Disarmed: sent with the next arming.
    rig.submit(Command::Disarm);
    rig.run(20);
    rig.submit(Command::SetGait(gait(180, 600)));
    rig.run(20);
    assert_eq!(profiles(&mut rig), [[10, 5, 21, 9], [10, 5, 21, 9]]);
    rig.submit(Command::Arm);
    rig.run(20);
    assert_eq!(
        profiles(&mut rig),
        [[10, 5, 21, 9, 10, 5], [10, 5, 21, 9, 10, 5]]
    );
}

#[test]
fn schema_mismatch_refuses_arming_and_names_both() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.node(5).schema_hash = 0x1234;
    rig.run(60);
    let mismatch = Event::SchemaMismatch {
        node: 5,
        master: SCHEMA_HASH,
        theirs: 0x1234,
        firmware: [1, 0, 0],
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
    let mut rig = TestRig::new(MasterConfig::default());
    rig.node(7).board = BoardKind::Joint;
    rig.run(60);
    let ticket = rig.submit(Command::Arm);
    rig.run(3);
    assert_eq!(rig.refusal(ticket), Some(Refusal::WrongRole { node: 7 }));

    let mut rig = TestRig::new(MasterConfig::default());
    rig.node(2).silent = true;
    rig.run(60);
    let ticket = rig.submit(Command::Arm);
    rig.run(3);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NodeMissing { node: 2 }));
    // The absent node does not delay the identification of others.
    for node in [1, 3, 4, 5, 6, 7, 8] {
        assert!(rig.saw(|event| *event == Event::NodeReady(node)), "{node}");
    }
}

#[test]
fn one_refusal_while_arming_disarms_the_others() {
    let mut rig = TestRig::new(MasterConfig::default());
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
fn arming_waits_for_slow_answers_however_long_they_take_in_all() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    for node in &mut rig.nodes {
        node.unanswered = 1;
    }
    let ticket = rig.submit(Command::Arm);
    let mut cycles = 0;
    while !rig.done(ticket) {
        assert_eq!(rig.refusal(ticket), None, "after {cycles} cycles");
        rig.cycle();
        cycles += 1;
    }
    // Longer than the boards have to show a closed loop once all of them have been asked.
    assert!(cycles > 12, "{cycles}");
    assert!(rig.master.is_armed());
}

/// Asks for arming; one board acknowledges it but does not close its loop. Returns the ticket in the cycle in which the
/// last board has acknowledged.
fn armed_but_for_one(rig: &mut TestRig) -> Ticket {
    rig.run(60);
    rig.node(5).never_arms = true;
    let ticket = rig.submit(Command::Arm);
    let arm = |request: &Message| matches!(request, Message::Arm(_));
    let asked = |node: &FakeNode| node.requests.iter().any(arm);
    while !rig.nodes.iter().all(asked) {
        rig.cycle();
    }
    ticket
}

#[test]
fn boards_have_ten_cycles_to_close_their_loops_after_the_last_has_acknowledged() {
    let mut rig = TestRig::new(MasterConfig::default());
    let ticket = armed_but_for_one(&mut rig);
    rig.run(10);
    assert_eq!(rig.refusal(ticket), None);
    rig.run(1);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NotConfirmed));
    rig.run(2);
    assert!(rig.nodes.iter().all(|node| node.mode == NodeMode::Idle));

    // In the last of these cycles it is not too late.
    let mut rig = TestRig::new(MasterConfig::default());
    let ticket = armed_but_for_one(&mut rig);
    rig.run(9);
    rig.node(5).mode = NodeMode::Armed;
    rig.run(2);
    assert!(rig.done(ticket) && rig.master.is_armed());
}

#[test]
fn arming_is_done_when_no_joint_fills_any_more() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    // A wheel that waits for a change of direction delays nothing.
    rig.node(7).limits = Limit::DriveInhibited.mask();
    rig.node(4).limits = Limit::DriveInhibited.mask();
    let ticket = rig.submit(Command::Arm);
    rig.run(205);
    assert!(!rig.done(ticket) && rig.refusal(ticket).is_none());
    rig.node(4).limits = LimitBits::NONE;
    rig.run(2);
    assert!(rig.done(ticket) && rig.master.is_armed());

    // A joint that fills for ever is not waited for.
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    rig.node(4).limits = Limit::DriveInhibited.mask();
    let ticket = rig.submit(Command::Arm);
    rig.run(240);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NotConfirmed));
    assert!(rig.nodes.iter().all(|node| node.mode == NodeMode::Idle));
}

#[test]
fn arming_without_room_for_all_requests_arms_nobody() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    rig.node(1).silent = true;
    let mut tickets = Vec::new();
    for _ in 0..2 {
        for _ in 0..8 {
            tickets.push(rig.submit(Command::TransmitPosition { joint: 1 }));
        }
        rig.cycle();
    }
    for _ in 0..7 {
        tickets.push(rig.submit(Command::TransmitPosition { joint: 1 }));
    }
    let arm = rig.submit(Command::Arm);
    rig.cycle();
    assert_eq!(rig.refusal(arm), Some(Refusal::Busy));
    rig.node(1).silent = false;
    rig.run(60);
    for node in 1..=8 {
        assert_eq!(rig.node(node).mode, NodeMode::Idle, "{node}");
    }
    for ticket in tickets {
        assert!(rig.done(ticket) || rig.refusal(ticket).is_some());
    }
}

#[test]
fn a_user_command_behind_a_failed_arming_is_answered() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.node(6).refuse_arm = true;
    rig.run(60);
    let arm = rig.submit(Command::Arm);
    let behind = rig.submit(Command::TransmitPosition { joint: 2 });
    rig.run(40);
    assert!(rig.refusal(arm).is_some());
    assert_eq!(rig.refusal(behind), Some(Refusal::Interrupted));
}

#[test]
fn a_wheel_move_beyond_the_encoder_circle_is_refused() {
    // 520 000 counts and 942.478 mm per turn: 2^22 − 1 counts are 7602 mm.
    let wheels = WheelGeometry {
        counts_per_revolution: 520_000,
        circumference_um: 942_478,
    };
    let mut rig = TestRig::new(MasterConfig {
        wheels,
        ..MasterConfig::default()
    });
    rig.arm();
    let go = |rig: &mut TestRig, mm| {
        let travel_mm = PositionMm::from_int(mm);
        let ticket = rig.submit(Command::WheelReference { travel_mm });
        rig.cycle();
        (rig.refusal(ticket), rig.done(ticket))
    };
    // 20 m are 11.0 million counts: modulo 2^24 that is 10.4 m backward.
    for far in [20_000, 7_603, -7_603] {
        let (refusal, done) = go(&mut rig, far);
        assert!(matches!(refusal, Some(Refusal::Parameter(_))), "{far}");
        assert!(!done);
    }
    assert_eq!(go(&mut rig, 7_500), (None, true));
    // A second move would add up to 15 m from the wheels' positions.
    assert_eq!(go(&mut rig, 7_500), (Some(Refusal::Moving), false));
    assert_eq!(go(&mut rig, -7_500), (None, true));
}

/// Half of the unambiguous range of the 24-bit circle, minus one.
#[test]
fn a_wheel_reference_is_at_most_2_to_the_22_less_one_counts_away() {
    let wheels = WheelGeometry {
        counts_per_revolution: 1_000_000,
        circumference_um: 1_000_000,
    };
    let mut rig = TestRig::new(MasterConfig {
        wheels,
        ..MasterConfig::default()
    });
    rig.arm();
    for wheel in [7, 8] {
        rig.node(wheel).rate = 0;
    }
    let go = |rig: &mut TestRig, counts: i32| {
        let travel_mm = PositionMm::from_f64(f64::from(counts) / 1e3);
        let ticket = rig.submit(Command::WheelReference { travel_mm });
        rig.cycle();
        (rig.refusal(ticket), rig.done(ticket))
    };
    let reach = (1 << 22) - 1;
    for far in [reach + 1, -reach - 1] {
        let (refusal, done) = go(&mut rig, far);
        assert!(matches!(refusal, Some(Refusal::Parameter(_))), "{far}");
        assert!(!done);
    }
    // The wheels are held: each way back is added to the way there.
    for (counts, answer) in [
        (reach, (None, true)),
        (1, (Some(Refusal::Moving), false)),
        (-reach, (None, true)),
        (-reach, (None, true)),
        (-1, (Some(Refusal::Moving), false)),
    ] {
        assert_eq!(go(&mut rig, counts), answer, "{counts}");
    }
}

#[test]
fn a_velocity_is_told_in_sixteenths_of_a_count_per_sample() {
    let units = |sample_us| WheelUnits {
        geometry: WheelGeometry::default(),
        sample_us,
    };
    // 104 000 counts and 942.478 mm per turn: 180 mm/s are 10.33 counts in 520 µs.
    for (sample_us, mm_s, raw) in [
        (520, 180, 165),
        (520, -180, -165),
        (520, 1, 1),
        (520, 0, 0),
        (1_040, 180, 331),
        (2_048, 32_000, i16::MAX),
        (2_048, -32_000, i16::MIN),
    ] {
        let speed = VelocityMmS::from_int(mm_s);
        assert_eq!(units(sample_us).velocity_raw(speed), raw, "{mm_s} mm/s");
    }
}

/// Turned by hand, while the master does not control them.
#[test]
fn wheels_that_were_turned_while_stopped_go_on_from_where_they_are() {
    let disarm = [Command::Disarm];
    let stop = [Command::EmergencyStop, Command::ClearFault];
    for end in [&disarm[..], &stop] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.arm();
        let travel_mm = PositionMm::from_int(100);
        rig.submit(Command::WheelReference { travel_mm });
        rig.run(30);
        for command in end {
            rig.submit(*command);
            rig.run(20);
        }
        rig.node(7).position += 3_000;
        rig.node(8).position -= 7_000;
        rig.arm();
        let here = [7, 8].map(|wheel| rig.node(wheel).position);
        rig.submit(Command::WheelReference { travel_mm });
        let sync = rig.cycle();
        for (wheel, here) in [7, 8].into_iter().zip(here) {
            let slot = sync.slots.wheel(Address::wheel(wheel).unwrap()).unwrap();
            let begin = WheelCount::wrapping_new(here as i32);
            let way = slot.reference.wrapping_difference(begin);
            assert_eq!(way, 11_035, "wheel {wheel} after {end:?}");
        }
    }
}

#[test]
fn direct_references_reach_their_slot_only_while_nothing_moves() {
    let mut rig = TestRig::new(MasterConfig::default());
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
        let mut rig = TestRig::new(MasterConfig {
            wheel_drive: drive,
            ..MasterConfig::default()
        });
        rig.arm();
        // The fake encoder starts 608 counts below the wrap.
        for k in 1..=3_i64 {
            rig.submit(Command::WheelReference {
                travel_mm: PositionMm::from_int(100),
            });
            if drive == WheelDrive::Stream {
                // The master's own trapezoid: it begins at the wheels' positions, and takes its time.
                let sync = rig.cycle();
                let slot = sync.slots.wheel(Address::wheel(7).unwrap()).unwrap();
                let end = (8_388_000 + k * 11_035) as i32;
                let left = slot.reference.get().wrapping_sub(end) << 8 >> 8;
                assert!((-11_040..-10_000).contains(&left), "{k}: {left}");
                rig.run(150);
            }
            let sync = rig.cycle();
            // 100 mm = 11 034.8 counts.
            let expected = 8_388_000 + k * 11_035 - (1 << 24);
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
fn a_wheel_that_starts_anew_has_not_moved() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    let travel_um = |rig: &TestRig| rig.master.layer0().odometry().travel_um();
    let before = travel_um(&rig);
    // It is back before three replies are missed, and counts from 0.
    let wheel = &mut rig.nodes[6];
    wheel.mode = NodeMode::Boot;
    wheel.position = 0;
    rig.run(1);
    assert_eq!(travel_um(&rig), before);
    // From there on its counts are motion again; half of it is the mean of both wheels.
    rig.nodes[6].mode = NodeMode::Idle;
    rig.nodes[6].position = 1_000;
    rig.run(1);
    let counts_um = WheelGeometry::default().counts_to_um(1_000);
    let moved = travel_um(&rig) - before;
    assert!((moved - counts_um / 2).abs() <= 1, "{moved} of {counts_um}");
}

#[test]
fn user_requests_are_answered_by_the_node() {
    let mut rig = TestRig::new(MasterConfig::default());
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
            let mut rig = TestRig::new(MasterConfig {
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
    let mut rig = TestRig::new(MasterConfig::default());
    rig.keep_telemetry = true;
    rig.run(101);
    let mut records = Vec::new();
    while let Some(record) = rig.master.take_telemetry() {
        records.push(record);
    }
    assert_eq!(records.len(), 32);
    // Cycles 1..=100 are over; the last 32 remain, and the 68 before them are lost.
    assert_eq!(records[0].cycle, 69);
    assert_eq!(records[31].cycle, 100);
    rig.keep_telemetry = false;
    rig.cycle();
    assert_eq!(rig.last_record.unwrap().counters.lost_records, 68);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// For any input from the bus: no panic, never armed without a command, no set-point in any slot.
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
            // Valid frames with arbitrary contents, so that the CRC does not hide the handlers.
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
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    let ack = Message::from(wheeleg_protocol::Ack { request: 0x11 });
    let bytes = emit(&ack, Address::joint(1).unwrap(), 999);
    rig.master.on_bus_bytes(&bytes, rig.now_us);
    rig.run(2);
    assert_eq!(rig.last_record.unwrap().counters.unexpected, 1);
    assert!(!rig.master.is_armed());
}
