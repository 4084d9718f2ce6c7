//! The paper's three steps through the whole stack: commanded, sensed and physical values agree, on either
//! leg.

use std::sync::OnceLock;

use crate::sil::{at, gait, range, robot, robot_with, run, settled_touches, window};
use wheeleg_config::{EventAction, LegChoice, RobotConfig, TargetSet};
use wheeleg_master::command::{Command, CorrectionKind};
use wheeleg_plant::sensors::AdcNoise;
use wheeleg_protocol::param::JointParam;
use wheeleg_studies::analysis::{Analysis, analyse};
use wheeleg_telemetry::{JointSample, Recording, Row};

/// Length of the three steps, s.
const RUN_S: f64 = 10.0;

/// A recorded run and its report.
struct Steps {
    recording: Recording,
    analysis: Analysis,
    /// Joints of the stepping leg: yaw, horizontal (b5), vertical (b6).
    leg: [usize; 3],
    /// The stepping foot; the held one is the other.
    foot: usize,
}

impl Steps {
    fn of(leg: LegChoice) -> Self {
        Self::with(leg, robot())
    }

    fn with(leg: LegChoice, robot: RobotConfig) -> Self {
        let mut scenario = gait(leg, RUN_S, &[]);
        scenario.targets = TargetSet::ThreeStep;
        let recording = run(&scenario, &robot, 1);
        let analysis = analyse(&scenario, &robot, &recording);
        let foot = usize::from(leg == LegChoice::Right);
        Self {
            recording,
            analysis,
            leg: [3 * foot, 3 * foot + 1, 3 * foot + 2],
            foot,
        }
    }

    fn b5(&self) -> &[Row<JointSample>] {
        &self.recording.joints[self.leg[1]]
    }

    fn b6(&self) -> &[Row<JointSample>] {
        &self.recording.joints[self.leg[2]]
    }

    /// Start, start of the push, and end of each step, s.
    fn steps(&self) -> Vec<[f64; 3]> {
        let gait = robot().gait;
        (0..gait.steps)
            .map(|k| {
                let begin = self.analysis.start_s + f64::from(k) * gait.period_s;
                let end = (begin + gait.period_s).min(RUN_S);
                [begin, begin + gait.push_s, end]
            })
            .collect()
    }

    /// From the first change of the reference at the node to the first millimetre in its
    /// direction, for lift, reach and lowering of each step, s.
    fn start_delays(&self) -> Vec<f64> {
        let gait = robot().gait;
        let mut delays = Vec::new();
        for [begin, push, _] in self.steps() {
            for (rows, offset_s, sign) in [
                (self.b6(), gait.lift_s, -1.0),
                (self.b5(), gait.reach_s, 1.0),
                (self.b6(), gait.lower_s, 1.0),
            ] {
                // The gait's clock is known to a cycle or two of the bus.
                let rows = window(rows, (begin + offset_s - 0.019).max(0.0), push);
                let before = rows[0].v.reference_mm;
                let jump = rows
                    .iter()
                    .position(|r| sign * (r.v.reference_mm - before) > 0.05)
                    .expect("the reference moves");
                assert!(
                    jump < 50,
                    "the reference moves at once, not after {jump} ms"
                );
                // From the turning point: the move before may still be ending.
                let mut turned = f64::INFINITY;
                let started = rows[jump..].iter().find(|r| {
                    let x = sign * r.v.position_mm;
                    turned = turned.min(x);
                    x - turned >= 1.0
                });
                delays.push(started.expect("it moves").t_s() - rows[jump].t_s());
            }
        }
        delays
    }
}

fn left() -> &'static Steps {
    static RUN: OnceLock<Steps> = OnceLock::new();
    RUN.get_or_init(|| Steps::of(LegChoice::Left))
}

fn right() -> &'static Steps {
    static RUN: OnceLock<Steps> = OnceLock::new();
    RUN.get_or_init(|| Steps::of(LegChoice::Right))
}

/// Mean and standard deviation.
fn spread(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
    (mean, variance.sqrt())
}

