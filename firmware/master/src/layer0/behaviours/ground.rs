//! How far the wheels have moved, and where the feet are relative to the ground that passes below.

use wheeleg_units::PositionMm;

use super::{SIDES, Senses};
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

/// Ways of the feet over the ground, as seen from the robot: how far each has moved ahead and to the left.
///
/// A foot that keeps its place on the ground has no way, however the robot moves, as long as no wheel slips.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::layer0) struct FootWays {
    wheels: Ways,
    /// Where the feet were at the last call, m from their yaw axes; `None` if a joint of the leg was not heard.
    feet_m: [Option<[f32; 2]>; WHEELS],
    ways_um: [[i64; 2]; WHEELS],
}

impl FootWays {
    /// One cycle; returns the ways so far, µm.
    pub(in crate::layer0) fn update(
        &mut self,
        geometry: &WalkGeometry,
        senses: &Senses,
    ) -> [[i64; 2]; WHEELS] {
        let robot = moved(geometry, self.wheels.since(senses));
        let feet = self.feet_m.iter_mut().zip(&mut self.ways_um);
        for (side, (foot, way)) in SIDES.into_iter().zip(feet) {
            let here = sensed_foot_m(geometry, senses, side);
            let Some((here, before)) = here.zip(core::mem::replace(foot, here)) else {
                continue;
            };
            let ground = robot.ground_m_s(geometry, side, before);
            for (axis, way) in way.iter_mut().enumerate() {
                let at = |of: [f32; 2]| of.get(axis).copied().unwrap_or(0.0);
                let step_m = at(here) - at(before) - at(ground);
                *way = way.saturating_add((step_m * 1e6) as i64);
            }
        }
        self.ways_um
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
