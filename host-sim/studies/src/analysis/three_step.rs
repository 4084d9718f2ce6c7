//! Targets of the three-step test: Figs. 12–16 (A19–A23, A25–A27), and rest.

use std::collections::VecDeque;

use super::moves::MoveMeter;
use super::rest::{RestMeter, rest_targets};
use super::{Analysis, Extremes, Target, within};
use wheeleg_config::{GaitParams, RobotConfig};
use wheeleg_telemetry::{JointSample, Row};

/// The end stops are elastic: a stroke may pass the axis limit by this, mm.
const STOP_MM: f64 = 0.5;
/// Travel that counts as the full stroke of 180 mm. The reference model itself covers 173.5 mm of b6, for
/// lack of time.
const FULL_STROKE_MM: f64 = 170.0;

/// One joint of the stepping leg, from the start of the motion on.
#[derive(Debug)]
struct Track {
    position_mm: Extremes,
    speed_mm_s: Extremes,
    acceleration_m_s2: Extremes,
    acceleration_raw_m_s2: Extremes,
    force_net_n: Extremes,
    force_net_raw_n: Extremes,
    force_pressure_n: Extremes,
    steps: StepStrokes,
    sampled: SampledAcceleration,
}

impl Track {
    fn new(sample_period_s: f64) -> Self {
        Self {
            position_mm: Extremes::default(),
            speed_mm_s: Extremes::default(),
            acceleration_m_s2: Extremes::default(),
            acceleration_raw_m_s2: Extremes::default(),
            force_net_n: Extremes::default(),
            force_net_raw_n: Extremes::default(),
            force_pressure_n: Extremes::default(),
            steps: StepStrokes::default(),
            sampled: SampledAcceleration::new(sample_period_s),
        }
    }

    fn add(&mut self, v: &JointSample) {
        self.position_mm.add(v.position_mm);
        self.speed_mm_s.add(v.velocity_mm_s.abs());
        self.acceleration_m_s2.add(v.acceleration_m_s2);
        self.acceleration_raw_m_s2.add(v.acceleration_raw_m_s2);
        self.force_net_n.add(v.force_net_n);
        self.force_net_raw_n.add(v.force_net_raw_n);
        self.force_pressure_n.add(v.force_pressure_n);
    }
}

/// Smallest and largest acceleration from second differences of the sensed position, sampled with a fixed
/// period, for any instant of the first sample.
///
/// Figs. 14 and 15 were not measured: the paper's "input data from the source file of the joint
/// positions were used to determine the velocities and accelerations" (section 9).
#[derive(Debug)]
struct SampledAcceleration {
    period_s: f64,
    /// Time, ns, and sensed position, m, of the last two periods.
    recent: VecDeque<(u64, f64)>,
    found_m_s2: Extremes,
}

impl SampledAcceleration {
    fn new(period_s: f64) -> Self {
        Self {
            period_s,
            recent: VecDeque::new(),
            found_m_s2: Extremes::default(),
        }
    }

    fn add(&mut self, row: &Row<JointSample>) {
        let period_ns = (self.period_s * 1e9).round() as u64;
        let now_m = row.v.sensed_mm * 1e-3;
        self.recent.push_back((row.t_ns, now_m));
        while (self.recent.front()).is_some_and(|(t_ns, _)| t_ns + 2 * period_ns < row.t_ns) {
            self.recent.pop_front();
        }
        let at = |t_ns: u64| {
            let i = self.recent.partition_point(|(at_ns, _)| *at_ns < t_ns);
            self.recent.get(i).filter(|(at_ns, _)| *at_ns == t_ns)
        };
        let ago = |periods: u64| row.t_ns.checked_sub(periods * period_ns).and_then(at);
        if let (Some((_, before_m)), Some((_, then_m))) = (ago(2), ago(1)) {
            let difference_m = now_m - 2.0 * then_m + before_m;
            self.found_m_s2
                .add(difference_m / (self.period_s * self.period_s));
        }
    }
}

/// The stroke covered in each step.
#[derive(Debug, Default)]
struct StepStrokes {
    /// Steps that are over.
    over: u16,
    /// Range in the current step.
    now: Extremes,
    /// Smallest of the finished steps, mm; `None` if one of them has no sample.
    smallest: Option<f64>,
}

impl StepStrokes {
    fn add(&mut self, row: &Row<JointSample>, gait: &GaitParams, start_s: f64) {
        while self.over < gait.steps {
            let from_s = start_s + f64::from(self.over) * gait.period_s;
            if within(row, from_s, from_s + gait.period_s) {
                self.now.add(row.v.position_mm);
            }
            if within(row, f64::NEG_INFINITY, from_s + gait.period_s) {
                break;
            }
            self.end_step();
        }
    }

