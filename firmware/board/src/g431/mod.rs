//! The STM32G431CB. Register names as in RM0440; `BOARD.md` says which peripherals are used, and why.
#![allow(
    unsafe_code,
    reason = "registers, interrupt handlers, memory that DMA shares"
)]

#[cfg(feature = "outputs")]
pub mod adc;
#[cfg(feature = "outputs")]
pub mod board;
mod breaks;
#[cfg(feature = "outputs")]
pub mod bridge;
#[cfg(feature = "outputs")]
pub mod bus;
pub mod clock;
#[cfg(feature = "outputs")]
pub mod encoder;
pub mod fatal;
pub mod flash;
#[cfg(feature = "hil")]
pub mod hil;
pub mod identity;
#[cfg(feature = "outputs")]
pub mod inhibit;
#[cfg(feature = "outputs")]
pub mod latch;
mod memory;
#[cfg(feature = "mutant")]
mod mutant;
#[cfg(feature = "outputs")]
pub mod parameters;
pub mod pins;
pub mod power;
#[cfg(any(feature = "outputs", feature = "hil"))]
pub mod slot;
#[cfg(feature = "outputs")]
pub mod start;
#[cfg(feature = "outputs")]
pub mod tick;
#[cfg(any(feature = "outputs", feature = "hil"))]
pub mod timebase;
#[cfg(feature = "outputs")]
pub mod valves;
pub mod watchdog;

#[cfg(feature = "outputs")]
pub use board::G431;
pub use stm32_metapac as pac;

#[cfg(all(feature = "outputs", feature = "hil"))]
compile_error!("a hardware-in-the-loop image must not contain the code that drives outputs");
