//! How a joint board moves: arming, references, slew, modes of the law.

use crate::common::joint::{JointRig, setpoint};
use crate::common::{ARM, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_protocol::LinkLossAction::Hold;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Arm, Correction, Disarm, Limit, Message, NackReason, ParamSet, PositionReference, SCHEMA_HASH,
    SelectCorrection,
};
use wheeleg_units::{PositionMm, VelocityMmS};

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
fn position_references_reach_from_end_to_end_of_the_stroke_and_no_further() {
    let mut rig = JointRig::armed();
    let mut answer = |raw: i32| {
        let command = Message::PositionReference(PositionReference {
            reference_raw: raw,
            deadline_cycle: rig.cycle.wrapping_add(2),
        });
        refusal(&rig.request(&command))
    };
    let far = PositionMm::from_int(180).raw();
    for (raw, refused) in [
        (0, false),
        (-1, true),
        (-70_000, true),
        (far, false),
        (far + 1, true),
    ] {
        assert_eq!(
            answer(raw),
            refused.then_some(NackReason::OutOfRange),
            "{raw}"
        );
    }
}

#[test]
fn change_of_correction_is_bumpless() {
    let select = Message::SelectCorrection(SelectCorrection {
        correction: Correction::Id,
    });
    let parameter = |id: JointParam, value| Message::ParamSet(ParamSet { id: id.id(), value });
    for change in [select, parameter(JointParam::Correction, 1)] {
        let mut rig = JointRig::tracking(Hold);
        rig.run_cycles(10, Some(setpoint(108.0, Hold)));
        let before = rig.node.snapshot().duty.to_f64();
        assert!(refusal(&rig.request(&change)).is_none());
        rig.tick();
        let after = rig.node.snapshot().duty.to_f64();
        assert!((after - before).abs() < 0.02, "{before} to {after}");
        rig.run_cycles(12, Some(setpoint(108.0, Hold)));
        let later = rig.node.snapshot().duty.to_f64();
        assert!(
            (later - before).abs() > 0.02,
            "the other law acts after the fade"
        );
        // Another parameter, set to what it is, does not take it back.
        let band = (0.8 * 65_536.0) as i32;
        rig.request(&parameter(JointParam::SettleBand, band));
        rig.run_cycles(12, Some(setpoint(108.0, Hold)));
        let last = rig.node.snapshot().duty.to_f64();
        assert!((last - before).abs() > 0.02, "{before} {later} {last}");
    }
}

#[test]
fn settled_axis_switches_no_valve() {
    let mut rig = JointRig::tracking(Hold);
    rig.run_cycles(20, Some(setpoint(106.0, Hold)));
    rig.run_cycles(10, Some(setpoint(100.2, Hold)));
    let pulses = rig.node.pulse_counts();
    assert!(pulses.iter().any(|count| *count > 1), "{pulses:?}");
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

/// A timer that counts faster than in microseconds opens the valves for as long.
#[test]
fn pulses_are_scaled_to_the_counts_of_the_timer() {
    let mut rig = JointRig::tracking(Hold);
    let mut fine = JointRig::tracking(Hold);
    for valve in &fine.valves {
        valve.more.set(3250);
    }
    let mut parts = 0;
    for n in 0..40 {
        for rig in [&mut rig, &mut fine] {
            rig.sync(Some(setpoint(100.0 + f64::from(n), Hold)), false);
        }
        for _ in 0..10 {
            rig.tick();
            fine.tick();
            let scaled = rig.duty().map(|on| (u32::from(on) * 4250 / 1000) as u16);
            assert_eq!(fine.duty(), scaled);
            parts += usize::from(scaled.iter().any(|on| (1..4250).contains(on)));
        }
    }
    assert!(parts > 0, "whole ticks only");
}
