//! Compares cases that differ in only one thing: the program, or the value of a paired factor.

use std::collections::HashMap;

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::plan::Plan;
use wheeleg_report::stats;

use super::Merged;
use super::cells::{self, Cell};
use crate::CampaignError;
use crate::columns::Column;

/// A yes-or-no result of pairs, before and after.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Split {
    /// Yes before, no after.
    pub lost: u64,
    /// No before, yes after.
    pub gained: u64,
    /// The same in both.
    pub same: u64,
    /// Probability of a split at least this unequal if both directions are equally likely: exact test of
    /// McNemar.
    pub p: f64,
}

/// One target of pairs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TargetSplit {
    /// Its value.
    #[serde(flatten)]
    pub change: Change,
    /// Verdicts.
    pub split: Split,
}

/// How a value differs in pairs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// Column of the value.
    pub column: Column,
    /// Whether the change is that of the distance from the middle of the limits, because the target has limits
    /// on both sides; otherwise it is that of the value.
    pub of_distance: bool,
    /// Pairs in which both cases have the value: only these are in mean and interval.
    pub measured: u64,
    /// Mean of after − before.
    pub mean: Option<f64>,
    /// Its 95 % interval, by resampling the pairs; for very many pairs, by the normal distribution.
    pub interval: Option<[f64; 2]>,
}

/// Pairs of two values of a paired factor.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Paired {
    /// The two, in words.
    pub what: String,
    /// Pairs.
    pub pairs: u64,
    /// Whether all required targets were met.
    pub passed: Split,
    /// Each target with limits.
    pub targets: Vec<TargetSplit>,
    /// Each target without limits: nothing can be lost or gained.
    pub values: Vec<Change>,
}

/// Pairs of two tables.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Pairs {
    /// The comparison; the other table is "before".
    pub paired: Paired,
    /// Cases only in this table.
    pub only_here: u64,
    /// Cases only in the other table.
    pub only_there: u64,
    /// Pairs with the same log.
    pub same_log: u64,
    /// The other program.
    pub program: String,
}

/// Compares a table with another, case by case.
pub(super) fn against(here: &Merged, there: &Merged) -> Result<Pairs, CampaignError> {
    let places = |of: &Merged| -> HashMap<String, usize> {
        let cases = of.table.texts("case").iter().enumerate();
        cases
            .filter_map(|(row, case)| Some((case.clone()?, row)))
            .collect()
    };
    let (rows_here, rows_there) = (places(here), places(there));
    let mut both: Vec<(usize, usize)> = rows_here
        .iter()
        .filter_map(|(case, row)| Some((*rows_there.get(case)?, *row)))
        .collect();
    both.sort_unstable();
    if both.is_empty() {
        return Err(CampaignError::refused(
            format!(
                "`{}` and `{}` have no case in common",
                here.path.display(),
                there.path.display()
            ),
            "compare tables of one plan, run by two programs",
        ));
    }
    let logs = |of: &Merged, row: usize| of.table.texts("log_hash")[row].clone();
    let same_log = both.iter().filter(|(before, after)| {
        let log = logs(here, *after);
        log.is_some() && log == logs(there, *before)
    });
    let common = both.len();
    Ok(Pairs {
        same_log: same_log.count() as u64,
        paired: paired(
            "this table against the other".to_owned(),
            there,
            here,
            &both,
        ),
        only_here: (rows_here.len() - common) as u64,
        only_there: (rows_there.len() - common) as u64,
        program: there.program.clone(),
    })
}

