//! Remote boards: the flashed images on an emulated STM32G431 ([`unicorn`]), the same
//! applications on QEMU ([`qemu`]), or on a bench board behind a serial port ([`serial`]).
//! Every remote board has a native twin, with which it is compared at every tick and frame.
//!
//! # Glossary
//!
//! * **SIL**: software in the loop: the application compiled for the host
//! * **PIL**: processor in the loop: the flashed image on an emulated processor
//! * **HIL**: hardware in the loop: an image on a bench board
//! * **remote board**: a board outside the simulator: PIL, QEMU or HIL
//! * **twin**: the native application beside a remote board, with the same inputs
//! * **lock-step**: the board waits for the simulator, the simulator for the board

mod channel;
pub mod choice;
mod compare;
mod cores;
mod error;
mod figures;
mod images;
mod line;
pub mod port;
#[cfg(unix)]
pub mod pty;
pub mod qemu;
mod remote_boards;
pub mod serial;
mod store;
mod transport;
pub mod unicorn;

pub use channel::{Channel, ChannelFigures, Count, Counts};
pub use choice::{NodeChoice, NodeKind, Nodes};
pub use compare::{Comparison, Difference};
pub use error::RemoteError;
pub use figures::{BoardFigures, PilSummary};
pub use images::ensure_same_sources;
pub use line::Line;
pub use remote_boards::RemoteBoards;
pub use transport::{Stream, Transport};
