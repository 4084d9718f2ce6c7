//! The ways down: outputs off, a note for the next start, reset.

use super::{breaks, flash, pac, pins};
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
    // The note is read only if a program has written it: with parity, RAM that nobody has written since
    // power-up gives an error.
    let note = match reset::may_have_note(flags) {
        true => NOTE.load(Ordering::Relaxed),
        false => 0,
    };
    NOTE.store(0, Ordering::Relaxed);
    reset::decode(flags, note)
}

/// Flag of the clock security system in RCC_CIFR (RM0440 §7.4.6); the register crate has no name
/// for it.
const CSSF: u32 = 1 << 8;

/// The non-maskable interrupt, by its cause: a crystal that has stopped, a parity error of RAM,
/// a word of flash with a double error. Such a word in the parameter store is noted for its
/// reader, and the program goes on; anything else ends in a reset.
pub fn on_nmi() {
    if pac::RCC.cifr().read().0 & CSSF != 0 {
        reset(Note::ClockLoss);
    }
    let in_store = flash::on_nmi();
    if breaks::ram_is_damaged() || !in_store {
        reset(Note::ProcessorFault);
    }
}

/// The processor has faulted, perhaps because its stack is not in memory: the handler sets the stack as after
/// a reset, since a second fault here would lock the processor up. The name is that of the vector table; a
/// handler of `cortex-m-rt` would push registers first.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
extern "C" fn on_fault() -> ! {
    core::arch::naked_asm!(
        "movw r0, :lower16:_stack_start",
        "movt r0, :upper16:_stack_start",
        "msr msp, r0",
        "b {after}",
        after = sym after_fault,
    )
}

extern "C" fn after_fault() -> ! {
    reset(Note::ProcessorFault)
}

/// The handlers of everything that ends in a reset, once in every image: the supply sags, the clock stops,
/// the processor faults, an interrupt has no handler.
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

            #[exception]
            unsafe fn DefaultHandler(_number: i16) {
                fatal::reset(Note::ProcessorFault)
            }
        }
    };
}
