//! Limits of the parameters that a joint board gets from its axis.

use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::param::JointParam;

use super::Broken;
use crate::derived::{DERIVED, limits};
use crate::quantity::{brief, suffix};
use crate::reader::range;

/// A quantity computed from several fields, within the limits of the board's parameter.
pub(super) fn within_limits(axis: &AxisParams, parameter: JointParam) -> Option<Broken> {
    let derived = DERIVED.iter().find(|row| row.parameter == parameter)?;
    if derived.fits(axis) {
        return None;
    }
    let row = parameter.info();
    let [low, high] = limits(parameter);
    Some(Broken {
        figures: format!(
            "together they make its `{}` {}{}",
            row.name,
            brief(derived.value(axis)),
            suffix(row.unit)
        ),
        offers: Vec::new(),
        words: format!(
            "`{}` is allowed from {}: {}",
            row.name,
            range(low, high, row.unit),
            row.text
        ),
    })
}
