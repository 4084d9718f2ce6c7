//! Leg geometry of the Wheeleg robot: position, velocity and acceleration, forward and inverse.
//!
//! Generic over the scalar ([`Scalar`]): `f32` on the master, `f64` in the simulated plant.
//! Lengths in metres, angles in radians, time in seconds; vectors are columns.
//!
//! One leg is two chains that share the leg's yaw axis O4:
//!
//! * [`r2p`]: yaw angle θ4, horizontal cylinder b5, vertical cylinder b6, which place the foot P;
//! * [`rpr`]: the yaw cylinder b2 between chassis and crank, a planar loop O1–O3–O4.
//!
//! [`LegGeometry`] joins them: [`LegGeometry::posture`] takes the three cylinder lengths to a
//! [`LegPosture`], [`LegGeometry::inverse`] takes a foot position back to lengths.
//!
//! # Frames
//!
//! F1 sits at the yaw cylinder's pivot O1 and F4 at O4 = O1 + [0.29, 0.40, 0] m; both have X
//! forward, Y left, Z up and are fixed to the chassis. The right leg uses the same equations with
//! Y mirrored; the mirror is the caller's.
//!
//! # Which θ3
//!
//! The paper uses one symbol for two angles. Here they are two types: [`Theta3`] is the relative
//! Denavit–Hartenberg angle between yaw rod and crank, [`Phi`] the absolute crank angle, with
//! φ = θ1 + θ3 − π = θ4 − π/2.
//!
//! # Errors
//!
//! No function returns NaN in an `Ok`: a non-finite argument or result, an open loop, a crank
//! without moment arm or a foot on the yaw axis is a [`KinematicsError`] that carries the offending
//! value. Functions without a `Result` (angle wrapping, strokes to lengths and back, [`printed`])
//! pass NaN and infinity on to the next one that has it.
//!
//! Source: Lacagnina, Muscato, Sinatra, *Kinematics, dynamics and control of a hybrid robot
//! Wheeleg*, Robotics and Autonomous Systems 45 (2003) 161–180, equations (1)–(39), corrected
//! where the printed form contradicts the paper's own tables. A star marks a corrected equation.
//! [`printed`] keeps the printed forms for diagnostics.
//!
//! # Glossary
//!
//! * **b2, b5, b6**: yaw, horizontal and vertical cylinder of a leg
//! * **stroke**: how far a piston is out of its fully retracted place
//! * **crank**: the part of the leg that the yaw cylinder turns about O4
//! * **posture**: angles and lengths of a leg for one set of strokes
//! * **closure**: the condition that a loop of links closes
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]
// `clippy::arithmetic_side_effects` is left out on purpose: it reports every operator on a generic
// scalar, and the scalars here are floating point, where arithmetic neither traps nor wraps.

mod angle;
mod error;
mod geometry;
mod leg;
mod lengths;
pub mod printed;
pub mod r2p;
pub mod rpr;

pub use angle::{Phi, Theta3, wrap_pi, wrap_two_pi};
pub use error::{Cylinder, KinematicsError, Quantity};
pub use geometry::{Closure, LegGeometry, LegParameters};
pub use leg::{FootState, JointAngles, LegPosture, LegRates};
pub use lengths::LegLengths;

/// The scalar of the kinematics: any real field that is `Copy`, in practice `f32` and `f64`.
pub trait Scalar: nalgebra::RealField + Copy {}
impl<T: nalgebra::RealField + Copy> Scalar for T {}

/// Converts a literal to the scalar, rounding to nearest.
pub(crate) fn lit<T: Scalar>(value: f64) -> T {
    nalgebra::convert(value)
}
