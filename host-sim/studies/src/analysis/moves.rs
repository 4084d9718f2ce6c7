//! How well joints move, for any law: time to the command, tracking, lowering, valves, drift.

use super::{Extremes, Target};
use wheeleg_telemetry::{JointSample, Row};

/// A joint has arrived this near to its command, mm (PAPER §8.2: some millimetres are enough).
const ARRIVED_MM: f64 = 5.0;
/// A command that jumps by more than this is a move, mm.
const MOVE_MM: f64 = 10.0;
/// In the last part of the way to a foot's standing stroke, mm, …
const LOWERING_MM: usize = 10;
/// … a foot that meets the ground should be no faster than this, mm/s.
const LOWERING_MM_S: f64 = 100.0;

/// One joint, while its samples come in.
#[derive(Debug, Clone, Default)]
struct JointMoves {
    /// Command of the last sample, mm.
    commanded_mm: Option<f64>,
    /// Begin of the move under way, s.
    since_s: Option<f64>,
    /// Longest time to the command, s; infinite if a command was not reached before the next one.
    longest_s: f64,
    moves: u32,
    /// Sum of squares of the tracking error under way, mm², its largest, mm, and their number.
    squares_mm2: f64,
    worst_mm: f64,
    samples: u32,
    /// Largest outward speed in each millimetre of the stroke reached so far, mm/s.
    outward_mm_s: Vec<f64>,
    edges: Extremes,
    position_mm: Extremes,
}

impl JointMoves {
    fn add(&mut self, row: &Row<JointSample>) {
        let v = &row.v;
        let t_s = row.t_s();
        let before_mm = *self.commanded_mm.get_or_insert(v.commanded_mm);
        if (v.commanded_mm - before_mm).abs() > MOVE_MM {
            if self.since_s.is_some() {
                self.longest_s = f64::INFINITY;
            }
            self.since_s = Some(t_s);
            self.moves += 1;
        }
        self.commanded_mm = Some(v.commanded_mm);
        let left_mm = v.commanded_mm - v.position_mm;
        if let Some(since_s) = self.since_s {
            let error_mm = (v.reference_mm - v.position_mm).abs();
            self.squares_mm2 += error_mm * error_mm;
            self.worst_mm = self.worst_mm.max(error_mm);
            self.samples += 1;
            if left_mm.abs() <= ARRIVED_MM {
                self.longest_s = self.longest_s.max(t_s - since_s);
                self.since_s = None;
            }
        }
        // A stroke is at most 0.5 m.
        let millimetre = v.position_mm.max(0.0) as usize;
        if self.outward_mm_s.len() <= millimetre {
            self.outward_mm_s.resize(millimetre + 1, 0.0);
        }
        let outward_mm_s = &mut self.outward_mm_s[millimetre];
        *outward_mm_s = outward_mm_s.max(v.velocity_mm_s);
        self.edges.add(f64::from(v.valve_edges));
        self.position_mm.add(v.position_mm);
    }
}

impl JointMoves {
    /// Largest speed in the last part of the way out, mm/s.
    fn lowering_mm_s(&self) -> f64 {
        let last = self.outward_mm_s.iter().rev().take(LOWERING_MM);
        last.copied().fold(0.0, f64::max)
    }
}

/// All joints of a gait in which one leg steps.
#[derive(Debug, Clone, Default)]
pub(super) struct MoveMeter([JointMoves; 6]);

impl MoveMeter {
    pub(super) fn joint(&mut self, joint: usize, row: &Row<JointSample>) {
        self.0[joint].add(row);
    }

