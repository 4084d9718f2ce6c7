//! The joint and wheel board applications, over embedded-hal traits.
//!
//! The same code runs on the board and on the host. A board owns one
//! [`joint::JointNode`] or [`wheel::WheelNode`] and calls, from interrupts of
//! falling priority:
//!
//! 1. `on_bus_bytes(bytes, t_end)` from the receiver (DMA idle or half/full),
//!    with the time at which the last of the bytes ended on the line;
//! 2. `tick(now)` from the sample timer, then `tick_done(end)` when it returns;
//! 3. `take_transmission()` after either: bytes to send and when to start.
//!
//! Inputs are latched at the start of a tick. Outputs are written in every tick, even on a fault, and take effect at
//! the next tick edge. Time is an argument: the low 32 bits of a microsecond counter, compared modulo 2^32.
//!
//! Nothing here panics for any input, allocates, blocks or uses floating point.
//!
//! # Glossary
//!
//! * **node**: the application of one board: sense, control, actuate, supervise, talk
//! * **mode**: what a node may do: DISARMED, ARMED, HOLD, EXHAUST, FAULT, …; one table says which mode may follow which
//! * **HOLD**: four valves shut, air trapped; a wheel ramps to a standstill
//! * **EXHAUST**: inlets shut, outlets open
//! * **latched**: of a fault: stays until it is cleared, even when its cause has gone
//! * **precharge**: filling both chambers before a joint moves
//! * **supervisor**: decides from sensors, link and outputs whether the mode must change
//! * **seal**: checksum of state between two ticks, which reveals a flipped bit
#![cfg_attr(not(test), no_std)]
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

pub mod acceptance;
mod board;
pub mod checksum;
pub mod clock;
pub mod debounce;
pub mod faults;
pub mod hardware;
pub mod joint;
pub mod log;
pub mod mode;
pub mod overrun;
pub mod parameters;
pub mod port;
pub mod sensor;
pub mod snapshot;
pub mod store;
pub mod supervisor;
pub mod time;
mod transmission;
pub mod wheel;

pub use board::NodeIdentity;
pub use transmission::Transmission;

use wheeleg_units::{Micros, Ticks};

/// Control tick of a joint board: 1 kHz.
pub const JOINT_TICK: Micros = Micros(1000);

/// Version of this firmware: major, minor, patch.
pub const FIRMWARE_VERSION: [u8; 3] = [0, 1, 0];

/// Samples for which a switch must be stable (ASSUMED: optical switches chatter
/// for less than 2 ms at a passing edge).
const SWITCH_TICKS: u8 = 3;

/// Joint ticks after which a self-test without enough good readings has failed.
const SELF_TEST_TICKS: Ticks = Ticks(500);

/// Why a board could not be constructed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// The address straps do not name a board of this kind.
    Address,
    /// The parameters contradict each other.
    Parameters,
}
