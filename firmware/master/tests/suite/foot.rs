//! Foot trajectories through inverse kinematics in `f32`, compared with `f64`, and the mirroring.

use wheeleg_master::argument::{self, OutOfRange, Value};
use wheeleg_master::contact::Side;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_master::layer1::params::ParamError;
use wheeleg_master::setpoint::{Cylinder, JointSetpoint, Phase, Setpoints};
use wheeleg_units::PositionMm;

const START_US: u64 = 7_000_000;

use crate::common::leg;
use nalgebra::Vector3;
use wheeleg_kinematics::{FootState, LegGeometry, LegParameters};
use wheeleg_master::layer1::foot::FootTrajectory;
use wheeleg_master::mirror::{foot_of_strokes, strokes_of_foot};

fn start() -> Setpoints {
    let mut out = Setpoints::idle(0);
    let home = [90, 0, 180, 90, 0, 180];
    for (slot, mm) in out.joints.iter_mut().zip(home) {
        *slot = Some(JointSetpoint {
            reference_mm: PositionMm::from_int(mm),
            ..JointSetpoint::default()
        });
    }
    out
}

/// f64 reference: strokes in mm and rates in mm/s.
fn exact(x: [f64; 3], v: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let mut parameters = LegParameters::<f64>::wheeleg_2003();
    parameters.min_foot_radius_m = 0.0099;
    let geometry = LegGeometry::new(parameters).unwrap();
    let state = FootState {
        position: Vector3::from(x),
        velocity: Vector3::from(v),
        acceleration: Vector3::zeros(),
    };
    let leg = geometry.inverse_motion(&state).unwrap();
    let s = geometry.strokes_from_lengths(&leg.lengths);
    (
        s.map(|m| m * 1e3),
        <[f64; 3]>::from(leg.rates).map(|r| r * 1e3),
    )
}

fn check(shape: FootShape, side: Side, path: impl Fn(f64) -> ([f64; 3], [f64; 3])) {
    let mut trajectory = FootTrajectory::new(shape, leg(), side, start(), START_US).unwrap();
    let duration = f64::from(shape.duration_s());
    let mut worst: f64 = 0.0;
    let mut moved: f64 = 0.0;
    // Up to the last whole cycle before the end.
    let cycles = (duration * 100.0 - 0.001) as u64;
    for k in 0..=cycles {
        let t = k as f64 * 0.01;
        let out = trajectory.setpoints(START_US + k * 10_000);
        let (x, v) = path(t);
        let (strokes, rates) = exact(x, v);
        for (i, cylinder) in [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical]
            .into_iter()
            .enumerate()
        {
            let joint = out.joints[side.joint(cylinder)].unwrap();
            worst = worst.max((joint.reference_mm.to_f64() - strokes[i]).abs());
            moved = moved.max((joint.reference_mm.to_f64() - 90.0).abs());
            let rate = joint.velocity_mm_s.to_f64();
            assert!(
                (rate - rates[i]).abs() < 0.05,
                "rate {rate} {} at {t}",
                rates[i]
            );
        }
        let other = side.other().joint(Cylinder::Vertical);
        assert_eq!(
            out.joints[other],
            start().joints[other],
            "the other leg stays"
        );
    }
    assert!(worst < 0.02, "{worst} mm");
    assert!(moved > 80.0, "the leg moves");
    let end = START_US + (duration * 1e6) as u64 + 10_000;
    assert_eq!(trajectory.setpoints(end).phase, Phase::Done);
}

#[test]
fn arch_agrees_with_double_precision() {
    let pi = std::f64::consts::PI;
    let duration = 8.0 * pi;
    for (side, mirrored) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
        for left in [0, 20, -20] {
            let shape = FootShape::Arch {
                forward_mm: PositionMm::from_int(150),
                left_mm: PositionMm::from_int(left),
                height_mm: PositionMm::from_int(180),
                rate_rad_s: 0.125,
            };
            let y = f64::from(left) * 1e-3 * mirrored;
            let path = |t: f64| {
                let (s, c) = (t / 8.0).sin_cos();
                (
                    [
                        0.01 + 0.15 * t / duration,
                        y * t / duration,
                        -0.19 + 0.18 * s * s,
                    ],
                    [0.15 / duration, y / duration, 0.18 * 0.25 * s * c],
                )
            };
            check(shape, side, path);
        }
    }
}

#[test]
fn literal_variant_rises_to_179_5_mm_in_3_5_s() {
    let shape = FootShape::Literal {
        forward_mm: PositionMm::from_int(180),
    };
    check(shape, Side::Left, |t| {
        let (s, c) = (t / 8.0).sin_cos();
        (
            [0.01 + 0.18 * t / 3.5, 0.0, -0.19 + s * s],
            [0.18 / 3.5, 0.0, 0.25 * s * c],
        )
    });
    let ([_, _, up], _) = shape.at(3.5);
    assert!((up - 0.1795).abs() < 5e-5, "{up}");
}

