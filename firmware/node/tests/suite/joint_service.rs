//! What a joint board answers: replies, requests, parameters, switches.

use crate::common::joint::{JointRig, setpoint};
use crate::common::{ARM, decode, frame, frame_from, refusal};
use wheeleg_node::FIRMWARE_VERSION;
use wheeleg_node::mode::Mode;
use wheeleg_protocol::LinkLossAction::Hold;
use wheeleg_protocol::link::{SlotTiming, TURNAROUND_US};
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Address, BoardKind, Disarm, Identify, InputBits, Message, MessageType, NackReason, ParamGet,
    ParamSet, SCHEMA_HASH, Sync, SyncFlags, SyncSlots, TransmitPosition, WheelFilter,
};
use wheeleg_units::{Micros, PositionMm};

fn set(parameter: JointParam, value: i32) -> Message {
    Message::ParamSet(ParamSet {
        id: parameter.id(),
        value,
    })
}

#[test]
fn slot_reply_is_timed_from_the_end_of_sync_for_any_chunking() {
    let offset = SlotTiming::DEFAULT
        .slot_start_us(Address::joint(3).unwrap())
        .unwrap();
    let sync = |cycle| {
        frame(
            Address::BROADCAST,
            0,
            &Message::Sync(Sync {
                cycle,
                master_time_us: 0,
                flags: SyncFlags::NONE,
                slots: SyncSlots::NONE,
            }),
        )
    };
    for chunk in [1, 2, 7, 50, 200] {
        let mut rig = JointRig::new();
        rig.run(20);
        let end = 300_000_u32;
        let mut bytes = sync(1);
        let behind = bytes.len();
        // Half of another frame follows in the same stream of bytes.
        bytes.extend_from_slice(&sync(2)[..40]);
        let mut done = 0;
        for chunk in bytes.chunks(chunk) {
            done += chunk.len();
            let t_end = end + 10 * (done as u32) - 10 * behind as u32;
            rig.node.on_bus_bytes(chunk, Micros(t_end));
        }
        let reply = rig.node.take_transmission().unwrap();
        assert_eq!(reply.start_at, Micros(end + offset), "chunks of {chunk}");
        assert!(rig.node.take_transmission().is_none());
    }
}

#[test]
fn slot_reply_carries_the_state_of_the_last_tick() {
    let mut rig = JointRig::pushing(Hold);
    rig.feet[1].high.set(true);
    rig.feet[2].high.set(true);
    rig.run(3);
    let (_, reply) = rig.sync(Some(setpoint(140.0, Hold)), false);
    let snapshot = rig.node.snapshot();
    assert_eq!(reply.joint_position(), snapshot.measured);
    assert_eq!(reply.mode, Mode::Tracking);
    assert!(reply.joint_duty().to_f64() > 0.1, "positive extends");
    assert_eq!(
        reply.inputs,
        InputBits::FOOT_LEFT.with(InputBits::FOOT_REAR)
    );
    assert_eq!(reply.sync_echo, rig.cycle.to_le_bytes()[0]);
    assert!((snapshot.measured.to_f64() - 100.0).abs() < 0.01);
}

#[test]
fn foot_switches_change_after_exactly_three_ticks() {
    let mut rig = JointRig::new();
    rig.run(5);
    rig.feet[3].high.set(true);
    rig.run(2);
    assert_eq!(rig.node.snapshot().switches, 0);
    rig.run(1);
    assert_eq!(rig.node.snapshot().switches, 0b1000);
    rig.feet[3].fails.set(true);
    rig.run(10);
    assert_eq!(
        rig.node.snapshot().switches,
        0b1000,
        "unreadable pins keep their level"
    );
}

