//! Gait parameters and the profile of the push.

use wheeleg_master::layer1::params::{GaitParams, ParamError};
use wheeleg_master::layer1::profile::Trapezoid;
use wheeleg_units::{PositionMm, VelocityMmS};

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    let good = GaitParams::default();
    assert_eq!(good.validate(), Ok(()));
    let field = |params: GaitParams| {
        let error = params.validate().expect_err("refused");
        if let ParamError::PushTooLong { needs_us, has_us } = error {
            assert!(needs_us > has_us);
        }
        let first = error.arguments().next();
        (first.map(|argument| argument.name), error.to_string())
    };
    let named = |params| field(params).0.unwrap_or_default();
    let mm = PositionMm::from_int;
    assert_eq!(named(GaitParams { steps: 0, ..good }), "steps");
    assert_eq!(
        named(GaitParams {
            stroke_mm: mm(181),
            ..good
        }),
        "stroke"
    );
    assert_eq!(
        named(GaitParams {
            yaw_s2_mm: mm(-1),
            ..good
        }),
        "yaw_s2"
    );
    assert_eq!(
        named(GaitParams {
            lift_us: 500_000,
            ..good
        }),
        "reach"
    );
    assert_eq!(
        named(GaitParams {
            push_us: 1_000_000,
            ..good
        }),
        "push"
    );
    assert_eq!(
        named(GaitParams {
            period_us: 2_000_000,
            ..good
        }),
        "period"
    );
    assert_eq!(
        named(GaitParams {
            period_us: 60_000_001,
            ..good
        }),
        "period"
    );
    let slow = GaitParams {
        push_speed_mm_s: VelocityMmS::from_int(150),
        ..good
    };
    let (first, told) = field(slow);
    assert_eq!(first, Some("period"));
    assert_eq!(
        told,
        "with this `stroke`, `push_speed` and `push_acceleration` the push takes 1.45 s, but from \
         `push` to the end of the `period` there are 1.333333 s; allowed: `period` at least 1.45 s \
         after `push`"
    );
    let early = GaitParams {
        period_us: 1_000_000,
        ..good
    };
    assert_eq!(
        field(early).1,
        "`push` is 2 s and must be less than `period`, which is 1 s; allowed: lift before reach and \
         lower, these before push, push before period"
    );
}

/// A step whose height is less than the slow distance is lowered slowly over its whole height.
#[test]
fn a_short_step_is_lowered_slowly_over_its_own_stroke() {
    let short = |stroke_mm: f64, speed_mm_s: f64| GaitParams {
        stroke_mm: PositionMm::from_f64(stroke_mm),
        touchdown_speed_mm_s: VelocityMmS::from_f64(speed_mm_s),
        ..GaitParams::default()
    };
    // There is one second for it.
    assert_eq!(short(5.0, 5.01).validate(), Ok(()));
    assert_eq!(short(1.0, 1.01).validate(), Ok(()));
    let error = short(5.0, 5.0).validate().expect_err("refused");
    assert!(
        error
            .to_string()
            .contains("the last 5 mm of the lowering take 1 s"),
        "{error}"
    );
    assert!(short(100.0, 15.0).validate().is_err());
    assert_eq!(short(100.0, 15.01).validate(), Ok(()));
}

/// Each of the five order relations on its own, and all violations at once.
#[test]
fn every_relation_names_both_instants() {
    let good = GaitParams::default();
    let named = |params: GaitParams| -> Vec<Vec<&str>> {
        let names = |error: ParamError| error.arguments().map(|argument| argument.name).collect();
        params.violations().map(names).collect()
    };
    let at = |lift, reach, lower, push| GaitParams {
        lift_us: lift,
        reach_us: reach,
        lower_us: lower,
        push_us: push,
        ..good
    };
    for (params, pair) in [
        (at(5, 5, 6, 7), ["reach", "lift"]),
        (at(5, 6, 5, 7), ["lower", "lift"]),
        (at(5, 7, 6, 7), ["push", "reach"]),
        (at(5, 6, 7, 7), ["push", "lower"]),
        (at(5, 6, 7, good.period_us), ["period", "push"]),
    ] {
        assert_eq!(named(params), [pair]);
    }
    let both = GaitParams {
        steps: 0,
        ..at(5, 5, 6, 7)
    };
    assert_eq!(named(both), [vec!["steps"], vec!["reach", "lift"]]);
}

#[test]
fn trapezoid_agrees_with_its_integral() {
    for (d, v, a) in [(180.0, 180.0, 600.0), (40.0, 180.0, 600.0), (0.0, 1.0, 1.0)] {
        let profile = Trapezoid::new(d, v, a);
        let n = 20_000;
        let dt = f64::from(profile.duration_s()) / f64::from(n);
        let mut sum = 0.0;
        for i in 0..n {
            let (_, speed) = profile.at(((f64::from(i) + 0.5) * dt) as f32);
            assert!(speed <= v + 1e-3 && speed >= 0.0);
            sum += f64::from(speed) * dt;
        }
        assert!((sum - f64::from(d)).abs() < 2e-3, "{sum} for {d}");
        assert_eq!(profile.at(f32::INFINITY), (d, 0.0));
        assert_eq!(profile.at(f32::NAN), (0.0, 0.0));
    }
    assert!((Trapezoid::new(180.0, 180.0, 600.0).duration_s() - 1.3).abs() < 1e-5);
    // Triangle: peak √(40·600) = 154.9 mm/s.
    assert!((Trapezoid::new(40.0, 180.0, 600.0).duration_s() - 0.516_398).abs() < 1e-5);
    assert_eq!(Trapezoid::new(f32::NAN, 1.0, 1.0).duration_s(), 0.0);
}
