//! Saves parameters through the board's own flash driver, for power cuts in mid-save on an emulated board. It
//! has no application: two pins show which set it found when it started, PB13 (motor backward) the old one,
//! PB15 (dump valve) the new one. Blank flash gets the old set at once; the old set gets the new one after a
//! while, in which the power cut can be prepared.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

use wheeleg_board::g431::flash::ParameterPages;
use wheeleg_board::g431::{clock, fatal, pins, power, watchdog};
use wheeleg_board::store::{Record, Store};

/// Records of a set: about as many as a joint has parameters.
const COUNT: usize = 40;
/// Values of the old set begin here, those of the new one there.
const OLD: i32 = 1_000;
const NEW: i32 = 5_000;
/// Before the new set is saved, ms.
const WAIT_MS: u32 = 150;

wheeleg_board::exception_handlers!();

unsafe extern "C" {
    fn this_image_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { this_image_can_panic() }
}

/// Record `index` of the set that begins at `first`.
fn record(index: usize, first: i32) -> Record {
    let id = index as u16;
    Record {
        id,
        raw: first.wrapping_add(i32::from(id)),
    }
}

/// Records of either set and of neither that were loaded.
#[derive(Clone, Copy, Default)]
struct Found {
    old: usize,
    new: usize,
    other: usize,
}

impl Found {
    fn take(&mut self, found: Record) {
        let index = usize::from(found.id);
        let count = if found == record(index, OLD) {
            &mut self.old
        } else if found == record(index, NEW) {
            &mut self.new
        } else {
            &mut self.other
        };
        *count = count.saturating_add(1);
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let _ = fatal::take_cause();
    watchdog::start();
    let _ = clock::start();
    power::start();
    // SAFETY: the one use of the pages.
    let mut store = Store::new(unsafe { ParameterPages::steal() });
    let found = store.load(Found::default(), Found::take);
    match found.map(|(found, _)| (found.old, found.new, found.other)) {
        None => save(&mut store, OLD),
        Some((COUNT, 0, 0)) => {
            pins::set_motor_backward(true);
            for _ in 0..WAIT_MS {
                cortex_m::asm::delay(clock::CLOCK_HZ / 1000);
                watchdog::feed();
            }
            save(&mut store, NEW);
        }
        Some((0, COUNT, 0)) => pins::set_dump(true),
        // A mixture: neither pin.
        Some(_) => {}
    }
    loop {
        cortex_m::asm::delay(clock::CLOCK_HZ / 1000);
        watchdog::feed();
    }
}

fn save(store: &mut Store<ParameterPages>, first: i32) {
    let records: [Record; COUNT] = core::array::from_fn(|index| record(index, first));
    let _ = store.save(&records);
}
