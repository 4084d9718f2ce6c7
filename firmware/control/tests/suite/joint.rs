//! Behaviour of the joint law: limits, rest, anti-windup, bumpless changes.

use proptest::prelude::*;
use wheeleg_control::joint::{
    Announced, ConfigError, Correction, Gain, JointConfig, JointController, JointGains, JointInput,
    JointOutput, JointParameter,
};
use wheeleg_control::valve::ValveOpenings;
use wheeleg_units::{Duty, Micros, PositionMm, Ticks, VelocityMmS};

const TICK: Micros = Micros(1000);

fn controller(gains: &JointGains) -> JointController {
    JointController::new(JointConfig::new(gains, TICK).expect("valid gains"))
}

fn at(measured_mm: f64, reference_mm: f64) -> JointInput {
    JointInput {
        measured: PositionMm::from_f64(measured_mm),
        reference: PositionMm::from_f64(reference_mm),
        ..JointInput::default()
    }
}

fn repeat(joint: &mut JointController, input: &JointInput, ticks: u32) -> JointOutput {
    let mut output = JointOutput::default();
    for _ in 0..ticks {
        output = joint.step(input);
    }
    output
}

#[test]
fn default_gains_are_valid() {
    assert!(JointConfig::new(&JointGains::default(), TICK).is_ok());
}

#[test]
fn each_parameter_is_refused_by_name_just_outside_its_range() {
    use JointParameter as P;
    let gain = Gain::from_num::<f64>;
    let mm = PositionMm::from_f64;
    let rejects = |change: &dyn Fn(&mut JointGains), error: ConfigError| {
        let mut gains = JointGains::default();
        change(&mut gains);
        assert_eq!(JointConfig::new(&gains, TICK).err(), Some(error));
    };
    let range = ConfigError::OutOfRange;
    let relation = ConfigError::Inconsistent;
    rejects(&|g| g.proportional = gain(-0.001), range(P::Proportional));
    rejects(&|g| g.proportional = gain(4.001), range(P::Proportional));
    rejects(&|g| g.correction_pd = gain(2.001), range(P::CorrectionPd));
    rejects(&|g| g.correction_id = gain(-0.1), range(P::CorrectionId));
    rejects(&|g| g.feed_forward = gain(0.101), range(P::FeedForward));
    rejects(&|g| g.error_scale = mm(0.249), range(P::ErrorScale));
    rejects(&|g| g.error_scale = mm(1000.1), range(P::ErrorScale));
    rejects(
        &|g| g.velocity_scale = VelocityMmS::from_f64(0.9),
        range(P::VelocityScale),
    );
    rejects(&|g| g.integral_scale = mm(0.0), range(P::IntegralScale));
    rejects(&|g| g.integral_zone = mm(-0.1), range(P::IntegralZone));
    rejects(
        &|g| g.duty_limit = Duty::from_per_mille(-1),
        range(P::DutyLimit),
    );
    rejects(
        &|g| g.dead_zone_duty = Duty::from_per_mille(501),
        range(P::DeadZoneDuty),
    );
    rejects(
        &|g| g.minimum_duty = Duty::from_per_mille(501),
        range(P::MinimumDuty),
    );
    rejects(&|g| g.settle_band = mm(-0.01), range(P::SettleBand));
    rejects(
        &|g| g.settle_velocity = VelocityMmS::ZERO,
        range(P::SettleVelocity),
    );
    rejects(
        &|g| g.settle_dwell = Micros::from_millis(10_001),
        range(P::SettleDwell),
    );
    rejects(&|g| g.release_band = mm(200.1), range(P::ReleaseBand));
    rejects(
        &|g| g.release_band = g.settle_band,
        relation(P::ReleaseBand),
    );
    rejects(
        &|g| g.release_dwell = Micros::from_millis(1001),
        range(P::ReleaseDwell),
    );
    rejects(&|g| g.bumpless_time = Micros::MAX, range(P::BumplessTime));
    rejects(&|g| g.velocity_window = 1, range(P::VelocityWindow));
    rejects(&|g| g.velocity_window = 65, range(P::VelocityWindow));
    rejects(&|g| g.stroke_max = g.stroke_min, relation(P::Stroke));
    rejects(&|g| g.stroke_max = mm(1000.1), range(P::Stroke));
    rejects(&|g| g.pwm_period = Micros(20_500), relation(P::PwmPeriod));
    rejects(&|g| g.pwm_period = Micros(999), range(P::PwmPeriod));
    rejects(
        &|g| g.duty_limit = Duty::from_per_mille(120),
        relation(P::DeadZoneDuty),
    );
    rejects(
        &|g| {
            g.duty_limit = Duty::from_per_mille(100);
            g.minimum_duty = Duty::from_per_mille(100);
        },
        relation(P::MinimumDuty),
    );
    let tick = JointConfig::new(&JointGains::default(), Micros(99)).err();
    assert_eq!(tick, Some(range(P::Tick)));
}

