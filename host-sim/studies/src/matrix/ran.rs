//! What a run of a row leaves for measuring and judging.

use super::operator::Intrusion;
use wheeleg_config::faults::FaultSpec;
use wheeleg_sim::{LineAudit, SimError};
use wheeleg_telemetry::Recording;

/// E-stop after the instant, s.
pub(super) const ESTOP_S: f64 = 0.1;

/// A run of a row.
pub(super) struct Ran {
    pub(super) at_s: f64,
    pub(super) faults: Vec<FaultSpec>,
    pub(super) recording: Recording,
    pub(super) line: LineAudit,
    /// Arming was asked for when every fault was over.
    pub(super) arming_asked: bool,
    /// Frames that had to have no effect.
    pub(super) intrusion: Option<Intrusion>,
    /// From power-up on.
    pub(super) outputs: Outputs,
    /// The run ended before its time, and why.
    pub(super) error: Option<SimError>,
}

/// What the joint boards had on their outputs from power-up on, in the time of the start-up, too.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Outputs {
    /// Ticks that were looked at, of all joints.
    pub(super) ticks: u64,
    /// Ticks among them with a valve energised, or under control.
    pub(super) driven: u64,
}
