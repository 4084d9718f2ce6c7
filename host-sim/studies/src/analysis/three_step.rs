//! Targets of the three-step test: Figs. 12–16 (A19–A23, A25–A27), and rest.

use super::rest::{rest_switching, rest_targets};
use super::{Analysis, Leg, Target, extremes, leg, window};
use wheeleg_config::{LegChoice, RobotConfig};
use wheeleg_telemetry::{JointSample, Recording, Row};

/// The end stops are elastic: a stroke may pass the axis limit by this, mm.
const STOP_MM: f64 = 0.5;
/// What counts as the full stroke of 180 mm. The reference model itself covers
/// 173.5 mm of b6, for want of time.
const FULL_STROKE_MM: f64 = 170.0;

pub(super) fn targets(
    robot: &RobotConfig,
    recording: &Recording,
    analysis: &Analysis,
) -> Vec<Target> {
    let choice = analysis.leg.unwrap_or(LegChoice::Left);
    let parts = leg(recording, choice);
    let mut targets = Vec::new();
    strokes(&mut targets, robot, &parts, analysis.start_s);
    speeds(&mut targets, &parts, analysis.start_s);
    accelerations(&mut targets, robot, &parts, analysis.start_s);
    steps(&mut targets, robot, &parts, analysis);
    delays(&mut targets, robot, analysis);
    forces(&mut targets, &parts, analysis.start_s);
    let joints: Vec<&[Row<JointSample>]> = recording.joints.iter().map(Vec::as_slice).collect();
    let rest = rest_switching(&joints, analysis.start_s, f64::INFINITY);
    targets.extend(rest_targets(&rest));
    targets
}

fn after(rows: &[Row<JointSample>], start_s: f64) -> &[Row<JointSample>] {
    window(rows, start_s, f64::INFINITY)
}

fn strokes(targets: &mut Vec<Target>, robot: &RobotConfig, parts: &Leg<'_>, start_s: f64) {
    let gait = &robot.gait;
    for (id, name, rows) in [("A19", "b5", parts.b5), ("A20", "b6", parts.b6)] {
        let mut per_step = (0..gait.steps).map(|k| {
            let t = start_s + f64::from(k) * gait.period_s;
            extremes(window(rows, t, t + gait.period_s), |s| s.position_mm).map(|(a, b)| b - a)
        });
        let smallest = per_step.try_fold(f64::INFINITY, |least, range| Some(least.min(range?)));
        targets.push(Target::new(
            id,
            format!("{name} stroke covered in every step (smallest of the steps)"),
            smallest,
            "mm",
            Some(FULL_STROKE_MM),
            Some(180.0 + 2.0 * STOP_MM),
        ));
        let range = extremes(after(rows, start_s), |s| s.position_mm);
        targets.push(Target::new(
            format!("{id}-min"),
            format!("{name} smallest stroke (axis 0 … 180, end stop gives {STOP_MM})"),
            range.map(|r| r.0),
            "mm",
            Some(-STOP_MM),
            Some(180.0 - FULL_STROKE_MM),
        ));
        targets.push(Target::new(
            format!("{id}-max"),
            format!("{name} largest stroke (axis 0 … 180, end stop gives {STOP_MM})"),
            range.map(|r| r.1),
            "mm",
            Some(FULL_STROKE_MM),
            Some(180.0 + STOP_MM),
        ));
    }
}

fn speeds(targets: &mut Vec<Target>, parts: &Leg<'_>, start_s: f64) {
    for (name, rows) in [("V5", parts.b5), ("V6", parts.b6)] {
        let peak = extremes(after(rows, start_s), |s| s.velocity_mm_s.abs()).map(|r| r.1);
        targets.push(Target::new(
            format!("A21-{name}"),
            format!("largest |{name}| (axis ±400)"),
            peak,
            "mm/s",
            None,
            Some(400.0),
        ));
        targets.push(
            Target::new(
                format!("A21-{name}-low"),
                "the same, for an axis that scales itself to ±400 (needs more than 200)",
                peak,
                "mm/s",
                Some(200.0),
                None,
            )
            .info(),
        );
    }
}

