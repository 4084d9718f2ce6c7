//! What a board says of itself after a tick, and limits that are met exactly.
//! Each test is the answer to a mutation that no other test noticed
//! (`cargo xtask mutants`).

use crate::common::joint::{JointRig, setpoint};
use crate::common::wheel::WheelRig;
use crate::common::{ARM, wheel};
use wheeleg_node::hardware::SensorError;
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_protocol::LinkLossAction::Hold;
use wheeleg_protocol::param::{JointParam, WheelParam};
use wheeleg_protocol::{
    ClearFault, EmergencyBrake, Fault, JointSetpoint, Limit, Message, ParamSet, WheelControlMode,
    WheelMode,
};
use wheeleg_units::{AdcCode, Micros, PositionMm, WheelCount};

#[test]
fn the_snapshot_of_a_joint_is_that_of_the_last_tick() {
    let mut rig = JointRig::tracking(Hold);
    for millimetre in 0..40 {
        rig.move_to(100.0 + 0.25 * f64::from(millimetre));
        rig.sync(Some(setpoint(140.0, Hold)), false);
        for _ in 0..10 {
            let start = rig.now;
            rig.tick();
            let snapshot = *rig.node.snapshot();
            assert_eq!(snapshot.at.get(), start);
            assert_eq!(snapshot.mode, Mode::Tracking);
            assert_eq!(snapshot.commanded, PositionMm::from_int(140));
            assert!(snapshot.faults.is_empty());
            // 1000 counts are one tick of 1000 µs.
            assert_eq!(snapshot.pulses, rig.duty());
        }
    }
    // 0.25 mm in 10 ms.
    let velocity = rig.node.snapshot().velocity.to_f64();
    assert!((15.0..=35.0).contains(&velocity), "{velocity} mm/s");
    rig.sensor.set(Err(SensorError::Converter));
    rig.run(2);
    let snapshot = rig.node.snapshot();
    assert_eq!(snapshot.mode, Mode::Hold);
    assert!(snapshot.faults.contains(Fault::SensorRange));
    assert_eq!(snapshot.pulses, [0; 4]);
    rig.run(1);
    assert_eq!(rig.node.snapshot().commanded, rig.node.snapshot().measured);
}

/// A joint that follows its reference at a distance; whether it faults.
fn follows_at(distance: PositionMm) -> bool {
    let mut rig = JointRig::new();
    let stroke = |code: u16| PositionMm::from_raw((i32::from(code) - 3277) * 200);
    let mut code = 3277 + 20_000;
    rig.sensor.set(Ok(AdcCode::new(code)));
    rig.run_cycles(3, None);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    for _ in 0..170 {
        // 0.25 mm a cycle, in the tick in which the reference moves on, too.
        code += 80;
        rig.sensor.set(Ok(AdcCode::new(code)));
        let slot = JointSetpoint {
            reference: stroke(code).saturating_add(distance),
            ..setpoint(0.0, Hold)
        };
        rig.run_cycles(1, Some(slot));
        if rig.node.mode() == Mode::Hold {
            assert!(rig.node.faults().contains(Fault::FollowingError));
            return true;
        }
        assert_eq!(rig.node.mode(), Mode::Tracking);
        assert_eq!(rig.node.snapshot().measured, stroke(code));
    }
    false
}

#[test]
fn a_joint_exactly_at_its_following_error_is_no_fault() {
    let limit = PositionMm::from_raw(JointParam::FollowingError.info().default);
    assert!(!follows_at(limit));
    assert!(follows_at(PositionMm::from_raw(limit.raw() + 1)));
}

