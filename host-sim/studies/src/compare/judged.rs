//! Statistics of random combinations: how likely a law misses, quantiles of its figures, each with its bound,
//! and a pairwise comparison with another version.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use wheeleg_config::builtin::text_of;
use wheeleg_report::stats;

use super::{Cases, Row, Variation};
use crate::StudyError;
use crate::axis_sim::Kind;
use crate::study::Summary;

/// Largest error at rest \[mm\] of a combination that is not a miss.
pub const ERROR_MM: f64 = 0.5;
/// Largest overshoot of such a combination \[mm\].
pub const OVERSHOOT_MM: f64 = 6.0;

/// Digest of the sources of `firmware/control`.
const CONTROL: [u8; 24] = *include_bytes!(concat!(env!("OUT_DIR"), "/control"));

/// Root of the combinations that judge the laws. It follows from the sources of `firmware/control`, so a
/// changed law is judged by combinations that were not used to make it.
#[must_use]
pub const fn judging_root() -> u64 {
    let [a, b, c, d, ..] = CONTROL;
    u32::from_le_bytes([a, b, c, d]) as u64
}

/// A quantile, and its upper bound with 95 %, for any distribution (order statistic).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Quantile {
    /// Share below it.
    pub share: f64,
    /// The quantile; absent if it is a move that never ends as it should.
    pub value: Option<f64>,
    /// Its bound; absent if there are too few combinations for one.
    pub at_most: Option<f64>,
}

/// Combinations in which a version kept the bars and the other one did not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Paired {
    /// Played by both.
    pub pairs: u64,
    /// Kept by the other version, missed by this one.
    pub worse: u64,
    /// The other way round.
    pub better: u64,
    /// Probability of such an unequal split if neither version is better: exact test of McNemar.
    pub p: f64,
}

/// Statistics of the random combinations of a controller on an axis.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Judged {
    /// Axis.
    pub axis: String,
    /// Controller.
    pub controller: Kind,
    /// Played combinations.
    pub combinations: u64,
    /// Of these: error beyond 0.5 mm, overshoot beyond 6 mm, a limit cycle, or stopped.
    pub missed: u64,
    /// Upper bound of the probability to miss, one-sided 95 % (Clopper and Pearson).
    pub missed_at_most: f64,
    /// Error at rest \[mm\].
    pub steady_error_mm: [Quantile; 2],
    /// Overshoot \[mm\].
    pub overshoot_mm: [Quantile; 2],
    /// Until within ±1 mm for good \[s\].
    pub settle_s: [Quantile; 2],
    /// Overshoot of the first move after power-up \[mm\].
    pub first_overshoot_mm: [Quantile; 2],
    /// Against another version; absent without one.
    pub paired: Option<Paired>,
}

/// Which combinations another version kept, by their names.
pub type Before = BTreeMap<String, bool>;

/// The part of a row that decides whether its bars are kept, for reading it back.
#[derive(Deserialize)]
#[serde(expecting = "a case")]
struct ReadCase {
    id: String,
    variation: String,
    steady_error_mm: Option<f64>,
    overshoot_mm: Option<f64>,
    limit_cycle: Option<bool>,
    stopped: Option<bool>,
}

#[derive(Deserialize)]
#[serde(expecting = "an object with `schema` and `cases`")]
struct ReadCases {
    schema: String,
    cases: Vec<ReadCase>,
}

/// Whether a combination keeps its bars.
fn keeps(
    error_mm: Option<f64>,
    overshoot_mm: Option<f64>,
    cycle: Option<bool>,
    stopped: Option<bool>,
) -> bool {
    error_mm.is_some_and(|mm| mm.abs() <= ERROR_MM)
        && overshoot_mm.is_some_and(|mm| mm <= OVERSHOOT_MM)
        && cycle == Some(false)
        && stopped == Some(false)
}

impl Row {
    /// Whether it keeps the bars of a combination: error, overshoot, no limit cycle, not stopped.
    #[must_use]
    pub fn keeps(&self) -> bool {
        let f = &self.figures;
        keeps(f.steady_error_mm, f.overshoot_mm, f.limit_cycle, f.stopped)
    }
}

