//! Link state machines: pure, with time as an argument.
//!
//! * [`LinkSupervisor`]: a node's watch over SYNC; [`NodeMonitor`]: the master's over replies.
//! * [`Requester`] and [`DuplicateFilter`]: the two ends of the acyclic service.
//! * [`SlotTiming`]: who may send when, and the bandwidth budget.

mod duplicate;
mod requester;
mod supervisor;
mod timing;

pub use duplicate::{DuplicateFilter, Verdict};
pub use requester::{GiveUp, Outcome, Refusal, Requester, RequesterConfig, Step};
pub use supervisor::{
    ADVANCE_MOST, ClearError, LinkLoss, LinkState, LinkSupervisor, NodeMonitor, WatchdogCycles,
};
pub use timing::{
    BAUD, CYCLE_US, CYCLIC_SHARE_PERMILLE, DISCOVERY_SLOTS, DUPLICATE_WINDOW_US, GAP_US,
    MAX_DEADLINE_CYCLES, SETTING_US, SlotTiming, TURNAROUND_US, deadline_is_live,
};
