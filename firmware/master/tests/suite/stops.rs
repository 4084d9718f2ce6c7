//! Causes that stop the robot, how fast it stops, and how it can continue.

use crate::common::{CYCLE_US, FakeNode, TestRig, emit};
use proptest::prelude::*;
use wheeleg_master::MasterConfig;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::event::{Event, HoldReason};
use wheeleg_master::finding::Finding;
use wheeleg_master::setpoint::Phase;
use wheeleg_protocol::{
    Address, Fault, InputBits, LimitBits, Message, NodeMode, SlotReply, SyncFlags,
};

#[test]
fn a_clear_queued_before_an_e_stop_does_not_take_it_back() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    let clear = rig.submit(Command::ClearFault);
    let stop = rig.submit(Command::EmergencyStop);
    for _ in 0..20 {
        let sync = rig.cycle();
        assert!(sync.flags.contains(SyncFlags::ESTOP));
    }
    assert!(rig.done(stop));
    assert_eq!(rig.refusal(clear), Some(Refusal::Interrupted));
    assert_eq!(rig.master.layer0().hold(), Some(HoldReason::EmergencyStop));
    // A clear that comes after it is obeyed.
    let clear = rig.submit(Command::ClearFault);
    rig.run(20);
    assert!(rig.done(clear));
    assert_eq!(rig.last_sync.unwrap().flags, SyncFlags::NONE);
}

#[test]
fn a_silent_node_is_lost_after_three_cycles_and_the_rest_hold() {
    let mut rig = TestRig::new(MasterConfig::default());
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
    // In that very SYNC the references freeze at the measured strokes, and the wheels are withdrawn.
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
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.node(3).echo_offset = 1;
    rig.run(4);
    assert!(rig.saw(|event| *event == Event::NodeLost(3)));
    assert!(rig.last_record.unwrap().counters.stale_replies >= 3);
}

#[test]
fn two_missed_cycles_are_no_loss() {
    let mut rig = TestRig::new(MasterConfig::default());
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
    let mut rig = TestRig::new(MasterConfig::default());
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
fn an_e_stop_is_the_bit_in_sync_alone_and_a_hold_asks_for_brakes() {
    let brakes = |rig: &mut TestRig| {
        let asked = |node: &mut FakeNode| core::mem::take(&mut node.requests);
        let requests = rig.nodes.iter_mut().flat_map(asked);
        requests
            .filter(|request| matches!(request, Message::EmergencyBrake(_)))
            .count()
    };
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.submit(Command::EmergencyStop);
    rig.run(20);
    assert_eq!(brakes(&mut rig), 0, "the bit in SYNC does it");

    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.node(7).inputs = InputBits::NONE;
    rig.run(20);
    assert_eq!(rig.master.layer0().hold(), Some(HoldReason::SupplyLost));
    assert_eq!(brakes(&mut rig), 8);

    // No axis is driven: there is nothing to brake, and nothing to hold.
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    rig.node(7).inputs = InputBits::NONE;
    rig.run(20);
    assert_eq!(rig.master.layer0().hold(), None);
    assert_eq!(brakes(&mut rig), 0);
}

#[test]
fn a_silent_node_is_named_while_nobody_drives_too() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    rig.node(4).silent = true;
    rig.run(4);
    assert!(rig.saw(|event| *event == Event::NodeLost(4)));
    assert_eq!(rig.master.layer0().hold(), None);
}

#[test]
fn a_wheel_board_that_starts_anew_counts_from_a_new_origin_and_the_way_stays() {
    let way = |rig: &TestRig| rig.master.layer0().odometry().travel_um();
    for wheel in [7, 8] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.run(60);
        rig.node(wheel).position += 50_000;
        rig.run(2);
        let before = way(&rig);
        assert!(before > 200_000, "{before}");
        rig.node(wheel).silent = true;
        rig.run(5);
        rig.node(wheel).position = 0;
        rig.node(wheel).silent = false;
        rig.run(2);
        assert_eq!(way(&rig), before);
        rig.node(wheel).position -= 50_000;
        rig.run(2);
        assert!(way(&rig).abs() <= 1, "{}", way(&rig));
    }
}

