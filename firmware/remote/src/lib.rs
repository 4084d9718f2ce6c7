//! Board applications whose sensors and outputs travel in messages.
//!
//! The applications of `wheeleg-node` run here unchanged. The difference to a board is behind their hardware
//! traits: the inputs of a tick come with the request that starts it, and the outputs that the tick presets
//! go back with the reply. Nothing here can reach a pin.
//!
//! Two kinds of images are built on it: the ones for QEMU, where the messages go
//! through a pair of pipes, and hardware-in-the-loop images, where they go over a
//! serial port.
//!
//! The messages are those of `wheeleg-remote-link`, one reply to every request.
//! Simulated time is an argument of the request: a board waits for as long as
//! the simulator likes, which decides how fast time runs. A board whose
//! simulator falls silent stands still, and it has no output that could move
//! anything.
//!
//! No floating point, no heap, and no panic for any input.
//!
//! # Glossary
//!
//! * **remote board**: a node whose sensors and outputs travel in messages
//! * **simulator**: the program at the other end, which sends the requests
//! * **edge**: the instant at which a tick begins: outputs take effect, inputs are latched
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

pub mod board;
pub mod frame;
pub mod pins;
pub mod serve;
pub mod session;
pub mod store;

pub use board::{Board, RemoteJoint, RemoteWheel};
pub use pins::{JointPins, WheelPins};
pub use serve::{Stream, serve};
pub use session::{Session, Stopwatch};
