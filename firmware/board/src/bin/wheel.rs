//! The image of a wheel board.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

#[path = "../image/wheel.rs"]
mod image;

/// Outputs off, a note for the next start, reset. The link check shows that
/// nothing in this image can get here.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    wheeleg_board::g431::fatal::reset(wheeleg_board::reset::Note::Panic)
}
