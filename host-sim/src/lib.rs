//! The `wheeleg` program as a library: scenarios and robots, the simulation
//! loops, telemetry, analysis and reports.
//!
//! The data's way: a [`config::Scenario`] and a [`config::RobotConfig`] go into
//! [`sil::run`], which writes typed samples into a [`telemetry::Recorder`].
//! [`analysis`] compares the recording with the paper's targets and
//! [`report`] draws it. [`cli`] is the command line on top.

pub mod analysis;
pub mod bench;
pub mod check;
pub mod cli;
pub mod compare;
pub mod config;
pub mod delay;
pub mod error;
pub mod export;
pub mod faults;
pub mod figures;
pub mod hil;
pub mod interface;
mod output;
pub mod pil;
pub mod report;
pub mod run;
pub mod sil;
pub mod telemetry;
pub mod tune;

pub use error::SimError;
