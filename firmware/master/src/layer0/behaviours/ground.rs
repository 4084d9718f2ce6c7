//! How far the wheels have moved, and where the feet are relative to the ground that passes below.

use wheeleg_units::PositionMm;

use super::Senses;
use crate::contact::Side;
use crate::layer1::units::metres;
use crate::layer1::walk::{Twist, WalkGeometry};
use crate::mirror;
use crate::setpoint::{Cylinder, WHEELS};

/// Travel of the wheels at the last call, µm; `None` before the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ways(Option<[i64; WHEELS]>);

impl Ways {
    /// How far each wheel has moved since the last call, µm; zero at the first.
    pub(super) fn since(&mut self, senses: &Senses) -> [i64; WHEELS] {
        let mut ways = senses.wheels.map(|wheel| wheel.travel_um);
        let before = self.0.replace(ways).unwrap_or(ways);
        for (way, before) in ways.iter_mut().zip(before) {
            *way = way.saturating_sub(before);
        }
        ways
    }
}

/// Motion of the robot, m and rad, from the travel of its wheels, µm.
pub(super) fn moved(geometry: &WalkGeometry, ways_um: [i64; WHEELS]) -> Twist {
    Twist::of_wheels(geometry, ways_um.map(|um| um as f32 * 1e-6))
}

/// Position of a leg's foot, forward and left of its yaw axis, m, from the strokes of its yaw cylinder and b5.
pub(super) fn foot_m(
    geometry: &WalkGeometry,
    side: Side,
    [yaw, b5]: [PositionMm; 2],
) -> Option<[f32; 2]> {
    // The height does not matter: the vertical cylinder is parallel to the yaw axis.
    let [x, y, _] = mirror::foot_of_strokes(&geometry.leg, side, [metres(yaw), metres(b5), 0.1])?;
    Some([x, y])
}

/// The same from the boards' reports; `None` if one was never heard.
pub(super) fn sensed_foot_m(
    geometry: &WalkGeometry,
    senses: &Senses,
    side: Side,
) -> Option<[f32; 2]> {
    let stroke = |cylinder| Some(senses.joint(side, cylinder)?.stroke_mm);
    foot_m(
        geometry,
        side,
        [stroke(Cylinder::Yaw)?, stroke(Cylinder::Horizontal)?],
    )
}