/// Figs. 14 and 15 were not measured: the paper's "input data from the source file of the joint
/// positions were used to determine the velocities and accelerations" (section 9). So its axes
/// are held against second differences of sampled positions. What moves faster than the
/// samples stands beside them for information.
fn accelerations(targets: &mut Vec<Target>, robot: &RobotConfig, parts: &Leg<'_>, start_s: f64) {
    let period_s = robot.reference.sample_period_s;
    for (id, name, rows, min, max) in [
        ("A22", "a5", parts.b5, -5.0, 10.0),
        ("A23", "a6", parts.b6, -10.0, 5.0),
    ] {
        let rows = after(rows, start_s);
        let sampled = sampled_acceleration(rows, period_s);
        let filtered = extremes(rows, |s| s.acceleration_m_s2);
        let raw = extremes(rows, |s| s.acceleration_raw_m_s2);
        for (suffix, pick) in [("min", 0), ("max", 1)] {
            let of = |r: Option<(f64, f64)>| r.map(|r| if pick == 0 { r.0 } else { r.1 });
            let word = if pick == 0 { "smallest" } else { "largest" };
            targets.push(Target::new(
                format!("{id}-{suffix}"),
                format!(
                    "{word} {name} from joint positions sampled every {:.0} ms, as the paper made \
                     its figure (axis {min} … {max}, read as m/s²)",
                    period_s * 1e3
                ),
                of(sampled),
                "m/s2",
                Some(min),
                Some(max),
            ));
            for (kind, what, range) in [
                ("20hz", "20 Hz low-pass of the true acceleration", filtered),
                ("raw", "unfiltered (end stops and contact included)", raw),
            ] {
                let id = format!("{id}-{suffix}-{kind}");
                let description = format!("{word} {name}, {what}");
                targets.push(Target::new(id, description, of(range), "m/s2", None, None).info());
            }
        }
    }
}

/// Smallest and largest acceleration, m/s², that second differences of the sensed position find
/// when it is sampled every `period_s`, whatever the instant of the first sample.
fn sampled_acceleration(rows: &[Row<JointSample>], period_s: f64) -> Option<(f64, f64)> {
    let first = rows.first()?;
    let apart = rows.partition_point(|r| r.t_s() < first.t_s() + period_s - 1e-9);
    let middles = rows
        .iter()
        .zip(rows.get(apart..)?)
        .zip(rows.get(2 * apart..)?);
    let accelerations = middles.map(|((before, at), after)| {
        let [before, at, after] = [before, at, after].map(|r| r.v.sensed_mm * 1e-3);
        (after - 2.0 * at + before) / (period_s * period_s)
    });
    accelerations.fold(None, |range, a| {
        let (low, high) = range.unwrap_or((a, a));
        Some((low.min(a), high.max(a)))
    })
}

fn steps(targets: &mut Vec<Target>, robot: &RobotConfig, parts: &Leg<'_>, analysis: &Analysis) {
    let expected = f64::from(robot.gait.steps);
    let lifts = analysis.contacts.iter().filter(|c| !c.touchdown).count();
    let touchdowns = analysis.contacts.iter().filter(|c| c.touchdown).count();
    let strides = strides(after(parts.b6, analysis.start_s), robot.gait.stroke_m * 1e3);
    let steps = lifts.min(touchdowns).min(strides);
    targets.push(Target::new(
        "A25",
        format!("steps in the run: {lifts} lifts and {touchdowns} touchdowns by the foot switches, {strides} strides of b6"),
        Some(steps as f64),
        "1",
        Some(expected),
        Some(expected),
    ));
    let alternate = analysis
        .contacts
        .iter()
        .enumerate()
        .all(|(i, c)| c.touchdown == (i % 2 == 1));
    targets.push(Target::new(
        "A25-order",
        "foot switches alternate lift, touchdown, starting on the ground (events)",
        Some(if alternate {
            (lifts + touchdowns) as f64
        } else {
            0.0
        }),
        "1",
        Some(2.0 * expected),
        Some(2.0 * expected),
    ));
}

/// Times the stroke falls below a quarter and comes back above three quarters.
fn strides(rows: &[Row<JointSample>], stroke_mm: f64) -> usize {
    let mut low = false;
    let mut count = 0;
    for row in rows {
        let x = row.v.position_mm / stroke_mm;
        if x < 0.25 {
            low = true;
        } else if x > 0.75 && low {
            low = false;
            count += 1;
        }
    }
    count
}

fn delays(targets: &mut Vec<Target>, robot: &RobotConfig, analysis: &Analysis) {
    let paper = robot.reference.delay_s;
    targets.push(
        Target::new(
            "A26",
            format!(
                "shift of the simulated velocities against the reference model, by \
                 cross-correlation (paper: {paper} s between model and experiment; read to ±0.1 s)"
            ),
            analysis.shift_s,
            "s",
            Some(paper - 0.1),
            Some(paper + 0.1),
        )
        .info(),
    );
    let known: Vec<f64> = analysis
        .start_delays
        .iter()
        .filter_map(|d| d.delay_s)
        .collect();
    for (suffix, value) in [
        ("min", known.iter().copied().reduce(f64::min)),
        ("max", known.iter().copied().reduce(f64::max)),
    ] {
        targets.push(
            Target::new(
                format!("A26-start-{suffix}"),
                format!(
                    "start delay, {suffix} of {} moves: command step latched by the node to the first 1 mm",
                    known.len()
                ),
                value,
                "s",
                None,
                None,
            )
            .info(),
        );
    }
}