#[test]
fn zero_error_gives_zero_duty_under_both_corrections() {
    for correction in [Correction::Pd, Correction::Id] {
        let mut joint = controller(&JointGains::default());
        joint.set_correction(correction);
        for _ in 0..500 {
            let output = joint.step(&at(90.0, 90.0));
            assert_eq!(output.duty, Duty::ZERO);
            assert_eq!(output.openings, ValveOpenings::SHUT);
            assert!(!output.limits.any(), "{:?}", output.limits);
        }
        assert!(joint.is_settled());
    }
}

#[test]
fn a_positive_error_fills_a_and_vents_b() {
    let output = controller(&JointGains::default()).step(&at(40.0, 60.0));
    assert_eq!(output.error, PositionMm::from_int(20));
    assert!(output.duty > Duty::ZERO);
    let [fill_a, vent_a, fill_b, vent_b] = output.openings.0;
    assert!(fill_a.get() > 0 && fill_a == vent_b);
    assert_eq!((vent_a, fill_b), (Micros::ZERO, Micros::ZERO));
}

#[test]
fn the_physical_gain_is_the_one_that_acts() {
    // Linear part alone: Kp = 0.01 per mm at 25 mm is a quarter.
    let gains = JointGains {
        proportional: Gain::lit("0.01"),
        correction_pd: Gain::ZERO,
        feed_forward: Gain::lit("0.002"),
        dead_zone_duty: Duty::ZERO,
        ..JointGains::default()
    };
    let output = controller(&gains).step(&at(10.0, 35.0));
    assert!((output.duty.to_f64() - 0.25).abs() < 1e-6);
    // Feed-forward: 100 mm/s × 0.002 s/mm = 0.2.
    let moving = JointInput {
        reference_velocity: VelocityMmS::from_int(100),
        ..at(10.0, 10.0)
    };
    let output = controller(&gains).step(&moving);
    assert!((output.duty.to_f64() - 0.2).abs() < 5e-6);
}

#[test]
fn approaching_fast_brakes() {
    // 3 mm before the target at 300 mm/s: the correction must overcome Kp·e.
    let mut joint = controller(&JointGains::default());
    let mut output = JointOutput::default();
    for k in 0..40 {
        output = joint.step(&at(57.0 - 0.3 * f64::from(39 - k), 60.0));
    }
    assert!((output.velocity.to_f64() - 300.0).abs() < 1.0);
    assert!(output.duty < Duty::ZERO, "{:?}", output.duty);
}

#[test]
fn limits_are_reported_with_their_reason() {
    let gains = JointGains {
        duty_limit: Duty::from_per_mille(500),
        ..JointGains::default()
    };
    let far = controller(&gains).step(&at(0.0, 170.0));
    assert_eq!(far.duty, Duty::from_per_mille(500));
    assert!(far.limits.duty && far.limits.error && !far.limits.velocity);
    assert!(!far.limits.below_minimum && !far.limits.reference);

    let outside = controller(&gains).step(&at(175.0, 190.0));
    assert!(outside.limits.reference);
    assert_eq!(outside.error, PositionMm::from_int(5));
    let inside = controller(&gains).step(&at(175.0, 180.0));
    assert!(!inside.limits.reference);

    let lazy = JointGains {
        minimum_duty: Duty::from_per_mille(50),
        ..gains
    };
    let small = controller(&lazy).step(&at(90.0, 91.0));
    assert!(small.limits.below_minimum);
    assert_eq!(small.duty, Duty::ZERO);

    let mut joint = controller(&gains);
    joint.step(&at(0.0, 90.0));
    let jump = joint.step(&at(90.0, 90.0));
    assert!(jump.limits.velocity);
}

