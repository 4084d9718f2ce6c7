//! What a table shows: rates, quantiles, correlations, the worst cases.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::plan::{Plan, Sampler};
use wheeleg_report::stats;

use super::Merged;
use super::asked::Asked;
use super::cells::{self, Cell};
use super::pairs::{self, Paired};
use super::worst::{Worst, worst};
use crate::columns::Column;
use crate::row::Status;
use crate::table::Table;
use crate::{CampaignError, Cases, Setup};

/// Number of kinds of errors listed.
const ERRORS: usize = 20;
/// Quantiles reported for every target.
const SHARES: [f64; 3] = [0.05, 0.5, 0.95];
/// Most values for which a bootstrap interval is drawn; for more, ranks are as good.
const BOOTSTRAP: usize = 500;

/// How often something was true.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Rate {
    /// How often it was true.
    pub met: u64,
    /// Out of how many.
    pub of: u64,
    /// Exact interval, 95 % two-sided.
    pub exact: [f64; 2],
    /// Score interval, 95 % two-sided.
    pub wilson: [f64; 2],
}

impl Rate {
    pub(super) fn of(met: u64, of: u64) -> Self {
        Self {
            met,
            of,
            exact: stats::clopper_pearson(met, of),
            wilson: stats::wilson(met, of),
        }
    }
}

/// A quantile with its intervals.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Quantile {
    /// Share of the values below it.
    pub share: f64,
    /// Its value.
    pub value: f64,
    /// Interval by ranks, 95 %; an end that too few values cannot bound is null.
    pub ranks: [Option<f64>; 2],
    /// Interval by resampling the values; null for too many or too few values.
    pub bootstrap: Option<[f64; 2]>,
}

/// A target in a cell.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct InCell {
    /// The cell, in words.
    pub cell: String,
    /// How often it was met, among the cases that ran to their end.
    pub rate: Rate,
    /// Quantiles of its value.
    pub quantiles: Vec<Quantile>,
    /// Rank correlation with each drawn factor.
    pub spearman: Vec<Option<f64>>,
    /// Smallest and largest value of each of these factors among the cases that missed the target; null for
    /// fewer than two such cases. An effect within a narrow range of a factor does not show as a correlation.
    pub missed_between: Vec<Option<[f64; 2]>>,
    /// Shares of the variance caused by the factors in [`Findings::shared`]; empty if there are none.
    pub shares: Vec<Shares>,
}

/// Shares of a target's variance caused by one factor.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Shares {
    /// By the factor alone.
    pub first: Share,
    /// Including its interactions with other factors.
    pub total: Share,
}

/// A share of a variance. Noise may make it less than 0 or more than 1.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Share {
    /// Estimate; null if the interval is wider than the whole variance, so that these samples do not
    /// determine it.
    pub value: Option<f64>,
    /// 95 % interval, by resampling the samples; null for too many samples, or without an estimate.
    pub interval: Option<[f64; 2]>,
}

impl From<stats::Share> for Share {
    fn from(share: stats::Share) -> Self {
        let is_told = |[low, high]: &[f64; 2]| high - low <= 1.0;
        match share.interval {
            Some(interval) if !is_told(&interval) => Self {
                value: None,
                interval: None,
            },
            interval => Self {
                value: Some(share.value),
                interval,
            },
        }
    }
}

impl From<stats::Shares> for Shares {
    fn from(shares: stats::Shares) -> Self {
        Self {
            first: shares.first.into(),
            total: shares.total.into(),
        }
    }
}

/// A target.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OfTarget {
    /// Its column: name, unit, meaning, limits.
    pub column: Column,
    /// In each cell.
    pub cells: Vec<InCell>,
}

/// The ground of a scenario, as its file describes it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OfScenario {
    /// Its name.
    pub scenario: String,
    /// Parts of the ground with their materials; empty for a level floor of rock.
    pub parts: Vec<String>,
}

