//! The ways down: outputs off, a note for the next start, reset.

use super::{flash, pac, pins};
use crate::reset::{self, Note};
use core::sync::atomic::{AtomicU32, Ordering};
use wheeleg_protocol::ResetCause;

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
    reset::decode(flags, note)
}

/// The non-maskable interrupt: a flash word with a double error is noted for its reader; anything
/// else is taken for a clock that has stopped. So is a double error whose flag does not stand,
/// because an earlier error's does (RM0440 §5.7.7).
pub fn on_nmi() {
    if !flash::on_nmi() {
        reset(Note::ClockLoss);
    }
}

/// The handlers of all that ends in a reset, once in every image: the supply
/// sags, the clock stops, the processor faults, an interrupt has no handler.
#[macro_export]
macro_rules! exception_handlers {
    () => {
        mod exception_handlers {
            use cortex_m_rt::exception;
            use $crate::g431::pac::interrupt;
            use $crate::g431::{fatal, power};
            use $crate::reset::Note;

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
        }
    };
}
