//! What a joint board does when nothing is wrong: arming, references, replies,
//! requests, parameters, switches.

mod common;

use common::joint::{JointRig, code_at, setpoint};
use common::{ARM, decode, frame, frame_from, refusal};
use wheeleg_node::FIRMWARE_VERSION;
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_protocol::LinkLossAction::Hold;
use wheeleg_protocol::link::SlotTiming;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Address, Arm, BoardKind, Correction, Disarm, Identify, InputBits, Limit, Message, MessageType,
    NackReason, ParamGet, ParamSet, PositionReference, SCHEMA_HASH, SelectCorrection, Sync,
    SyncFlags, SyncSlots, TransmitPosition, WheelFilter,
};
use wheeleg_units::{Micros, PositionMm, VelocityMmS};

fn set(parameter: JointParam, value: i32) -> Message {
    Message::ParamSet(ParamSet {
        id: parameter.id(),
        value,
    })
}

#[test]
fn nothing_moves_before_arming() {
    let mut rig = JointRig::new();
    for _ in 0..50 {
        rig.sync(Some(setpoint(170.0, Hold)), false);
        for _ in 0..10 {
            rig.tick();
            assert!(!rig.any_open());
        }
    }
    assert_eq!(rig.node.mode(), Mode::Idle);
}

#[test]
fn arming_needs_self_test_link_and_the_same_interface() {
    let mut rig = JointRig::new();
    assert_eq!(refusal(&rig.request(&ARM)), Some(NackReason::NotReady));
    rig.run(20);
    assert_eq!(rig.node.mode(), Mode::Idle);
    assert_eq!(refusal(&rig.request(&ARM)), Some(NackReason::LinkDown));
    rig.run_cycles(2, None);
    let other = Message::Arm(Arm {
        schema_hash: SCHEMA_HASH ^ 1,
    });
    assert_eq!(
        refusal(&rig.request(&other)),
        Some(NackReason::VersionMismatch)
    );
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    assert_eq!(rig.node.mode(), Mode::Armed);
}

#[test]
fn armed_axis_stays_where_it_was_armed() {
    let mut rig = JointRig::armed();
    rig.run_cycles(20, None);
    let snapshot = rig.node.snapshot();
    assert_eq!(snapshot.reference, snapshot.measured);
    assert!(!rig.any_open());
}

#[test]
fn reference_starts_at_the_actual_position_and_slews() {
    let mut rig = JointRig::with(
        JointParameters::default()
            .with(
                JointParam::SlewRate.id(),
                VelocityMmS::from_int(100).raw(),
                true,
            )
            .unwrap(),
    );
    rig.run_cycles(3, None);
    rig.request(&ARM);
    let start = rig.node.snapshot().measured;
    let mut last = start;
    for tick in 0..400 {
        if tick % 10 == 0 {
            rig.sync(Some(setpoint(130.0, Hold)), false);
        }
        rig.tick();
        let snapshot = *rig.node.snapshot();
        let step = snapshot.reference.saturating_sub(last).raw();
        // 100 mm/s is 0.1 mm per tick.
        assert!((0..=6553).contains(&step), "step {step} at tick {tick}");
        assert_eq!(step == 6553, snapshot.limits.contains(Limit::SlewLimited));
        last = snapshot.reference;
    }
    assert_eq!(last, PositionMm::from_int(130));
}

#[test]
fn rearming_after_a_stop_forgets_the_old_reference() {
    let mut rig = JointRig::pushing(Hold);
    rig.run(100);
    // The leg has sagged while it was held.
    for millimetres in (60..100).rev() {
        rig.move_to(f64::from(millimetres));
        rig.run(1);
    }
    rig.run_cycles(3, None);
    rig.clear();
    rig.request(&ARM);
    rig.run_cycles(1, None);
    let snapshot = rig.node.snapshot();
    assert_eq!(snapshot.reference, snapshot.measured);
    assert!((snapshot.reference.to_f64() - 60.0).abs() < 0.01);
    assert!(!rig.any_open());
}

#[test]
fn moving_reference_is_carried_on_within_the_cycle_and_no_further() {
    let mut rig = JointRig::tracking(Hold);
    let mut slot = setpoint(100.0, Hold);
    slot.velocity = VelocityMmS::from_int(50).to_wire();
    rig.sync(Some(slot), false);
    let mut references = Vec::new();
    for _ in 0..30 {
        rig.tick();
        references.push(rig.node.snapshot().reference.to_f64());
    }
    for (tick, reference) in references.iter().enumerate() {
        let expected = 100.0 + 0.05 * tick.min(10) as f64;
        assert!(
            (reference - expected).abs() < 1e-3,
            "tick {tick}: {reference}"
        );
    }
}

