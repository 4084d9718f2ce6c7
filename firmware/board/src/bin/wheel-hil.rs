//! Hardware-in-the-loop image of a wheel board; it cannot drive an output, and it
//! links only if nothing in it can panic.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

use cortex_m_rt::entry;
use wheeleg_board::g431::hil;
use wheeleg_board::g431::slot::Slot;
use wheeleg_remote::{RemoteWheel, Session, WheelPins};

unsafe extern "C" {
    fn this_image_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { this_image_can_panic() }
}

static PINS: Slot<WheelPins> = Slot::new();
static SESSION: Slot<Session<'static, RemoteWheel<'static>>> = Slot::new();

#[entry]
fn main() -> ! {
    hil::run(&PINS, &SESSION)
}

wheeleg_board::exception_handlers!();
wheeleg_board::image_record!(WheelHil);
