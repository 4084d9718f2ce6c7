//! The one place where left and right differ.
//!
//! Both legs have the same model; the right one lives in a frame mirrored in Y
//! (model.md §1). Foot positions in the robot's axes (X forward, Y left, Z up)
//! change the sign of Y on their way into and out of the right leg's frame;
//! strokes are equal on both sides.

use crate::contact::Side;

/// Y of the robot's axes to Y of the leg's own frame, and back.
#[must_use]
pub fn leg_y(side: Side, y: f32) -> f32 {
    match side {
        Side::Left => y,
        Side::Right => -y,
    }
}
/// TEMP
pub fn foot_of_strokes(_s: Side, _x: [f32; 3]) -> Option<[f32; 3]> {
    None
}
/// TEMP
pub fn strokes_of_foot(_s: Side, _x: [f32; 3], _v: [f32; 3]) -> Option<([f32; 3], [f32; 3])> {
    None
}
