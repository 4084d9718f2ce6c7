//! Bearing of the touching side, odometry, reflexes, homing.

use proptest::prelude::*;
use wheeleg_master::contact::{
    BEARING_ERROR_RAD, FRONT, FootSwitches, INNER, OUTER, REAR, Sector, Side, bearing_of,
};
use wheeleg_master::layer0::behaviours::{JointSense, Senses};
use wheeleg_master::layer0::odometry::{Odometry, WheelGeometry};
use wheeleg_master::layer0::reflex::Reflexes;
use wheeleg_master::layer1::homing::{Homing, HomingConfig, HomingStep};
use wheeleg_master::setpoint::{Feedback, JointSetpoint, Reflex, Setpoints, TravelSetpoint};
use wheeleg_units::{PositionMm, WheelCount};

fn circle_distance(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(std::f64::consts::TAU);
    d.min(std::f64::consts::TAU - d)
}

#[test]
fn bearing_error_is_within_its_bound_and_the_bound_is_tight() {
    let mut low: f64 = 0.0;
    let mut high: f64 = 0.0;
    for i in 0..200_000 {
        let angle = std::f64::consts::TAU * f64::from(i) / 200_000.0;
        let (left, forward) = (angle.sin() as f32, angle.cos() as f32);
        let exact = f64::from(left).atan2(f64::from(forward));
        let found = f64::from(bearing_of(left, forward));
        assert!(
            circle_distance(found, exact) <= f64::from(BEARING_ERROR_RAD),
            "{angle}"
        );
        let signed = (found - exact + 9.0 * std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
            - std::f64::consts::PI;
        low = low.min(signed);
        high = high.max(signed);
    }
    // The approximation errs on both sides, by nearly its bound: a better or worse one would need another documented
    // number.
    assert!(low < -0.8 * f64::from(BEARING_ERROR_RAD), "{low}");
    assert!(high > 0.8 * f64::from(BEARING_ERROR_RAD), "{high}");
}

#[test]
fn all_sixteen_switch_patterns_have_the_right_side() {
    for bits in 0..16_u8 {
        let foot = FootSwitches(bits);
        let has = |bit| f64::from(u8::from(bits & bit != 0));
        let forward = has(FRONT) - has(REAR);
        let outward = has(OUTER) - has(INNER);
        assert_eq!(foot.any(), bits != 0);
        assert_eq!(foot.flat(), bits == 15);
        for (side, sign) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
            let bearing = foot.bearing_rad(side);
            if forward == 0.0 && outward == 0.0 {
                assert_eq!(bearing, None, "{bits:04b}");
                continue;
            }
            let exact = (sign * outward).atan2(forward);
            let bearing = f64::from(bearing.unwrap());
            assert!(circle_distance(bearing, exact) <= f64::from(BEARING_ERROR_RAD));
        }
    }
    let sector = |bits, side| FootSwitches(bits).sector(side).unwrap();
    assert_eq!(sector(FRONT, Side::Left), Sector::Front);
    assert_eq!(sector(OUTER, Side::Left), Sector::Left);
    assert_eq!(sector(OUTER, Side::Right), Sector::Right);
    assert_eq!(sector(INNER, Side::Right), Sector::Left);
    assert_eq!(sector(REAR, Side::Right), Sector::Rear);
    assert_eq!(sector(REAR | OUTER, Side::Right), Sector::RearRight);
    assert_eq!(sector(FRONT | OUTER, Side::Left), Sector::FrontLeft);
    assert_eq!(sector(REAR | OUTER, Side::Left), Sector::RearLeft);
    assert_eq!(sector(FRONT | INNER, Side::Left), Sector::FrontRight);
}

proptest! {
    /// Counts that wrap any number of times give the true distance.
    #[test]
    fn odometry_survives_the_wrap(
        start in any::<i32>(),
        steps in prop::collection::vec(-8_000_000_i32..8_000_000, 1..50),
    ) {
        let geometry = WheelGeometry::default();
        let mut odometry = Odometry::new(geometry);
        let mut count = WheelCount::wrapping_new(start);
        let mut total = 0_i64;
        odometry.update(Side::Left, count);
        for step in steps {
            count = count.wrapping_add(step);
            total += i64::from(step);
            odometry.update(Side::Left, count);
        }
        let exact_um = total as f64 * 942_478.0 / 104_000.0;
        let found = odometry.wheel_um(Side::Left) as f64;
        prop_assert!((found - exact_um).abs() <= 0.51, "{found} {exact_um}");
        // Distance to counts and back is within half a µm in either direction.
        let um = odometry.wheel_um(Side::Left);
        prop_assert!((geometry.counts_to_um(geometry.um_to_counts(um)) - um).abs() <= 1);
    }
}

