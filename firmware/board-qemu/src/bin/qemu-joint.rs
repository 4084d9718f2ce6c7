//! The joint application on QEMU.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "a section that the linker knows by name")]

use wheeleg_board_qemu::run_on_semihosting;
use wheeleg_remote::{JointPins, RemoteJoint};

#[cortex_m_rt::entry]
fn main() -> ! {
    let pins = JointPins::default();
    run_on_semihosting::<RemoteJoint<'_>>(&pins)
}

wheeleg_board_qemu::image_record!(QemuJoint);
