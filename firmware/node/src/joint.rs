//! The joint board: one pneumatic cylinder with four on/off valves.

mod node;
mod reference;
mod requests;
mod settings;

pub use node::JointNode;
pub use settings::JointSettings;
