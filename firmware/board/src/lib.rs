//! Board support of the joint and wheel boards, and the parts that every board shares.
//!
//! `BOARD.md` beside this crate holds the pin table and the use of each register. The modules outside
//! [`g431`] know no register: they build and are tested on the host, and serve any other board as well.
//!
//! | module | what |
//! |---|---|
//! | [`executive`] | the main loop: events in the order of their time stamps |
//! | [`rx_timestamps`], [`ring`] | received bytes from interrupt to main loop |
//! | [`straps`], [`reset`], [`led`] | address, cause of reset, status light |
//! | [`store`] | parameters in two flash pages (of `wheeleg-node`) |
//! | `g431` | the STM32G431CB: the only place with registers and `unsafe` |
//!
//! # Glossary
//!
//! * **executive**: the main loop of a board: takes what the interrupts latched, in the order of
//!   their time stamps
//! * **strap**: a pin tied to ground or supply on the board; four of them are its bus address
//! * **tick**: one run of the application: every 1 ms on a joint board
//! * **preload**: a timer register that takes effect at the next tick edge, not when it is
//!   written
//! * **break**: the input by which a timer turns its outputs off without the processor
//! * **store**: two flash pages in which parameters survive a power failure
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

pub mod executive;
#[cfg(all(target_os = "none", feature = "g431"))]
pub mod g431;
pub mod led;
pub mod reset;
pub mod ring;
pub mod rx_timestamps;
mod same_core;
pub mod straps;

pub use wheeleg_identity::{Kind, Record};
pub use wheeleg_node::store;
