//! Results of a run of a row, for measuring and judging.

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
    /// Arming was requested when every fault was over.
    pub(super) arming_asked: bool,
    /// Frames that must have no effect.
    pub(super) intrusion: Option<Intrusion>,
    /// From power-up on.
    pub(super) outputs: Outputs,
    /// The run ended before its time, and why.
    pub(super) error: Option<SimError>,
}

/// Outputs of the joint boards from power-up on, start-up included.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Outputs {
    /// Checked ticks, of all joints.
    pub(super) ticks: u64,
    /// Ticks among them with a valve energised, or under control.
    pub(super) driven: u64,
}
