//! Fault memory of a board: what is latched, what was first, and when.

use wheeleg_protocol::{Fault, FaultBits};
use wheeleg_units::Micros;

/// First fault since the last clear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FirstFault {
    /// What happened.
    pub fault: Fault,
    /// When, in the board's microseconds (modulo 2^32).
    pub at: Micros,
}

/// Latched faults of one board.
///
/// `latched` bars arming until it is cleared; `sticky` keeps every fault since reset, for diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct FaultLog {
    latched: FaultBits,
    sticky: FaultBits,
    first: Option<FirstFault>,
}

impl FaultLog {
    /// No fault.
    pub const fn new() -> Self {
        Self {
            latched: FaultBits::NONE,
            sticky: FaultBits::NONE,
            first: None,
        }
    }

    /// Latches `fault`; returns true if it was not latched before.
    pub fn latch(&mut self, fault: Fault, at: Micros) -> bool {
        let new = !self.latched.contains(fault);
        self.latched.insert(fault);
        self.sticky.insert(fault);
        if self.first.is_none() {
            self.first = Some(FirstFault { fault, at });
        }
        new
    }

    /// Clears the latch and the first fault; the sticky set stays.
    pub fn clear(&mut self) {
        self.latched = FaultBits::NONE;
        self.first = None;
    }

    /// Faults latched now.
    pub const fn latched(&self) -> FaultBits {
        self.latched
    }

    /// Every fault since reset.
    pub const fn sticky(&self) -> FaultBits {
        self.sticky
    }

    /// The first fault since the last clear.
    pub const fn first(&self) -> Option<FirstFault> {
        self.first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_fault_survives_later_ones_until_cleared() {
        let mut log = FaultLog::new();
        assert!(log.latch(Fault::SensorRange, Micros(10)));
        assert!(!log.latch(Fault::SensorRange, Micros(20)));
        assert!(log.latch(Fault::LinkLost, Micros(30)));
        let first = log.first().unwrap();
        assert_eq!((first.fault, first.at), (Fault::SensorRange, Micros(10)));
        log.clear();
        assert!(log.latched().is_empty() && log.first().is_none());
        assert!(
            log.sticky().contains(Fault::SensorRange) && log.sticky().contains(Fault::LinkLost)
        );
    }
}
