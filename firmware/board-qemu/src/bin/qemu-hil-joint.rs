//! The joint application as a bench board on QEMU: its messages go over a UART.
#![no_std]
#![no_main]

use wheeleg_board_qemu::run_on_uart;
use wheeleg_remote::{JointPins, RemoteJoint};

#[cortex_m_rt::entry]
fn main() -> ! {
    let pins = JointPins::default();
    run_on_uart::<RemoteJoint<'_>>(&pins)
}
