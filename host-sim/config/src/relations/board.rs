//! What a joint board can be told of its axis.

use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::param::JointParam;

use super::Broken;
use crate::quantity::{brief, suffix};
use crate::reader::range;
use crate::told::{TOLD, limits};

/// A quantity that is made of several fields, within the limits of the board's parameter.
pub(super) fn told(axis: &AxisParams, parameter: JointParam) -> Option<Broken> {
    let told = TOLD.iter().find(|told| told.parameter == parameter)?;
    if told.fits(axis) {
        return None;
    }
    let row = parameter.info();
    let [low, high] = limits(parameter);
    Some(Broken {
        figures: format!(
            "together they make its `{}` {}{}",
            row.name,
            brief(told.value(axis)),
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
