//! The report of the matrix.

use serde::Serialize;

use super::count;
use super::judge::{AfterAll, DEGRADED_MM, Outcome, REACTION_MS, Verdict};
use super::measure::Measured;
use super::row::{Expect, Row, Since};
use crate::StudyError;
use crate::study::Stopped;
use wheeleg_config::builtin::DEFAULT_SCENARIO;
use wheeleg_report::number::{counted, fixed, minus};
use wheeleg_report::page;

const TEMPLATE: &str = include_str!("page.html");

/// The required response of a row, in words.
pub(super) fn reaction(row: &Row) -> String {
    match row.expect {
        Expect::Stop(stop) => {
            let whose = match stop.axis {
                0 => "all axes stop".to_owned(),
                axis @ 1..=6 => format!("joint {axis} stops, then all axes"),
                axis => format!("wheel {axis} stops, then all axes"),
            };
            match stop.since {
                Since::Fault => whose,
                Since::Motion(_) => format!("{whose}; times count from 2 mm of expected motion"),
            }
        }
        Expect::GoesOn { .. } => "the motion continues".to_owned(),
        Expect::Degrades => "continues, or all axes stop; no wrong data are acted on".to_owned(),
        Expect::Restarts { board } => {
            format!("board {board} restarts disarmed, with either the old or the new parameters")
        }
        Expect::NoArming => "the robot does not arm".to_owned(),
        Expect::NotImplemented => row.not_implemented().unwrap_or_default().to_owned(),
    }
}

/// A sum of limits without the rounding tail of its binary fraction.
pub(super) fn tidy(ms: f64) -> f64 {
    (ms * 1e3).round() / 1e3
}

/// Limits of a row, each for its column; none if nothing is limited.
#[derive(Default, Serialize)]
struct Limits {
    detected: String,
    own: String,
    commanded: String,
    sensed: String,
    physical: String,
    wheels: String,
    deviation: String,
    /// Limits without a column.
    others: Vec<String>,
}

impl Limits {
    /// Limits of a row in which all axes stop, `all_ms` after the fault at the latest.
    fn all(outcome: &Outcome, all_ms: f64) -> Self {
        let AfterAll {
            physical_ms,
            wheels_ms,
        } = outcome.after_all;
        let at_most = |ms: f64, digits: usize| format!("≤ {}", fixed(ms, digits));
        let all = format!("≤ {all_ms}");
        Self {
            commanded: all.clone(),
            sensed: all,
            physical: at_most(all_ms + physical_ms, 1),
            wheels: at_most(all_ms + wheels_ms, 0),
            ..Self::default()
        }
    }

    fn of(outcome: &Outcome) -> Self {
        let row = &outcome.row;
        match row.expect {
            Expect::Stop(stop) => {
                let [from, to] = stop.detected_ms;
                let mut limits = Self::all(outcome, stop.all_ms);
                limits.detected = minus(&format!("{from} to {to}"));
                if stop.axis > 0 {
                    limits.own = format!("≤ {}", stop.own_ms);
                }
                if row.estop {
                    limits.others.push(format!("dump ≤ {} ms", stop.all_ms));
                }
                let held = row.held_mm.map(|mm| format!("held within {mm} mm"));
                limits.others.extend(held);
                limits
            }
            Expect::GoesOn { deviation_mm } => Self {
                deviation: format!("≤ {deviation_mm}"),
                ..Self::default()
            },
            Expect::Degrades => {
                let mut limits = Self::all(outcome, REACTION_MS);
                limits.deviation = format!("≤ {DEGRADED_MM}");
                let others =
                    "times count after the detection; without one, the deviation is judged";
                limits.others.push(others.to_owned());
                limits
            }
            _ => Self::default(),
        }
    }
}

/// Faults of a row, and its E-stop, each with its time.
fn what_goes_wrong(outcome: &Outcome) -> String {
    let mut all = outcome.faults.clone();
    if outcome.row.estop {
        // The row counts from the instant of the E-stop.
        all.push(format!("E-stop@{:.3}s", outcome.measured.since_s));
    }
    if let Some(connection) = outcome.row.connection {
        all.push(format!(
            "{}@{:.3}s",
            connection.label(),
            outcome.measured.at_s
        ));
    }
    all.join(", ")
}

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    /// Why the matrix stopped.
    stopped: Option<String>,
    version: &'static str,
    verdict: String,
    seed: u64,
    /// Scenario of the rows in which the robot walks.
    scenario: &'static str,
    rows: Vec<Shown<'a>>,
    passed: usize,
    failed: usize,
    /// Not implemented.
    missing: usize,
    /// Frames accepted that nobody sent.
    wrong: u64,
}

#[derive(Serialize)]
struct Shown<'a> {
    id: &'a str,
    faults: String,
    phase: &'static str,
    reaction: String,
    limits: Limits,
    /// Whether it was run.
    run: bool,
    failed: bool,
    measured: &'a Measured,
    verdict: &'static str,
    class: &'static str,
    failures: &'a [String],
    quoted: &'a [String],
    note: &'a str,
}

impl<'a> Shown<'a> {
    fn new(o: &'a Outcome) -> Self {
        Self {
            id: o.row.id,
            faults: what_goes_wrong(o),
            phase: o.row.phase.label(),
            reaction: reaction(&o.row),
            limits: Limits::of(o),
            run: o.verdict != Verdict::NotImplemented,
            failed: o.verdict == Verdict::Fail,
            measured: &o.measured,
            verdict: o.verdict.label(),
            class: match o.verdict {
                Verdict::Pass => "pass",
                Verdict::Fail => "fail",
                Verdict::NotImplemented => "info",
            },
            failures: &o.failures,
            quoted: &o.quoted,
            note: o.row.note,
        }
    }
}

pub(super) fn render(
    outcomes: &[Outcome],
    seed: u64,
    stopped: Option<&Stopped>,
) -> Result<String, StudyError> {
    let [passed, failed, missing] = [Verdict::Pass, Verdict::Fail, Verdict::NotImplemented]
        .map(|verdict| count(outcomes, verdict));
    // Failed rows come first, those not run last.
    let rows = [Verdict::Fail, Verdict::Pass, Verdict::NotImplemented].map(|verdict| {
        let rows = outcomes.iter().filter(move |o| o.verdict == verdict);
        rows.map(Shown::new)
    });
    let values = Page {
        stopped: stopped.map(ToString::to_string),
        version: env!("CARGO_PKG_VERSION"),
        scenario: DEFAULT_SCENARIO,
        verdict: match failed {
            0 if passed == 1 => {
                "Passed: the robot reacts as it must in the one row that was run.".to_owned()
            }
            0 => format!("Passed: the robot reacts as it must in all {passed} rows that were run."),
            _ => format!(
                "Failed: the robot does not react as it must in {failed} of {}.",
                counted(passed + failed, "row", "rows")
            ),
        },
        seed,
        rows: rows.into_iter().flatten().collect(),
        passed,
        failed,
        missing,
        wrong: outcomes.iter().map(|o| o.measured.wrong_frames).sum(),
    };
    Ok(page(TEMPLATE, values)?)
}
