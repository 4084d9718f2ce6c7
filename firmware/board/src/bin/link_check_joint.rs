//! Links only if nothing in the joint image can panic: the same image, whose panic
//! handler calls a function that does not exist. A panic that can be reached
//! leaves the linker with an undefined symbol of a telling name.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "handlers and symbols that are linked by name")]

#[path = "../image/joint.rs"]
mod image;

unsafe extern "C" {
    fn this_image_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { this_image_can_panic() }
}
