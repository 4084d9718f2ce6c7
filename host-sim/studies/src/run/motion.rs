//! What the page's robot plays: geometry and state over time, as data for `page/report.js`.

use serde::Serialize;

use super::figures::Source;
use super::ground::GroundPicture;
use wheeleg_config::Drawing;
use wheeleg_telemetry::{MasterSample, Row};

/// Instants of the motion, at most; a short run has one every 20 ms.
const INSTANTS: usize = 1_500;
const PERIOD_NS: u64 = 20_000_000;

/// The robot over time.
#[derive(Serialize)]
pub(super) struct Motion {
    geometry: Drawing,
    start: f64,
    end: f64,
    /// Times since the start of the motion, s.
    t: Vec<f64>,
    commanded_mm: [Vec<f64>; 6],
    sensed_mm: [Vec<f64>; 6],
    load_n: [Vec<f64>; 2],
    switches: [Vec<u8>; 2],
    travel_mm: Vec<f64>,
    pitch_deg: Vec<f64>,
    y_mm: Vec<f64>,
    z_mm: Vec<f64>,
    yaw_deg: Vec<f64>,
    /// None: a level floor.
    #[serde(skip_serializing_if = "Option::is_none")]
    ground: Option<GroundPicture>,
    supply_bar: Vec<f64>,
    phases: Vec<Phase>,
    marks: Vec<Mark>,
}

/// A phase of the gait.
#[derive(Serialize)]
struct Phase {
    from: f64,
    to: f64,
    name: String,
    /// Whether a foot is in the air.
    air: bool,
}

/// What happened to the robot.
#[derive(Serialize)]
struct Mark {
    t: f64,
    text: String,
}

/// The codes of [`MasterSample::phase`].
fn phase_name(sample: &MasterSample) -> Option<(String, bool)> {
    let (name, air) = match sample.phase {
        1 => ("unload", false),
        2 => ("lift, reach", true),
        3 => ("lower", true),
        4 => ("rest", false),
        5 => return Some((format!("push, step {}", sample.step), false)),
        _ => return None,
    };
    Some((name.to_owned(), air))
}

/// A thousandth of a unit is finer than a drawing shows.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3 + 0.0
}

/// `value` of the last row at each instant.
fn sampled<S, V>(rows: &[Row<S>], instants: &[u64], value: impl Fn(&S) -> V) -> Vec<V>
where
    V: Default,
{
    let last = |at: &u64| rows.partition_point(|row| row.t_ns <= *at).max(1) - 1;
    let values = instants
        .iter()
        .map(|at| rows.get(last(at)).map(|row| value(&row.v)));
    values.map(Option::unwrap_or_default).collect()
}

impl Motion {
    pub(super) fn new(source: &Source<'_>) -> Self {
        let recording = source.recording;
        let (start, end) = source.x_range();
        let joints = &recording.joints;
        let inside = joints[0].iter().map(|row| (row.t_ns, source.t(row.t_s())));
        let inside = inside.filter(|(_, t)| (start..=end).contains(t));
        let regular: Vec<(u64, f64)> = inside
            .filter(|(t_ns, _)| t_ns.is_multiple_of(PERIOD_NS))
            .collect();
        let every = regular.len().div_ceil(INSTANTS).max(1);
        let (instants, t): (Vec<u64>, Vec<f64>) = regular.into_iter().step_by(every).unzip();
        Self {
            geometry: Drawing::of(source.robot),
            start,
            end,
            commanded_mm: std::array::from_fn(|j| {
                sampled(&joints[j], &instants, |s| rounded(s.commanded_mm))
            }),
            sensed_mm: std::array::from_fn(|j| {
                sampled(&joints[j], &instants, |s| rounded(s.sensed_mm))
            }),
            load_n: std::array::from_fn(|f| {
                sampled(&recording.feet[f], &instants, |s| rounded(s.normal_force_n))
            }),
            switches: std::array::from_fn(|f| {
                sampled(&recording.feet[f], &instants, |s| s.switches)
            }),
            travel_mm: sampled(&recording.body, &instants, |s| rounded(s.x_mm)),
            pitch_deg: sampled(&recording.body, &instants, |s| rounded(s.pitch_deg)),
            y_mm: sampled(&recording.body, &instants, |s| rounded(s.y_mm)),
            z_mm: sampled(&recording.body, &instants, |s| rounded(s.z_mm)),
            yaw_deg: sampled(&recording.body, &instants, |s| rounded(s.yaw_deg)),
            ground: GroundPicture::new(source),
            supply_bar: sampled(&recording.supply, &instants, |s| rounded(s.pressure_bar)),
            t: t.into_iter().map(rounded).collect(),
            phases: phases(source, end),
            marks: marks(source),
        }
    }

    /// Whether there is anything to play.
    pub(super) fn is_empty(&self) -> bool {
        self.t.len() < 2
    }
}

fn phases(source: &Source<'_>, end: f64) -> Vec<Phase> {
    let mut phases: Vec<Phase> = Vec::new();
    let mut last = None;
    for row in &source.recording.master {
        let t = source.t(row.t_s());
        let now = phase_name(&row.v);
        if now == last {
            continue;
        }
        if let (Some(_), Some(open)) = (&last, phases.last_mut()) {
            open.to = t;
        }
        if let Some((name, air)) = now.clone() {
            let (from, to) = (t.max(source.x_range().0), end);
            phases.push(Phase {
                from,
                to,
                name,
                air,
            });
        }
        last = now;
    }
    phases.retain(|phase| phase.to > phase.from);
    phases
}

/// Faults, the first at each instant: sixteen alike are one mark.
fn marks(source: &Source<'_>) -> Vec<Mark> {
    let (start, end) = source.x_range();
    let faults = source.recording.events.iter();
    let faults = faults.filter(|row| row.v.cause.kind() == wheeleg_telemetry::EventKind::Fault);
    let mut marks: Vec<Mark> = Vec::new();
    for row in faults {
        let t = source.t(row.t_s());
        let again = marks.last().is_some_and(|last| t - last.t < 0.05);
        if !again && (start..=end).contains(&t) {
            let text = row.v.cause.to_string();
            marks.push(Mark { t, text });
        }
    }
    marks
}
