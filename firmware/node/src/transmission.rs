//! What a board hands to its transmitter.

use heapless::Vec;
use wheeleg_protocol::MAX_ENCODED;
use wheeleg_units::Micros;

/// One encoded frame and when its first bit goes on the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transmission {
    /// Start, in the board's microseconds (modulo 2^32).
    pub start_at: Micros,
    /// It belongs in the board's own slot; if sent later it would fall into other boards' slots.
    pub in_slot: bool,
    /// The frame with both delimiters.
    pub bytes: Vec<u8, MAX_ENCODED>,
}
