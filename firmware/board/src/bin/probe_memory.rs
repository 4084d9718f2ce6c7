//! Copies and clears memory with the board's own routines, for every alignment and many lengths, on an
//! emulated board. Two pins give the result: PB15 (dump valve) that every byte was right, PB13 (motor
//! backward) that one was not.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

use core::hint::black_box;
use wheeleg_board::g431::{clock, fatal, pins, power};

const PLACE: usize = 64;
/// Longest piece: several rounds of the loop and every remainder.
const BYTES_MAX: usize = 44;
const WORD: usize = 4;
/// Value where nothing may be written.
const GUARD: u8 = 0xA5;

wheeleg_board::exception_handlers!();

unsafe extern "C" {
    fn this_image_can_panic() -> !;
    fn __aeabi_memcpy(to: *mut u8, from: *const u8, bytes: usize);
    fn __aeabi_memcpy4(to: *mut u8, from: *const u8, bytes: usize);
    fn __aeabi_memcpy8(to: *mut u8, from: *const u8, bytes: usize);
    fn __aeabi_memclr(place: *mut u8, bytes: usize);
    fn __aeabi_memclr4(place: *mut u8, bytes: usize);
    fn __aeabi_memclr8(place: *mut u8, bytes: usize);
}

type Routine = unsafe extern "C" fn(*mut u8, *const u8, usize);
type Clear = unsafe extern "C" fn(*mut u8, usize);

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { this_image_can_panic() }
}

/// Aligned for every routine, so that an offset is an alignment.
#[repr(align(8))]
struct Place([u8; PLACE]);

impl Place {
    /// Whether it holds `inside` of the piece at `offset` and guards around it.
    fn holds(&self, offset: usize, bytes: usize, inside: impl Fn(usize) -> u8) -> bool {
        let mut bytes_here = black_box(self).0.iter().enumerate();
        bytes_here.all(|(at, byte)| {
            let expected = match at.checked_sub(offset) {
                Some(at) if at < bytes => inside(at),
                _ => GUARD,
            };
            *byte == expected
        })
    }
}

fn copies(copy: Routine, to: usize, from: usize, bytes: usize) -> bool {
    let source = Place(core::array::from_fn(|at| at as u8));
    let mut place = Place([GUARD; PLACE]);
    let pieces = (place.0.get_mut(to..), source.0.get(from..));
    let (Some(target), Some(piece)) = pieces else {
        return false;
    };
    // SAFETY: an offset and a length are together less than a place.
    unsafe { copy(target.as_mut_ptr(), piece.as_ptr(), bytes) };
    place.holds(to, bytes, |at| from.wrapping_add(at) as u8)
}

fn clears(clear: Clear, offset: usize, bytes: usize) -> bool {
    let mut place = Place([GUARD; PLACE]);
    let Some(piece) = place.0.get_mut(offset..) else {
        return false;
    };
    // SAFETY: as above.
    unsafe { clear(piece.as_mut_ptr(), bytes) };
    place.holds(offset, bytes, |_| 0)
}

fn all_is_right(bytes: usize) -> bool {
    let aligned = [__aeabi_memcpy4 as Routine, __aeabi_memcpy8];
    let aligned = aligned.into_iter().all(|copy| copies(copy, 0, 0, bytes));
    let cleared = [__aeabi_memclr4 as Clear, __aeabi_memclr8];
    let cleared = cleared.into_iter().all(|clear| clears(clear, 0, bytes));
    let any = (0..WORD).all(|to| {
        let mut from = 0..WORD;
        from.all(|from| copies(__aeabi_memcpy, to, from, bytes))
            && clears(__aeabi_memclr, to, bytes)
    });
    aligned && cleared && any
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let _ = fatal::take_cause();
    let _ = clock::start();
    power::start();
    if (0..=BYTES_MAX).all(all_is_right) {
        pins::set_dump(true);
    } else {
        pins::set_motor_backward(true);
    }
    loop {
        cortex_m::asm::nop();
    }
}