#[test]
fn mirror_flips_the_side_and_nothing_else() {
    // The leg yawed to its own outside: b2 short, foot at +Y of the leg's frame.
    let strokes = [0.02, 0.12, 0.10];
    let left = foot_of_strokes(&leg(), Side::Left, strokes).unwrap();
    let right = foot_of_strokes(&leg(), Side::Right, strokes).unwrap();
    assert!(
        left[1] > 0.02,
        "b2 short turns the left leg to the left: {left:?}"
    );
    assert_eq!([right[0], -right[1], right[2]], left);
    for side in [Side::Left, Side::Right] {
        let foot = foot_of_strokes(&leg(), side, strokes).unwrap();
        let (back, _) = strokes_of_foot(&leg(), side, foot, [0.0; 3]).unwrap();
        for (a, b) in strokes.iter().zip(back) {
            assert!((a - b).abs() < 1e-6);
        }
        // Moving to the robot's left shortens the left leg's yaw cylinder and lengthens the right leg's.
        let (_, rates) = strokes_of_foot(&leg(), side, foot, [0.0, 0.1, 0.0]).unwrap();
        assert_eq!(rates[0] < 0.0, side == Side::Left, "{rates:?}");
    }
}

/// A shorter crank, a foot further out, and a vertical cylinder that begins lower.
#[test]
fn a_leg_of_other_dimensions_is_led_by_its_own() {
    let mut other = leg();
    (other.crank_m, other.p4_m) = (0.25, [0.25, 0.40]);
    other.stroke_zero_m = [0.31, 0.06, 0.20];
    other.min_foot_radius_m = 0.06;
    let exact = LegGeometry::new(LegParameters::<f64> {
        crank_m: 0.25,
        p4_m: [0.25, 0.40],
        stroke_zero_m: [0.31, 0.06, 0.20],
        min_foot_radius_m: 0.06,
        ..LegParameters::wheeleg_2003()
    })
    .unwrap();
    for strokes in [[0.09, 0.0, 0.18], [0.02, 0.12, 0.10], [0.16, 0.18, 0.0]] {
        let lengths = exact.lengths_from_strokes(strokes);
        let expected = exact.posture(&lengths).unwrap().foot();
        let strokes = strokes.map(|m| m as f32);
        let foot = foot_of_strokes(&other, Side::Left, strokes).unwrap();
        for (found, expected) in foot.into_iter().zip(expected.iter()) {
            assert!(
                (f64::from(found) - expected).abs() < 1e-6,
                "{strokes:?} {foot:?}"
            );
        }
        let (back, _) = strokes_of_foot(&other, Side::Left, foot, [0.0; 3]).unwrap();
        for (back, stroke) in back.into_iter().zip(strokes) {
            assert!((back - stroke).abs() < 1e-6, "{strokes:?} {back}");
        }
        // With the paper's dimensions the foot would go elsewhere, or nowhere.
        let wrong = strokes_of_foot(&leg(), Side::Left, foot, [0.0; 3]);
        assert!(wrong.is_none_or(|(wrong, _)| (wrong[1] - strokes[1]).abs() > 0.04));
    }
}

#[test]
fn paths_out_of_reach_are_refused() {
    let arch = |forward, left, rate_rad_s| FootShape::Arch {
        forward_mm: PositionMm::from_int(forward),
        left_mm: PositionMm::from_int(left),
        height_mm: PositionMm::from_int(100),
        rate_rad_s,
    };
    let new = |shape| FootTrajectory::new(shape, leg(), Side::Left, start(), 0).map(|_| ());
    assert_eq!(new(arch(180, 0, 0.125)), Ok(()));
    let range = OutOfRange {
        argument: &argument::FORWARD,
        value: Value::Fixed(fixed::types::I16F16::lit("240")),
    };
    assert_eq!(new(arch(240, 0, 0.125)), Err(ParamError::OutOfRange(range)));
    assert!(matches!(
        new(arch(180, 60, 0.125)),
        Err(ParamError::OutOfReach { .. })
    ));
    assert!(matches!(
        new(arch(100, 0, f32::NAN)),
        Err(ParamError::NotFinite(_))
    ));
    let range = OutOfRange {
        argument: &argument::RATE,
        value: Value::Fixed(fixed::types::I16F16::lit("3")),
    };
    assert_eq!(new(arch(100, 0, 3.0)), Err(ParamError::OutOfRange(range)));
}
