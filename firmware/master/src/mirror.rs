//! The one place where left and right differ.
//!
//! Both legs have the same model; the right one uses a frame mirrored in Y (MODEL.md §1). Foot positions in the robot's
//! axes (X forward, Y left, Z up, from the leg's yaw axis O4) change the sign of Y on their way into and out of the
//! right leg's frame; strokes are equal on both sides.

use nalgebra::Vector3;
use wheeleg_kinematics::{FootState, LegGeometry, LegParameters};

use crate::contact::Side;

/// Largest excess over the stroke that still counts as inside, m: rounding of `f32` at the ends of the stroke, well
/// below the 15 µm of the potentiometer's converter.
const ROUNDING_M: f32 = 5.0e-6;

/// Converts Y from the robot's axes to the leg's own frame, and back.
#[must_use]
pub fn leg_y(side: Side, y: f32) -> f32 {
    match side {
        Side::Left => y,
        Side::Right => -y,
    }
}

/// The leg in `f32`. The foot may be as close to the yaw axis as the drawn-back horizontal cylinder puts it, less
/// rounding.
fn geometry(leg: &LegParameters<f32>) -> Option<LegGeometry<f32>> {
    let mut parameters = *leg;
    parameters.min_foot_radius_m -= ROUNDING_M;
    LegGeometry::new(parameters).ok()
}

/// Position of the foot in the robot's axes from O4, m, from strokes (s2, s5, s6) in m. `None` if the loop of the yaw
/// cylinder does not close.
#[must_use]
pub fn foot_of_strokes(
    leg: &LegParameters<f32>,
    side: Side,
    strokes_m: [f32; 3],
) -> Option<[f32; 3]> {
    let geometry = geometry(leg)?;
    let posture = geometry
        .posture(&geometry.lengths_from_strokes(strokes_m))
        .ok()?;
    let foot = posture.foot();
    Some([foot.x, leg_y(side, foot.y), foot.z])
}

/// Strokes (m) and their rates (m/s) for a foot at `position` (m) moving with `velocity` (m/s), both in the robot's
/// axes from O4. `None` if a stroke is out of its range or the foot is on the yaw axis.
#[must_use]
pub fn strokes_of_foot(
    leg: &LegParameters<f32>,
    side: Side,
    position: [f32; 3],
    velocity: [f32; 3],
) -> Option<([f32; 3], [f32; 3])> {
    let geometry = geometry(leg)?;
    let own = |[x, y, z]: [f32; 3]| Vector3::new(x, leg_y(side, y), z);
    let state = FootState {
        position: own(position),
        velocity: own(velocity),
        acceleration: Vector3::zeros(),
    };
    let leg = geometry.inverse_motion(&state).ok()?;
    let strokes = geometry.strokes_from_lengths(&leg.lengths);
    let inside = strokes
        .iter()
        .zip(geometry.parameters().stroke_m)
        .all(|(stroke, full)| *stroke >= -ROUNDING_M && *stroke <= full + ROUNDING_M);
    let [b2, b5, b6] = [leg.rates.x, leg.rates.y, leg.rates.z];
    inside.then_some((strokes, [b2, b5, b6]))
}
