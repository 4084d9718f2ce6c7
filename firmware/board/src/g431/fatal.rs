//! The ways down: outputs off, a note for the next start, reset.

use super::{flash, pac, pins};
use crate::reset::{Note, ResetCause};
use core::sync::atomic::{AtomicU32, Ordering};

/// Survives a reset: not initialised by the start-up code.
#[unsafe(link_section = ".uninit.NOTE")]
static NOTE: AtomicU32 = AtomicU32::new(0);

/// Turns the outputs off, leaves a note and resets the processor.
pub fn reset(note: Note) -> ! {
    pins::force_outputs_off();
    NOTE.store(note as u32, Ordering::Relaxed);
    cortex_m::peripheral::SCB::sys_reset();
}

/// Why the processor started; clears the flags and the note.
pub fn take_cause() -> ResetCause {
    let csr = pac::RCC.csr();
    let flags = csr.read().0;
    csr.modify(|r| r.set_rmvf(true));
    let note = NOTE.load(Ordering::Relaxed);
    NOTE.store(0, Ordering::Relaxed);
    ResetCause::decode(flags, note)
}

/// The non-maskable interrupt: a flash word with a double error is noted for its
/// reader; anything else is the clock, which has stopped.
pub fn on_nmi() {
    if !flash::on_nmi() {
        reset(Note::ClockLoss);
    }
}
