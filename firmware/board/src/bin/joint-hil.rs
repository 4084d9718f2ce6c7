//! Hardware-in-the-loop image of a joint board; it cannot drive an output, and it
//! links only if nothing in it can panic.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

use cortex_m_rt::entry;
use wheeleg_board::g431::hil;
use wheeleg_remote::{JointPins, RemoteJoint};

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
    let pins = JointPins::default();
    hil::run::<RemoteJoint<'_>>(&pins)
}

wheeleg_board::ways_down!();
