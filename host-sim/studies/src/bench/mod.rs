//! One cylinder on the bench off its data sheet: played, judged and shown. A case of a campaign; the moves and
//! figures are those of [`crate::compare`].

mod files;
mod targets;

use serde::Serialize;
use wheeleg_config::bench::{Air, Bench, Deviation};

pub use files::{BenchFault, BenchSummary, write};
pub use targets::{FOUND_DELAY, targets, unmeasured};

use crate::axis_sim::suite::{AxisSimError, designed_with, draw_start, force_left_n, searched};
use crate::compare::{Played, play_from_power_up};

/// A case that was played.
#[derive(Debug, Clone)]
pub struct PlayedBench {
    /// Its moves.
    pub played: Played,
    /// Force left over the load at rest; 1.25 means a quarter more than the load needs. At most [`NO_LOAD`].
    pub margin: f64,
    /// Opening delay of the valves that the board searched for and found, s.
    pub found_delay_s: Option<f64>,
    /// Time from power-up to the end, s, without the search for the valves' delays.
    pub simulated_s: f64,
}

/// Margin of a cylinder without a load.
pub const NO_LOAD: f64 = 1e3;

/// Plays a case. The seed makes the noise of the converter, the air where that is unknown, and the random
/// combination where the variation is drawn.
///
/// # Errors
/// [`AxisSimError`] if plant or board refuse their data, or the plant leaves the range of its model.
pub fn play(bench: &Bench, seed: u64) -> Result<PlayedBench, AxisSimError> {
    let mut plant = bench.varied(seed);
    let left_n = force_left_n(&plant);
    plant.load_n += bench.load_share * left_n;
    let wait_ms = match bench.air {
        Air::File => 0,
        Air::Unknown => draw_start(&mut plant, seed)?,
    };
    let found = searched(&bench.sheet, &plant, bench.delays, seed)?;
    let design = designed_with(&bench.sheet, found, bench.controller, bench.delays);
    let plants = [&bench.sheet, &plant];
    let played = play_from_power_up(bench.motion, plants, &design, seed, wait_ms)?;
    Ok(PlayedBench {
        margin: (left_n / plant.load_n.abs().max(1e-9)).min(NO_LOAD),
        found_delay_s: found.map(|delays| delays.t_on_s),
        simulated_s: (played.ticks + wait_ms) as f64 * 1e-3,
        played,
    })
}

/// What a case is, in words for a page.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct About {
    /// Axis.
    pub axis: String,
    /// Controller.
    pub controller: &'static str,
    /// Move.
    #[serde(rename = "move")]
    pub motion: &'static str,
    /// Source of the board's valve delays.
    pub delays: &'static str,
    /// Air at power-up.
    pub air: &'static str,
    /// Force on the rod in addition to the plant's, as a share of the force left; positive extends.
    pub load_share: f64,
    /// Variation of the plant, in a word of a plan; `drawn=NUMBER` of a random combination of factors, whose air is told by
    /// `air`.
    pub variation: String,
    /// Where the plant is not as the data sheet says.
    pub deviations: Vec<Deviation>,
    /// Seed, a whole number as text: JSON numbers are exact only up to 2^53.
    pub seed: String,
}

impl About {
    /// Of a case.
    #[must_use]
    pub fn of(bench: &Bench, seed: u64) -> Self {
        Self {
            axis: bench.axis.clone(),
            controller: bench.controller.name(),
            motion: bench.motion.name(),
            delays: bench.delays.name(),
            air: bench.air.name(),
            load_share: bench.load_share,
            variation: bench.variation.of_seed(seed).to_string(),
            deviations: bench.deviations(seed),
            seed: seed.to_string(),
        }
    }
}
