//! Supply supervision: below about 2.9 V the outputs go off, as a rule before the brown-out reset.

use super::{fatal, pac, pins};
use crate::reset::Note;
use pac::Interrupt;

/// EXTI line of the voltage detector (RM0440 §14.3).
const LINE: usize = 16;
/// PVD threshold 6: trips between 2.84 and 2.96 V on the way down (DATASHEET). Brown-out level 4 is
/// 2.76 to 2.86 V: on a part at both ends the reset comes first, and the pins are hi-Z.
const THRESHOLD: u8 = 6;

/// Starts the detector.
pub fn start() {
    pac::PWR.cr2().modify(|r| {
        r.set_pls(THRESHOLD);
        r.set_pvde(true);
    });
    let exti = pac::EXTI;
    exti.rtsr(0).modify(|r| r.set_line(LINE, true));
    exti.pr(0).write(|r| r.set_line(LINE, true));
    exti.imr(0).modify(|r| r.set_line(LINE, true));
    // SAFETY: the handler shares no state that a critical section protects.
    unsafe { cortex_m::peripheral::NVIC::unmask(Interrupt::PVD_PVM) };
    // A supply that is low already makes no edge.
    if pac::PWR.sr2().read().pvdo() {
        on_sag();
    }
}

/// The supply sags: outputs off at once; then either it goes on falling until
/// the brown-out reset, or it comes back and the board restarts. The watchdog
/// bounds the wait.
pub fn on_sag() -> ! {
    pins::force_outputs_off();
    while pac::PWR.sr2().read().pvdo() {}
    fatal::reset(Note::SupplySag)
}
