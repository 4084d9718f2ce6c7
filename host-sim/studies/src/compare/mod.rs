//! The cases of `wheeleg compare`: every controller on the same plants, moves and inputs.
//!
//! A case is a controller, an axis, a move, a deviation from the axis's data sheet, and a seed. The joint
//! board's whole application ([`crate::axis_sim::Node`]) plays it from power-up, with gains that the builder
//! derives from the sheet. Cases are independent, and each can be played alone by its name. The comparison itself
//! is a campaign of them.

mod bounds;
mod case;
mod judged;
mod moves;
mod single;

use schemars::JsonSchema;
use serde::Serialize;

pub use bounds::fastest_steps;
pub use case::{BadCaseId, Case, CaseFacts, CaseId, Figures, MARGIN, Row, fault_names};
pub use judged::{
    Before, ERROR_MM, Judged, OVERSHOOT_MM, Paired, Quantile, judging_root, read_before,
};
pub(crate) use moves::play_from_power_up;
pub use moves::{CONTACT_S, Move, Played, RECOVERY_S, REST_S, STEP_S, Sizes};
pub use single::{Single, panel, play};
pub(crate) use single::{trace_csv, trace_figure};
pub use wheeleg_config::bench::{UnknownVariation, Variation};

use crate::StudyError;
use crate::axis_sim::suite::{AxisSimError, TestRig};
use crate::axis_sim::{Kind, design};
use crate::study;
use wheeleg_config::AxisConfig;
use wheeleg_plant::axis::Axis;

/// Contents of `summary.json`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Cases<'a> {
    /// One object per case that was played or is not feasible.
    pub cases: &'a [Row],
    /// Statistics of the random combinations, one object per axis and controller.
    pub judged: &'a [Judged],
    /// Why cases failed that could not be simulated to their end; they are not among `cases`.
    pub failure: Option<String>,
}

impl study::Summary for Cases<'_> {
    const SCHEMA: &'static str = "wheeleg.compare/3";
}

/// An axis that cannot be compared: names the file, field, value and range.
#[must_use]
pub fn axis_error(file: &str, e: &AxisSimError) -> StudyError {
    let help = match e {
        AxisSimError::Unphysical { help, .. } => help,
        _ => "change the axis file to data within these limits",
    };
    StudyError::refused(format!("the axis `{file}` cannot be used: {e}"), help)
}

/// Loads an axis and derives its gains for every controller.
///
/// # Errors
/// [`StudyError`] if the axis cannot be read, or a board refuses its gains.
pub fn load(name: &str, kinds: &[Kind]) -> Result<AxisConfig, StudyError> {
    let config = AxisConfig::load(name)?;
    for kind in kinds {
        TestRig::new(&config.axis, &design(&config.axis, *kind), 0)
            .map_err(|e| axis_error(name, &e))?;
    }
    Ok(config)
}

/// Refuses a variation that this axis's plant cannot have, as its file would be refused with it.
///
/// # Errors
/// [`StudyError`] with the fields of the file, or with what the plant refuses.
pub fn ensure_playable(config: &AxisConfig, variation: Variation) -> Result<(), StudyError> {
    let plant = variation.factors(&config.axis).plant(&config.axis);
    let Err(e) = Axis::new(&plant) else {
        return Ok(());
    };
    variation.ensure_possible(config)?;
    Err(axis_error(&config.name, &e.into()))
}