    fn end_step(&mut self) {
        let span = std::mem::take(&mut self.now).span();
        let before = match self.over {
            0 => Some(f64::INFINITY),
            _ => self.smallest,
        };
        self.smallest = before.zip(span).map(|(least, span)| least.min(span));
        self.over += 1;
    }

    /// The smallest of all steps; `None` if one of them has no sample.
    fn smallest(&self, steps: u16) -> Option<f64> {
        let now = self.now.span();
        match steps.checked_sub(self.over)? {
            0 => self.smallest,
            1 if self.over == 0 => now,
            1 => self.smallest.zip(now).map(|(least, now)| least.min(now)),
            _ => None,
        }
    }
}

/// Times the stroke falls below a quarter and comes back above three quarters.
#[derive(Debug, Default)]
struct Strides {
    low: bool,
    count: usize,
}

impl Strides {
    fn add(&mut self, position_mm: f64, stroke_mm: f64) {
        let x = position_mm / stroke_mm;
        if x < 0.25 {
            self.low = true;
        } else if x > 0.75 && self.low {
            self.low = false;
            self.count += 1;
        }
    }
}

/// The test, while its samples come in.
#[derive(Debug)]
pub(super) struct ThreeStepMeter {
    gait: GaitParams,
    start_s: f64,
    b5: Track,
    b6: Track,
    strides: Strides,
    rest: RestMeter,
    moves: MoveMeter,
}

impl ThreeStepMeter {
    pub(super) fn new(gait: GaitParams, sample_period_s: f64, start_s: f64) -> Self {
        Self {
            gait,
            start_s,
            b5: Track::new(sample_period_s),
            b6: Track::new(sample_period_s),
            strides: Strides::default(),
            rest: RestMeter::default(),
            moves: MoveMeter::default(),
        }
    }

    pub(super) fn b5(&mut self, row: &Row<JointSample>) {
        if within(row, self.start_s, f64::INFINITY) {
            self.b5.add(&row.v);
            self.b5.sampled.add(row);
            self.b5.steps.add(row, &self.gait, self.start_s);
        }
    }

    pub(super) fn b6(&mut self, row: &Row<JointSample>) {
        if within(row, self.start_s, f64::INFINITY) {
            self.b6.add(&row.v);
            self.b6.sampled.add(row);
            self.b6.steps.add(row, &self.gait, self.start_s);
            let stroke_mm = self.gait.stroke_m * 1e3;
            self.strides.add(row.v.position_mm, stroke_mm);
        }
    }

    pub(super) fn joint(&mut self, joint: usize, row: &Row<JointSample>) {
        if within(row, self.start_s, f64::INFINITY) {
            self.rest.joint(joint, row);
            self.moves.joint(joint, row);
        }
    }

    pub(super) fn targets(self, robot: &RobotConfig, analysis: &Analysis) -> Vec<Target> {
        let mut targets = Vec::new();
        self.strokes(&mut targets);
        let axes = targets.len();
        self.speeds(&mut targets);
        self.accelerations(&mut targets);
        // The axes of the paper's plots describe its experiment, and so its law; another one may
        // be faster.
        if !robot.has_papers_law() {
            for target in targets.drain(axes..).collect::<Vec<_>>() {
                targets.push(target.info());
            }
        }
        self.steps(&mut targets, analysis);
        delays(&mut targets, robot, analysis);
        self.forces(&mut targets);
        targets.extend(self.moves.targets(self.gait.steps));
        targets.extend(rest_targets(&self.rest.result()));
        targets
    }

