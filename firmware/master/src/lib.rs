//! Master of the robot: layer 0 (drivers, bus cycle, reflexes), layer 1 (gait
//! and trajectory), the dispatcher of user commands and the RT-FIFOs between
//! them.
//!
//! `no_std`, without heap, bounded in time and memory, never panics. Time is
//! an argument: a monotonic count of microseconds.
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

pub mod argument;
pub mod command;
pub mod config;
pub mod contact;
pub mod dispatcher;
pub mod event;
pub mod fifo;
pub mod finding;
pub mod layer0;
pub mod layer1;
pub mod master;
pub mod mirror;
pub mod setpoint;
pub mod telemetry;

pub use config::MasterConfig;
pub use master::{Master, TxBytes};
