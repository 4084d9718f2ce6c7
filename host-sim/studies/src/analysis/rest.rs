//! Rest: once a joint has settled, no valve may switch.

use super::{Extremes, Target, within};
use wheeleg_telemetry::{JointSample, Row};

/// The joints while their references stand still.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct RestResult {
    /// Commanded valve edges at rest, all joints.
    pub(super) edges: u32,
    /// Total time at rest, all joints, s.
    pub(super) rest_s: f64,
    /// Largest distance between reference and true stroke at the end of a rest, mm.
    pub(super) error_mm: f64,
}

/// A joint is at rest from this long after its reference last moved, s.
pub(crate) const SETTLING_S: f64 = 1.2;
/// A reference that moves less than this stands still, mm.
const STILL_MM: f64 = 0.01;

/// One joint, while its samples come in.
#[derive(Debug, Clone, Default)]
struct JointRest {
    /// Reference and command last taken as new, mm, and their time, s. A reference generator begins a move
    /// with increments that count as still; the command reveals it.
    target: Option<([f64; 2], f64)>,
    /// Time, s, valve edges and distance from the reference, mm, of the last sample.
    last: Option<(f64, u32, f64)>,
    result: RestResult,
}

impl JointRest {
    fn joint(&mut self, row: &Row<JointSample>) {
        let t_s = row.t_s();
        let error_mm = (row.v.reference_mm - row.v.position_mm).abs();
        let now = [row.v.reference_mm, row.v.commanded_mm];
        let (target, moved_s) = *self.target.get_or_insert((now, t_s));
        let moves = |(now, before): (f64, f64)| (now - before).abs() > STILL_MM;
        if let Some((before_s, edges, before_mm)) = self.last {
            let at_rest = before_s >= moved_s + SETTLING_S;
            if now.into_iter().zip(target).any(moves) {
                if at_rest {
                    self.result.note_error(before_mm);
                }
                self.target = Some((now, t_s));
            } else if at_rest {
                self.result.rest_s += t_s - before_s;
                self.result.edges += row.v.valve_edges - edges;
            }
        }
        self.last = Some((t_s, row.v.valve_edges, error_mm));
    }

    fn result(mut self) -> RestResult {
        if let (Some((_, moved_s)), Some((t_s, _, error_mm))) = (self.target, self.last)
            && t_s >= moved_s + SETTLING_S
        {
            self.result.note_error(error_mm);
        }
        self.result
    }
}

/// Valve switching and error of all joints at rest, while their samples come in.
#[derive(Debug, Clone, Default)]
pub(super) struct RestMeter([JointRest; 6]);

impl RestMeter {
    pub(super) fn joint(&mut self, joint: usize, row: &Row<JointSample>) {
        self.0[joint].joint(row);
    }

    pub(super) fn result(self) -> RestResult {
        let mut all = RestResult::default();
        for one in self.0.map(JointRest::result) {
            all.edges += one.edges;
            all.rest_s += one.rest_s;
            all.note_error(one.error_mm);
        }
        all
    }
}

impl RestResult {
    fn note_error(&mut self, error_mm: f64) {
        self.error_mm = self.error_mm.max(error_mm);
    }
}

/// The scenario that only stands.
#[derive(Debug, Default)]
pub(super) struct StandMeter {
    rest: RestMeter,
    /// For each joint, the time when it settled, s, and its range since then.
    settled: [Option<(f64, Extremes)>; 6],
}

impl StandMeter {
    pub(super) fn joint(&mut self, joint: usize, row: &Row<JointSample>) {
        self.rest.joint(joint, row);
        let since = || (row.t_s() + SETTLING_S, Extremes::default());
        let (from_s, range) = self.settled[joint].get_or_insert_with(since);
        if within(row, *from_s, f64::INFINITY) {
            range.add(row.v.position_mm);
        }
    }

    pub(super) fn targets(self) -> Vec<Target> {
        let ranges = self.settled.iter().flatten();
        let creep = ranges.filter_map(|(_, range)| range.span());
        let creep = creep.fold(0.0, f64::max);
        let mut targets = rest_targets(&self.rest.result());
        targets.push(Target::new(
            "R3",
            "largest movement of a joint while standing",
            Some(creep),
            "mm",
            None,
            Some(5.0),
        ));
        targets
    }
}

/// The targets on rest that every scenario shares.
pub(super) fn rest_targets(rest: &RestResult) -> Vec<Target> {
    vec![
        Target::new(
            "R1",
            format!("valve edges at rest (from {SETTLING_S} s after a reference last moved)"),
            // No time at rest means nothing was measured.
            (rest.rest_s > 0.0).then_some(f64::from(rest.edges)),
            "1",
            Some(0.0),
            Some(0.0),
        ),
        Target::new(
            "R2",
            "largest position error at the end of a rest (paper: some millimetres)",
            (rest.rest_s > 0.0).then_some(rest.error_mm),
            "mm",
            None,
            Some(5.0),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference jumps at 1 s; edges grow as `edges(t in ms)`.
    fn joint(edges: impl Fn(u64) -> u32, position_mm: f64) -> Vec<Row<JointSample>> {
        (0..5000_u64)
            .map(|ms| Row {
                t_ns: ms * 1_000_000,
                v: JointSample {
                    reference_mm: if ms < 1000 { 0.0 } else { 90.0 },
                    position_mm,
                    valve_edges: edges(ms),
                    ..JointSample::default()
                },
            })
            .collect()
    }

    fn rest_switching(joints: &[Vec<Row<JointSample>>]) -> RestResult {
        let mut meter = RestMeter::default();
        for (joint, rows) in joints.iter().enumerate() {
            rows.iter().for_each(|row| meter.joint(joint, row));
        }
        meter.result()
    }

    #[test]
    fn switching_counts_only_at_rest() {
        // Busy for 1 s after the jump, then quiet.
        let quiet = joint(|ms| ms.clamp(1000, 2000) as u32, 89.0);
        let result = rest_switching(&[quiet]);
        assert_eq!(result.edges, 0);
        assert!((result.rest_s - 2.8).abs() < 0.01, "{}", result.rest_s);
        assert!((result.error_mm - 1.0).abs() < 1e-9);
        // A limit cycle: one edge every 10 ms, always.
        let cycling = joint(|ms| (ms / 10) as u32, 89.0);
        let result = rest_switching(&[cycling]);
        assert!((275..=285).contains(&result.edges), "{}", result.edges);
    }

    #[test]
    fn no_rest_is_not_a_pass() {
        let rest = rest_switching(&[]);
        assert!(rest_targets(&rest).iter().all(|t| !t.pass));
    }
}
