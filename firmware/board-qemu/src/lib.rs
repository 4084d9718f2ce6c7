//! Board support for QEMU's `mps2-an386` (Cortex-M4).
//!
//! The images run the applications of `wheeleg-node` on a CPU model that is
//! independent of the one that runs the images of the real board. Sensors and
//! outputs travel in messages (`wheeleg-remote`); this crate adds the way the
//! messages take and the clock that times the work of a tick:
//!
//! * `qemu-joint` and `qemu-wheel` exchange messages by semihosting on standard input and
//!   output of the emulator. The CPU stands still in a semihosting call, so that
//!   waiting costs no instruction and a run is the same every time.
//! * `qemu-hil-joint` exchanges them through a UART of the machine, as a
//!   hardware-in-the-loop image does on a bench board.
//!
//! An image in which a panic can be reached does not link: the panic handler
//! calls a function that exists nowhere.
//!
//! # Glossary
//!
//! * **semihosting**: an instruction by which a program on an emulator calls the host
//! * **HIL**: hardware in the loop: an image on a bench board, with sensors and valves simulated
//! * **simulator**: the program that sends requests and gets one reply each
#![no_std]
#![allow(
    unsafe_code,
    reason = "semihosting calls, registers of the machine, the panic handler that must not link"
)]
#![deny(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic
)]

#[cfg(target_os = "none")]
mod never_panics;
#[cfg(target_os = "none")]
pub mod semihosting;
#[cfg(target_os = "none")]
pub mod stopwatch;
#[cfg(target_os = "none")]
pub mod uart;

#[cfg(target_os = "none")]
pub mod identity;
#[cfg(target_os = "none")]
mod image;
#[cfg(target_os = "none")]
pub use image::{run_on_semihosting, run_on_uart};
