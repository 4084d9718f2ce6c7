//! Hardware-in-the-loop image of a wheel board; it cannot drive an output, and it
//! links only if nothing in it can panic.
#![no_std]
#![no_main]
#![allow(unsafe_code)]

use cortex_m_rt::{entry, exception};
use wheeleg_board::g431::pac::interrupt;
use wheeleg_board::g431::{fatal, hil, power};
use wheeleg_board::reset::Note;
use wheeleg_remote::{RemoteWheel, WheelPins};

unsafe extern "C" {
    fn this_image_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { this_image_can_panic() }
}

#[entry]
fn main() -> ! {
    let pins = WheelPins::default();
    hil::run::<RemoteWheel<'_>>(&pins)
}

#[interrupt]
fn PVD_PVM() {
    power::on_sag();
}

#[exception]
unsafe fn NonMaskableInt() {
    fatal::on_nmi();
}

#[exception(trampoline = false)]
unsafe fn HardFault() -> ! {
    fatal::reset(Note::ProcessorFault)
}

#[exception]
unsafe fn DefaultHandler(_number: i16) {
    fatal::reset(Note::ProcessorFault)
}
