//! The robot and its ground as other programs see them.
//!
//! [`urdf`] writes the robot as a tree of links and joints. [`Scene`] goes with a log and adds the
//! channels that viewers know: every link's frame, every joint's position, ground, contact forces,
//! events ([`Derived`](wheeleg_telemetry::Derived)). Names are those of the URDF.
//!
//! # Glossary
//!
//! * **link**: a rigid body of the URDF, or a massless frame
//! * **joint**: connection of two links: a cylinder, a wheel, a passive hinge, or fixed
//! * **tree**: all links and joints, the yaw mechanism's loop cut open
//! * **frame**: pose of a link
//! * **scene**: ground, shapes and forces, as primitives

mod error;
mod frames;
mod geometry;
mod ground;
mod json;
mod log;
mod messages;
mod shapes;
mod tree;
pub mod urdf;

pub use error::SceneError;
pub use log::Scene;
