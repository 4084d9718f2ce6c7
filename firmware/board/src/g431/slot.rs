//! A place for the application, so that it lives among the variables and its
//! construction leaves nothing on the stack.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// A static that is written once.
pub struct Slot<T> {
    taken: AtomicBool,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: the first caller gets the one reference to the value; `taken` keeps everybody else away. Only the
// main program uses it, no handler does.
unsafe impl<T> Sync for Slot<T> {}

impl<T> Slot<T> {
    /// An empty slot.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "made in statics alone")]
    pub const fn new() -> Self {
        Self {
            taken: AtomicBool::new(false),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Puts the result of `make` into the slot; `None` if it is taken already.
    #[inline]
    #[expect(clippy::mut_from_ref, reason = "`taken` gives the reference out once")]
    pub fn fill(&'static self, make: impl FnOnce() -> T) -> Option<&'static mut T> {
        if self.taken.load(Ordering::Relaxed) {
            return None;
        }
        self.taken.store(true, Ordering::Relaxed);
        // SAFETY: `taken` was false, so no reference to the value exists.
        let place = unsafe { &mut *self.value.get() };
        Some(place.write(make()))
    }
}
