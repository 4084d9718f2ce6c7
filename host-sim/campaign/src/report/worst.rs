//! The worst cases: first those without a result, then those furthest outside a required limit; of equal ones,
//! those whose next miss is the furthest. Among the cases that passed, the nearest to a limit come first.

use std::cmp::Ordering;

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::plan::Value;
use wheeleg_report::number::short;

use super::{Merged, cells};
use crate::columns::Column;
use crate::row::Status;

/// Number of cases listed.
const WORST: usize = 20;
/// A limit smaller than this counts as zero, because a share of it is meaningless. Misses are expressed as a
/// share of at least this value.
const NOTHING: f64 = 1e-9;

/// A case with what it missed, or what it was nearest to missing.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Worst {
    /// Identity.
    pub case: String,
    /// How it ended.
    pub status: String,
    /// Whether it met all required targets.
    pub passed: bool,
    /// Values of the factors.
    pub factors: Vec<String>,
    /// Required targets outside their limits, and by what share of the limit: first those that were not
    /// measured, then the furthest outside.
    pub missed: Vec<String>,
    /// For a case that passed, the required target nearest to a limit, and by what share of the limit it was
    /// met.
    pub nearest: Option<String>,
}

/// How far a value is outside its limits, as a share of the limit that it missed.
fn excess(value: f64, column: &Column) -> f64 {
    let beyond = |limit: f64, by: f64| by.max(0.0) / limit.abs().max(NOTHING);
    let low = column.min.map_or(0.0, |min| beyond(min, min - value));
    let high = column.max.map_or(0.0, |max| beyond(max, value - max));
    low.max(high)
}

/// How far a value is outside its limits, in words: as a share of the limit, or as an amount if the limit is
/// zero.
fn amount(value: f64, by: f64, column: &Column) -> String {
    let below = column.min.filter(|min| value < *min);
    let limit = below.or(column.max).unwrap_or(0.0);
    if limit.abs() > NOTHING {
        return percent(by);
    }
    let unit = match column.unit.as_str() {
        // A dimensionless number.
        "" | "1" => String::new(),
        unit => format!(" {unit}"),
    };
    format!("{}{unit}", short((value - limit).abs()))
}

/// How much room a value has within its limits, as a share of the nearest limit; negative if the value misses
/// it. `None` if no limit provides a measure.
fn room(value: f64, column: &Column) -> Option<f64> {
    // Equal limits leave no room.
    if column.min.is_some() && column.min == column.max {
        return None;
    }
    let within = |limit: f64, by: f64| (limit.abs() > NOTHING).then(|| by / limit.abs());
    let low = column.min.and_then(|min| within(min, value - min));
    let high = column.max.and_then(|max| within(max, max - value));
    [low, high].into_iter().flatten().min_by(f64::total_cmp)
}

/// A share in percent, with one more digit below 1 %.
fn percent(share: f64) -> String {
    let digits = usize::from(share < 0.01);
    format!("{:.digits$} %", 1e2 * share)
}

/// A target with its values and verdicts.
type Judged<'a> = (&'a Column, &'a [Option<f64>], &'a [Option<bool>]);

/// How bad a case is, from best to worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Class {
    /// It met all required targets.
    Passed,
    /// It missed a required target.
    Missed,
    /// A required target could not be measured.
    NotMeasured,
    /// It has no result.
    NoResult,
}

/// A required target that a case missed, and by what share of the limit; `None` if it was not measured.
type Miss<'a> = (&'a Column, Option<f64>);

/// Misses in the order in which they are listed: first those not measured, then the furthest.
fn furthest_first<'a>(missed: impl Iterator<Item = Miss<'a>>) -> Vec<Miss<'a>> {
    let mut missed: Vec<Miss<'a>> = missed.collect();
    let by = |(_, by): &Miss<'_>| by.unwrap_or(f64::INFINITY);
    missed.sort_by(|a, b| by(b).total_cmp(&by(a)));
    missed
}

