//! Hardware in the loop: the application on a bench board, sensors and valves on
//! a serial port, the plant in this program.
//!
//! # Pacing
//!
//! The simulator leads. Every tick is one request with the inputs latched at its
//! edge and one reply with the outputs, and simulated time stands still until
//! the reply is there. So a run gives the same bits at any speed of the port, and
//! a slow port makes it slow, never wrong. Real time is no requirement: the board
//! has no output that could move anything (its image says so when the session
//! opens, and is refused otherwise).
//!
//! What a real-time loop would show, overruns, is measured on the board itself:
//! it times the work of each tick on its own clock and latches the fault of the
//! application when a tick takes longer than its period. That fault is in the log.
//!
//! # Latency
//!
//! A round trip costs the time of about 30 + 60 bytes on the line (8 ms at
//! 115 200 Bd, 1 ms at 1 MBd) and the latency of the USB bridge, 1 to 16 ms.
//! One joint takes some 20 exchanges in a bus cycle of 10 ms: ten ticks and the
//! frames that it hears. [`SerialLine::statistics`] tells what they took.
//!
//! # Loss
//!
//! A port that vanishes, or a board that stays silent longer than
//! [`HilOptions::patience`], ends the run with an error; what was logged up to
//! there is complete. The board waits for a new session, outputs nowhere.

mod serial;

pub use serial::{HilOptions, SerialLine, Statistics, connect};