/// A joint that stands at a distance from its reference; whether it faults.
fn stands_at(distance: PositionMm) -> bool {
    let mut rig = JointRig::new();
    let code = 3277 + 30_000;
    rig.sensor.set(Ok(AdcCode::new(code)));
    let measured = PositionMm::from_raw((i32::from(code) - 3277) * 200);
    rig.run_cycles(3, None);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    let slot = JointSetpoint {
        reference: measured.saturating_add(distance),
        ..setpoint(0.0, Hold)
    };
    for _ in 0..170 {
        rig.run_cycles(1, Some(slot));
        if rig.node.mode() == Mode::Hold {
            assert!(rig.node.faults().contains(Fault::FollowingError));
            return true;
        }
        assert_eq!(rig.node.mode(), Mode::Tracking);
    }
    false
}

/// What a valve stuck open makes of an axis at rest: its law holds it, away from its reference.
#[test]
fn a_joint_that_stands_may_be_off_by_a_quarter_of_its_following_error() {
    let limit = JointParam::FollowingError.info().default / 4;
    for sign in [1, -1] {
        assert!(!stands_at(PositionMm::from_raw(sign * limit)));
        assert!(stands_at(PositionMm::from_raw(sign * (limit + 1))));
    }
}

/// Whether the integral is limited while a P + I law stands before `error_mm`.
fn integral_limited(error_mm: f64) -> bool {
    let mut parameters = JointParameters::default();
    for (parameter, value) in [
        (JointParam::Law, 3),
        (JointParam::Integral, JointParam::Integral.info().max),
    ] {
        parameters = parameters
            .with(parameter.id(), value, true)
            .expect("permitted");
    }
    let mut rig = JointRig::with(parameters);
    rig.run_cycles(3, None);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    rig.run_cycles(8, Some(setpoint(100.0 + error_mm, Hold)));
    assert_eq!(rig.node.mode(), Mode::Tracking);
    rig.node.snapshot().limits.contains(Limit::IntegralLimited)
}

#[test]
fn an_integral_that_is_frozen_or_at_its_bound_is_limited() {
    assert!(integral_limited(55.0), "frozen: outside its zone");
    assert!(integral_limited(2.0), "at its bound");
}

/// A wheel in position control whose encoder stands at a distance from the
/// reference; whether it faults.
fn wheel_at(distance: i32) -> bool {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    let set = Message::ParamSet(ParamSet {
        id: WheelParam::FollowingError.id(),
        value: 40,
    });
    assert!(matches!(rig.request(&set), Message::ParamValue(_)));
    // The encoder is ours, not the motor's.
    rig.speed_at_full = 0;
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    let slot = |count| Some(wheel::setpoint(count, 0));
    rig.run_ms(20, slot(distance));
    for _ in 0..20 {
        // It moves to and fro, so that it is no lost encoder.
        rig.counter.0.set(rig.counter.0.get() + 1);
        let count = rig.counter.0.get();
        rig.run_ms(10, slot(count + distance));
        if rig.node.mode() != Mode::Tracking {
            assert!(rig.node.faults().contains(Fault::FollowingError));
            return true;
        }
    }
    false
}

#[test]
fn a_wheel_exactly_at_its_following_error_is_no_fault() {
    // The encoder moves a count ahead of the reference in each cycle, so the error
    // that lasts is one less.
    assert!(!wheel_at(41));
    assert!(wheel_at(42));
}

#[test]
fn a_drive_at_its_limit_says_so() {
    let mut rig = WheelRig::armed();
    let ahead = WheelCount::wrapping_new(2_000_000).get();
    rig.run_ms(30, Some(wheel::setpoint(ahead, 0)));
    let snapshot = rig.node.snapshot();
    assert!(rig.drive() >= 99, "{}", rig.drive());
    assert!(snapshot.limits.contains(Limit::DutySaturated));
    let mut rig = WheelRig::armed();
    rig.run_ms(30, Some(wheel::setpoint(rig.counter.0.get(), 0)));
    assert!(!rig.node.snapshot().limits.contains(Limit::DutySaturated));
}

