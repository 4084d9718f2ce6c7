//! How long a move takes to start, per kind of move and law.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;

use super::run_all;
use super::trial::{Law, Outcome, Start, Trial};
use crate::StudyError;
use crate::study::{Ended, Progress};
use wheeleg_report::stats::{median, quantile};

/// Distribution of one kind of move under one law. Times from the set-point in the board.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Distribution {
    /// Kind.
    pub start: Start,
    /// Law.
    pub law: Law,
    /// Starts that did not come within the observed time.
    pub never: usize,
    /// Delays in the order of the seeds \[s\].
    pub delay_s: Vec<f64>,
    /// Smallest \[s\].
    pub min_s: f64,
    /// Median \[s\].
    pub median_s: f64,
    /// Nine out of ten are at most this \[s\].
    pub p90_s: f64,
    /// Largest \[s\].
    pub max_s: f64,
    /// Median pressures A, B at the command, absolute \[Pa\].
    pub pressure_pa: [f64; 2],
    /// Largest speed over all of them \[m/s\].
    pub peak_m_s: f64,
}

/// All of them.
#[derive(Debug, Default, Serialize, JsonSchema)]
pub struct Starts {
    /// Kinds of the first law, then of the second.
    pub list: Vec<Distribution>,
    /// Move from the held home of each law, first seed.
    #[serde(skip)]
    pub home: Vec<Outcome>,
}

impl Starts {
    /// The distribution of a kind and law.
    #[must_use]
    pub fn of(&self, law: Law, start: Start) -> Option<&Distribution> {
        self.list.iter().find(|d| d.law == law && d.start == start)
    }
}

/// Measures `seeds` starts of every kind under both laws into `starts`, where they stay if one fails.
///
/// # Errors
/// [`Ended`] if the axis cannot be simulated, no start of a kind moved, or the study is stopped.
pub fn measure(
    axis: &AxisParams,
    seeds: u32,
    progress: &Progress,
    starts: &mut Starts,
) -> Result<(), Ended> {
    let kinds = Law::ALL
        .into_iter()
        .flat_map(|law| Start::ALL.map(|start| (law, start)));
    for (law, start) in kinds {
        let trials: Vec<Trial> = (1..=u64::from(seeds))
            .map(|seed| Trial::new(axis, law, start, seed))
            .collect();
        let what = format!("{} law, {}", law.name(), start.name());
        let outcomes = run_all(&what, &trials, progress)?;
        let distribution = distribution(law, start, &outcomes).ok_or_else(|| {
            StudyError::refused(
                format!(
                    "`{}` under the {} law: the piston never moves 1 mm",
                    start.name(),
                    law.name()
                ),
                "the load may exceed what the cylinder can move; see --load and the supply of the robot file",
            )
        })?;
        starts.list.push(distribution);
        if start == Start::HomeHeld {
            starts.home.extend(outcomes.into_iter().next());
        }
    }
    Ok(())
}

fn distribution(law: Law, start: Start, outcomes: &[Outcome]) -> Option<Distribution> {
    let delay_s: Vec<f64> = outcomes.iter().filter_map(|o| o.delay_s).collect();
    let pressure = |i: usize| {
        let list: Vec<f64> = outcomes.iter().map(|o| o.pressure_pa[i]).collect();
        median(&list)
    };
    Some(Distribution {
        start,
        law,
        never: outcomes.len() - delay_s.len(),
        min_s: quantile(&delay_s, 0.0)?,
        median_s: median(&delay_s)?,
        p90_s: quantile(&delay_s, 0.9)?,
        max_s: quantile(&delay_s, 1.0)?,
        pressure_pa: [pressure(0)?, pressure(1)?],
        peak_m_s: outcomes.iter().map(|o| o.peak_m_s).fold(0.0, f64::max),
        delay_s,
    })
}
