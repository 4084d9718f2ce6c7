//! Supply supervision: below 2.9 V the outputs go off before the brown-out reset.

use super::{fatal, pac, pins};
use crate::reset::Note;
use pac::Interrupt;

/// EXTI line of the voltage detector (RM0440 §14.3).
const LINE: usize = 16;
/// PVD threshold 6: 2.9 V rising, 2.8 V falling (DATASHEET).
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
}

/// The supply sags: outputs off at once; then either it goes on falling until
/// the brown-out reset, or it comes back and the board starts anew. The watchdog
/// bounds the wait.
pub fn on_sag() -> ! {
    pins::force_outputs_off();
    while pac::PWR.sr2().read().pvdo() {}
    fatal::reset(Note::SupplySag)
}
