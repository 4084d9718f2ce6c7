//! Processor in the loop: boards that run outside of this process.

mod partner;
pub mod qemu;

pub use partner::{Partner, Stream};