    fn strokes(&self, targets: &mut Vec<Target>) {
        for (id, name, track) in [("A19", "b5", &self.b5), ("A20", "b6", &self.b6)] {
            let smallest = track.steps.smallest(self.gait.steps);
            targets.push(Target::new(
                id,
                format!("{name} stroke covered in every step (smallest of the steps)"),
                smallest,
                "mm",
                Some(FULL_STROKE_MM),
                Some(180.0 + 2.0 * STOP_MM),
            ));
            let range = track.position_mm.0;
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

    fn speeds(&self, targets: &mut Vec<Target>) {
        for (name, track) in [("V5", &self.b5), ("V6", &self.b6)] {
            let peak = track.speed_mm_s.0.map(|r| r.1);
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

    /// The axes of the paper's figures are compared with accelerations from sampled positions. Motions faster
    /// than the samples are given in addition, for information.
    fn accelerations(&self, targets: &mut Vec<Target>) {
        for (id, name, track, min, max) in [
            ("A22", "a5", &self.b5, -5.0, 10.0),
            ("A23", "a6", &self.b6, -10.0, 5.0),
        ] {
            let sampled = track.sampled.found_m_s2.0;
            let filtered = track.acceleration_m_s2.0;
            let raw = track.acceleration_raw_m_s2.0;
            for (suffix, pick) in [("min", 0), ("max", 1)] {
                let of = |r: Option<(f64, f64)>| r.map(|r| if pick == 0 { r.0 } else { r.1 });
                let word = if pick == 0 { "smallest" } else { "largest" };
                targets.push(Target::new(
                    format!("{id}-{suffix}"),
                    format!(
                        "{word} {name} from joint positions sampled every {:.0} ms, as the paper \
                         made its figure (axis {min} … {max}, read as m/s²)",
                        track.sampled.period_s * 1e3
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
                    let target = Target::new(id, description, of(range), "m/s2", None, None);
                    targets.push(target.info());
                }
            }
        }
    }

    fn steps(&self, targets: &mut Vec<Target>, analysis: &Analysis) {
        let expected = f64::from(self.gait.steps);
        let lifts = analysis.contacts.iter().filter(|c| !c.touchdown).count();
        let touchdowns = analysis.contacts.iter().filter(|c| c.touchdown).count();
        let strides = self.strides.count;
        let steps = lifts.min(touchdowns).min(strides);
        targets.push(Target::new(
            "A25",
            "steps in the run (the fewest of lifts and touchdowns by the foot switches, and strides of b6)",
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

    fn forces(&self, targets: &mut Vec<Target>) {
        let filtered = self.b6.force_net_n.0;
        let raw = self.b6.force_net_raw_n.0;
        let pressure = self.b6.force_pressure_n.0;
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
            analysis.fit.map(|fit| fit.shift_s),
            "s",
            Some(paper - 0.1),
            Some(paper + 0.1),
        )
        .info(),
    );
    for (place, name) in ["b5", "b6"].into_iter().enumerate() {
        let id = format!("A26-rms-{name}");
        let description = format!("{name} beside the reference model shifted by that, RMS");
        let residual = analysis.fit.map(|fit| fit.residual_mm[place]);
        targets.push(Target::new(id, description, residual, "mm", None, None).info());
    }
    let known: Vec<f64> = analysis
        .start_delays
        .iter()
        .filter_map(|d| d.delay_s)
        .collect();
    for (suffix, word, value) in [
        ("min", "shortest", known.iter().copied().reduce(f64::min)),
        ("max", "longest", known.iter().copied().reduce(f64::max)),
    ] {
        targets.push(
            Target::new(
                format!("A26-start-{suffix}"),
                format!("start delay, {word} of the moves: command step latched by the node to the first 1 mm"),
                value,
                "s",
                None,
                None,
            )
            .info(),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Analyser, analyse, testing};
    use wheeleg_config::builtin;

    /// The reference model itself meets the paper's axes; so must the analysis of it, with the known values.
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
        assert!(value("A26-rms-b5") < 0.5 && value("A26-rms-b6") < 0.5);
        assert!((value("A27-raw") - 25.78).abs() < 0.01);
        assert!((value("A25") - 3.0).abs() < 1e-12);
        assert!((value("A22-max-raw") - 5.88).abs() < 0.1);
        // The low-pass rounds the corner of a step of acceleration; sampling rounds it more.
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
        let sampled = |rows: &[Row<JointSample>], period_s: f64| {
            let mut meter = SampledAcceleration::new(period_s);
            rows.iter().for_each(|row| meter.add(row));
            meter.found_m_s2.0
        };
        let parabola = rows(&|t| 1.5 * t * t);
        for period_s in [0.01, 0.05, 0.1] {
            let (low, high) = sampled(&parabola, period_s).expect("long enough");
            assert!(
                (low - 3.0).abs() < 1e-9 && (high - 3.0).abs() < 1e-9,
                "{low} {high}"
            );
        }
        let (w, h) = (20.0_f64, 0.1);
        let (_, high) = sampled(&rows(&|t| (w * t).sin()), h).expect("long enough");
        let expected = 2.0 * (1.0 - (w * h).cos()) / (h * h);
        assert!(
            (high - expected).abs() < 0.002 * expected,
            "{high} {expected}"
        );
        assert!(sampled(&parabola[..150], 0.1).is_none());
    }

    /// The table of a campaign describes its columns before the first run, so no count of a run belongs into the words.
    #[test]
    fn targets_are_described_alike_before_and_after_a_run() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let recording = testing::from_reference(&robot, 0.25, 0.0);
        let after = analyse(&scenario, &robot, &recording).targets;
        for before in Analyser::new(&scenario, &robot).finish().targets {
            let same = after.iter().find(|t| t.id == before.id);
            let described = same.map(|t| &t.description);
            assert_eq!(described, Some(&before.description), "{}", before.id);
        }
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
