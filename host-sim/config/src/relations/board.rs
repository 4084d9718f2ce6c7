//! Limits of the parameters that a joint board gets from its axis.

use wheeleg_protocol::param::JointParam;

use super::{Bound, Broken, Facts, Offer};
use crate::derived::{DERIVED, limits};
use crate::quantity::{brief, suffix};
use crate::reader::range;

/// Volumes are given in m³, and a board has cm³.
const CM3: f64 = 1e-6;
/// The same of lengths.
const MM: f64 = 1e-3;

/// A quantity that is made of several fields, within the limits of the board's parameter.
pub(super) fn within_limits(f: &Facts<'_>, parameter: JointParam) -> Option<Broken> {
    let axis = f.axis?;
    let derived = DERIVED.iter().find(|row| row.parameter == parameter)?;
    if derived.fits(axis) {
        return None;
    }
    let row = parameter.info();
    let [low, high] = limits(parameter);
    let value = derived.value(axis);
    let (limit, [bound, against]) = match value > high {
        true => (high, [Bound::UpTo, Bound::From]),
        false => (low, [Bound::From, Bound::UpTo]),
    };
    let fields = derived.fields;
    let offers = match (parameter, fields) {
        // The sum of its fields.
        (JointParam::DeadVolumeA | JointParam::DeadVolumeB, _) => fields
            .iter()
            .filter_map(|path| {
                let own = f.si(path)? - (value - limit) * CM3;
                (own >= 0.0).then(|| Offer::new(f, path, bound, own))
            })
            .collect(),
        // The first over the second.
        (JointParam::SensorFullScale, [electrical, gain]) => vec![
            Offer::new(f, electrical, bound, limit * MM * f.si(gain)?),
            Offer::new(f, gain, against, f.si(electrical)? / (limit * MM)),
        ],
        _ => Vec::new(),
    };
    Some(Broken {
        figures: format!(
            "together they make its `{}` {}{}",
            row.name,
            brief(value),
            suffix(row.unit)
        ),
        offers: offers.into_iter().map(|offer| vec![offer]).collect(),
        words: format!(
            "its `{}` is allowed from {}: {}",
            row.name,
            range(low, high, row.unit),
            row.text
        ),
    })
}