#[test]
fn duplicates_get_the_same_answer_and_act_once() {
    let mut rig = JointRig::pushing(Hold);
    let disarm = Message::Disarm(Disarm {});
    let first = rig.send(&disarm, 900).unwrap();
    rig.run(1);
    rig.request(&ARM);
    rig.run(1);
    // The sequence counter of a resend is that of the request before.
    let second = rig.send(&disarm, 900).unwrap();
    assert_eq!(decode(&first).1, decode(&second).1);
    assert_eq!(
        rig.node.mode(),
        Mode::Idle,
        "another request came between: executed"
    );
    rig.request(&ARM);
    let sequence = rig.sequence;
    let again = rig.send(&ARM, sequence).unwrap();
    assert!(matches!(decode(&again).1, Message::Ack(_)));
    let clash = rig.send(&disarm, sequence).unwrap();
    assert_eq!(refusal(&decode(&clash).1), Some(NackReason::Duplicate));
    assert_eq!(rig.node.mode(), Mode::Armed, "a clash executes nothing");
}

#[test]
fn requests_for_others_are_ignored_and_wrong_ones_named() {
    let mut rig = JointRig::armed();
    let identify = Message::Identify(Identify {});
    for destination in [
        Address::joint(4).unwrap(),
        Address::BROADCAST,
        Address::MASTER,
    ] {
        let bytes = frame(destination, 5, &identify);
        rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        assert!(rig.node.take_transmission().is_none(), "{destination}");
    }
    let stranger = frame_from(Address::joint(4).unwrap(), rig.address, 5, &ARM);
    rig.node.on_bus_bytes(&stranger, Micros(rig.now));
    assert!(
        rig.node.take_transmission().is_none(),
        "not from the master"
    );
    let filter = Message::WheelFilter(WheelFilter {
        zero: 0,
        pole: 0,
        gain: 0,
    });
    assert_eq!(refusal(&rig.request(&filter)), Some(NackReason::WrongBoard));
    // Neither an answer is a request, nor a SYNC to one board alone.
    let position = rig.request(&Message::TransmitPosition(TransmitPosition {}));
    let sync = Message::Sync(Sync {
        cycle: rig.cycle.wrapping_add(1),
        master_time_us: 0,
        flags: SyncFlags::ESTOP,
        slots: SyncSlots::NONE,
    });
    for no_request in [position, sync] {
        let refused = refusal(&rig.request(&no_request));
        assert_eq!(refused, Some(NackReason::UnknownMessage), "{no_request:?}");
    }
    assert_eq!(rig.node.mode(), Mode::Armed);
}

#[test]
fn identity_names_board_version_and_unique_id() {
    let mut rig = JointRig::new();
    let Message::Identity(identity) = rig.request(&Message::Identify(Identify {})) else {
        panic!();
    };
    assert_eq!(identity.board, BoardKind::Joint);
    assert_eq!(identity.address, rig.address);
    assert_eq!(identity.firmware, FIRMWARE_VERSION);
    assert_eq!(identity.schema_hash, SCHEMA_HASH);
    assert_eq!(identity.unique_id, [3; 12]);
}

#[test]
fn answers_start_after_the_turnaround() {
    let mut rig = JointRig::armed();
    let answer = rig
        .send(&Message::TransmitPosition(TransmitPosition {}), 77)
        .unwrap();
    assert_eq!(answer.start_at, Micros(rig.now + TURNAROUND_US));
    let (envelope, Message::Position(position)) = decode(&answer) else {
        panic!();
    };
    assert_eq!(envelope.sequence, 77);
    assert!((PositionMm::from_raw(position.position_raw).to_f64() - 100.0).abs() < 0.01);
    assert_eq!(position.cycle, rig.cycle);
    // Ten ticks since the SYNC, of which the last read the stroke.
    assert_eq!(position.age_us, 9000);
}

