//! The main program of every image.

use wheeleg_remote::{Board, Session, serve};

use crate::semihosting::{self, HostPipes};
use crate::stopwatch::{CLOCK_HZ, SysTickStopwatch};
use crate::uart::Uart;

const HOST: &str = "QEMU mps2-an386 (Cortex-M4)";
const HOST_HIL: &str = "QEMU mps2-an386, HIL over UART";

/// Runs a board whose messages go through semihosting; ends the emulator when the simulator has gone.
pub fn run_on_semihosting<'p, B: Board<'p>>(pins: &'p B::Pins) -> ! {
    let Some(mut pipes) = HostPipes::open() else {
        semihosting::fail();
    };
    let mut stopwatch = stopwatch();
    let mut session = Session::<B>::new(pins, HOST, CLOCK_HZ);
    serve(&mut session, &mut pipes, &mut stopwatch);
    semihosting::exit()
}

/// Runs a board whose messages go over the UART, for ever: the next simulator
/// may open a new session.
pub fn run_on_uart<'p, B: Board<'p>>(pins: &'p B::Pins) -> ! {
    let mut uart = Uart::new();
    let mut stopwatch = stopwatch();
    loop {
        let mut session = Session::<B>::new(pins, HOST_HIL, CLOCK_HZ);
        serve(&mut session, &mut uart, &mut stopwatch);
    }
}

fn stopwatch() -> SysTickStopwatch {
    // SAFETY: the only place that takes the core's peripherals; `take` would
    // bring a path to a panic along.
    let core = unsafe { cortex_m::Peripherals::steal() };
    SysTickStopwatch::new(core.SYST)
}
