//! Layer 1 against model.md §6: instants, look-ahead, pushes, trajectories.

use wheeleg_master::contact::Side;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_master::layer1::params::{GaitParams, ParamError, Pattern};
use wheeleg_master::layer1::profile::Trapezoid;
use wheeleg_master::layer1::square::SquareGait;
use wheeleg_master::setpoint::{
    Ahead, Cylinder, Feedback, JointSetpoint, OnLinkLoss, Phase, Reflex, Setpoints,
};
use wheeleg_units::{PositionMm, VelocityMmS};

const START_US: u64 = 7_000_000;

/// Feedback of a robot that follows exactly: strokes equal to the last
/// references, travel equal to that of the wheels.
struct Ideal {
    feedback: Feedback,
    base_um: i64,
    segment: Option<u16>,
}

impl Ideal {
    fn new() -> Self {
        let feedback = Feedback {
            strokes_mm: [Some(PositionMm::ZERO); 6],
            motion_allowed: true,
            ..Feedback::default()
        };
        Self {
            feedback,
            base_um: 0,
            segment: None,
        }
    }

    /// The reference of each joint after the follow reflex, mm.
    fn follow(&mut self, setpoints: &Setpoints) -> [f64; 6] {
        let travel = setpoints.travel.unwrap();
        if self.segment != Some(travel.segment) {
            self.segment = Some(travel.segment);
            self.base_um = self.feedback.travel_um;
        }
        let travelled = travel.travel_mm.to_f64();
        self.feedback.travel_um = self.base_um + (travelled * 1e3).round() as i64;
        let mut out = [0.0; 6];
        for (i, joint) in setpoints.joints.iter().enumerate() {
            let joint = joint.unwrap();
            out[i] = joint.reference_mm.to_f64();
            if joint.reflex == Reflex::FollowTravel {
                out[i] = (out[i] - travelled).clamp(0.0, 180.0);
            }
            self.feedback.strokes_mm[i] = Some(PositionMm::from_f64(out[i]));
        }
        out
    }
}

struct Sample {
    t_s: f64,
    setpoints: Setpoints,
    strokes: [f64; 6],
}

/// The gait sampled every `step_us` for `seconds`.
fn record(params: GaitParams, step_us: u64, seconds: u64) -> Vec<Sample> {
    let mut gait = SquareGait::new(params, START_US, 1).unwrap();
    let mut ideal = Ideal::new();
    (0..=seconds * 1_000_000 / step_us)
        .map(|k| {
            let now = START_US + k * step_us;
            let setpoints = gait.setpoints(now, &ideal.feedback);
            let strokes = ideal.follow(&setpoints);
            Sample {
                t_s: (k * step_us) as f64 * 1e-6,
                setpoints,
                strokes,
            }
        })
        .collect()
}

#[test]
fn square_wave_switches_at_the_instants_of_the_model() {
    let samples = record(GaitParams::default(), 10_000, 10);
    for s in &samples {
        // Exact rational time of the grid, so that no rounding hides a shift by one cycle.
        let k3 = (s.t_s * 300.0).round() as i64; // t in 1/300 s
        let step = (k3 / 1000).min(2);
        let u = (k3 - step * 1000) as f64 / 300.0;
        let b6 = if (0.10..1.00).contains(&u) {
            0.0
        } else {
            180.0
        };
        assert_eq!(s.strokes[2], b6, "b6 at {}", s.t_s);
        let b5 = s.strokes[1];
        if u < 0.5 {
            assert!(b5.abs() < 0.01, "b5 {b5} at {}", s.t_s);
        } else if u < 2.0 {
            assert_eq!(b5, 180.0, "b5 at {}", s.t_s);
        } else if u >= 3.3 {
            assert!(b5.abs() < 0.01, "b5 {b5} at {}", s.t_s);
        } else {
            // Trapezoid 180 mm/s, 600 mm/s²: ramps of 0.3 s, 1.3 s in all.
            let t = u - 2.0;
            let x = if t < 0.3 {
                300.0 * t * t
            } else if t < 1.0 {
                27.0 + 180.0 * (t - 0.3)
            } else {
                180.0 - 300.0 * (1.3 - t) * (1.3 - t)
            };
            // The step begins up to 6.7 ms before its first cycle on the grid.
            assert!((b5 - (180.0 - x)).abs() < 0.01, "b5 {b5} at {}", s.t_s);
        }
        // Held leg and yaw.
        assert_eq!(s.strokes[0], 90.0);
        assert_eq!(s.strokes[3..], [90.0, 90.0, 180.0]);
    }
    let done = &samples[1000];
    assert_eq!(done.setpoints.phase, Phase::Done);
    assert_eq!(samples[999].setpoints.phase, Phase::Rest);
    // Three pushes of 180 mm.
    let segments: std::collections::BTreeSet<_> = samples
        .iter()
        .map(|s| s.setpoints.travel.unwrap().segment)
        .collect();
    assert_eq!(segments.len(), 4, "rest, then three motions");
}

