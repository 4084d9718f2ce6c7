//! The joint application as a bench board on QEMU: its messages go over a UART.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "a section that the linker knows by name")]

use wheeleg_board_qemu::run_on_uart;
use wheeleg_remote::{JointPins, RemoteJoint};

#[cortex_m_rt::entry]
fn main() -> ! {
    let pins = JointPins::default();
    run_on_uart::<RemoteJoint<'_>>(&pins)
}

wheeleg_board_qemu::image_record!(QemuHilJoint);
