//! The report of the matrix, as a page and as JSON.

use minijinja::{Value, context};
use serde_json::json;

use super::count;
use super::judge::{AfterAll, DEGRADED_MM, Outcome, REACTION_MS, Verdict};
use super::row::{Expect, Row, Since};
use crate::StudyError;
use wheeleg_report::page;

const TEMPLATE: &str = include_str!("page.html");

/// Contents of `summary.json`.
pub(super) fn summary(outcomes: &[Outcome], seed: u64) -> serde_json::Value {
    let rows: Vec<serde_json::Value> = outcomes.iter().map(row_json).collect();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "seed": seed,
        "passed": count(outcomes, Verdict::Pass),
        "failed": count(outcomes, Verdict::Fail),
        "not_implemented": count(outcomes, Verdict::NotImplemented),
        "rows": rows,
    })
}

fn row_json(outcome: &Outcome) -> serde_json::Value {
    let row = &outcome.row;
    let pass = match outcome.verdict {
        Verdict::NotImplemented => None,
        verdict => Some(verdict == Verdict::Pass),
    };
    let run = outcome.verdict != Verdict::NotImplemented;
    json!({
        "row": row.id,
        "faults": outcome.faults,
        "phase": row.phase.words(),
        "expected": expected_json(outcome),
        "measured": run.then_some(&outcome.measured),
        "latched": run.then_some(outcome.measured.latched),
        "pass": pass,
        "verdict": outcome.verdict.words(),
        "failures": outcome.failures,
        "note": row.note,
    })
}

fn expected_json(outcome: &Outcome) -> serde_json::Value {
    let (row, after_all) = (&outcome.row, &outcome.after_all);
    let mut value = match row.expect {
        Expect::Stop(stop) => json!({
            "reaction": reaction(row),
            "detected_ms": stop.detected_ms,
            "axis": (stop.axis > 0).then_some(stop.axis),
            "own_ms": stop.own_ms,
            "all_ms": stop.all_ms,
            "physical_ms": tidy(stop.all_ms + after_all.physical_ms),
            "wheels_stand_ms": tidy(stop.all_ms + after_all.wheels_ms),
            "dump_ms": row.estop.then_some(stop.all_ms),
            "held_mm": row.held_mm,
            "latched": true,
        }),
        Expect::GoesOn { deviation_mm } => json!({
            "reaction": reaction(row), "deviation_mm": deviation_mm, "latched": false,
        }),
        Expect::Degrades => json!({
            "reaction": reaction(row),
            "all_ms_after_detection": REACTION_MS,
            "physical_ms_after_detection": tidy(REACTION_MS + after_all.physical_ms),
            "wheels_stand_ms_after_detection": tidy(REACTION_MS + after_all.wheels_ms),
            "deviation_mm_without_detection": DEGRADED_MM,
            "latched": "if all axes stop",
        }),
        _ => json!({ "reaction": reaction(row) }),
    };
    let reads: Vec<String> = row.reads.iter().map(ToString::to_string).collect();
    value["reads"] = json!(reads);
    value
}

/// What must come of a row, in words.
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
        Expect::GoesOn { .. } => "the motion goes on".to_owned(),
        Expect::Degrades => "goes on, or all axes stop; nothing wrong is acted on".to_owned(),
        Expect::StartsAnew { board } => {
            format!("board {board} starts anew, disarmed, with the old parameters or the new ones")
        }
        Expect::NoArming => "the robot does not arm".to_owned(),
        Expect::NotImplemented => row.not_implemented().unwrap_or_default().to_owned(),
    }
}

/// A sum of limits without the tail of its binary fraction.
fn tidy(ms: f64) -> f64 {
    (ms * 1e3).round() / 1e3
}

/// Limits of a row, in words, as it is judged by them.
fn limits(outcome: &Outcome) -> String {
    let row = &outcome.row;
    let after = |all_ms: f64| {
        let AfterAll {
            physical_ms,
            wheels_ms,
        } = outcome.after_all;
        format!(
            "all {all_ms}, physical {:.1}, wheels {:.0} ms",
            all_ms + physical_ms,
            all_ms + wheels_ms
        )
    };
    match row.expect {
        Expect::Stop(stop) => {
            let [from, to] = stop.detected_ms;
            let own = if stop.axis > 0 {
                format!(", axis {}", stop.own_ms)
            } else {
                String::new()
            };
            let dump = if row.estop {
                format!(", dump {} ms", stop.all_ms)
            } else {
                String::new()
            };
            let held = row.held_mm.map(|mm| format!(", held within {mm} mm"));
            format!(
                "detected {from} to {to}{own}, {}{dump}{}",
                after(stop.all_ms),
                held.unwrap_or_default()
            )
            .replace('-', "−")
        }
        Expect::GoesOn { deviation_mm } => format!("deviation {deviation_mm} mm"),
        Expect::Degrades => format!(
            "after the detection {}; without one, deviation {DEGRADED_MM} mm",
            after(REACTION_MS)
        ),
        _ => String::new(),
    }
}

/// Faults of a row, and its E-stop, each with its time.
fn what_goes_wrong(outcome: &Outcome) -> String {
    let mut all = outcome.faults.clone();
    if outcome.row.estop {
        // The instant from which the row counts is that of the E-stop.
        all.push(format!("E-stop@{:.3}s", outcome.measured.since_s));
    }
    all.join(", ")
}

pub(super) fn render(outcomes: &[Outcome], seed: u64) -> Result<String, StudyError> {
    let ms = |value: Option<f64>| {
        // Without the sign of a zero.
        let shown = |v: f64| if v.abs() < 0.05 { 0.0 } else { v };
        value.map_or_else(
            || "–".to_owned(),
            |v| format!("{:.1}", shown(v)).replace('-', "−"),
        )
    };
    let rows: Vec<Value> = outcomes
        .iter()
        .map(|o| {
            let m = &o.measured;
            let run = o.verdict != Verdict::NotImplemented;
            context! {
                id => o.row.id,
                faults => what_goes_wrong(o),
                phase => if run { o.row.phase.words() } else { "" },
                reaction => reaction(&o.row),
                limits => limits(o),
                detected => ms(m.detected_ms),
                own => ms(m.own_commanded_ms),
                commanded => ms(m.commanded_ms),
                sensed => ms(m.sensed_ms),
                physical => ms(m.physical_ms),
                wheels => ms(m.wheels_stand_ms),
                deviation => ms(m.deviation_mm),
                latched => if m.latched { "yes" } else if run { "no" } else { "" },
                verdict => o.verdict.words(),
                class => match o.verdict {
                    Verdict::Pass => "pass",
                    Verdict::Fail => "fail",
                    Verdict::NotImplemented => "info",
                },
                failures => if run { o.failures.clone() } else { Vec::new() },
                quoted => &o.quoted,
                note => o.row.note,
            }
        })
        .collect();
    let values = context! {
        version => env!("CARGO_PKG_VERSION"),
        seed => seed,
        rows => rows,
        passed => count(outcomes, Verdict::Pass),
        failed => count(outcomes, Verdict::Fail),
        missing => count(outcomes, Verdict::NotImplemented),
        wrong => outcomes.iter().map(|o| o.measured.wrong_frames).sum::<u64>(),
    };
    Ok(page(TEMPLATE, values)?)
}
