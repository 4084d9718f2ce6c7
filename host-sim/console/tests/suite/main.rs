//! The server over real sockets. What happens to the robot is judged in master time; the clock on
//! the wall only bounds how long a test may take.

mod api;
mod common;
mod control;
mod flood;
mod foxglove;
mod hostile;
mod latency;
mod looking;
#[cfg(unix)]
mod port;
mod protected;
mod recording;
mod threats;
