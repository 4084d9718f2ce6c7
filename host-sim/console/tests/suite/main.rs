//! The server over real sockets. Effects on the robot are judged in master time; wall-clock time only bounds
//! how long a test may take.

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
