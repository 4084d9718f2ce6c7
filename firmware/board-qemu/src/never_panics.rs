//! Proof by the linker that no panic can be reached.

use core::panic::PanicInfo;

unsafe extern "C" {
    /// Exists nowhere: a reachable panic is an undefined symbol, and the linker
    /// names the function that leads to it.
    fn this_image_could_panic() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: no linked image holds this call, see above.
    unsafe { this_image_could_panic() }
}
