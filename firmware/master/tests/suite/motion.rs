//! Layer 1 against MODEL.md §6: instants, look-ahead, pushes, trajectories.

use wheeleg_master::contact::Side;
use wheeleg_master::layer1::params::{GaitParams, Pattern};
use wheeleg_master::layer1::square::SquareGait;
use wheeleg_master::setpoint::{
    Cylinder, Feedback, JointSetpoint, NextReference, OnLinkLoss, Phase, Reflex, Setpoints,
};
use wheeleg_units::{PositionMm, VelocityMmS};

const START_US: u64 = 7_000_000;

/// Feedback of a robot that follows exactly: strokes equal to the last references, travel equal to that of the wheels.
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
        let travelled = travel.wheels[0].travel_mm.to_f64();
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
        // Exact rational time on the grid, so that no rounding hides a shift by one cycle.
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
                let Some(NextReference {
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
                    // A push: it begins in that cycle and is there at its end.
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
    assert_eq!(
        out.travel.unwrap().wheels[0].target_mm,
        PositionMm::from_int(170)
    );
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

/// The foot stood at 170 mm: it is lowered fast to 15 mm above that, and slowly from there on.
#[test]
fn a_guarded_touchdown_is_slow_from_above_the_ground_on() {
    const SPEED_MM_S: f64 = 60.0;
    let params = GaitParams {
        touchdown_speed_mm_s: VelocityMmS::from_f64(SPEED_MM_S),
        ..GaitParams::default()
    };
    let mut gait = SquareGait::new(params, START_US, 1).unwrap();
    let mut feedback = Ideal::new().feedback;
    let mut b6_at = |ms: u64, stroke_mm: Option<i16>| {
        feedback.strokes_mm[2] = stroke_mm.map(PositionMm::from_int);
        let out = gait.setpoints(START_US + ms * 1_000, &feedback);
        out.joints[2].unwrap()
    };
    assert_eq!(b6_at(0, Some(170)).reference_mm.to_f64(), 180.0);
    assert_eq!(b6_at(100, Some(170)).reference_mm.to_f64(), 0.0);
    let reach = b6_at(900, Some(0));
    let ahead = reach.ahead.unwrap();
    assert_eq!((ahead.reference_mm.to_f64(), ahead.cycles), (155.0, 10));
    // However long the foot takes.
    for (ms, stroke_mm) in [
        (1_000, Some(0)),
        (1_300, Some(100)),
        (1_500, Some(151)),
        (1_510, None),
    ] {
        assert_eq!(b6_at(ms, stroke_mm).reference_mm.to_f64(), 155.0, "{ms}");
    }
    let begin_ms = 1_520;
    for ms in (begin_ms..1_990).step_by(10) {
        let wanted_mm = 155.0 + SPEED_MM_S * (ms - begin_ms) as f64 * 1e-3;
        let reference_mm = b6_at(ms, Some(153)).reference_mm.to_f64();
        assert!(
            (reference_mm - wanted_mm.min(180.0)).abs() < 1e-3,
            "{ms}: {reference_mm}"
        );
    }
    assert_eq!(
        b6_at(2_000, Some(160)).reference_mm.to_f64(),
        180.0,
        "the push needs it down"
    );
    // In the next step the ground is expected at the foot's present position.
    assert_eq!(b6_at(3_434, Some(176)).reference_mm.to_f64(), 0.0);
    assert_eq!(b6_at(4_340, Some(0)).reference_mm.to_f64(), 161.0);
}

/// Without a speed the reference jumps, as in the paper.
#[test]
fn without_a_touchdown_speed_the_lowering_is_a_jump() {
    for s in record(GaitParams::default(), 10_000, 10) {
        let air = matches!(s.setpoints.phase, Phase::Lift | Phase::Reach);
        let wanted_mm = if air { 0.0 } else { 180.0 };
        assert_eq!(
            s.setpoints.joints[2].unwrap().reference_mm.to_f64(),
            wanted_mm,
            "{}",
            s.t_s
        );
    }
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

/// A new motion number means that the distance restarts from zero.
#[test]
fn a_second_gait_numbers_its_motions_on() {
    let motions = |gait: &mut SquareGait| -> std::collections::BTreeSet<u16> {
        let mut ideal = Ideal::new();
        (0..=1_000)
            .map(|cycle| {
                let setpoints = gait.setpoints(START_US + cycle * 10_000, &ideal.feedback);
                ideal.follow(&setpoints);
                setpoints.travel.unwrap().segment
            })
            .collect()
    };
    let mut first = SquareGait::new(GaitParams::default(), START_US, 1).unwrap();
    let of_first = motions(&mut first);
    let next = first.segment() + 1;
    let mut second = SquareGait::new(GaitParams::default(), START_US, next).unwrap();
    let of_second = motions(&mut second);
    assert_eq!(of_first.union(&of_second).count(), 8);
}

#[test]
fn the_leg_that_steps_second_is_held_until_it_is_lowered() {
    let held_mm = PositionMm::from_int(150);
    let params = GaitParams {
        steps: 4,
        pattern: Pattern::Alternate { first: Side::Left },
        held_leg_s6_mm: held_mm,
        ..GaitParams::default()
    };
    let mut right_lowered = false;
    for s in record(params, 10_000, 13) {
        let (phase, stepping) = (s.setpoints.phase, s.setpoints.stepping.unwrap());
        let air = matches!(phase, Phase::Lift | Phase::Reach);
        right_lowered |= stepping == Side::Right && phase == Phase::Lower;
        for side in [Side::Left, Side::Right] {
            let vertical = s.setpoints.joints[side.joint(Cylinder::Vertical)].unwrap();
            let wanted = if air && stepping == side {
                PositionMm::ZERO
            } else if side == Side::Left || right_lowered {
                params.stroke_mm
            } else {
                held_mm
            };
            assert_eq!(vertical.reference_mm, wanted, "{side:?} at {}", s.t_s);
        }
    }
}
