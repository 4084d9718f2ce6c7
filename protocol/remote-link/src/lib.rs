//! Messages between the simulator and a board outside of it.
//!
//! A board outside is the firmware image on an emulated processor, the same application on another emulator,
//! or a bench board whose sensors and valves travel over a serial line. The simulator asks, the board
//! answers; exactly one [`Reply`] follows every [`Request`], in order. A program that hosts several boards
//! distinguishes them by the index in the frame.
//!
//! # Course of a session
//!
//! 1. [`Request::Hello`]: versions are compared, the image names itself.
//! 2. [`Request::Store`] (any number): contents of the parameter store.
//! 3. [`Request::PowerUp`]: straps and unique id are set, the processor leaves
//!    reset and runs its start-up code. The simulator's time zero is the first
//!    edge of the board's tick timer.
//! 4. [`Request::Run`] at every event that concerns the board: arrived bytes, or a tick edge with the inputs
//!    latched at it. The board runs to the given instant and answers with its outputs from then on (after an
//!    edge: those that the tick before it prepared) and with the transmissions that it has scheduled.
//! 5. [`Request::Hook`] for fault injection, [`Request::Bye`] at the end.
//!
//! In one `Run`, bytes come before the edge: a byte whose end falls on the
//! instant of the edge has been received when the tick starts.
//!
//! Times are nanoseconds since the simulator's time zero. A board that counts
//! microseconds takes `ns / 1000` and keeps the low 32 bits.
//!
//! # Framing
//!
//! `COBS(index, postcard(message), CRC-32C) 0x00`, see [`frame`]. The stream can be joined anywhere: bytes
//! before the first zero are dropped.
//!
//! # Glossary
//!
//! * **edge**: the instant at which a tick begins
//! * **hook**: a way to make a remote board fail
//! * **postcard**: the encoding of the messages: variable-length integers, fields in order
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

#[cfg(any(feature = "image", all(unix, feature = "wait")))]
extern crate std;

pub mod frame;
#[cfg(feature = "image")]
pub mod image;
mod reply;
mod request;
#[cfg(all(unix, feature = "wait"))]
pub mod wait;

pub use frame::{Deframer, FrameError, encode};
pub use reply::{
    Figures, Halt, Hello, Image, Outputs, Ran, Reply, SOFTWARE_RESET, Sent, Trip, WATCHDOG_RESET,
};
pub use request::{Hook, Inputs, Nonvolatile, Power, Request, Run, Straps, Switches};

/// Version of this interface; both sides must have the same.
pub const LINK_VERSION: u16 = 5;

/// Most bus bytes in one [`Run`]: 1.28 ms of two drivers at 1 Mbit/s.
pub const MAX_RECEIVED: usize = 256;

/// Most bytes of one transmission (the longest bus frame has 200).
pub const MAX_SENT: usize = 200;

/// Most transmissions in one [`Ran`].
pub const MAX_TRANSMISSIONS: usize = 2;

/// Most bytes of the parameter store in one message.
pub const MAX_NONVOLATILE: usize = 128;

/// Longest text, bytes.
pub const MAX_TEXT: usize = 192;

/// A short text.
pub type Text = heapless::String<MAX_TEXT>;

/// A text cut to the available length, at a character boundary.
#[must_use]
pub fn text(text: &str) -> Text {
    let mut out = Text::new();
    for c in text.chars() {
        if out.push(c).is_err() {
            break;
        }
    }
    out
}
