//! Control laws of the robot's eight boards: pure functions of state and input,
//! in fixed point.
//!
//! * [`joint`]: proportional law with a fuzzy correction, rest detection,
//!   anti-windup; on [`fuzzy`] (the inference engine), [`rules`] (its tables)
//!   and [`velocity`] (the estimate of ė).
//! * [`valve`] and [`pwm`]: from a signed duty to the on-times of four on/off
//!   valves, with their switching delays compensated.
//! * [`wheel`]: the HCTL-1100's lead filter and its four modes.
//!
//! Sign conventions, units and rounding are those of [`wheeleg_units`]. There
//! is no clock: the length of a tick enters a configuration once, and every
//! call is one tick. No function of this crate panics, allocates or loops more
//! than its arrays are long.
#![no_std]
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

pub mod fuzzy;
pub mod joint;
pub mod pwm;
pub mod rules;
pub mod valve;
pub mod velocity;
pub mod wheel;
