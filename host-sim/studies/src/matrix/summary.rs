//! The matrix as JSON.

use schemars::JsonSchema;
use serde::Serialize;

use super::count;
use super::judge::{DEGRADED_MM, Outcome, REACTION_MS, Verdict};
use super::measure::Measured;
use super::page::{reaction, tidy};
use super::row::Expect;
use crate::study;

/// Contents of `summary.json`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Summary<'a> {
    /// Version of the program.
    version: &'static str,
    /// Seed of all noise, and of the instants.
    #[serde(serialize_with = "study::schema::seed_text")]
    #[schemars(with = "String")]
    seed: u64,
    /// Rows that passed.
    passed: usize,
    /// Rows that failed.
    failed: usize,
    /// Rows that are not implemented, and were not run.
    not_implemented: usize,
    /// All of them, in the order of the table.
    rows: Vec<RowSummary<'a>>,
}

impl study::Summary for Summary<'_> {
    const SCHEMA: &'static str = "wheeleg.faults/2";
}

/// A row with its result.
#[derive(Debug, Serialize, JsonSchema)]
struct RowSummary<'a> {
    /// Name.
    row: &'static str,
    /// The injected faults.
    faults: &'a [String],
    /// When the fault begins.
    phase: &'static str,
    /// The required response.
    expected: Expected,
    /// The measurements; null if it was not run.
    measured: Option<&'a Measured>,
    /// Whether the stop is latched; null if it was not run.
    latched: Option<bool>,
    /// Whether it passed; null if it was not run.
    pass: Option<bool>,
    /// The same in words.
    verdict: &'static str,
    /// Its failures, or why the row was not run.
    failures: &'a [String],
    /// A remark.
    note: &'static str,
}

/// The required response of a row.
#[derive(Debug, Serialize, JsonSchema)]
struct Expected {
    /// In words.
    reaction: String,
    #[serde(flatten)]
    limits: Limits,
    /// Messages that the user must get.
    reads: Vec<String>,
}

/// Limits of the required response of a row, by its kind. Times in ms.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
enum Limits {
    /// All axes stop.
    Stop {
        /// Earliest and latest detection.
        detected_ms: [f64; 2],
        /// The axis that stops first, if there is one.
        axis: Option<u8>,
        /// Valves of that axis commanded shut.
        own_ms: f64,
        /// Valves of all axes commanded shut.
        all_ms: f64,
        /// Valves of all axes physically shut.
        physical_ms: f64,
        /// Both rims stand.
        wheels_stand_ms: f64,
        /// The supply is dumped; null if no E-stop is pressed.
        dump_ms: Option<f64>,
        /// Axes are held within this many mm.
        held_mm: Option<f64>,
        /// Whether the stop must be latched.
        latched: bool,
    },
    /// The motion goes on.
    GoesOn {
        /// Largest deviation from the run without the fault.
        deviation_mm: f64,
        /// Whether a stop must be latched.
        latched: bool,
    },
    /// The motion goes on, or all axes stop.
    Degrades {
        /// Valves of all axes commanded shut, from the detection on.
        all_ms_after_detection: f64,
        /// Valves of all axes physically shut, from the detection on.
        physical_ms_after_detection: f64,
        /// Both rims stand, from the detection on.
        wheels_stand_ms_after_detection: f64,
        /// Largest deviation if nothing is detected.
        deviation_mm_without_detection: f64,
        /// When the stop must be latched.
        latched: &'static str,
    },
    /// No times.
    Other {},
}

impl<'a> Summary<'a> {
    /// From the outcomes of the rows.
    #[must_use]
    pub fn new(outcomes: &'a [Outcome], seed: u64) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            seed,
            passed: count(outcomes, Verdict::Pass),
            failed: count(outcomes, Verdict::Fail),
            not_implemented: count(outcomes, Verdict::NotImplemented),
            rows: outcomes.iter().map(RowSummary::new).collect(),
        }
    }
}

impl<'a> RowSummary<'a> {
    fn new(outcome: &'a Outcome) -> Self {
        let row = &outcome.row;
        let run = outcome.verdict != Verdict::NotImplemented;
        Self {
            row: row.id,
            faults: &outcome.faults,
            phase: row.phase.label(),
            expected: Expected {
                reaction: reaction(row),
                limits: Limits::new(outcome),
                reads: row.reads.iter().map(ToString::to_string).collect(),
            },
            measured: run.then_some(&outcome.measured),
            latched: run.then_some(outcome.measured.latched),
            pass: run.then_some(outcome.verdict == Verdict::Pass),
            verdict: outcome.verdict.label(),
            failures: &outcome.failures,
            note: row.note,
        }
    }
}

impl Limits {
    fn new(outcome: &Outcome) -> Self {
        let (row, after_all) = (&outcome.row, &outcome.after_all);
        match row.expect {
            Expect::Stop(stop) => Self::Stop {
                detected_ms: stop.detected_ms,
                axis: (stop.axis > 0).then_some(stop.axis),
                own_ms: stop.own_ms,
                all_ms: stop.all_ms,
                physical_ms: tidy(stop.all_ms + after_all.physical_ms),
                wheels_stand_ms: tidy(stop.all_ms + after_all.wheels_ms),
                dump_ms: row.estop.then_some(stop.all_ms),
                held_mm: row.held_mm,
                latched: true,
            },
            Expect::GoesOn { deviation_mm } => Self::GoesOn {
                deviation_mm,
                latched: false,
            },
            Expect::Degrades => Self::Degrades {
                all_ms_after_detection: REACTION_MS,
                physical_ms_after_detection: tidy(REACTION_MS + after_all.physical_ms),
                wheels_stand_ms_after_detection: tidy(REACTION_MS + after_all.wheels_ms),
                deviation_mm_without_detection: DEGRADED_MM,
                latched: "if all axes stop",
            },
            _ => Self::Other {},
        }
    }
}