fn forces(targets: &mut Vec<Target>, parts: &Leg<'_>, start_s: f64) {
    let rows = after(parts.b6, start_s);
    let filtered = extremes(rows, |s| s.force_net_n);
    let raw = extremes(rows, |s| s.force_net_raw_n);
    let pressure = extremes(rows, |s| s.force_pressure_n);
    let peak = |r: Option<(f64, f64)>| r.map(|(a, b)| if -a > b { a } else { b });
    targets.push(Target::new(
        "A27",
        "F6 of largest magnitude, net force, 20 Hz low-pass (axis ±30)",
        peak(filtered),
        "N",
        Some(-30.0),
        Some(30.0),
    ));
    for (id, what, range) in [
        ("A27-raw", "the same, unfiltered net force", raw),
        (
            "A27-pressure",
            "the same, unfiltered pressure force alone",
            pressure,
        ),
    ] {
        targets.push(Target::new(id, what, peak(range), "N", None, None).info());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{analyse, testing};
    use wheeleg_config::builtin;

    /// The reference model itself meets the paper's axes; so the analysis,
    /// fed with it, must say so, with the known values.
    #[test]
    fn reference_model_passes_its_own_targets_with_known_values() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let recording = testing::from_reference(&robot, 0.25, 0.0);
        let analysis = analyse(&scenario, &robot, &recording);
        let value = |id: &str| {
            let t = analysis.targets.iter().find(|t| t.id == id);
            t.and_then(|t| t.value).unwrap_or_else(|| panic!("{id}"))
        };
        for t in analysis.targets.iter().filter(|t| t.required) {
            assert!(t.pass, "{t:?}");
        }
        assert!((value("A21-V5") - 378.4).abs() < 0.1);
        assert!((value("A26") - 0.25).abs() < 0.002);
        assert!((value("A27-raw") - 25.78).abs() < 0.01);
        assert!((value("A25") - 3.0).abs() < 1e-12);
        assert!((value("A22-max-raw") - 5.88).abs() < 0.1);
        // The low-pass takes the corner off a step of acceleration, samples take more.
        assert!(value("A22-max-20hz") < value("A22-max-raw"));
        assert!(value("A22-max-20hz") > 4.0);
        assert!(value("A22-max") < value("A22-max-20hz"));
        assert!(value("A22-max") > 1.5);
    }

    /// x = a t²/2 has the acceleration a at any sampling; one sine lies between its analytic
    /// second difference and its amplitude.
    #[test]
    fn second_differences_of_samples_are_those_of_calculus() {
        let rows = |x_m: &dyn Fn(f64) -> f64| -> Vec<Row<JointSample>> {
            let row = |ms: u64| Row {
                t_ns: ms * 1_000_000,
                v: JointSample {
                    sensed_mm: x_m(ms as f64 * 1e-3) * 1e3,
                    ..JointSample::default()
                },
            };
            (0..1000).map(row).collect()
        };
        let parabola = rows(&|t| 1.5 * t * t);
        for period_s in [0.01, 0.05, 0.1] {
            let (low, high) = sampled_acceleration(&parabola, period_s).expect("long enough");
            assert!(
                (low - 3.0).abs() < 1e-9 && (high - 3.0).abs() < 1e-9,
                "{low} {high}"
            );
        }
        let (w, h) = (20.0_f64, 0.1);
        let (_, high) = sampled_acceleration(&rows(&|t| (w * t).sin()), h).expect("long enough");
        let expected = 2.0 * (1.0 - (w * h).cos()) / (h * h);
        assert!(
            (high - expected).abs() < 0.002 * expected,
            "{high} {expected}"
        );
        assert!(sampled_acceleration(&parabola[..150], 0.1).is_none());
    }

    #[test]
    fn a_robot_that_does_not_move_fails() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let mut recording = testing::from_reference(&robot, 0.0, 0.0);
        for joint in [1, 2] {
            for row in &mut recording.joints[joint] {
                row.v.position_mm = 0.0;
            }
        }
        for row in &mut recording.feet[0] {
            row.v.switches = 15;
        }
        let analysis = analyse(&scenario, &robot, &recording);
        for id in ["A19", "A20", "A25", "A25-order"] {
            let t = analysis.targets.iter().find(|t| t.id == id);
            assert!(t.is_some_and(|t| !t.pass), "{id}");
        }
        assert!(!analysis.passed());
    }
}
