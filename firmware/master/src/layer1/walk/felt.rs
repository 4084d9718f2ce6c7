//! What a walk meets on uneven ground, and answers.

use crate::contact::Side;

/// Something met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Felt {
    /// A swinging foot ran against something: it is lifted higher, or set down there.
    Bump(
        /// Its leg.
        Side,
    ),
    /// A leg at its full length finds no ground: the nose goes down, then the foot is set nearer.
    NoGround(
        /// The leg.
        Side,
    ),
    /// A standing foot has lost the ground: it follows it.
    LostGround(
        /// Its leg.
        Side,
    ),
    /// No foot carries: the wheels slow down, so that the robot does not fall on its tail.
    TipGuard,
    /// No progress: the robot backs off, and lifts its feet higher.
    BackOff,
    /// No progress after several tries: the robot stands.
    Stuck,
}
