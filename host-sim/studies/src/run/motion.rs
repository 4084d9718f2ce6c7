//! The robot animation of a run's page.

use super::figures::Source;
use super::ground::picture;
use crate::cause::goes_wrong;
use crate::motion::{Blind, Mark, Motion, Phase, Readings, phase_name, rounded};
use wheeleg_config::Drawing;
use wheeleg_protocol::Fault;
use wheeleg_telemetry::Row;

/// Most instants of the motion; a short run has one every 20 ms.
const INSTANTS: usize = 1_500;
const PERIOD_NS: u64 = 20_000_000;

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

/// The robot over the time of the figures.
pub(super) fn motion(source: &Source<'_>) -> Motion {
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
    Motion {
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
        switches: std::array::from_fn(|f| sampled(&recording.feet[f], &instants, |s| s.switches)),
        travel_mm: sampled(&recording.body, &instants, |s| rounded(s.x_mm)),
        pitch_deg: sampled(&recording.body, &instants, |s| rounded(s.pitch_deg)),
        y_mm: sampled(&recording.body, &instants, |s| rounded(s.y_mm)),
        z_mm: sampled(&recording.body, &instants, |s| rounded(s.z_mm)),
        yaw_deg: sampled(&recording.body, &instants, |s| rounded(s.yaw_deg)),
        ground: picture(source),
        supply_bar: sampled(&recording.supply, &instants, |s| rounded(s.pressure_bar)),
        t: t.into_iter().map(rounded).collect(),
        phases: phases(source, end),
        marks: marks(source),
        blind: blind(source, end),
    }
}

/// When joints had no reading.
fn blind(source: &Source<'_>, end: f64) -> Vec<Blind> {
    let mut readings = Readings::default();
    for row in &source.recording.events {
        let cause = &row.v.cause;
        if let Some(board) = cause.board() {
            let fault = cause.fault_code().and_then(Fault::from_code);
            readings.look(source.t(row.t_s()), Some(cause.code()), board, fault);
        }
    }
    readings.blind(end)
}

fn phases(source: &Source<'_>, end: f64) -> Vec<Phase> {
    let mut phases: Vec<Phase> = Vec::new();
    let mut last = None;
    for row in &source.recording.master {
        let t = source.t(row.t_s());
        let now = phase_name(row.v.phase, row.v.step);
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

/// Failures, the first at each instant: sixteen of the same kind are one mark.
fn marks(source: &Source<'_>) -> Vec<Mark> {
    let (start, end) = source.x_range();
    let faults = source.recording.events.iter().filter(|row| {
        let cause = &row.v.cause;
        goes_wrong(Some(cause.kind()), Some(cause.code()))
    });
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
