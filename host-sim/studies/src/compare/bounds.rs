//! The fastest steps of an axis with perfect knowledge of the plant.

use wheeleg_plant::axis::AxisParams;

use super::{STEP_S, Sizes};
use crate::axis_sim::suite::{AxisSimError, TestRig};
use crate::axis_sim::{Kind, design, optimal};
use crate::study::Progress;

/// The fastest large and small step of an axis, retracting and extending, from the rest in which the
/// predictive controller begins them; `None` if none was found. Useless once the comparison is stopped.
///
/// # Errors
/// [`AxisSimError`] if the plant leaves the range of its model.
pub fn fastest_steps(
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
