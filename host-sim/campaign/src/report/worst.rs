//! The cases that are furthest outside of a limit; of those that passed, the nearest to one.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::plan::Value;
use wheeleg_report::number::short;

use super::{Merged, cells};
use crate::columns::Column;
use crate::row::Status;

/// Cases that are listed.
const WORST: usize = 20;
/// A limit of less than this is none to be near to: a share of it tells nothing. What is missed is a share
/// of this at least.
const NOTHING: f64 = 1e-9;

/// A case with what was missed in it, or what was nearest to be.
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
    /// Targets outside of their limits, and by how much of the limit's value.
    pub missed: Vec<String>,
    /// Of a case that passed, the required target nearest to a limit, and by how much of the limit's
    /// value it was met.
    pub nearest: Option<String>,
}

/// By how much a value is outside of its limits, as a share of the limit that it missed.
fn excess(value: f64, column: &Column) -> f64 {
    let beyond = |limit: f64, by: f64| by.max(0.0) / limit.abs().max(NOTHING);
    let low = column.min.map_or(0.0, |min| beyond(min, min - value));
    let high = column.max.map_or(0.0, |max| beyond(max, value - max));
    low.max(high)
}

/// By how much a value is outside of its limits, in words: a share of the limit, but of a limit of nothing the
/// amount.
fn amount(value: f64, by: f64, column: &Column) -> String {
    let below = column.min.filter(|min| value < *min);
    let limit = below.or(column.max).unwrap_or(0.0);
    if limit.abs() > NOTHING {
        return percent(by);
    }
    let unit = match column.unit.as_str() {
        // A number without a unit.
        "" | "1" => String::new(),
        unit => format!(" {unit}"),
    };
    format!("{}{unit}", short((value - limit).abs()))
}

/// How much room a value has within its limits, as a share of the limit that it is nearest to; none
/// where no limit tells. It is below 0 where it is missed.
fn room(value: f64, column: &Column) -> Option<f64> {
    // Equal limits leave no room to anything.
    if column.min.is_some() && column.min == column.max {
        return None;
    }
    let within = |limit: f64, by: f64| (limit.abs() > NOTHING).then(|| by / limit.abs());
    let low = column.min.and_then(|min| within(min, value - min));
    let high = column.max.and_then(|max| within(max, max - value));
    [low, high].into_iter().flatten().min_by(f64::total_cmp)
}

/// A share in percent; what is below 1 % with a digit more.
fn percent(share: f64) -> String {
    let digits = usize::from(share < 0.01);
    format!("{:.digits$} %", 1e2 * share)
}

/// A target with its values and verdicts.
type Judged<'a> = (&'a Column, &'a [Option<f64>], &'a [Option<bool>]);

pub(super) fn worst(merged: &Merged) -> Vec<Worst> {
    let table = &merged.table;
    let (statuses, passed) = (table.texts("status"), table.flags("passed"));
    let targets: Vec<Judged<'_>> = merged
        .columns
        .all
        .iter()
        .filter(|column| merged.columns.targets.contains(&column.name))
        .map(|column| {
            let verdicts = table.flags(&format!("{}.pass", column.name));
            (column, table.numbers(&column.name), verdicts)
        })
        .collect();
    let missed_in = |row: usize| -> Vec<(&Column, f64)> {
        let missed = targets.iter().filter(|(.., pass)| pass[row] == Some(false));
        let missed = missed.map(|(column, values, _)| {
            // What could not be measured is as bad as can be.
            let by = values[row].map_or(f64::INFINITY, |value| excess(value, column));
            (*column, by)
        });
        missed.collect()
    };
    // Without a result first, then by the largest excess.
    let score = |row: usize| -> f64 {
        if statuses[row].as_deref() != Some(Status::Ok.name()) {
            return f64::INFINITY;
        }
        let by = missed_in(row).into_iter().map(|(_, by)| by);
        by.fold(0.0, f64::max)
    };
    // Of one that passed, the required target with the least room, as a share of the limit.
    let nearest = |row: usize| -> Option<(&Column, f64)> {
        let required = targets.iter().filter(|(column, ..)| column.required);
        let rooms =
            required.filter_map(|(column, values, _)| Some((*column, room(values[row]?, column)?)));
        rooms.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let is_passed = |row: usize| passed[row] == Some(true);
    // Those that passed come behind all others, and lower with more room.
    let mut ranked: Vec<(usize, bool, f64)> = (0..table.rows())
        .map(|row| match is_passed(row) {
            true => (
                row,
                true,
                -nearest(row).map_or(f64::INFINITY, |(_, room)| room),
            ),
            false => (row, false, score(row)),
        })
        .collect();
    ranked.sort_by(|a, b| a.1.cmp(&b.1).then(b.2.total_cmp(&a.2)).then(a.0.cmp(&b.0)));
    let cases = table.texts("case");
    ranked
        .into_iter()
        .take(WORST)
        .map(|(row, passed, _)| Worst {
            passed,
            nearest: nearest(row).filter(|_| passed).map(|(column, room)| {
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
            missed: missed_in(row)
                .into_iter()
                .map(
                    |(column, by)| match merged.table.numbers(&column.name)[row] {
                        Some(value) if by.is_finite() => {
                            format!("{} by {}", column.name, amount(value, by, column))
                        }
                        _ => format!("{} not measured", column.name),
                    },
                )
                .collect(),
        })
        .collect()
}
