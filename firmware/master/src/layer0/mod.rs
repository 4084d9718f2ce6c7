//! Layer 0.
pub mod liveness;
pub mod odometry;
pub mod reflex;