#[test]
fn the_sensed_stroke_is_the_true_one_through_a_real_sensor() {
    let robot = robot();
    let adc = robot.plant.adc;
    let AdcNoise::Gaussian { sigma_lsb } = adc.noise else {
        panic!("the robot's converters have Gaussian noise");
    };
    for (joint, rows) in left().recording.joints.iter().enumerate() {
        let pot = robot.plant.potentiometers[joint];
        let full_mm = pot.electrical_stroke_m * 1e3;
        let lsb_mm = full_mm / f64::from(1_u32 << adc.bits);
        // The reading is the mean of several conversions.
        let noise_mm = sigma_lsb * lsb_mm / f64::from(adc.oversampling).sqrt();
        let bow_mm = pot.nonlinearity * full_mm;
        // Truncation takes half a step on average; six sigmas in 60 000 readings.
        let bound_mm = bow_mm + 0.5 * lsb_mm + 6.0 * noise_mm;
        let error = |s: &JointSample| s.sensed_mm - s.position_mm;
        let (low, high) = range(rows, error);
        let name = joint + 1;
        assert!(
            -bound_mm < low && high < bound_mm,
            "joint {name}: {low} … {high} mm"
        );
        // Not the true stroke passed through: its noise is there, and only its noise where the joint is at
        // rest.
        let (mean, deviation) = spread(window(rows, 0.0, 0.15).iter().map(|r| error(&r.v)));
        assert!(
            (0.6 * noise_mm..1.8 * noise_mm).contains(&deviation),
            "joint {name} at rest: {deviation} mm against {noise_mm} mm"
        );
        assert!(
            mean.abs() < bow_mm + lsb_mm,
            "joint {name} at rest: {mean} mm"
        );
        let moves = rows.iter().any(|r| r.v.velocity_mm_s.abs() > 100.0);
        if moves {
            // Over the whole stroke the bow of the potentiometer shows, both ways.
            assert!(
                high > 0.5 * bow_mm && low < -0.5 * bow_mm,
                "joint {name}: {low} … {high} mm"
            );
        }
    }
}

#[test]
fn cylinders_follow_their_references_but_not_at_once() {
    let steps = left();
    let robot = robot();
    for [begin, push, _] in steps.steps() {
        // b5 has arrived when the push begins, b6 has reached the ground.
        for (name, rows) in [("b5", steps.b5()), ("b6", steps.b6())] {
            let s = at(rows, push - 0.01);
            let error = s.reference_mm - s.position_mm;
            assert!(error.abs() < 1.5, "{name} at {push} s: {error} mm");
            assert!(
                (s.reference_mm - 180.0).abs() < 0.1,
                "{name}: {}",
                s.reference_mm
            );
        }
        // A reference that jumps 180 mm is not followed by a pneumatic cylinder within
        // a few milliseconds.
        let lower = begin + robot.gait.lower_s;
        let (_, lag) = range(window(steps.b6(), lower, push), |s| {
            s.reference_mm - s.position_mm
        });
        assert!((8.0..120.0).contains(&lag), "b6 lags by {lag} mm");
    }
    // Yaw and the held leg stay at their references.
    for joint in (0..6).filter(|j| !steps.leg[1..].contains(j)) {
        let rows = &steps.recording.joints[joint];
        let (low, high) = range(rows, |s| s.reference_mm - s.position_mm);
        assert!(
            low > -1.0 && high < 1.0,
            "joint {}: {low} … {high} mm",
            joint + 1
        );
    }
}

#[test]
fn every_step_takes_the_whole_stroke_below_400_mm_per_s() {
    for steps in [left(), right()] {
        for [begin, _, end] in steps.steps() {
            for (name, rows) in [("b5", steps.b5()), ("b6", steps.b6())] {
                let rows = window(rows, begin, end);
                let (low, high) = range(rows, |s| s.position_mm);
                assert!(
                    high - low > 170.0,
                    "{name} from {begin} s: {low} … {high} mm"
                );
                assert!(
                    low > -0.5 && high < 180.5,
                    "{name} from {begin} s: {low} … {high} mm"
                );
                let (back, forth) = range(rows, |s| s.velocity_mm_s);
                assert!(
                    back >= -400.0 && forth <= 400.0,
                    "{name}: {back} … {forth} mm/s"
                );
                assert!(
                    back < -100.0 && forth > 200.0,
                    "{name}: {back} … {forth} mm/s"
                );
            }
        }
    }
}

/// Regression brackets, above and below: neither a dead time nor a cylinder
/// without any may creep in.
#[test]
fn start_delays_and_force_stay_in_their_brackets() {
    for steps in [left(), right()] {
        let delays = steps.start_delays();
        assert_eq!(delays.len(), 9, "three moves in each of three steps");
        for (i, delay) in delays.into_iter().enumerate() {
            // The first lift starts from chambers at supply and ambient pressure, which have to swap; later
            // moves start from the state that the last one left.
            let bracket = if i == 0 { 0.10..0.30 } else { 0.015..0.12 };
            assert!(bracket.contains(&delay), "move {i}: {delay} s");
        }
        let moving = window(steps.b6(), steps.analysis.start_s, RUN_S);
        let (low, high) = range(moving, |s| s.force_net_n);
        assert!(low >= -30.0 && high <= 30.0, "F6 {low} … {high} N");
        let peak = high.max(-low);
        assert!((7.0..25.0).contains(&peak), "F6 {low} … {high} N");
        // The pressure force has to hold the robot up: far more than the net force.
        let (_, pressure) = range(moving, |s| s.force_pressure_n.abs());
        assert!(pressure > 3.0 * peak, "{pressure} N");
    }
}

