//! The parameters that the flash holds, over the defaults.

use super::flash::ParameterPages;
use crate::store::Store;

/// The store, for saving.
///
/// # Safety
/// At most one may exist at a time.
pub(super) unsafe fn store() -> Store<ParameterPages> {
    // SAFETY: the caller's.
    Store::new(unsafe { ParameterPages::steal() })
}

/// The stored values over `defaults`; `None` if they are damaged, or the application refuses
/// one of them, because it is from another version.
pub fn load<P: Copy, R>(defaults: P, with: impl Fn(&P, u16, i32) -> Result<P, R>) -> Option<P> {
    // SAFETY: the one use of the pages; it ends here.
    let store = unsafe { store() };
    store.parameters(defaults, with)
}