#[test]
fn phases_follow_the_table() {
    let at = |t_ms: u64| {
        let mut gait = SquareGait::new(GaitParams::default(), START_US, 1).unwrap();
        let out = gait.setpoints(START_US + t_ms * 1000, &Ideal::new().feedback);
        (out.phase, out.step)
    };
    assert_eq!(at(0), (Phase::Unload, 0));
    assert_eq!(at(99), (Phase::Unload, 0));
    assert_eq!(at(100), (Phase::Lift, 0));
    assert_eq!(at(500), (Phase::Reach, 0));
    assert_eq!(at(999), (Phase::Reach, 0));
    assert_eq!(at(1000), (Phase::Lower, 0));
    assert_eq!(at(1999), (Phase::Lower, 0));
    assert_eq!(at(3333), (Phase::Rest, 0));
    assert_eq!(at(3334), (Phase::Unload, 1));
    assert_eq!(at(3434), (Phase::Lift, 1));
    assert_eq!(at(10_000), (Phase::Done, 2));
}

#[test]
fn link_loss_may_exhaust_the_leg_in_the_air_only() {
    for s in record(GaitParams::default(), 10_000, 10) {
        let air = matches!(s.setpoints.phase, Phase::Lift | Phase::Reach);
        for (i, joint) in s.setpoints.joints.iter().enumerate() {
            let exhaust = joint.unwrap().on_link_loss == OnLinkLoss::HoldThenExhaust;
            assert_eq!(exhaust, air && (i == 1 || i == 2), "joint {i} at {}", s.t_s);
        }
    }
}

#[test]
fn look_ahead_counts_down_to_the_very_cycle() {
    let alternate = GaitParams {
        steps: 4,
        pattern: Pattern::Alternate { first: Side::Left },
        ..GaitParams::default()
    };
    for (params, seconds) in [(GaitParams::default(), 10), (alternate, 13)] {
        let samples = record(params, 10_000, seconds);
        let mut seen = 0;
        for (n, s) in samples.iter().enumerate() {
            for j in 0..6 {
                let now = s.setpoints.joints[j].unwrap();
                let Some(Ahead {
                    reference_mm,
                    cycles,
                }) = now.ahead
                else {
                    continue;
                };
                let arrival = n + usize::from(cycles);
                assert!(cycles > 0 && arrival < samples.len());
                let then = samples[arrival].setpoints.joints[j].unwrap();
                if then.reflex == Reflex::FollowTravel && then.velocity_mm_s == VelocityMmS::ZERO
                    || then.velocity_mm_s < VelocityMmS::ZERO
                {
                    // A push: it begins at that cycle and leads there at its end.
                    let phase = |i: usize| samples[i].setpoints.phase;
                    assert_eq!(phase(arrival), Phase::Push);
                    assert_ne!(phase(arrival - 1), Phase::Push);
                    let end = (arrival..).find(|&i| phase(i) != Phase::Push).unwrap();
                    assert!((samples[end].strokes[j] - reference_mm.to_f64()).abs() < 0.05);
                } else {
                    let before = samples[arrival - 1].setpoints.joints[j].unwrap();
                    assert_eq!(then.reference_mm, reference_mm, "joint {j}, cycle {n}");
                    assert!(
                        before.reference_mm != then.reference_mm || before.reflex != then.reflex,
                        "joint {j}, cycle {n}: the change is not one cycle early"
                    );
                }
                seen += 1;
            }
        }
        assert!(seen > 1_000, "{seen}");
        // Every jump of more than 5 mm was announced one cycle before.
        for pair in samples.windows(2) {
            for j in 0..6 {
                if (pair[1].strokes[j] - pair[0].strokes[j]).abs() > 5.0 {
                    let ahead = pair[0].setpoints.joints[j].unwrap().ahead;
                    assert_eq!(ahead.map(|a| a.cycles), Some(1), "{j} at {}", pair[1].t_s);
                }
            }
        }
    }
}

