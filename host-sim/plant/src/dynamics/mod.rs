//! Rigid-body dynamics by the natural orthogonal complement.
//!
//! * [`noc`]: the readable reference, block by block as in the paper (leg 36 × 3, half robot
//!   48 × 4), with the corrected equations. [`printed`] holds the paper's printed variants.
//! * [`floating`]: the engine the simulator steps: the whole robot with a floating chassis,
//!   fourteen velocities, both ways.
//!
//! Positive cylinder forces extend their cylinder. Gravity is a vector, so a slope is a tilted
//! gravity.

mod error;
pub mod floating;
pub mod noc;
mod params;
pub mod printed;

pub use error::{DynamicsError, finite};
pub use params::{BodyParams, HalfRobotParams, LegBodies, RobotDynamicsParams};
