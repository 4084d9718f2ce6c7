//! The wheel board: one DC motor with encoder under the HCTL-1100's control laws; the first wheel also has the
//! supply-pressure switch and the dump valve.

mod encoder;
mod motion;
mod node;
mod outputs;
mod requests;
mod settings;

#[cfg(test)]
mod integrity_tests;

pub use node::WheelNode;
pub use settings::WheelSettings;