#[test]
fn withdrawn_setpoint_keeps_the_present_reference() {
    let mut rig = JointRig::tracking(Hold);
    rig.run_cycles(3, Some(setpoint(110.0, Hold)));
    rig.run_cycles(5, None);
    assert_eq!(rig.node.mode(), Mode::Armed);
    assert_eq!(rig.node.snapshot().reference, PositionMm::from_int(110));
}

#[test]
fn disarming_shuts_the_valves_in_the_next_tick() {
    let mut rig = JointRig::pushing(Hold);
    assert!(matches!(
        rig.request(&Message::Disarm(Disarm {})),
        Message::Ack(_)
    ));
    rig.tick();
    assert_eq!((rig.node.mode(), rig.any_open()), (Mode::Idle, false));
}

#[test]
fn position_reference_obeys_mode_range_and_deadline() {
    let command = |millimetres: f64, deadline_cycle| {
        Message::PositionReference(PositionReference {
            reference_raw: PositionMm::from_f64(millimetres).raw(),
            deadline_cycle,
        })
    };
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    let cycle = rig.cycle;
    assert_eq!(
        refusal(&rig.request(&command(120.0, cycle))),
        Some(NackReason::NotArmed)
    );
    rig.request(&ARM);
    let reason = refusal(&rig.request(&command(120.0, cycle.wrapping_sub(1))));
    assert_eq!(reason, Some(NackReason::Expired));
    assert_eq!(
        refusal(&rig.request(&command(181.0, cycle))),
        Some(NackReason::OutOfRange)
    );
    assert!(matches!(
        rig.request(&command(120.0, cycle)),
        Message::Ack(_)
    ));
    rig.run_cycles(5, None);
    assert_eq!(rig.node.snapshot().reference, PositionMm::from_int(120));
    rig.run_cycles(1, Some(setpoint(120.0, Hold)));
    let cycle = rig.cycle;
    assert_eq!(
        refusal(&rig.request(&command(90.0, cycle))),
        Some(NackReason::WrongMode)
    );
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
    assert_eq!(answer.start_at, Micros(rig.now + 50));
    let (envelope, Message::Position(position)) = decode(&answer) else {
        panic!();
    };
    assert_eq!(envelope.sequence, 77);
    assert!((PositionMm::from_raw(position.position_raw).to_f64() - 100.0).abs() < 0.01);
    assert_eq!(position.cycle, rig.cycle);
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
fn change_of_correction_is_bumpless() {
    let mut rig = JointRig::tracking(Hold);
    rig.run_cycles(10, Some(setpoint(108.0, Hold)));
    let before = rig.node.snapshot().duty.to_f64();
    let select = Message::SelectCorrection(SelectCorrection {
        correction: Correction::Id,
    });
    assert!(matches!(rig.request(&select), Message::Ack(_)));
    rig.tick();
    let after = rig.node.snapshot().duty.to_f64();
    assert!((after - before).abs() < 0.02, "{before} to {after}");
    rig.run_cycles(12, Some(setpoint(108.0, Hold)));
    let later = rig.node.snapshot().duty.to_f64();
    assert!(
        (later - before).abs() > 0.02,
        "the other law acts after the fade"
    );
}

#[test]
fn settled_axis_switches_no_valve() {
    let mut rig = JointRig::tracking(Hold);
    rig.run_cycles(10, Some(setpoint(100.2, Hold)));
    let pulses = rig.node.pulse_counts();
    for _ in 0..500 {
        rig.run_cycles(1, Some(setpoint(100.2, Hold)));
        assert!(!rig.any_open());
    }
    assert_eq!(rig.node.pulse_counts(), pulses);
    assert!(rig.node.snapshot().settled);
    assert!(rig.node.snapshot().limits.contains(Limit::SettledShut));
}

#[test]
fn positive_error_fills_a_and_vents_b() {
    for (target, [fill_a, vent_a, fill_b, vent_b]) in [(160.0, [1, 0, 0, 1]), (40.0, [0, 1, 1, 0])]
    {
        let mut rig = JointRig::tracking(Hold);
        let mut on = [0_u32; 4];
        for _ in 0..20 {
            rig.sync(Some(setpoint(target, Hold)), false);
            for _ in 0..10 {
                rig.tick();
                for (on, duty) in on.iter_mut().zip(rig.duty()) {
                    *on += u32::from(duty);
                }
            }
        }
        assert_eq!(
            on.map(|sum| u32::from(sum > 0)),
            [fill_a, vent_a, fill_b, vent_b]
        );
    }
}

#[test]
fn microsecond_counter_may_wrap_while_tracking() {
    let mut rig = JointRig::new();
    rig.now = u32::MAX - 200_000;
    rig.run_cycles(3, None);
    rig.request(&ARM);
    rig.run_cycles(40, Some(setpoint(100.0, Hold)));
    assert!(rig.now < 1_000_000, "wrapped");
    assert_eq!(rig.node.mode(), Mode::Tracking);
    assert!(rig.node.faults().is_empty());
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
    assert_eq!(code_at(0.0).get(), 3277);
}
