//! Simulated time and the clocks of the boards.

use wheeleg_units::Micros;

/// Nanoseconds in a microsecond.
pub(super) const NS_PER_US: u64 = 1_000;

/// A time of the simulation as a board counts it.
pub(super) fn micros(ns: u64) -> Micros {
    // The boards' clocks are 32-bit microsecond counters and wrap.
    Micros((ns / NS_PER_US) as u32)
}
