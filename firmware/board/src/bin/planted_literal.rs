//! An image that parses a fixed-point literal at run time. It shows that the
//! search for the parser in the other images can find it.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

use core::sync::atomic::{AtomicI32, Ordering};
use fixed::types::I16F16;
use wheeleg_board as _;

static GAIN: AtomicI32 = AtomicI32::new(0);

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

#[cortex_m_rt::entry]
fn main() -> ! {
    loop {
        // Written as by mistake: without `const { … }`. The black box keeps the optimiser from doing here
        // what it may or may not do in a larger program.
        let text = core::hint::black_box("12.5");
        GAIN.store(I16F16::lit(text).to_bits(), Ordering::Relaxed);
    }
}
