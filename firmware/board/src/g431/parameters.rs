//! The parameters that the flash holds, over the defaults.

use super::flash::ParameterPages;
use crate::store::Store;

/// The store, for whoever saves.
///
/// # Safety
/// At most one may exist at a time.
pub(super) unsafe fn store() -> Store<ParameterPages> {
    // SAFETY: the caller's.
    Store::new(unsafe { ParameterPages::steal() })
}

/// Puts the stored values over `defaults`, one by one. A value that the
/// application refuses, because it is from another version, keeps its default.
pub fn load<P: Copy, R>(defaults: P, with: impl Fn(&P, u16, i32) -> Result<P, R>) -> P {
    // SAFETY: the one use of the pages; it ends here.
    let store = unsafe { store() };
    let loaded = store.load(defaults, |parameters, record| {
        if let Ok(changed) = with(parameters, record.id, record.raw) {
            *parameters = changed;
        }
    });
    loaded.map_or(defaults, |(parameters, _)| parameters)
}
