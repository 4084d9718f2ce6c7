//! Rest: once a joint has settled, no valve may switch.

use super::{Target, extremes, window};
use wheeleg_telemetry::{JointSample, Recording, Row};

/// What the joints did while their references stood still.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RestResult {
    /// Commanded valve edges at rest, all joints.
    pub edges: u32,
    /// Total time at rest, all joints, s.
    pub rest_s: f64,
    /// Largest distance between reference and true stroke at the end of a rest, mm.
    pub error_mm: f64,
}

/// A joint is at rest from this long after its reference last moved, s.
pub(crate) const SETTLING_S: f64 = 1.2;
/// A reference that moves less than this stands still, mm.
const STILL_MM: f64 = 0.01;

/// Valve switching and error of the joints at rest between `from_s` and `to_s`.
#[must_use]
pub fn rest_switching(joints: &[&[Row<JointSample>]], from_s: f64, to_s: f64) -> RestResult {
    let mut result = RestResult::default();
    for rows in joints {
        let rows = window(rows, from_s, to_s);
        let Some(first) = rows.first() else { continue };
        let mut reference = first.v.reference_mm;
        let mut moved_s = first.t_s();
        for pair in rows.windows(2) {
            let (before, now) = (&pair[0], &pair[1]);
            let ends = (now.v.reference_mm - reference).abs() > STILL_MM;
            let at_rest = before.t_s() >= moved_s + SETTLING_S;
            if ends {
                if at_rest {
                    result.note_error(before);
                }
                reference = now.v.reference_mm;
                moved_s = now.t_s();
            } else if at_rest {
                result.rest_s += now.t_s() - before.t_s();
                result.edges += now.v.valve_edges - before.v.valve_edges;
            }
        }
        if let Some(last) = rows.last().filter(|l| l.t_s() >= moved_s + SETTLING_S) {
            result.note_error(last);
        }
    }
    result
}

impl RestResult {
    fn note_error(&mut self, row: &Row<JointSample>) {
        let error = (row.v.reference_mm - row.v.position_mm).abs();
        self.error_mm = self.error_mm.max(error);
    }
}

/// Targets of the scenario that only stands.
pub(super) fn stand_targets(recording: &Recording) -> Vec<Target> {
    let joints: Vec<&[Row<JointSample>]> = recording.joints.iter().map(Vec::as_slice).collect();
    let rest = rest_switching(&joints, 0.0, f64::INFINITY);
    let creep = recording
        .joints
        .iter()
        .filter_map(|rows| {
            let settled = rows.first()?.t_s() + SETTLING_S;
            let (lo, hi) = extremes(window(rows, settled, f64::INFINITY), |s| s.position_mm)?;
            Some(hi - lo)
        })
        .fold(0.0, f64::max);
    let mut targets = rest_targets(&rest);
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

/// The targets on rest that every scenario shares.
pub(super) fn rest_targets(rest: &RestResult) -> Vec<Target> {
    vec![
        Target::new(
            "R1",
            format!(
                "valve edges at rest (from {SETTLING_S} s after a reference last moved; {:.1} joint seconds)",
                rest.rest_s
            ),
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

    #[test]
    fn switching_counts_only_at_rest() {
        // Busy for 1 s after the jump, then quiet.
        let quiet = joint(|ms| ms.clamp(1000, 2000) as u32, 89.0);
        let result = rest_switching(&[&quiet], 0.0, 10.0);
        assert_eq!(result.edges, 0);
        assert!((result.rest_s - 2.8).abs() < 0.01, "{}", result.rest_s);
        assert!((result.error_mm - 1.0).abs() < 1e-9);
        // A limit cycle: one edge every 10 ms, always.
        let cycling = joint(|ms| (ms / 10) as u32, 89.0);
        let result = rest_switching(&[&cycling], 0.0, 10.0);
        assert!((275..=285).contains(&result.edges), "{}", result.edges);
    }

    #[test]
    fn no_rest_is_not_a_pass() {
        let rest = rest_switching(&[], 0.0, 10.0);
        assert!(rest_targets(&rest).iter().all(|t| !t.pass));
    }
}