#[test]
fn parameters_are_set_whole_or_not_at_all() {
    let mut rig = JointRig::armed();
    let before = *rig.node.parameters();
    let refused = |rig: &mut JointRig, message: &Message, reason| {
        assert_eq!(refusal(&rig.request(message)), Some(reason));
        assert_eq!(*rig.node.parameters(), before);
    };
    refused(
        &mut rig,
        &set(JointParam::Proportional, 4 << 24 | 1),
        NackReason::OutOfRange,
    );
    refused(&mut rig, &set(JointParam::ValveOn, 4000), NackReason::Armed);
    // Inside its row, but not above the settle band of 0.8 mm.
    refused(
        &mut rig,
        &set(JointParam::ReleaseBand, 40_000),
        NackReason::OutOfRange,
    );
    let unknown = Message::ParamSet(ParamSet {
        id: 0x0201,
        value: 1,
    });
    refused(&mut rig, &unknown, NackReason::UnknownParameter);
    let Message::ParamValue(value) = rig.request(&set(JointParam::Proportional, 1 << 20)) else {
        panic!();
    };
    assert_eq!(value.value, 1 << 20);
    let get = Message::ParamGet(ParamGet {
        id: JointParam::Proportional.id(),
    });
    assert!(matches!(rig.request(&get), Message::ParamValue(value) if value.value == 1 << 20));
    rig.run_cycles(2, None);
    assert_eq!(
        rig.node.mode(),
        Mode::Armed,
        "a set parameter is no corruption"
    );
}

#[test]
fn watchdog_can_be_lengthened_but_not_disabled() {
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    let cycles = JointParam::WatchdogCycles;
    for wrong in [0, 11, -1] {
        assert_eq!(
            refusal(&rig.request(&set(cycles, wrong))),
            Some(NackReason::OutOfRange)
        );
    }
    assert!(matches!(
        rig.request(&set(cycles, 10)),
        Message::ParamValue(_)
    ));
    rig.request(&ARM);
    rig.run_cycles(1, Some(setpoint(100.0, Hold)));
    rig.run(85);
    assert_eq!(rig.node.mode(), Mode::Tracking);
    rig.run(10);
    assert_eq!(rig.node.mode(), Mode::Hold);
}

#[test]
fn every_request_is_answered_once_with_its_own_type_or_a_nack() {
    let mut rig = JointRig::armed();
    for message_type in MessageType::ALL {
        let Some(expected) = message_type.answer() else {
            continue;
        };
        let payload = vec![0; message_type.payload_len()];
        let header = wheeleg_protocol::Header {
            version: wheeleg_protocol::VERSION,
            message_type: message_type.code(),
            source: Address::MASTER,
            destination: rig.address,
            sequence: 2000 + u16::from(message_type.code()),
        };
        let mut out = [0; 200];
        let bytes = wheeleg_protocol::encode(&header, &payload, &mut out).unwrap();
        rig.node.on_bus_bytes(bytes, Micros(rig.now));
        let answer = decode(&rig.node.take_transmission().expect("answered")).1;
        let sort = answer.message_type();
        assert!(
            sort == expected || sort == MessageType::Nack,
            "{message_type:?}"
        );
        assert!(rig.node.take_transmission().is_none());
    }
}

#[test]
fn a_new_calibration_is_no_sensor_fault_and_has_to_prove_itself() {
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    assert_eq!(rig.node.mode(), Mode::Idle);
    // 1 000 codes are 3.05 mm, more than a piston moves in a tick.
    let zero = JointParam::SensorZero.info().default + 1_000;
    let answer = rig.request(&set(JointParam::SensorZero, zero));
    assert!(matches!(answer, Message::ParamValue(_)));
    rig.run(9);
    let refused = rig.request(&ARM);
    assert!(matches!(refused, Message::Nack(nack) if nack.reason == NackReason::NotReady));
    rig.run(11);
    assert!(rig.node.faults().is_empty());
    assert!((rig.node.snapshot().measured.to_f64() - 96.95).abs() < 0.01);
    assert_eq!(rig.node.snapshot().velocity.raw(), 0);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
}
