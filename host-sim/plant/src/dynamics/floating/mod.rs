//! The whole robot with a floating chassis: fourteen independent velocities.
//!
//! # Frames
//!
//! World: X, Y horizontal, Z up, at rest. Chassis frame B: origin in the middle of the wheel axle,
//! X forward, Y left, Z up. [`FloatingState::orientation`] takes chassis components to world
//! components.
//!
//! # Position
//!
//! Origin of B in the world (m), unit quaternion, cylinder lengths \[b2, b5, b6\] of the left and
//! the right leg (m), angle of the left and the right wheel against the chassis about +Y (rad;
//! rolling forward is positive).
//!
//! # Generalised velocity
//!
//! `ν = [ω (3), v (3), ḃ2L, ḃ5L, ḃ6L, ḃ2R, ḃ5R, ḃ6R, θ̇L, θ̇R]`: angular velocity of the chassis
//! and velocity of the origin of B, both **in chassis axes**, then the joints. It is not the
//! derivative of any position coordinates in its first six entries; `ν̇` is its component-wise
//! derivative, so the origin's acceleration in the world is R (v̇ + ω × v).
//!
//! # Quaternion
//!
//! q̇ = ½ q ∘ (0, ω). [`FloatingState::advanced`] moves along a constant twist exactly (a screw);
//! [`FloatingRobot::step_rk4`] integrates the four components and normalises once per stage and
//! step, which keeps its fourth order. A quaternion whose norm is off by more than
//! [`state::NORM_TOLERANCE`] is refused.
//!
//! # Generalised force
//!
//! Power is `ν · force`: moment about the origin of B and force on the chassis, both in chassis axes (zero
//! unless somebody pushes), cylinder forces (positive extends), wheel torques. A wheel torque acts
//! between chassis and wheel, so it needs no reaction entry of its own.
//!
//! # Bodies
//!
//! Chassis, six bodies a leg, two wheels, and two rotors. A rotor has inertia about the axle's
//! direction alone (its mass is the chassis's) and turns in space at i θ̇ about Y on top of the
//! chassis, for the reduction i. So it appears as J i² on θ, as J on the chassis's pitch, as J i
//! between them, and as a gyroscopic moment.
//!
//! The yaw loop O1–O3–O4 is inside each leg: its rates follow from ḃ2 through N (`MODEL.md`
//! section 4), so no loop constraint is left.
//!
//! * [`reference`]: the natural orthogonal complement, T 102 × 14, in world axes; readable;
//! * [`FloatingRobot`]: the same numbers from composite bodies in chassis axes and an arrow-shaped
//!   factorisation.

mod contact;
mod group;
mod kin;
mod leg;
mod mirror;
mod params;
pub mod reference;
mod robot;
mod solve;
pub mod state;

pub use contact::{Contacts, Wrench};
pub use kin::{FloatingKin, Momentum};
pub use params::FloatingParams;
pub use reference::{FloatingReference, FloatingSystem};
pub use robot::FloatingRobot;
pub use state::{DOF, FloatingState, Velocity};
