//! The gain of an announced move: the counter chamber vented and the drive chamber filled ahead of time.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;

use super::trial::{Law, Outcome, Start, Trial};
use super::{EARLY_LIMIT_MM, PREVIEW_LIMIT_S, run_all};
use crate::study::{Ended, Progress};
use wheeleg_report::stats::{largest, median};

/// Preview \[s\].
pub const PREVIEWS_S: [f64; 9] = [0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4];
/// Announced moves.
const STARTS: [Start; 5] = [
    Start::HomeHeld,
    Start::HomeRest,
    Start::StopHeld,
    Start::MidExtend,
    Start::MidRetract,
];
/// Force in addition to the axis's own on the move from home \[N\], positive extends.
const LOADS_N: [f64; 4] = [-30.0, -15.0, 15.0, 30.0];

/// Starts of one kind at one preview, worst of all seeds.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Previewed {
    /// Law; only the default one uses the preview.
    pub law: Law,
    /// Kind of move.
    pub start: Start,
    /// Load in addition to the axis's own \[N\].
    pub load_n: f64,
    /// Preview \[s\].
    pub preview_s: f64,
    /// Median start delay \[s\]; `None` if a start never came.
    pub median_s: Option<f64>,
    /// Largest start delay \[s\]; `None` if a start never came.
    pub delay_s: Option<f64>,
    /// Largest motion between preview and command \[mm\].
    pub early_mm: f64,
}

impl Previewed {
    /// Whether it starts in time, and stands still until then.
    #[must_use]
    pub fn meets(&self) -> bool {
        self.delay_s.is_some_and(|d| d <= PREVIEW_LIMIT_S) && self.early_mm <= EARLY_LIMIT_MM
    }
}

/// All of them.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Preview {
    /// Seeds of each row.
    pub seeds: u32,
    /// Rows in the order of law, kind, load and preview time.
    pub rows: Vec<Previewed>,
    /// Default law from the held home, announced by the longest preview; first seed.
    #[serde(skip)]
    pub home: Outcome,
}

impl Preview {
    /// Rows of a law and kind without load.
    pub fn of(&self, law: Law, start: Start) -> impl Iterator<Item = &Previewed> {
        self.rows
            .iter()
            .filter(move |r| r.law == law && r.start == start && r.load_n == 0.0)
    }

    /// Shortest preview from which every longer one meets the bar, without load \[s\].
    #[must_use]
    pub fn enough_s(&self, start: Start) -> Option<f64> {
        let rows: Vec<&Previewed> = self.of(Law::Default, start).collect();
        let first = rows.iter().rposition(|r| !r.meets()).map_or(0, |i| i + 1);
        rows.get(first).map(|r| r.preview_s)
    }
}

/// Measures all rows.
///
/// # Errors
/// [`Ended`] if the axis cannot be simulated, or the study is stopped.
pub fn measure(axis: &AxisParams, seeds: u32, progress: &Progress) -> Result<Preview, Ended> {
    let mut cases = Vec::new();
    for start in STARTS {
        cases.extend(PREVIEWS_S.map(|preview_s| (Law::Default, start, 0.0, preview_s)));
    }
    for load_n in LOADS_N {
        cases
            .extend(PREVIEWS_S.map(|preview_s| (Law::Default, Start::HomeHeld, load_n, preview_s)));
    }
    cases.extend([0.0, 0.4].map(|preview_s| (Law::Paper, Start::HomeHeld, 0.0, preview_s)));
    let trials: Vec<Trial> = cases
        .iter()
        .flat_map(|case| (1..=u64::from(seeds)).map(move |seed| (case, seed)))
        .map(|(&(law, start, load_n, preview_s), seed)| {
            let mut trial = Trial::new(axis, law, start, seed);
            trial.axis.load_n += load_n;
            trial.preview_s = preview_s;
            trial
        })
        .collect();
    let mut outcomes = run_all("announced moves", &trials, progress)?;
    let each = seeds as usize;
    let rows = cases
        .iter()
        .zip(outcomes.chunks(each))
        .map(|(&(law, start, load_n, preview_s), group)| {
            let delays: Option<Vec<f64>> = group.iter().map(|o| o.delay_s).collect();
            Previewed {
                law,
                start,
                load_n,
                preview_s,
                median_s: delays.as_deref().and_then(median),
                delay_s: delays.as_deref().and_then(largest),
                early_mm: group.iter().map(|o| o.early_mm).fold(0.0, f64::max),
            }
        })
        .collect();
    let home = outcomes.swap_remove((PREVIEWS_S.len() - 1) * each);
    Ok(Preview { seeds, rows, home })
}