#[test]
fn no_valve_switches_at_rest() {
    const SETTLING_S: f64 = 1.2;
    for steps in [left(), right()] {
        let mut rest_s = 0.0;
        let mut all_edges = 0;
        for (joint, rows) in steps.recording.joints.iter().enumerate() {
            let mut moved_s = rows[0].t_s();
            for pair in rows.windows(2) {
                let (before, now) = (&pair[0], &pair[1]);
                if (now.v.reference_mm - before.v.reference_mm).abs() > 0.01 {
                    moved_s = now.t_s();
                } else if before.t_s() > moved_s + SETTLING_S {
                    rest_s += now.t_s() - before.t_s();
                    assert_eq!(
                        now.v.valve_edges,
                        before.v.valve_edges,
                        "joint {} at {:.3} s",
                        joint + 1,
                        now.t_s()
                    );
                    // A valve that stands open makes no edges either.
                    assert_eq!(
                        now.v.valves_open,
                        0,
                        "joint {} at {:.3} s",
                        joint + 1,
                        now.t_s()
                    );
                }
            }
            all_edges += rows[rows.len() - 1].v.valve_edges;
        }
        // Four joints never get another reference: at least their rests were checked.
        assert!(
            rest_s > 4.0 * (RUN_S - SETTLING_S) - 0.1,
            "{rest_s} joint seconds"
        );
        assert!(
            all_edges > 300,
            "only {all_edges} edges: did anything move?"
        );
    }
}

#[test]
fn the_stepping_foot_lifts_and_touches_three_times_and_the_other_never() {
    for steps in [left(), right()] {
        let feet = &steps.recording.feet;
        let touches = settled_touches(&feet[steps.foot]);
        let expected = [false, true, false, true, false, true];
        assert_eq!(touches.iter().map(|t| t.1).collect::<Vec<_>>(), expected);
        assert!(settled_touches(&feet[1 - steps.foot]).is_empty());
        for (k, [begin, push, _]) in steps.steps().into_iter().enumerate() {
            let (lift, touch) = (touches[2 * k].0, touches[2 * k + 1].0);
            assert!(
                begin < lift && lift < touch && touch < push,
                "{lift} {touch}"
            );
            // In the air the foot clears the ground by nearly the stroke, and bears nothing.
            let flight = window(&feet[steps.foot], lift + 0.05, touch - 0.05);
            let (_, height) = range(flight, |s| s.clearance_mm);
            assert!((160.0..182.0).contains(&height), "{height} mm");
            assert!(range(flight, |s| s.normal_force_n).1 <= 0.0);
        }
    }
}

/// The robot's axes are not those for which the law was tuned: it need not meet the paper's figures
/// on them, but it must step. A move is announced while the one before it is still under way.
#[test]
fn with_the_predictive_law_the_foot_lifts_and_touches_three_times_too() {
    for leg in [LegChoice::Left, LegChoice::Right] {
        let steps = Steps::with(leg, robot_with(JointParam::Law, 5));
        let touches = settled_touches(&steps.recording.feet[steps.foot]);
        let expected = [false, true, false, true, false, true];
        assert_eq!(touches.iter().map(|t| t.1).collect::<Vec<_>>(), expected);
        for [begin, push, end] in steps.steps() {
            // Lifted most of the way in the time that the gait has for it, and down again.
            let (up, down) = range(window(steps.b6(), begin, push), |s| s.position_mm);
            assert!(up < 60.0 && down > 170.0, "{begin}: {up} to {down} mm");
            let (back, reached) = range(window(steps.b5(), begin, end), |s| s.position_mm);
            assert!(
                back < 10.0 && reached > 170.0,
                "{begin}: {back} to {reached} mm"
            );
        }
        let faults = |rows: &[Row<JointSample>]| rows.iter().any(|r| r.v.faults != 0);
        assert!(!steps.recording.joints.iter().any(|rows| faults(rows)));
    }
}