#[test]
fn rest_needs_the_dwell_and_release_needs_the_wider_band() {
    let gains = JointGains {
        settle_band: PositionMm::from_f64(0.8),
        release_band: PositionMm::from_f64(2.0),
        settle_dwell: Micros::from_millis(40),
        release_dwell: Micros::from_millis(3),
        ..JointGains::default()
    };
    let mut joint = controller(&gains);
    assert!(!repeat(&mut joint, &at(89.3, 90.0), 39).settled);
    assert!(repeat(&mut joint, &at(89.3, 90.0), 1).settled);
    // Between the bands nothing opens, for ever.
    for _ in 0..1000 {
        let output = joint.step(&at(88.1, 90.0));
        assert!(output.settled && output.openings.is_shut());
    }
    // Outside the release band for less than its dwell: a noise spike.
    assert!(repeat(&mut joint, &at(87.9, 90.0), 2).settled);
    assert!(repeat(&mut joint, &at(88.1, 90.0), 1).settled);
    assert!(repeat(&mut joint, &at(87.9, 90.0), 2).settled);
    let released = repeat(&mut joint, &at(87.9, 90.0), 1);
    assert!(!released.settled && released.duty > Duty::ZERO);
}

#[test]
fn a_moving_reference_releases_at_once() {
    let mut joint = controller(&JointGains::default());
    assert!(repeat(&mut joint, &at(90.0, 90.0), 100).settled);
    let moving = JointInput {
        reference_velocity: VelocityMmS::from_int(100),
        ..at(90.0, 90.0)
    };
    assert!(!joint.step(&moving).settled);
    // And it does not settle while the reference moves.
    assert!(!repeat(&mut joint, &moving, 100).settled);
}

#[test]
fn noise_at_rest_switches_nothing() {
    // ±1 step of 12 bits over 180 mm, uniform, for 20 s.
    let mut joint = controller(&JointGains::default());
    let mut state = 7_u64;
    let mut settled_at = None;
    for tick in 0..20_000 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let step = f64::from(i32::try_from((state >> 40) % 3).unwrap() - 1);
        let output = joint.step(&at(90.3 + step * 180.0 / 4096.0, 90.0));
        if output.settled && settled_at.is_none() {
            settled_at = Some(tick);
        }
        if settled_at.is_some() {
            assert!(output.settled && output.openings.is_shut(), "tick {tick}");
        }
    }
    assert!(settled_at.is_some_and(|tick| tick < 500), "{settled_at:?}");
}

#[test]
fn the_integral_is_bounded_conditional_and_reported() {
    let gains = JointGains {
        integral_scale: PositionMm::from_f64(0.5),
        integral_zone: PositionMm::from_int(15),
        ..JointGains::default()
    };
    // 5 mm for 100 ms is 0.5 mm·s: the bound.
    let mut joint = controller(&gains);
    joint.set_correction(Correction::Id);
    let early = repeat(&mut joint, &at(85.0, 90.0), 50);
    assert!(!early.limits.integral_clamped && !early.limits.integral_frozen);
    let late = repeat(&mut joint, &at(85.0, 90.0), 60);
    assert!(late.limits.integral_clamped);
    assert!(late.duty > early.duty);
    // However long it lasted, it unwinds as fast as it wound up: after 100 ms
    // of the opposite error it is gone, and the duty is that of a fresh start.
    repeat(&mut joint, &at(85.0, 90.0), 60_000);
    let unwound = repeat(&mut joint, &at(95.0, 90.0), 101);
    let mut fresh = controller(&gains);
    fresh.set_correction(Correction::Id);
    let reference = repeat(&mut fresh, &at(95.0, 90.0), 1);
    assert!((unwound.duty.to_f64() - reference.duty.to_f64()).abs() < 0.02);
    // Outside the zone it is frozen.
    let far = repeat(&mut joint, &at(70.0, 90.0), 1);
    assert!(far.limits.integral_frozen);
    // Under PD there is no integral to report.
    joint.set_correction(Correction::Pd);
    let pd = repeat(&mut joint, &at(70.0, 90.0), 1);
    assert!(!pd.limits.integral_frozen && !pd.limits.integral_clamped);
}

#[test]
fn a_saturated_output_freezes_the_integral_only_towards_saturation() {
    let gains = JointGains {
        duty_limit: Duty::from_per_mille(300),
        integral_zone: PositionMm::from_int(100),
        ..JointGains::default()
    };
    let mut joint = controller(&gains);
    joint.set_correction(Correction::Id);
    let output = repeat(&mut joint, &at(50.0, 90.0), 20);
    assert!(output.limits.duty && output.limits.integral_frozen);
    // Saturated towards extension by damping while the error is negative: a fast
    // retraction just past the target. The integral is free to move.
    let mut joint = controller(&gains);
    joint.set_correction(Correction::Id);
    let mut output = JointOutput::default();
    for k in 0..40 {
        output = joint.step(&at(90.2 + f64::from(39 - k), 90.0));
    }
    assert!(output.limits.duty && output.duty > Duty::ZERO && output.error.raw() < 0);
    assert!(!output.limits.integral_frozen);
}