    /// Targets for information: no law has had to meet them yet.
    pub(super) fn targets(&self, steps: u16) -> Vec<Target> {
        let mut targets = Vec::new();
        // In the stepping leg, b5 and b6 are the joints with long moves.
        for (name, offset) in [("b5", 1), ("b6", 2)] {
            let legs = [&self.0[offset], &self.0[offset + 3]];
            let Some(joint) = legs.into_iter().find(|joint| joint.moves > 0) else {
                continue;
            };
            let mut add = |id: &str, what: String, value: f64, unit, max| {
                let id = format!("{id}-{name}");
                targets.push(Target::new(id, what, Some(value), unit, None, max).info());
            };
            let why = match joint.longest_s.is_finite() {
                true => "",
                false => " (none: the next command came before that)",
            };
            add(
                "M1",
                format!("{name} longest time to within {ARRIVED_MM} mm of a new command{why}"),
                joint.longest_s,
                "s",
                None,
            );
            let samples = f64::from(joint.samples.max(1));
            add(
                "M2-rms",
                format!("{name} distance from the board's reference until then, RMS"),
                (joint.squares_mm2 / samples).sqrt(),
                "mm",
                None,
            );
            add(
                "M2-worst",
                format!("{name} the same, largest"),
                joint.worst_mm,
                "mm",
                None,
            );
            add(
                "M3",
                format!("{name} valve edges in a step"),
                joint.edges.span().unwrap_or(0.0) / f64::from(steps.max(1)),
                "1",
                None,
            );
            if offset == 2 {
                add(
                    "M4",
                    format!("{name} largest speed in the last {LOWERING_MM} mm down"),
                    joint.lowering_mm_s(),
                    "mm/s",
                    Some(LOWERING_MM_S),
                );
            }
        }
        let standing = self.0.iter().filter(|joint| joint.moves == 0);
        let drift = standing.filter_map(|joint| joint.position_mm.span());
        targets.push(
            Target::new(
                "M5",
                "largest movement of a joint that is sent nowhere",
                drift.reduce(f64::max),
                "mm",
                None,
                Some(5.0),
            )
            .info(),
        );
        targets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(targets: &[Target], id: &str) -> f64 {
        let target = targets.iter().find(|t| t.id == id);
        target.and_then(|t| t.value).unwrap_or(f64::NAN)
    }

    #[test]
    fn a_move_that_the_next_command_ends_says_so_instead_of_a_time() {
        let mut meter = MoveMeter::default();
        for ms in 0..300_u32 {
            let row = Row {
                t_ns: u64::from(ms) * 1_000_000,
                v: JointSample {
                    commanded_mm: f64::from(ms / 100) * 50.0,
                    ..JointSample::default()
                },
            };
            meter.joint(2, &row);
        }
        let targets = meter.targets(1);
        let late = targets.iter().find(|t| t.id == "M1-b6").expect("moved");
        assert_eq!(late.measured_text(), "not measured");
        let why = "(none: the next command came before that)";
        assert!(late.description.ends_with(why), "{}", late.description);
    }

    #[test]
    fn a_ramp_after_a_step_has_the_known_figures() {
        let mut meter = MoveMeter::default();
        for ms in 0..2000_u32 {
            let after_s = f64::from(ms.saturating_sub(1000)) * 1e-3;
            // 100 mm at 200 mm/s, 2 mm behind its reference.
            let reference_mm = (200.0 * after_s).min(100.0);
            let row = Row {
                t_ns: u64::from(ms) * 1_000_000,
                v: JointSample {
                    commanded_mm: if ms < 1000 { 0.0 } else { 100.0 },
                    reference_mm,
                    position_mm: (reference_mm - 2.0).max(0.0),
                    velocity_mm_s: if ms > 1000 { 200.0 } else { 0.0 },
                    valve_edges: ms / 100,
                    ..JointSample::default()
                },
            };
            meter.joint(2, &row);
            meter.joint(
                0,
                &Row {
                    v: JointSample::default(),
                    ..row
                },
            );
        }
        let targets = meter.targets(1);
        // 97 mm of the reference's way.
        assert!((value(&targets, "M1-b6") - 0.485).abs() < 0.002);
        assert!((value(&targets, "M2-rms-b6") - 2.0).abs() < 0.05);
        assert!((value(&targets, "M2-worst-b6") - 2.0).abs() < 1e-9);
        assert_eq!(value(&targets, "M3-b6"), 19.0);
        assert_eq!(value(&targets, "M4-b6"), 200.0);
        assert_eq!(value(&targets, "M5"), 0.0);
        assert!(targets.iter().all(|t| !t.required));
    }
}