#[test]
fn foot_switches_say_what_the_ground_does() {
    let steps = left();
    for foot in 0..2 {
        let (mut wrong, mut agree) = (0, 0);
        for row in &steps.recording.feet[foot] {
            // 4 N press a flat sole to the switches' threshold; both sides of it are clear.
            let pressed = match row.v.normal_force_n {
                f if f > 6.0 => true,
                f if f < 2.0 => false,
                _ => continue,
            };
            if (row.v.switches != 0) == pressed {
                agree += 1;
            } else {
                wrong += 1;
            }
        }
        // The boards debounce: a few milliseconds late at each change, never more.
        assert!(
            wrong < 100 && agree > 9_000,
            "foot {foot}: {wrong} wrong, {agree} right"
        );
        assert!(foot == 1 || wrong > 0, "foot {foot}: debouncing takes time");
    }
}

#[test]
fn the_chassis_travels_what_the_leg_reached() {
    for steps in [left(), right()] {
        let body = &steps.recording.body;
        for [begin, push, end] in steps.steps() {
            let reached = at(steps.b5(), push).position_mm;
            let travelled = at(body, end).x_mm - at(body, push).x_mm;
            assert!(
                (travelled - reached).abs() < 1.0,
                "{travelled} mm against {reached} mm"
            );
            assert!((170.0..181.0).contains(&travelled), "{travelled} mm");
            // Before the push the robot stands, but it is not bolted down.
            let (low, high) = range(window(body, begin, push), |s| s.x_mm);
            assert!(high - low < 1.0, "{} mm while stepping", high - low);
            assert!(high - low > 1e-4, "the ground is rigid");
        }
    }
}

#[test]
fn the_held_foot_slides_with_the_chassis_under_kinetic_friction() {
    let robot = robot();
    let contact = robot.plant.contacts.foot.law;
    for steps in [left(), right()] {
        let held = 1 - steps.foot;
        let held_b5 = &steps.recording.joints[3 * held + 1];
        for [begin, push, _] in steps.steps() {
            // In mid-push, at constant speed.
            let (from, to) = (push + 0.45, push + 0.85);
            let body = window(&steps.recording.body, from, to);
            let (slow, fast) = range(body, |s| s.speed_mm_s);
            assert!(slow > 140.0 && fast < 220.0, "{slow} … {fast} mm/s");
            let (low, high) = range(window(held_b5, push, to), |s| s.position_mm);
            assert!(
                high - low < 1.0,
                "the held leg gave way by {} mm",
                high - low
            );
            let foot = window(&steps.recording.feet[held], from, to);
            let (low, high) = range(foot, |s| -s.friction_force_n / s.normal_force_n);
            assert!(
                low > 0.93 * contact.mu_kinetic && high < 1.07 * contact.mu_kinetic,
                "held foot: friction over load {low} … {high}"
            );
            // Standing on both feet or on one, nothing slides.
            let stand = window(&steps.recording.feet[held], begin + 0.6, begin + 0.95);
            let (low, high) = range(stand, |s| s.friction_force_n / s.normal_force_n);
            assert!(
                low > -contact.mu_static && high < contact.mu_static,
                "standing: {low} … {high}"
            );
        }
        // On loaded soles: never more than the ground can give.
        for foot in &steps.recording.feet {
            for row in foot.iter().filter(|r| r.v.normal_force_n > 5.0) {
                let ratio = row.v.friction_force_n.abs() / row.v.normal_force_n;
                assert!(
                    ratio < 1.1 * contact.mu_static,
                    "{ratio} at {:.3} s",
                    row.t_s()
                );
            }
        }
    }
}

#[test]
fn odometry_is_the_travel_of_the_chassis() {
    let steps = left();
    let origin = [0, 1].map(|w| steps.recording.wheels[w][0].v.sensed_mm);
    let start = steps.recording.body[0].v.x_mm;
    let mut worst = 0.0_f64;
    for (i, body) in steps.recording.body.iter().enumerate() {
        let travel = body.v.x_mm - start;
        for (wheel, origin) in origin.iter().enumerate() {
            let error = steps.recording.wheels[wheel][i].v.sensed_mm - origin - travel;
            worst = worst.max(error.abs());
        }
    }
    // The chassis pitches about the axle while the feet lift and load; that turns the
    // encoder, not the wheel.
    assert!(worst < 1.0 && worst > 0.01, "{worst} mm");

    // The master's own odometry draws b5 back as the chassis advances, so that the foot
    // stays on its spot: reference and travel add up to the stroke reached.
    for [_, push, _] in steps.steps() {
        let reached = at(steps.b5(), push).position_mm;
        let from = at(&steps.recording.body, push).x_mm;
        for t in [0.4, 0.6, 0.8].map(|u| push + u) {
            let travelled = at(&steps.recording.body, t).x_mm - from;
            assert!(travelled > 30.0, "{travelled} mm");
            let sum = at(steps.b5(), t).reference_mm + travelled;
            // A cycle or two of the bus at 0.18 m/s.
            assert!(
                (sum - reached).abs() < 6.0,
                "at {t} s: {sum} mm against {reached} mm"
            );
        }
    }
}