#[test]
fn changing_the_law_does_not_bump_and_fades_out() {
    let gains = JointGains {
        dead_zone_duty: Duty::ZERO,
        minimum_duty: Duty::ZERO,
        bumpless_time: Micros::from_millis(100),
        ..JointGains::default()
    };
    let stiff = JointGains {
        proportional: Gain::lit("0.06"),
        ..gains
    };
    let input = at(80.0, 90.0);
    let change_correction = |joint: &mut JointController| joint.set_correction(Correction::Id);
    let change_gains =
        |joint: &mut JointController| joint.retune(JointConfig::new(&stiff, TICK).unwrap());
    let changes: [&dyn Fn(&mut JointController); 2] = [&change_correction, &change_gains];
    for change in changes {
        let mut joint = controller(&gains);
        let before = repeat(&mut joint, &input, 30).duty.to_f64();
        change(&mut joint);
        // What it would jump to without the fade.
        let mut sharp = controller(&JointGains {
            bumpless_time: Micros::ZERO,
            ..*joint.config().gains()
        });
        sharp.set_correction(joint.correction());
        let target = sharp.step(&input).duty.to_f64();
        assert!(
            (target - before).abs() > 0.09,
            "nothing to bump: {before} {target}"
        );
        let mut last = before;
        for tick in 0..100 {
            let duty = joint.step(&input).duty.to_f64();
            assert!((duty - last).abs() < 0.012, "tick {tick}: {last} to {duty}");
            last = duty;
        }
        // Fully faded: the same as a law that never changed.
        let settled = repeat(&mut sharp, &input, 100).duty.to_f64();
        assert!((repeat(&mut joint, &input, 1).duty.to_f64() - settled).abs() < 0.005);
    }
}

/// Laws far beyond the duty on both sides of a change: the bump is larger than what the
/// fade can hold, and is faded by that much alone. The output still goes one way only.
#[test]
fn a_change_between_laws_far_beyond_the_duty_jumps_by_no_more_than_it_must_and_fades_out() {
    let gains = JointGains {
        dead_zone_duty: Duty::ZERO,
        minimum_duty: Duty::ZERO,
        correction_pd: Gain::ZERO,
        correction_id: Gain::ZERO,
        proportional: Gain::lit("0.06"),
        bumpless_time: Micros::from_millis(100),
        ..JointGains::default()
    };
    let config = JointConfig::new(&gains, TICK).unwrap();
    for sign in [1.0, -1.0] {
        let mut joint = controller(&gains);
        // 0.06 / mm at 60 mm: 3.6 times the whole duty, cut to 2.
        let far = |side: f64| at(90.0 - 60.0 * side * sign, 90.0);
        let before = repeat(&mut joint, &far(1.0), 30).duty.to_f64();
        assert!((before - sign).abs() < 1e-3, "{before}");
        joint.retune(config);
        // The error turns round with the change: from +2 to -2 is a bump of 4, of which
        // 2 is faded, so the duty is at zero at first and not at its other end.
        let mut last = joint.step(&far(-1.0)).duty.to_f64();
        assert!(last.abs() < 0.03, "{sign}: {last}");
        for tick in 1..50 {
            let duty = joint.step(&far(-1.0)).duty.to_f64();
            let step = (last - duty) * sign;
            assert!((0.0..0.03).contains(&step), "{tick}: {last} to {duty}");
            last = duty;
        }
        assert!((last + sign).abs() < 0.05, "{last} halfway of the fade");
        let faded = repeat(&mut joint, &far(-1.0), 60).duty.to_f64();
        assert!((faded + sign).abs() < 1e-3, "{faded}");
    }
}

#[test]
fn observing_keeps_the_velocity_and_forgets_the_rest() {
    let mut joint = controller(&JointGains::default());
    joint.set_correction(Correction::Id);
    repeat(&mut joint, &at(85.0, 90.0), 200);
    let mut velocity = VelocityMmS::ZERO;
    for k in 0..40 {
        velocity = joint.observe(PositionMm::from_f64(85.0 + 0.1 * f64::from(k)));
    }
    assert!((velocity.to_f64() - 100.0).abs() < 0.5);
    assert!(!joint.is_settled());
    // Same as a controller that has only ever watched.
    let mut fresh = controller(&JointGains::default());
    fresh.set_correction(Correction::Id);
    for k in 0..40 {
        fresh.observe(PositionMm::from_f64(85.0 + 0.1 * f64::from(k)));
    }
    assert_eq!(joint.step(&at(89.0, 90.0)), fresh.step(&at(89.0, 90.0)));
}

