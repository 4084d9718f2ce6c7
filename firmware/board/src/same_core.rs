//! Order of accesses between an interrupt handler and the main loop, which run on
//! the same core.
//!
//! The core sees its own accesses in program order, so that it is enough to keep the
//! compiler from moving them; `Ordering::Acquire` and `Release` would add a barrier
//! instruction for other cores each.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};

/// An atomic that one side writes once the data that it announces is in place.
pub(crate) trait Announce {
    type Value;

    /// The announced value; data read after this is at least as new.
    fn seen(&self) -> Self::Value;

    /// Announces the data written before this.
    fn announce(&self, value: Self::Value);
}

macro_rules! announce {
    ($atomic:ty, $value:ty) => {
        impl Announce for $atomic {
            type Value = $value;

            #[inline(always)]
            fn seen(&self) -> $value {
                let value = self.load(Ordering::Relaxed);
                compiler_fence(Ordering::Acquire);
                value
            }

            #[inline(always)]
            fn announce(&self, value: $value) {
                compiler_fence(Ordering::Release);
                self.store(value, Ordering::Relaxed);
            }
        }
    };
}

announce!(AtomicBool, bool);
announce!(AtomicU32, u32);