#[test]
fn the_other_leg_does_the_same_in_the_mirror() {
    let (l, r) = (left(), right());
    for joint in 0..6 {
        let mirror = (joint + 3) % 6;
        let pairs = l.recording.joints[joint]
            .iter()
            .zip(&r.recording.joints[mirror]);
        let (mut square, mut n) = (0.0, 0.0);
        for (a, b) in pairs {
            let apart = a.v.position_mm - b.v.position_mm;
            assert!(
                apart.abs() < 12.0,
                "joint {} at {:.3} s: {apart} mm",
                joint + 1,
                a.t_s()
            );
            square += apart * apart;
            n += 1.0;
        }
        // The sensors' noise is another one on every joint.
        let rms = f64::sqrt(square / n);
        assert!(rms < 2.0, "joint {}: {rms} mm rms", joint + 1);
        assert!(
            rms > 0.0,
            "joint {}: the same noise on both sides",
            joint + 1
        );
    }
    let lifts = |s: &Steps| settled_touches(&s.recording.feet[s.foot]);
    for (a, b) in lifts(l).into_iter().zip(lifts(r)) {
        assert_eq!(a.1, b.1);
        assert!((a.0 - b.0).abs() < 0.05, "{a:?} {b:?}");
    }
    for (a, b) in l.start_delays().into_iter().zip(r.start_delays()) {
        assert!((a - b).abs() < 0.02, "{a} s {b} s");
    }
    let travel = |s: &Steps| s.recording.body[s.recording.body.len() - 1].v.x_mm;
    assert!(
        (travel(l) - travel(r)).abs() < 0.5,
        "{} {}",
        travel(l),
        travel(r)
    );
}

/// The correction of an armed, moving joint is changed by command: the drive
/// does not jump, the law does change, and the joint still arrives.
#[test]
fn changing_the_correction_in_motion_is_bumpless() {
    // In mid-reach, in mid-push, and where the lowering foot slows down.
    for (joint, at_s) in [(2, 0.70), (2, 2.50), (3, 1.60)] {
        let robot = robot();
        let one = |correction: CorrectionKind| {
            let command = Command::SelectCorrection { joint, correction };
            let events = [(at_s, EventAction::Command(command))];
            run(&gait(LegChoice::Left, 3.2, &events), &robot, 1)
        };
        let plain = run(&gait(LegChoice::Left, 3.2, &[]), &robot, 1);
        let same = one(CorrectionKind::Pd);
        let other = one(CorrectionKind::Id);
        let index = usize::from(joint) - 1;
        let drive =
            |r: &Recording| -> Vec<f64> { r.joints[index].iter().map(|row| row.v.drive).collect() };
        // Choosing the law that is in force changes nothing.
        assert_eq!(drive(&plain), drive(&same), "joint {joint}");
        let apart: Vec<f64> = drive(&other)
            .iter()
            .zip(drive(&plain))
            .map(|(a, b)| a - b)
            .collect();
        let first = apart
            .iter()
            .position(|d| *d != 0.0)
            .expect("another law drives otherwise");
        // The request takes its turn on the bus: not before the command, soon after it.
        let delay_s = first as f64 * 1e-3 - at_s;
        assert!((0.0..0.06).contains(&delay_s), "joint {joint}: {delay_s} s");
        assert!(
            plain.joints[index][first].v.velocity_mm_s.abs() > 50.0,
            "joint {joint} was to be in motion"
        );
        let step = apart[first..first + 20]
            .iter()
            .scan(0.0, |last, d| Some((d - std::mem::replace(last, *d)).abs()))
            .fold(0.0, f64::max);
        assert!(
            step < 0.03,
            "joint {joint} at {at_s} s: the drive jumps by {step}"
        );
        let later = apart[first..].iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        assert!(later > 3.0 * step && later > 0.05, "joint {joint}: {later}");
        let end = &other.joints[index][1_990].v;
        assert!(
            (end.position_mm - end.reference_mm).abs() < 3.0,
            "joint {joint}: {} against {} mm",
            end.position_mm,
            end.reference_mm
        );
    }
}