#[test]
fn a_drive_is_at_its_limit_from_the_first_count_too_many() {
    let mut seen = [false; 2];
    for distance in 1..40 {
        let mut rig = WheelRig::armed();
        rig.speed_at_full = 0;
        rig.counter.0.set(rig.counter.0.get() - distance);
        rig.tick();
        let limited = rig.node.snapshot().limits.contains(Limit::DutySaturated);
        assert_eq!(
            limited,
            rig.drive().abs() == 100,
            "{distance}: {}",
            rig.drive()
        );
        seen[usize::from(limited)] = true;
    }
    assert_eq!(seen, [true; 2]);
}

#[test]
fn a_speed_changed_during_a_profile_is_that_of_the_next_one() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    let mode = WheelControlMode::Trapezoidal;
    rig.request(&Message::WheelMode(WheelMode { mode }));
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    let mut largest = [0; 2];
    for (profile, largest) in largest.iter_mut().enumerate() {
        let target = 12_000 * (profile as i32 + 1);
        let mut last = rig.node.snapshot().control.command;
        for tick in 0..3_000 {
            rig.run_ms(1, Some(wheel::setpoint(target, 0)));
            let command = rig.node.snapshot().control.command;
            *largest = command.wrapping_difference(last).abs().max(*largest);
            last = command;
            if (profile, tick) == (0, 200) {
                let set = Message::ParamSet(ParamSet {
                    id: WheelParam::MaxSpeed.id(),
                    value: 10,
                });
                let answer = rig.request(&set);
                assert!(matches!(answer, Message::ParamValue(_)), "{answer:?}");
            }
        }
        assert_eq!(last.get(), target);
    }
    // Two samples in a millisecond.
    assert!(largest[0] > 2 * 20, "{largest:?}");
    assert!((1..=2 * 10).contains(&largest[1]), "{largest:?}");
}

#[test]
fn rest_ends_the_doubt_about_a_motion() {
    let mut rig = JointRig::tracking(Hold);
    for round in 0..3 {
        let mut cycles = 0;
        while rig.node.motion_overdue() == Micros::ZERO {
            rig.run_cycles(1, Some(setpoint(140.0, Hold)));
            cycles += 1;
            assert!(
                cycles < 200,
                "a piston that stands still under air is in doubt"
            );
        }
        assert!(cycles > 100 || round > 0, "{cycles}");
        // Shorter than the 200 ms that make it a fault.
        rig.run_cycles(15, Some(setpoint(140.0, Hold)));
        assert_eq!(rig.node.mode(), Mode::Tracking);
        rig.run_cycles(30, Some(setpoint(100.0, Hold)));
        assert!(rig.node.snapshot().settled);
        assert_eq!(rig.node.motion_overdue(), Micros::ZERO);
    }
    assert!(rig.node.faults().is_empty());
}

/// Found by the random sequences of `fuzz.rs`: a wheel that was armed and braked
/// again between two samples began the ramp of its last stop anew.
#[test]
fn a_stop_right_after_arming_has_nothing_to_ramp_down() {
    let mut rig = WheelRig::turning();
    let brake = Message::EmergencyBrake(EmergencyBrake {});
    rig.request(&brake);
    rig.run_ms(100, None);
    let left = rig.drive();
    assert!(left > 0, "half way down the ramp");
    for request in [Message::ClearFault(ClearFault {}), ARM, brake] {
        assert!(matches!(rig.request(&request), Message::Ack(_)));
    }
    assert_eq!(rig.node.mode(), Mode::Hold);
    rig.tick();
    assert_eq!(rig.drive(), 0);
}

/// Found by the fuzz target `joint`: the pulses of the tick in which the fault
/// was found still went out.
#[test]
fn the_tick_that_misses_a_motion_opens_no_valve() {
    let mut rig = JointRig::tracking(Hold);
    for _ in 0..400 {
        rig.sync(Some(setpoint(140.0, Hold)), false);
        for _ in 0..10 {
            rig.tick();
            if rig.node.mode() == Mode::Hold {
                assert!(rig.node.faults().contains(Fault::NoMotion));
                assert_eq!(rig.duty(), [0; 4]);
                return;
            }
        }
    }
    panic!("a piston that stands still under air is at fault");
}
