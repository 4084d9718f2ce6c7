//! The joint board: one pneumatic cylinder with four on/off valves.

mod air;
mod no_motion_detector;
mod node;
mod outputs;
mod precharge;
mod reference;
mod requests;
mod settings;

#[cfg(test)]
mod foot_tests;
#[cfg(test)]
mod integrity_tests;

pub use no_motion_detector::MotionAccount;
pub use node::JointNode;
pub use settings::{JointSettings, TickSettings};
