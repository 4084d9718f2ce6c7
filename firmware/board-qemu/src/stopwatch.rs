//! Time of a tick by SysTick, marks for the instruction counter, and the
//! watermark of the stack.

use core::arch::asm;
use core::ptr;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use wheeleg_remote::Stopwatch;
use wheeleg_units::Micros;

/// Clock of processor and SysTick (ARM DAI 0386, section 4.7.1).
pub const CLOCK_HZ: u32 = 25_000_000;

const COUNTS_PER_US: u32 = CLOCK_HZ / 1_000_000;
/// SysTick has 24 bits.
const RELOAD: u32 = 0x00FF_FFFF;
/// Value with which cortex-m-rt paints the stack.
const PAINT: u32 = 0xCCCC_CCCC;
/// Calls between two searches of the stack: a search takes longer than a tick.
const SEARCH_EVERY: u16 = 1024;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// A function whose address marks an instant: the instruction counter counts
/// from the first instruction of one mark to that of the next. The bodies
/// differ, because equal functions would be merged into one.
macro_rules! mark {
    ($name:ident, $($nop:literal),+) => {
        #[inline(never)]
        #[unsafe(no_mangle)]
        extern "C" fn $name() {
            // SAFETY: does nothing.
            unsafe { asm!($($nop),+, options(nostack, preserves_flags)) }
        }
    };
}
mark!(mark_tick_begins, "nop");
mark!(mark_tick_ended, "nop", "nop");
mark!(mark_bytes_begin, "nop", "nop", "nop");
mark!(mark_bytes_ended, "nop", "nop", "nop", "nop");

/// SysTick as a stopwatch.
#[derive(Debug)]
pub struct SysTickStopwatch {
    began: u32,
    stack_used: u32,
    calls: u16,
}

impl SysTickStopwatch {
    /// Starts SysTick; it runs from now on and interrupts nobody.
    #[must_use]
    pub fn new(mut syst: SYST) -> Self {
        syst.set_clock_source(SystClkSource::Core);
        syst.set_reload(RELOAD);
        syst.clear_current();
        syst.enable_counter();
        Self {
            began: 0,
            stack_used: 0,
            calls: 0,
        }
    }
}

impl Stopwatch for SysTickStopwatch {
    fn tick_begins(&mut self) {
        self.began = SYST::get_current();
        mark_tick_begins();
    }

    fn tick_ended(&mut self) -> Micros {
        mark_tick_ended();
        // SysTick counts down.
        let counts = self.began.wrapping_sub(SYST::get_current()) & RELOAD;
        Micros(counts.wrapping_div(COUNTS_PER_US))
    }

    fn bytes_begin(&mut self) {
        mark_bytes_begin();
    }

    fn bytes_ended(&mut self) {
        mark_bytes_ended();
    }

    fn stack(&mut self) -> (u32, u32) {
        let (bottom, top) = (ptr::addr_of!(_stack_end), ptr::addr_of!(_stack_start));
        if self.calls == 0 {
            self.stack_used = bytes_between(untouched_up_to(bottom, top), top);
        }
        self.calls = self.calls.wrapping_add(1) % SEARCH_EVERY;
        (self.stack_used, bytes_between(bottom, top))
    }
}

/// First word from `bottom` on that is not paint any more.
fn untouched_up_to(bottom: *const u32, top: *const u32) -> *const u32 {
    let mut at = bottom;
    // SAFETY: the linker script puts readable RAM between the two; volatile,
    // because the words change behind the compiler's back.
    while at < top && unsafe { at.read_volatile() } == PAINT {
        at = at.wrapping_add(1);
    }
    at
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "addresses have 32 bits on this machine"
)]
fn bytes_between(low: *const u32, high: *const u32) -> u32 {
    high.addr().wrapping_sub(low.addr()) as u32
}
