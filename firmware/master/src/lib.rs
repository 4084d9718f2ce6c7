//! Master of the robot: layer 0 (drivers, bus cycle, reflexes), layer 1 (gait and trajectory), the dispatcher of user
//! commands and the RT-FIFOs between them.
//!
//! `no_std`, without heap, bounded in time and memory, never panics. Time is an argument: a monotonic count of
//! microseconds.
//!
//! # Glossary
//!
//! * **layer 0**: drivers, bus cycle, safety and reflexes; works without layer 1
//! * **layer 1**: gait, trajectories and inverse kinematics
//! * **dispatcher**: routes coded commands to the layer that carries them out, and answers with a ticket
//! * **ticket**: number by which a command is answered: accepted, then done or refused
//! * **RT-FIFO**: bounded queue between two layers on which neither side waits
//! * **SYNC**: the frame that begins a bus cycle, with one slot of set-points for each node
//! * **slot**: place of a node in SYNC, and the time in which it replies
//! * **reflex**: a reaction of layer 0 to what the robot senses, without layer 1
//! * **behaviour**: a reflex of a walk, with a name, a priority, a switch and a counter
//! * **look-ahead**: the next command of a joint, announced before it takes effect
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
pub mod behaviour;
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