#[test]
fn node_fault_and_supply_loss_hold_all() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.node(2).faults = Fault::SensorRange.into();
    rig.run(2);
    let reason = HoldReason::NodeFault {
        node: 2,
        faults: 1 << 4,
    };
    assert!(rig.saw(|event| *event == Event::Hold(reason)));

    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.node(7).inputs = InputBits::NONE;
    rig.run(2);
    assert!(rig.saw(|event| *event == Event::Hold(HoldReason::SupplyLost)));
    assert!(!rig.master.is_armed());

    // Cleared without air: nothing may arm, not even for a cycle.
    rig.submit(Command::ClearFault);
    rig.run(20);
    let ticket = rig.submit(Command::Arm);
    rig.run(5);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NoAir));
    let armed = |rig: &mut TestRig| {
        let requests = rig.node(3).requests.iter();
        requests.filter(|m| matches!(m, Message::Arm(_))).count()
    };
    assert_eq!(armed(&mut rig), 1, "before the air was lost");
    rig.node(7).inputs = InputBits::SUPPLY_PRESSURE;
    rig.run(2);
    rig.arm();
    assert_eq!(armed(&mut rig), 2);
}

#[test]
fn a_stalled_layer_one_is_held_for_a_tenth_of_a_second() {
    let mut rig = TestRig::new(MasterConfig::default());
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
    // It comes back: the stop is still latched.
    rig.master.set_layer1_enabled(true);
    rig.run(5);
    assert!(!rig.master.is_armed());
}

#[test]
fn a_node_that_restarts_faster_than_it_is_missed_stops_the_others() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.stand();
    rig.submit(Command::StartGait);
    rig.run(60);
    // Its next reply comes in its slot, from a board that remembers nothing.
    rig.node(4).mode = NodeMode::Idle;
    rig.run(2);
    assert!(!rig.saw(|event| matches!(event, Event::NodeLost(_))));
    assert_eq!(
        rig.master.layer0().hold(),
        Some(HoldReason::NodeDisarmed(4))
    );
    rig.run(20);
    assert!(!rig.master.is_armed(), "latched");
    let others = [1, 2, 3, 5, 6].map(|joint| rig.node(joint).mode);
    assert_eq!(others, [NodeMode::Hold; 5]);
    // Disarming on request does not cause this.
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.submit(Command::Disarm);
    rig.run(20);
    assert!(!rig.saw(|event| matches!(event, Event::Hold(_))));
}

#[test]
fn emergency_brake_of_one_joint_stops_motion_and_keeps_the_others() {
    let mut rig = TestRig::new(MasterConfig::default());
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
fn blow_through_is_for_maintenance_only() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    let ticket = rig.submit(Command::BlowThrough { joint: 2 });
    rig.run(3);
    assert!(rig.done(ticket));
    rig.arm();
    let ticket = rig.submit(Command::BlowThrough { joint: 2 });
    rig.run(3);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NotDisarmed));
}

#[test]
fn a_stop_reaches_the_others_before_the_silent_node_times_out() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    // A request to the node that is about to fall silent is under way.
    rig.node(1).silent = true;
    let ticket = rig.submit(Command::TransmitPosition { joint: 1 });
    rig.run(4);
    assert!(rig.saw(|event| *event == Event::Hold(HoldReason::NodeLost(1))));
    assert_eq!(rig.refusal(ticket), Some(Refusal::Interrupted));
    for node in 2..=8 {
        assert_eq!(rig.node(node).mode, NodeMode::Hold, "{node}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Garbage and forged replies in mid-step: every reference stays within the stroke, and a HOLD, once entered, is
    /// not left.
    #[test]
    fn references_stay_in_the_stroke_whatever_the_bus_brings(
        garbage in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..60), 120),
        forged in prop::collection::vec((1_u8..=8, any::<i32>(), any::<u8>(), any::<bool>()), 120),
    ) {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.stand();
        rig.submit(Command::StartGait);
        rig.run(20);
        let mut held = None;
        for (bytes, (from, position_raw, inputs, faulty)) in garbage.into_iter().zip(forged) {
            rig.master.on_bus_bytes(&bytes, rig.now_us - 100);
            let cycle = rig.last_sync.unwrap().cycle;
            let active_faults = wheeleg_protocol::FaultBits::from_raw(u16::from(faulty && inputs > 250));
            let reply = SlotReply {
                position_raw,
                velocity_raw: 0,
                effort_raw: 0,
                active_faults,
                mode: NodeMode::Tracking,
                limits: LimitBits::NONE,
                inputs: InputBits::from_raw(inputs & 0x0F).unwrap().with(InputBits::SUPPLY_PRESSURE),
                sync_echo: cycle as u8,
            };
            let forged = emit(&Message::from(reply), Address::new(from).unwrap(), 0);
            rig.master.on_bus_bytes(&forged, rig.now_us - 50);
            let sync = rig.cycle();
            for joint in 1..=6 {
                if let Some(slot) = sync.slots.joint(Address::joint(joint).unwrap()) {
                    let mm = slot.reference.to_f64();
                    prop_assert!((0.0..=180.0).contains(&mm), "{joint}: {mm}");
                }
            }
            let hold = rig.master.layer0().hold();
            if held.is_some() {
                prop_assert_eq!(hold, held);
            }
            held = hold;
        }
    }
}

