//! The bounds of a comparison: the fastest steps of its axes.

use wheeleg_config::AxisConfig;
use wheeleg_studies::StudyError;
use wheeleg_studies::compare::{Move, axis_error, fastest_steps};
use wheeleg_studies::study::{Ended, Progress};

use super::Options;

/// The bounds of all axes, of a comparison with steps; none once it is stopped.
pub(super) fn all(
    options: &Options,
    configs: &[AxisConfig],
    progress: &Progress,
) -> Result<Vec<[Option<[f64; 2]>; 2]>, StudyError> {
    let wanted = options
        .moves
        .as_ref()
        .is_none_or(|m| m.iter().any(|m| matches!(m, Move::Step20 | Move::Step100)));
    let none = vec![[None; 2]; configs.len()];
    if !wanted {
        return Ok(none);
    }
    let runs = if options.quick { 480 } else { 1500 };
    let found = progress.all("bounds", configs, |config| {
        fastest_steps(&config.axis, runs, progress).map_err(|e| axis_error(&config.name, &e))
    });
    let found = Ended::kept(found)?;
    // A search that was broken off has found no bound.
    Ok(found.filter(|_| !progress.is_stopped()).unwrap_or(none))
}