#[test]
fn alternating_legs_share_each_push() {
    let params = GaitParams {
        steps: 5,
        pattern: Pattern::Alternate { first: Side::Left },
        ..GaitParams::default()
    };
    let samples = record(params, 10_000, 17);
    let stepping: Vec<_> = (0..5)
        .map(|k| samples[k * 333 + 50].setpoints.stepping.unwrap())
        .collect();
    assert_eq!(
        stepping,
        [Side::Left, Side::Right, Side::Left, Side::Right, Side::Left]
    );
    for k in 0..5 {
        let end = &samples[(k + 1) * 1000 / 3 - 1];
        let (step, other) = if k % 2 == 0 { (1, 4) } else { (4, 1) };
        assert!(
            (end.strokes[step] - 90.0).abs() < 0.05,
            "step {k}: {:?}",
            end.strokes
        );
        assert!(
            end.strokes[other].abs() < 0.05,
            "step {k}: {:?}",
            end.strokes
        );
    }
    // While its leg stands, no b5 jumps: the foot does not drag.
    for pair in samples.windows(2) {
        let stepping = pair[1].setpoints.stepping.unwrap();
        let other = stepping.other().joint(Cylinder::Horizontal);
        assert!((pair[1].strokes[other] - pair[0].strokes[other]).abs() < 1.9);
    }
}

#[test]
fn push_starts_from_the_stroke_reached() {
    let mut gait = SquareGait::new(GaitParams::default(), START_US, 1).unwrap();
    let mut feedback = Ideal::new().feedback;
    feedback.strokes_mm[1] = Some(PositionMm::from_int(170));
    let out = gait.setpoints(START_US + 2_000_000, &feedback);
    assert_eq!(
        out.joints[1].unwrap().reference_mm,
        PositionMm::from_int(170)
    );
    assert_eq!(out.travel.unwrap().target_mm, PositionMm::from_int(170));
}

#[test]
fn stop_ends_with_the_step_under_way() {
    let mut gait = SquareGait::new(GaitParams::default(), START_US, 1).unwrap();
    gait.stop_after_step(START_US + 4_000_000);
    let feedback = Ideal::new().feedback;
    assert_ne!(
        gait.setpoints(START_US + 6_660_000, &feedback).phase,
        Phase::Done
    );
    assert_eq!(
        gait.setpoints(START_US + 6_670_000, &feedback).phase,
        Phase::Done
    );
    assert_eq!(gait.steps(), 2);
}

#[test]
fn touchdown_reflex_is_asked_for_from_the_lowering_on() {
    let params = GaitParams {
        touchdown_reflex: true,
        ..GaitParams::default()
    };
    for s in record(params, 10_000, 10) {
        let b6: JointSetpoint = s.setpoints.joints[2].unwrap();
        let lowered = !matches!(s.setpoints.phase, Phase::Lift | Phase::Reach) && s.t_s > 0.5;
        assert_eq!(b6.reflex == Reflex::StopOnTouch, lowered, "{}", s.t_s);
        assert_eq!(s.setpoints.joints[5].unwrap().reflex, Reflex::None);
    }
}

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

mod foot {
    use super::*;
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
        let mut trajectory = FootTrajectory::new(shape, side, start(), START_US).unwrap();
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
        let left = foot_of_strokes(Side::Left, strokes).unwrap();
        let right = foot_of_strokes(Side::Right, strokes).unwrap();
        assert!(
            left[1] > 0.02,
            "b2 short turns the left leg to the left: {left:?}"
        );
        assert_eq!([right[0], -right[1], right[2]], left);
        for side in [Side::Left, Side::Right] {
            let foot = foot_of_strokes(side, strokes).unwrap();
            let (back, _) = strokes_of_foot(side, foot, [0.0; 3]).unwrap();
            for (a, b) in strokes.iter().zip(back) {
                assert!((a - b).abs() < 1e-6);
            }
            // Moving to the robot's left shortens the left leg's yaw cylinder and
            // lengthens the right leg's.
            let (_, rates) = strokes_of_foot(side, foot, [0.0, 0.1, 0.0]).unwrap();
            assert_eq!(rates[0] < 0.0, side == Side::Left, "{rates:?}");
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
        let new = |shape| FootTrajectory::new(shape, Side::Left, start(), 0).map(|_| ());
        assert_eq!(new(arch(180, 0, 0.125)), Ok(()));
        assert!(matches!(
            new(arch(240, 0, 0.125)),
            Err(ParamError::OutOfRange {
                field: "forward_mm",
                ..
            })
        ));
        assert!(matches!(
            new(arch(180, 60, 0.125)),
            Err(ParamError::OutOfReach { .. })
        ));
        assert!(matches!(
            new(arch(100, 0, f32::NAN)),
            Err(ParamError::NotFinite { .. })
        ));
        assert!(matches!(
            new(arch(100, 0, 3.0)),
            Err(ParamError::OutOfRange {
                field: "rate_rad_s",
                ..
            })
        ));
    }
}