/// Reads from its `summary.json` which of these many combinations from `root` on another version kept.
///
/// # Errors
/// [`StudyError`] if the file cannot be read, is not a summary of a comparison or has none of the
/// combinations.
pub fn read_before(path: &Path, root: u64, combinations: u64) -> Result<Before, StudyError> {
    let help = "give the summary.json that `wheeleg compare --root N` of the other version wrote";
    let named = |what: String| StudyError::refused(format!("`{}` {what}", path.display()), help);
    let text = text_of(path).map_err(|e| named(format!("cannot be read: {e}")))?;
    let read: ReadCases = serde_json::from_str(&text)
        .map_err(|e| named(format!("is not a summary of a comparison: {e}")))?;
    // Combinations of another form have other noise.
    let own = <Cases<'_> as Summary>::SCHEMA;
    if read.schema != own {
        return Err(named(format!("is a `{}`, not a `{own}`", read.schema)));
    }
    let drawn = |row: &ReadCase| match row.variation.parse() {
        Ok(Variation::Drawn(number)) => number.wrapping_sub(root) < combinations,
        _ => false,
    };
    let before: Before = read
        .cases
        .into_iter()
        .filter(drawn)
        .map(|row| {
            let kept = keeps(
                row.steady_error_mm,
                row.overshoot_mm,
                row.limit_cycle,
                row.stopped,
            );
            (row.id, kept)
        })
        .collect();
    if before.is_empty() {
        let what =
            format!("has none of the {combinations} random combinations from --root {root} on");
        return Err(named(what));
    }
    Ok(before)
}

/// A quantile of values; missing ones count as larger than any.
fn quantile(values: &[Option<f64>], share: f64) -> Quantile {
    let all: Vec<f64> = values.iter().map(|v| v.unwrap_or(f64::INFINITY)).collect();
    let [value, at_most] = stats::bounded_quantile(&all, share);
    let finite = |v: Option<f64>| v.filter(|v| v.is_finite());
    Quantile {
        share,
        value: finite(value),
        at_most: finite(at_most),
    }
}

impl Judged {
    /// Of these combinations of a controller on an axis, and of those of another version; none without any.
    #[must_use]
    pub fn of(axis: &str, kind: Kind, rows: &[&Row], before: Option<&Before>) -> Option<Self> {
        let count = rows.len() as u64;
        let missed = rows.iter().filter(|r| !r.keeps()).count() as u64;
        let of = |value: fn(&Row) -> Option<f64>, shares: [f64; 2]| {
            let values: Vec<Option<f64>> = rows.iter().map(|r| value(r)).collect();
            shares.map(|share| quantile(&values, share))
        };
        (count > 0).then(|| Self {
            axis: axis.to_owned(),
            controller: kind,
            combinations: count,
            missed,
            missed_at_most: stats::failure_bound(missed as u32, count as u32),
            steady_error_mm: of(|r| r.figures.steady_error_mm.map(f64::abs), [0.99, 0.999]),
            overshoot_mm: of(|r| r.figures.overshoot_mm, [0.99, 0.999]),
            settle_s: of(|r| r.figures.settle_s, [0.5, 0.99]),
            first_overshoot_mm: of(|r| r.figures.first_overshoot_mm, [0.5, 0.99]),
            paired: before.map(|before| paired(rows, before)),
        })
    }
}

/// Rows against those of the same name in another version.
fn paired(rows: &[&Row], before: &Before) -> Paired {
    let both: Vec<(bool, bool)> = rows
        .iter()
        .filter_map(|row| Some((*before.get(&row.case.id)?, row.keeps())))
        .collect();
    let count = |split: (bool, bool)| both.iter().filter(|pair| **pair == split).count() as u64;
    let (worse, better) = (count((true, false)), count((false, true)));
    Paired {
        pairs: both.len() as u64,
        worse,
        better,
        p: stats::mcnemar(worse, better),
    }
}