fn input() -> impl Strategy<Value = JointInput> {
    (any::<i32>(), any::<i32>(), any::<i32>()).prop_map(|(measured, reference, velocity)| {
        JointInput {
            measured: PositionMm::from_raw(measured),
            reference: PositionMm::from_raw(reference),
            reference_velocity: VelocityMmS::from_raw(velocity),
            announced: None,
        }
    })
}

/// The largest gains that are accepted: what stresses the arithmetic most.
fn extreme_gains() -> JointGains {
    JointGains {
        proportional: Gain::lit("4"),
        correction_pd: Gain::lit("2"),
        correction_id: Gain::lit("2"),
        feed_forward: Gain::lit("0.1"),
        error_scale: PositionMm::from_int(1000),
        velocity_scale: VelocityMmS::from_int(5000),
        integral_scale: PositionMm::from_int(1000),
        integral_zone: PositionMm::from_int(1000),
        velocity_window: 64,
        stroke_min: PositionMm::from_int(-1000),
        stroke_max: PositionMm::from_int(1000),
        ..JointGains::default()
    }
}

proptest! {
    #[test]
    fn nothing_overflows_and_the_output_is_bounded(
        inputs in prop::collection::vec(input(), 1..120), tick in 100_u32..=2000,
        switches in prop::collection::vec(any::<bool>(), 120),
    ) {
        let smallest = JointGains {
            error_scale: PositionMm::from_raw(16_384),
            velocity_scale: VelocityMmS::from_int(1),
            integral_scale: PositionMm::from_raw(3277),
            ..extreme_gains()
        };
        for gains in [extreme_gains(), smallest] {
            let gains = JointGains { pwm_period: Micros(tick * 10), ..gains };
            let mut joint = JointController::new(JointConfig::new(&gains, Micros(tick)).unwrap());
            for (input, &switch) in inputs.iter().zip(&switches) {
                joint.set_correction(if switch { Correction::Id } else { Correction::Pd });
                let output = joint.step(input);
                prop_assert!(output.duty.abs() <= gains.duty_limit);
                prop_assert!(output.openings.0.iter().all(|&opening| opening <= gains.pwm_period));
                prop_assert_eq!(output.duty == Duty::ZERO, output.openings.is_shut());
            }
        }
    }

    #[test]
    fn the_law_is_odd(
        inputs in prop::collection::vec((-200_i16..=200, -200_i16..=200, -500_i16..=500), 1..200),
        id in any::<bool>(),
    ) {
        let gains = JointGains {
            stroke_min: PositionMm::from_int(-180),
            ..JointGains::default()
        };
        let (mut plus, mut minus) = (controller(&gains), controller(&gains));
        if id {
            plus.set_correction(Correction::Id);
            minus.set_correction(Correction::Id);
        }
        for (measured, reference, velocity) in inputs {
            let make = |sign: i16| JointInput {
                measured: PositionMm::from_int(sign * measured),
                reference: PositionMm::from_int(sign * reference),
                reference_velocity: VelocityMmS::from_int(sign * velocity),
                announced: None,
            };
            let (a, b) = (plus.step(&make(1)), minus.step(&make(-1)));
            prop_assert_eq!(a.duty.negated(), b.duty);
            prop_assert_eq!(a.limits, b.limits);
            prop_assert_eq!(a.settled, b.settled);
        }
    }

    #[test]
    fn at_standstill_a_larger_error_never_gives_less_duty(a in 0_i32..180 * 65_536, b in 0_i32..180 * 65_536) {
        let duty = |raw: i32| {
            controller(&JointGains::default())
                .step(&JointInput { reference: PositionMm::from_raw(raw), ..JointInput::default() })
                .duty
        };
        let (low, high) = (a.min(b), a.max(b));
        prop_assert!(duty(low) <= duty(high));
    }
}

#[test]
fn an_announced_reference_does_not_change_the_output_of_this_law() {
    let config = JointConfig::new(&JointGains::default(), TICK).unwrap();
    let (mut told, mut untold) = (JointController::new(config), JointController::new(config));
    for tick in 0..400_u32 {
        let plain = at(f64::from(tick) * 0.05, 20.0);
        let ahead = JointInput {
            announced: Some(Announced {
                reference: PositionMm::from_int(150),
                after: Ticks(400 - tick),
            }),
            ..plain
        };
        assert_eq!(told.step(&ahead), untold.step(&plain), "{tick}");
    }
}
