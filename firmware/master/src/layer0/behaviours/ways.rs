//! How far the wheels have gone, and with them the ground below a foot.

use super::Senses;
use crate::contact::Side;
use crate::setpoint::WHEELS;

/// Seven parts of a foot's way are that of its own wheel, one that of the other: feet are 0.40 m
/// apart, wheels 0.56 m.
const OWN_OF_8: i64 = 7;

/// Travel of the wheels when it was last looked at, µm; `None`: not yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ways(Option<[i64; WHEELS]>);

impl Ways {
    /// What each wheel has gone since the last look, µm; nothing at the first.
    pub(super) fn since(&mut self, senses: &Senses) -> [i64; WHEELS] {
        let mut ways = senses.wheels.map(|wheel| wheel.travel_um);
        let before = self.0.replace(ways).unwrap_or(ways);
        for (way, before) in ways.iter_mut().zip(before) {
            *way = way.saturating_sub(before);
        }
        ways
    }
}

/// Way of the ground below a foot, from those of the wheels, µm.
pub(super) fn at_foot_um(side: Side, [left, right]: [i64; WHEELS]) -> i64 {
    let (own, other) = match side {
        Side::Left => (left, right),
        Side::Right => (right, left),
    };
    own.saturating_mul(OWN_OF_8).saturating_add(other) >> 3_u32
}