/// What a table shows.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Findings {
    /// What the plan asks.
    pub asked: Asked,
    /// Rows.
    pub rows: u64,
    /// Rows by [`Status::ALL`].
    pub by_status: Vec<(String, u64)>,
    /// For each cell, how often all required targets were met, among all cases.
    pub passed: Vec<(String, Rate)>,
    /// Names of the factors.
    pub factors: Vec<String>,
    /// Names of the factors that are drawn and numeric.
    pub drawn: Vec<String>,
    /// Smallest and largest value of each of these in the table.
    pub drawn_between: Vec<Option<[f64; 2]>>,
    /// Names of the factors with shares of the variance: those that Saltelli's design draws.
    pub shared: Vec<String>,
    /// Each target.
    pub targets: Vec<OfTarget>,
    /// Errors by kind, the most frequent first.
    pub errors: Vec<(String, u64)>,
    /// The ground of each scenario; empty for cylinders on the bench.
    pub grounds: Vec<OfScenario>,
    /// The worst cases, worst first; those that passed come last, nearest to a limit first.
    pub worst: Vec<Worst>,
    /// Values of paired factors, each compared with the factor's first value.
    pub paired: Vec<Paired>,
}

/// Evaluates a table.
pub(super) fn find(merged: &Merged) -> Result<Findings, CampaignError> {
    let plan = merged.plan.plan()?;
    let table = &merged.table;
    let cells = cells::cells(table, &plan);
    let statuses = table.texts("status");
    let by_status = Status::ALL.map(|status| {
        let name = Some(status.name());
        let count = statuses.iter().filter(|s| s.as_deref() == name).count();
        (status.name().to_owned(), count as u64)
    });
    let passed = table.flags("passed");
    let grid = cells::grid(&plan);
    let drawn: Vec<String> = merged
        .columns
        .factors
        .iter()
        .filter(|name| !grid.contains(name) && !table.numbers(&of_factor(name)).is_empty())
        .cloned()
        .collect();
    let columns = merged.columns.all.iter();
    let columns = columns.filter(|column| merged.columns.targets.contains(&column.name));
    let shared: Vec<String> = match plan.sampler {
        Sampler::Saltelli => plan.drawn().map(|factor| factor.name.clone()).collect(),
        Sampler::Random | Sampler::LatinHypercube | Sampler::Sobol => Vec::new(),
    };
    let targets = columns.map(|column| of_target(merged, column, &cells, &drawn, shared.len()));
    Ok(Findings {
        asked: Asked::of(&plan),
        rows: table.rows() as u64,
        by_status: by_status.to_vec(),
        passed: cells
            .iter()
            .map(|cell| {
                let met = cell.rows.iter().filter(|row| passed[**row] == Some(true));
                let rate = Rate::of(met.count() as u64, cell.rows.len() as u64);
                (cell.name.clone(), rate)
            })
            .collect(),
        factors: merged.columns.factors.clone(),
        targets: targets.collect(),
        drawn_between: drawn
            .iter()
            .map(|name| between(table.numbers(&of_factor(name)).iter().flatten()))
            .collect(),
        drawn,
        shared,
        errors: errors(merged),
        grounds: grounds(&plan, merged, &cells)?,
        worst: worst(merged),
        paired: pairs::within(merged, &plan, &cells),
    })
}

/// Name of a factor's column.
fn of_factor(name: &str) -> String {
    format!("f.{name}")
}

/// Smallest and largest value; `None` for fewer than two values.
fn between<'a>(values: impl Iterator<Item = &'a f64>) -> Option<[f64; 2]> {
    let none = (0, [f64::INFINITY, f64::NEG_INFINITY]);
    let (count, between) = values.fold(none, |(count, [low, high]), value| {
        (count + 1, [low.min(*value), high.max(*value)])
    });
    (count > 1).then_some(between)
}

/// Number of grounds listed.
const GROUNDS: usize = 20;

/// The ground of the first case of each cell, without repetitions.
fn grounds(plan: &Plan, merged: &Merged, cells: &[Cell]) -> Result<Vec<OfScenario>, CampaignError> {
    let cases = Cases::new(plan)?;
    let indices = merged.table.wholes("index");
    let mut found: Vec<OfScenario> = Vec::new();
    for cell in cells {
        let index = cell.rows.first().and_then(|row| indices[*row]);
        let Some(index) = index.and_then(|index| u64::try_from(index).ok()) else {
            continue;
        };
        let setup = cases.case(index).setup.ok();
        let Some((scenario, _)) = setup.as_ref().and_then(Setup::robot) else {
            continue;
        };
        let of = OfScenario {
            scenario: scenario.name.clone(),
            parts: scenario.ground.parts.clone(),
        };
        if !found.contains(&of) {
            found.push(of);
        }
        if found.len() == GROUNDS {
            break;
        }
    }
    Ok(found)
}

