//! Telemetry of the master: one record of fixed size per bus cycle.

use wheeleg_protocol::{LinkQuality, NODES, SlotReply, SyncSlots};

use crate::behaviour::Tally;
use crate::contact::FootSwitches;
use crate::event::HoldReason;
use crate::setpoint::{Acts, Phase, WHEELS, WalkPlan};

/// Counts since start-up. Counters wrap; those of the protocol crate stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Cycles in which each node did not answer.
    pub missed: [u32; NODES],
    /// Replies to a cycle other than the running one.
    pub stale_replies: u32,
    /// Valid frames that do not match anything the master waits for.
    pub unexpected: u32,
    /// Acyclic requests sent, repeats included.
    pub requests: u32,
    /// Acyclic requests that were never answered.
    pub unanswered: u32,
    /// Sets of set-points lost between layers 1 and 0.
    pub lost_setpoints: u32,
    /// Sets of feedback lost between layers 0 and 1.
    pub lost_feedback: u32,
    /// Telemetry records lost before this one.
    pub lost_records: u32,
    /// Events lost.
    pub lost_events: u32,
    /// How often each behaviour has acted.
    pub behaviours: Tally,
    /// Frames and frame errors seen on the bus.
    pub link: LinkQuality,
}

/// One bus cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Cycle number since start-up; its low 16 bits are those of SYNC.
    pub cycle: u32,
    /// Start of the cycle, µs.
    pub time_us: u64,
    /// Phase of the motion.
    pub phase: Phase,
    /// Step of the gait, from 0.
    pub step: u16,
    /// Whether all axes are armed.
    pub armed: bool,
    /// Whether the E-stop is latched at the end of the cycle: from the next SYNC on its bit is sent to all boards,
    /// until `ClearFault`.
    pub emergency_stop: bool,
    /// Why all axes hold, if they do.
    pub hold: Option<HoldReason>,
    /// Set-points sent in this cycle, raw as on the wire.
    pub slots: SyncSlots,
    /// Reply of each node in this cycle; `None` if there was none.
    pub replies: [Option<SlotReply>; NODES],
    /// Switches of the left and right foot that count, in each leg's frame: without those that are found stuck closed,
    /// which the replies have.
    pub feet: [Option<FootSwitches>; WHEELS],
    /// Bearing of the touching side of each foot in the robot's frame, rad (see [`crate::contact`]).
    pub bearing_rad: [Option<f32>; WHEELS],
    /// Mean wheel travel since start-up, µm.
    pub travel_um: i64,
    /// Plan of the walk in this cycle, if one is under way.
    pub walk: Option<WalkPlan>,
    /// State of the behaviours at the end of the cycle.
    pub acts: Acts,
    /// Counters at the end of the cycle.
    pub counters: Counters,
}