#[test]
fn odometry_mean_and_rebase() {
    let mut odometry = Odometry::new(WheelGeometry::default());
    assert!(!odometry.known());
    for side in [Side::Left, Side::Right] {
        odometry.update(side, WheelCount::MAX);
    }
    odometry.update(Side::Left, WheelCount::MAX.wrapping_add(104_000));
    assert_eq!(odometry.wheel_um(Side::Left), 942_478);
    assert_eq!(odometry.travel_um(), 471_239);
    // A node that was reset starts at another count: no jump.
    odometry.rebase(Side::Left);
    odometry.update(Side::Left, WheelCount::ZERO);
    assert_eq!(odometry.travel_um(), 471_239);
    odometry.update(Side::Left, WheelCount::ZERO.wrapping_add(-104_000));
    assert_eq!(odometry.travel_um(), 0);
}

fn mm(value: i16) -> PositionMm {
    PositionMm::from_int(value)
}

#[test]
fn a_standing_foot_follows_the_measured_travel() {
    let mut reflexes = Reflexes::default();
    let mut setpoints = Setpoints::idle(0);
    let joint = JointSetpoint {
        reference_mm: mm(170),
        reflex: Reflex::FollowTravel,
        ..JointSetpoint::default()
    };
    let mut at = |segment, travel_um| {
        setpoints.travel = Some(TravelSetpoint {
            segment,
            ..TravelSetpoint::default()
        });
        reflexes.observe(&setpoints, &Senses::default(), travel_um);
        reflexes.apply(1, joint, travel_um).reference_mm.to_f64()
    };
    assert_eq!(
        at(1, 5_000_000),
        170.0,
        "travel counts from the segment's start"
    );
    assert_eq!(at(1, 5_050_000), 120.0);
    assert!((at(1, 5_050_001) - 119.999).abs() < 2e-5);
    assert_eq!(at(1, 5_400_000), 0.0, "kept inside the stroke");
    assert_eq!(at(1, 4_900_000), 180.0);
    assert_eq!(at(2, 5_050_000), 170.0, "a new segment, a new origin");
}

#[test]
fn touchdown_stops_the_lowering_and_a_stuck_switch_does_not() {
    let mut setpoints = Setpoints::idle(0);
    let lower = JointSetpoint {
        reference_mm: mm(180),
        reflex: Reflex::StopOnTouch,
        ..JointSetpoint::default()
    };
    let run = |reflexes: &mut Reflexes, setpoints: &Setpoints, closed: bool, stroke| {
        let b6 = JointSense {
            stroke_mm: mm(stroke),
            ..JointSense::default()
        };
        let senses = Senses {
            feet: [Some(FootSwitches(u8::from(closed))), None],
            joints: [None, None, Some(b6), None, None, None],
            ..Senses::default()
        };
        reflexes.observe(setpoints, &senses, 0);
        reflexes.apply(2, lower, 0).reference_mm
    };
    setpoints.joints[2] = Some(lower);
    let mut reflexes = Reflexes::default();
    assert_eq!(run(&mut reflexes, &setpoints, false, 10), mm(180));
    assert_eq!(run(&mut reflexes, &setpoints, false, 100), mm(180));
    assert_eq!(run(&mut reflexes, &setpoints, true, 130), mm(130));
    // A bounce does not release it.
    assert_eq!(run(&mut reflexes, &setpoints, false, 131), mm(130));
    assert_eq!(run(&mut reflexes, &setpoints, true, 129), mm(130));
    // Lifting resets it.
    let lifted = Setpoints::idle(0);
    run(&mut reflexes, &lifted, true, 20);
    // Now the switch is stuck closed: the leg goes to its reference.
    for stroke in [20, 60, 120] {
        assert_eq!(run(&mut reflexes, &setpoints, true, stroke), mm(180));
    }
}

#[test]
fn homing_slews_settles_and_times_out() {
    let config = HomingConfig::default();
    let target = [90, 0, 180, 90, 90, 180].map(mm);
    let mut feedback = Feedback {
        strokes_mm: [Some(mm(60)); 6],
        ..Feedback::default()
    };
    let mut homing = Homing::new(config, target, &feedback).unwrap();
    let mut last = [60.0; 6];
    let mut cycles = 0;
    loop {
        let (joints, step) = homing.cycle(&feedback);
        cycles += 1;
        for (i, joint) in joints.iter().enumerate() {
            let reference = joint.unwrap().reference_mm;
            // 90 mm/s is 0.9 mm per cycle.
            assert!((reference.to_f64() - last[i]).abs() < 0.9001);
            last[i] = reference.to_f64();
            feedback.strokes_mm[i] = Some(reference);
        }
        if step == HomingStep::Settled {
            break;
        }
        assert_eq!(step, HomingStep::Moving);
    }
    // 120 mm take 134 cycles of 0.9 mm; then 30 settled cycles, the first of which is that of arrival.
    assert!((160..=170).contains(&cycles), "{cycles}");
    assert_eq!(last, [90.0, 0.0, 180.0, 90.0, 90.0, 180.0]);

    // Joint index 4 stays 4 mm off: the time runs out and it is named.
    let mut homing = Homing::new(config, target, &feedback).unwrap();
    feedback.strokes_mm[4] = Some(mm(94));
    let outcome = (0..1500).map(|_| homing.cycle(&feedback).1).last();
    assert_eq!(outcome, Some(HomingStep::TimedOut { joint: 4 }));
    feedback.strokes_mm[3] = None;
    assert!(Homing::new(config, target, &feedback).is_none());
}
