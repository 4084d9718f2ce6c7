//! The fastest steps of an axis with perfect knowledge of the plant.

use wheeleg_config::AxisConfig;
use wheeleg_plant::axis::AxisParams;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::suite::{AxisSimError, TestRig};
use wheeleg_studies::axis_sim::{Kind, design, optimal};
use wheeleg_studies::compare::{Move, STEP_S, Sizes, axis_error};
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
    if !wanted || progress.is_stopped() {
        return Ok(none);
    }
    let runs = if options.quick { 480 } else { 1500 };
    let found = progress.all("bounds", configs, |config| {
        bounds(&config.axis, runs, progress).map_err(|e| axis_error(&config.name, &e))
    });
    Ok(Ended::kept(found)?.unwrap_or(none))
}

/// The fastest large and small step of an axis, retracting and extending, from the rest in which the
/// predictive controller begins them. Useless once the comparison is stopped.
fn bounds(
    sheet: &AxisParams,
    runs: u32,
    progress: &Progress,
) -> Result<[Option<[f64; 2]>; 2], AxisSimError> {
    let go_on = || !progress.is_stopped();
    let sizes = Sizes::of(sheet);
    let [low_m, high_m] = sizes.large_m;
    let pairs = [[low_m, high_m], [high_m - sizes.small_m, high_m]];
    let mut found = [None; 2];
    for (bound_s, [from_m, to_m]) in found.iter_mut().zip(pairs) {
        let mut rig = TestRig::new(sheet, &design(sheet, Kind::Predictive), 1)?;
        rig.step(to_m, STEP_S)?;
        let mut fastest = |target_m: f64| -> Result<f64, AxisSimError> {
            let bench = rig.bench();
            let bound =
                optimal::fastest_while(bench.axis(), &bench.state, target_m, 1, runs, &go_on)?;
            rig.step(target_m, STEP_S)?;
            Ok(bound.settle_s)
        };
        let both = [fastest(from_m)?, fastest(to_m)?];
        // A search that never settled found no bound.
        *bound_s = both
            .iter()
            .all(|s| *s < optimal::HORIZON_S - 0.1)
            .then_some(both);
    }
    Ok(found)
}
