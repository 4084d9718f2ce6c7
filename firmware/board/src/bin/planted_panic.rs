//! Must not link: an image with a panic that can be reached. It shows that the
//! link check of the other images can fail.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

use core::sync::atomic::{AtomicU32, Ordering};
use wheeleg_board as _;

static INDEX: AtomicU32 = AtomicU32::new(0);
static TABLE: [u8; 4] = [1, 2, 3, 4];

unsafe extern "C" {
    fn this_image_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { this_image_can_panic() }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    loop {
        let index = INDEX.load(Ordering::Relaxed) as usize;
        INDEX.store(u32::from(TABLE[index]), Ordering::Relaxed);
    }
}