/// Compares misses, the furthest of each case first: all cases that a fault has stopped miss its limit of zero
/// alike, and differ in what else they miss.
fn further(a: &[f64], b: &[f64]) -> Ordering {
    let mut pairs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
    let first = pairs.find(|order| order.is_ne());
    first.unwrap_or_else(|| a.len().cmp(&b.len()))
}

pub(super) fn worst(merged: &Merged) -> Vec<Worst> {
    let table = &merged.table;
    let (statuses, passed) = (table.texts("status"), table.flags("passed"));
    // A target that only informs does not make a case bad.
    let required: Vec<Judged<'_>> = merged
        .columns
        .all
        .iter()
        .filter(|column| column.required && merged.columns.targets.contains(&column.name))
        .map(|column| {
            let verdicts = table.flags(&format!("{}.pass", column.name));
            (column, table.numbers(&column.name), verdicts)
        })
        .collect();
    let missed_in = |row: usize| {
        let missed = required
            .iter()
            .filter(move |(.., pass)| pass[row] == Some(false));
        missed.map(move |(column, values, _)| -> Miss<'_> {
            (*column, values[row].map(|value| excess(value, column)))
        })
    };
    // For a case that passed, the required target with the least room, as a share of the limit.
    let nearest = |row: usize| -> Option<(&Column, f64)> {
        let rooms = required
            .iter()
            .filter_map(|(column, values, _)| Some((*column, room(values[row]?, column)?)))
            // If the case passed without room, its own scenario or move did not require the target.
            .filter(|(_, room)| *room >= 0.0);
        rooms.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    // Within a class, rank by the measured values, the furthest miss first; less room is worse.
    let rank = |row: usize| -> (Class, Vec<f64>) {
        if statuses[row].as_deref() != Some(Status::Ok.name()) {
            return (Class::NoResult, Vec::new());
        }
        if passed[row] == Some(true) {
            let room = nearest(row).map_or(f64::INFINITY, |(_, room)| room);
            return (Class::Passed, vec![-room]);
        }
        let missed = furthest_first(missed_in(row));
        let class = match missed.iter().any(|(_, by)| by.is_none()) {
            true => Class::NotMeasured,
            false => Class::Missed,
        };
        (class, missed.into_iter().filter_map(|(_, by)| by).collect())
    };
    let mut ranked: Vec<(usize, (Class, Vec<f64>))> =
        (0..table.rows()).map(|row| (row, rank(row))).collect();
    // The sort is stable: equally bad cases stay in the order of the plan.
    ranked.sort_by(|(_, (a, by_a)), (_, (b, by_b))| b.cmp(a).then_with(|| further(by_b, by_a)));
    let cases = table.texts("case");
    ranked
        .into_iter()
        .take(WORST)
        .map(|(row, (class, _))| Worst {
            passed: class == Class::Passed,
            nearest: nearest(row)
                .filter(|_| class == Class::Passed)
                .map(|(column, room)| {
                    format!("{} within its limit by {}", column.name, percent(room))
                }),
            case: cases[row].clone().unwrap_or_default(),
            status: statuses[row].clone().unwrap_or_default(),
            factors: merged
                .columns
                .factors
                .iter()
                .map(|factor| match cells::value(table, factor, row) {
                    Some(Value::Number(x)) => short(x),
                    Some(other) => other.to_string(),
                    None => String::new(),
                })
                .collect(),
            missed: furthest_first(missed_in(row))
                .into_iter()
                .map(
                    |(column, by)| match table.numbers(&column.name)[row].zip(by) {
                        // Limits that differ from case to case give no measure.
                        Some(_) if !column.has_limits() => format!("{} missed", column.name),
                        Some((value, by)) => {
                            format!("{} by {}", column.name, amount(value, by, column))
                        }
                        None => format!("{} not measured", column.name),
                    },
                )
                .collect(),
        })
        .collect()
}