/// The master has restarted without the board noticing: no request of this master has armed it.
#[test]
fn a_board_that_is_armed_while_nobody_is_is_told_of_and_disarmed() {
    let left = |event: &Event| match event {
        Event::Found { node, finding } => (*finding == Finding::LeftArmed).then_some(*node),
        _ => None,
    };
    for boards in [&[4][..], &[1, 2, 3, 4, 5, 6, 7, 8], &[8]] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.run(60);
        for board in boards {
            rig.node(*board).mode = NodeMode::Armed;
        }
        let before: Vec<usize> = rig.nodes.iter().map(|n| n.requests.len()).collect();
        rig.run(30);
        let told: Vec<_> = rig.events.iter().filter_map(|(_, e)| left(e)).collect();
        assert_eq!(told, boards.iter().map(|b| Some(*b)).collect::<Vec<_>>());
        for (node, before) in rig.nodes.iter().zip(before) {
            assert_eq!(node.mode, NodeMode::Idle);
            let disarms = |m: &&Message| matches!(m, Message::Disarm(_));
            let asked = node.requests[before..].iter().filter(disarms).count();
            assert_eq!(asked, usize::from(boards.contains(&node.address.raw())));
        }
    }
    // A board that does not hear the request is asked again, but named only once.
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    rig.node(4).mode = NodeMode::Armed;
    rig.node(4).unanswered = 5;
    rig.run(60);
    assert_eq!(
        (rig.node(4).mode, rig.node(4).unanswered),
        (NodeMode::Armed, 0)
    );
    rig.run(120);
    assert_eq!(rig.node(4).mode, NodeMode::Idle);
    let told: Vec<_> = rig.events.iter().filter_map(|(_, e)| left(e)).collect();
    assert_eq!(told, [Some(4)]);
    // A requested arming or disarming does not count, whichever board is slow.
    for slow in [6, 8] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.arm();
        rig.node(slow).unanswered = 3;
        let ticket = rig.submit(Command::Disarm);
        rig.run(60);
        assert!(rig.done(ticket) && !rig.saw(|event| left(event).is_some()));
        // Nor does an aborted arming.
        let mut rig = TestRig::new(MasterConfig::default());
        rig.run(60);
        rig.node(2).never_arms = true;
        rig.submit(Command::Arm);
        rig.run(12);
        rig.node(slow).unanswered = 3;
        rig.run(100);
        assert!(rig.nodes.iter().all(|node| node.mode == NodeMode::Idle));
        assert!(!rig.saw(|event| left(event).is_some()));
    }
}

/// Behind a board that does not answer, requests wait for its repetitions.
#[test]
fn a_valve_is_not_opened_long_after_it_was_asked_for() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    let open = |rig: &mut TestRig, unanswered: u8| {
        rig.node(2).unanswered = unanswered;
        for _ in 0..20 {
            rig.submit(Command::TransmitPosition { joint: 2 });
            rig.cycle();
        }
        let ticket = rig.submit(Command::OpenAllValves { joint: 3 });
        rig.run(400);
        let opened = rig.node(3).requests.iter();
        let opened = opened.filter(|m| matches!(m, Message::OpenAllValves(_)));
        let opened = opened.count();
        (rig.done(ticket), rig.refusal(ticket), opened)
    };
    assert_eq!(open(&mut rig, 0), (true, None, 1));
    let late = open(&mut rig, 200);
    assert_eq!(late, (false, Some(Refusal::Expired), 1));
}

/// With the robot held already, an E-stop still drops waiting commands.
#[test]
fn an_e_stop_of_a_held_robot_drops_what_was_asked_before() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.node(2).faults = Fault::SensorRange.into();
    rig.run(20);
    assert!(rig.master.layer0().hold().is_some());
    let read = rig.submit(Command::ReadParameter {
        node: 5,
        id: 0x0101,
    });
    let open = rig.submit(Command::OpenAllValves { joint: 3 });
    rig.master.cycle(rig.now_us);
    rig.now_us += CYCLE_US;
    rig.submit(Command::EmergencyStop);
    rig.run(20);
    assert_eq!(rig.refusal(open), Some(Refusal::Interrupted));
    assert!(rig.done(read), "what opens no valve goes on");
    let opened = rig.node(3).requests.iter();
    assert_eq!(
        opened
            .filter(|m| matches!(m, Message::OpenAllValves(_)))
            .count(),
        0
    );
}