/// Compares each value of a paired factor with its first value, with everything else equal.
pub(super) fn within(merged: &Merged, plan: &Plan, cells: &[Cell]) -> Vec<Paired> {
    let table = &merged.table;
    let (samples, replicates) = (table.wholes("sample"), table.wholes("replicate"));
    let mut found = Vec::new();
    for (place, (factor, _)) in cells::listed(plan).enumerate() {
        if !factor.paired {
            continue;
        }
        let values: Vec<_> = cells
            .iter()
            .map(|cell| cell.values[place].clone())
            .collect();
        let Some(first) = values.first() else {
            continue;
        };
        let mut others: Vec<_> = values.iter().filter(|v| *v != first).collect();
        others.dedup();
        let mut seen = Vec::new();
        others.retain(|v| {
            let new = !seen.contains(v);
            seen.push(*v);
            new
        });
        for other in others {
            let mut rows = Vec::new();
            for after in cells.iter().filter(|cell| cell.values[place] == *other) {
                let mut values = after.values.clone();
                values[place] = first.clone();
                let Some(before) = cells.iter().find(|cell| cell.values == values) else {
                    continue;
                };
                let key = |row: &usize| (samples[*row], replicates[*row]);
                let known: HashMap<_, usize> =
                    before.rows.iter().map(|row| (key(row), *row)).collect();
                let pairs = after.rows.iter();
                rows.extend(pairs.filter_map(|row| Some((*known.get(&key(row))?, *row))));
            }
            let what = format!("{} {other} against {first}", factor.name);
            found.push(paired(what, merged, merged, &rows));
        }
    }
    found
}

/// Compares pairs of rows, before and after.
fn paired(what: String, before: &Merged, after: &Merged, rows: &[(usize, usize)]) -> Paired {
    let flags = |name: &str| {
        let (b, a) = (before.table.flags(name), after.table.flags(name));
        split(rows.iter().map(|(i, j)| {
            let of = |flags: &[Option<bool>], row: usize| flags.get(row).copied().flatten();
            (of(b, *i), of(a, *j))
        }))
    };
    let columns = after.columns.all.iter();
    let changes = columns
        .filter(|column| after.columns.targets.contains(&column.name))
        .map(|column| {
            let middle = column.middle();
            let numbers = |of: &Merged, row: usize| -> Option<f64> {
                let value = of.table.numbers(&column.name).get(row).copied().flatten()?;
                Some(middle.map_or(value, |middle| (value - middle).abs()))
            };
            let differences: Vec<f64> = rows
                .iter()
                .filter_map(|(i, j)| Some(numbers(after, *j)? - numbers(before, *i)?))
                .collect();
            Change {
                of_distance: middle.is_some(),
                measured: differences.len() as u64,
                mean: stats::mean(&differences),
                interval: interval_of_mean(&differences),
                column: column.clone(),
            }
        });
    let (limited, values): (Vec<Change>, Vec<Change>) =
        changes.partition(|change| change.column.has_limits());
    let targets = limited.into_iter().map(|change| TargetSplit {
        split: flags(&format!("{}.pass", change.column.name)),
        change,
    });
    Paired {
        what,
        pairs: rows.len() as u64,
        targets: targets.collect(),
        values,
        passed: flags("passed"),
    }
}

/// Most pairs for which an interval is drawn; the mean of more pairs is close to normal.
const BOOTSTRAP: usize = 2_000;

fn interval_of_mean(values: &[f64]) -> Option<[f64; 2]> {
    let mean = |values: &[f64]| stats::mean(values).unwrap_or(f64::NAN);
    if values.len() <= BOOTSTRAP {
        return stats::bootstrap(values, 1, mean);
    }
    let centre = mean(values);
    let squares: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    let n = values.len() as f64;
    let half = 1.96 * (squares / (n - 1.0) / n).sqrt();
    Some([centre - half, centre + half])
}

/// A missing verdict counts as no: a case without a result has not passed.
fn split(pairs: impl Iterator<Item = (Option<bool>, Option<bool>)>) -> Split {
    let (mut lost, mut gained, mut same) = (0, 0, 0);
    for (before, after) in pairs {
        match (before == Some(true), after == Some(true)) {
            (true, false) => lost += 1,
            (false, true) => gained += 1,
            _ => same += 1,
        }
    }
    Split {
        lost,
        gained,
        same,
        p: stats::mcnemar(lost, gained),
    }
}
