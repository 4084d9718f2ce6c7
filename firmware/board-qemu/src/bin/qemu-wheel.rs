//! The wheel application on QEMU.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "a section that the linker knows by name")]

use wheeleg_board_qemu::run_on_semihosting;
use wheeleg_remote::{RemoteWheel, WheelPins};

#[cortex_m_rt::entry]
fn main() -> ! {
    let pins = WheelPins::default();
    run_on_semihosting::<RemoteWheel<'_>>(&pins)
}

wheeleg_board_qemu::image_record!(QemuWheel);
