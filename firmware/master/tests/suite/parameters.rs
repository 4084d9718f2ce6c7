//! Gait parameters and the profile of the push.

use wheeleg_master::layer1::params::{GaitParams, ParamError};
use wheeleg_master::layer1::profile::Trapezoid;
use wheeleg_units::{PositionMm, VelocityMmS};

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    let good = GaitParams::default();
    assert_eq!(good.validate(), Ok(()));
    let field = |params: GaitParams| match params.validate() {
        Err(ParamError::OutOfRange { field, .. } | ParamError::Order { field }) => field,
        Err(ParamError::Steps { .. }) => "steps",
        Err(ParamError::PeriodTooLong { .. }) => "period",
        Err(ParamError::PushTooLong { needs_us, has_us }) => {
            assert!(needs_us > has_us);
            "push"
        }
        other => panic!("{other:?}"),
    };
    let mm = PositionMm::from_int;
    assert_eq!(field(GaitParams { steps: 0, ..good }), "steps");
    assert_eq!(
        field(GaitParams {
            stroke_mm: mm(181),
            ..good
        }),
        "stroke_mm"
    );
    assert_eq!(
        field(GaitParams {
            yaw_s2_mm: mm(-1),
            ..good
        }),
        "yaw_s2_mm"
    );
    assert_eq!(
        field(GaitParams {
            lift_us: 500_000,
            ..good
        }),
        "reach_us"
    );
    assert_eq!(
        field(GaitParams {
            push_us: 1_000_000,
            ..good
        }),
        "push_us"
    );
    assert_eq!(
        field(GaitParams {
            period_us: 2_000_000,
            ..good
        }),
        "period_us"
    );
    assert_eq!(
        field(GaitParams {
            period_us: 60_000_001,
            ..good
        }),
        "period"
    );
    let slow = GaitParams {
        push_speed_mm_s: VelocityMmS::from_int(150),
        ..good
    };
    assert_eq!(field(slow), "push");
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