fn of_target(
    merged: &Merged,
    column: &Column,
    cells: &[Cell],
    drawn: &[String],
    shared: usize,
) -> OfTarget {
    let table = &merged.table;
    let values = table.numbers(&column.name);
    let verdicts = table.flags(&format!("{}.pass", column.name));
    let in_cell = |cell: &Cell| {
        let judged = cell.rows.iter().filter_map(|row| verdicts[*row]);
        let (met, of) = judged.fold((0, 0), |(met, of), pass| (met + u64::from(pass), of + 1));
        let there = cell.rows.iter().filter_map(|row| values[*row]);
        let mut sorted: Vec<f64> = there.collect();
        sorted.sort_by(f64::total_cmp);
        let quantiles = SHARES
            .into_iter()
            .filter_map(|share| quantile(&sorted, share));
        let of_rows = |column: &[Option<f64>]| -> Vec<f64> {
            let rows = cell.rows.iter();
            rows.map(|row| column[*row].unwrap_or(f64::NAN)).collect()
        };
        let y = of_rows(values);
        let spearman = drawn.iter().map(|factor| {
            let x = of_rows(table.numbers(&of_factor(factor)));
            stats::spearman(&x, &y)
        });
        let missed = || {
            cell.rows
                .iter()
                .filter(|row| verdicts[**row] == Some(false))
        };
        let missed_between = drawn.iter().map(|factor| {
            let x = table.numbers(&of_factor(factor));
            between(missed().filter_map(|row| x[*row].as_ref()))
        });
        InCell {
            cell: cell.name.clone(),
            rate: Rate::of(met, of),
            quantiles: quantiles.collect(),
            spearman: spearman.collect(),
            missed_between: missed_between.collect(),
            shares: match shared {
                0 => Vec::new(),
                factors => shares(table, cell, values, factors),
            },
        }
    };
    OfTarget {
        column: column.clone(),
        cells: cells.iter().map(in_cell).collect(),
    }
}

/// Shares of the variance of a cell's values; empty if all values are equal, or too few sets of samples are
/// complete.
fn shares(table: &Table, cell: &Cell, values: &[Option<f64>], factors: usize) -> Vec<Shares> {
    let (samples, replicates) = (table.wholes("sample"), table.wholes("replicate"));
    let size = factors + 2;
    let mut sets: BTreeMap<(i64, i64), Vec<f64>> = BTreeMap::new();
    for row in &cell.rows {
        let (Some(sample), Some(value)) = (samples[*row], values[*row]) else {
            continue;
        };
        let (set, place) = (sample / size as i64, sample.rem_euclid(size as i64));
        let set = sets.entry((set, replicates[*row].unwrap_or(0)));
        set.or_insert_with(|| vec![f64::NAN; size])[place as usize] = value;
    }
    let whole = |set: &Vec<f64>| set.iter().all(|value| value.is_finite());
    let sets: Vec<Vec<f64>> = sets.into_values().filter(whole).collect();
    let found = stats::shares(&sets).into_iter().flatten();
    found.map(Shares::from).collect()
}

fn quantile(sorted: &[f64], share: f64) -> Option<Quantile> {
    let value = stats::quantile(sorted, share)?;
    let ranks = stats::quantile_ranks(sorted.len() as u64, share);
    let bootstrap = (sorted.len() <= BOOTSTRAP)
        .then(|| {
            let of = |drawn: &[f64]| stats::quantile(drawn, share).unwrap_or(f64::NAN);
            stats::bootstrap(sorted, 1, of)
        })
        .flatten();
    Some(Quantile {
        share,
        value,
        ranks: ranks.map(|rank| rank.and_then(|rank| sorted.get(rank as usize - 1)).copied()),
        bootstrap,
    })
}

fn errors(merged: &Merged) -> Vec<(String, u64)> {
    let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
    for error in merged.table.texts("error").iter().flatten() {
        *counts.entry(error).or_default() += 1;
    }
    let mut counts: Vec<(String, u64)> = counts
        .into_iter()
        .map(|(error, count)| (error.to_owned(), count))
        .collect();
    counts.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    counts.truncate(ERRORS);
    counts
}
