//! The operator's lease of control: a person drives the robot only while they are known to see it. The master itself
//! notices when they are gone, not the network in front of it.

use super::{Layer0, Power};
use crate::command::Command;
use crate::config::{OPERATOR_TIMEOUT_MAX_US, OPERATOR_TIMEOUT_MIN_US};
use crate::dispatcher::Refusal;
use crate::event::{Events, HoldReason};

/// Client number of the operator, who may hold control.
pub const OPERATOR_CLIENT: u8 = 2;
/// Client number of everybody else at the console, who may only stop.
pub const STOP_CLIENT: u8 = 3;
/// A lease that lasts from one view of the robot to the next.
#[derive(Clone, Copy, Debug)]
pub struct Lease {
    timeout_us: u64,
    /// Newest master time that the holder has seen; `None`: nobody has control.
    seen_us: Option<u64>,
}

impl Lease {
    /// Not held; lost after `timeout_us`, which is limited to [`OPERATOR_TIMEOUT_MIN_US`] and
    /// [`OPERATOR_TIMEOUT_MAX_US`].
    #[must_use]
    pub fn new(timeout_us: u32) -> Self {
        Self {
            timeout_us: timeout_us
                .clamp(OPERATOR_TIMEOUT_MIN_US, OPERATOR_TIMEOUT_MAX_US)
                .into(),
            seen_us: None,
        }
    }

    /// Whether the operator has control.
    #[must_use]
    pub const fn is_held(&self) -> bool {
        self.seen_us.is_some()
    }

    /// Newest master time that the holder has seen, µs; `None`: nobody has control.
    #[must_use]
    pub const fn seen_us(&self) -> Option<u64> {
        self.seen_us
    }

    /// The operator has seen the robot's state of time `seen_us`. A view older than the newest one, or in the future,
    /// has no effect.
    pub fn beat(&mut self, seen_us: u64, now_us: u64) {
        if let Some(newest) = &mut self.seen_us
            && seen_us <= now_us
        {
            *newest = seen_us.max(*newest);
        }
    }

    /// Begins the lease. A holder that asks again has not thereby seen anything new.
    fn take(&mut self, now_us: u64) {
        self.seen_us.get_or_insert(now_us);
    }

    fn release(&mut self) {
        self.seen_us = None;
    }

    /// Ends a lease whose holder has seen nothing new for too long; returns true if it ends now.
    fn expire(&mut self, now_us: u64) -> bool {
        let lost = self
            .seen_us
            .is_some_and(|seen| now_us.saturating_sub(seen) > self.timeout_us);
        if lost {
            self.release();
        }
        lost
    }
}

impl Layer0 {
    /// The operator's lease, read-only.
    #[must_use]
    pub const fn lease(&self) -> &Lease {
        &self.lease
    }

    /// See [`Lease::beat`].
    pub fn beat(&mut self, seen_us: u64, now_us: u64) {
        self.lease.beat(seen_us, now_us);
    }

    /// Whether a client may give this command. An E-stop is not checked: anybody may stop.
    ///
    /// # Errors
    /// [`Refusal::NotInControl`].
    pub fn may_command(&self, client: u8, command: &Command) -> Result<(), Refusal> {
        let takes = matches!(command, Command::TakeControl);
        let leases = takes || matches!(command, Command::ReleaseControl);
        let may = match client {
            OPERATOR_CLIENT => takes || self.lease.is_held(),
            STOP_CLIENT => false,
            // A scenario, or a service tool beside it, needs no lease and can hold none.
            _ => !leases,
        };
        if may {
            Ok(())
        } else {
            Err(Refusal::NotInControl)
        }
    }

    pub(super) fn take_control(&mut self, now_us: u64) {
        self.lease.take(now_us);
    }

    /// # Errors
    /// [`Refusal::Moving`]: nobody would watch the motion under way.
    pub(super) fn release_control(&mut self) -> Result<(), Refusal> {
        if self.power != Power::Disarmed && self.setpoints.phase.is_moving() {
            return Err(Refusal::Moving);
        }
        self.lease.release();
        Ok(())
    }

    /// Stops a robot whose operator is gone. Returns true if they have just gone: then their commands must not be
    /// executed any more, either.
    pub fn watch_operator(&mut self, now_us: u64, events: &mut Events) -> bool {
        let lost = self.lease.expire(now_us);
        if lost && self.power != Power::Disarmed {
            self.hold_all(HoldReason::OperatorLost, now_us, events);
        }
        lost
    }
}
