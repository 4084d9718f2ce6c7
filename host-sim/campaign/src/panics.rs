//! Turns panics into values.

use std::cell::RefCell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Message of this thread's panic, while it is being caught.
    static CAUGHT: RefCell<Option<String>> = const { RefCell::new(None) };
    static CATCHING: RefCell<bool> = const { RefCell::new(false) };
}

/// Runs `work`; returns a panic as its message and location, without printing it.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CATCHING.with_borrow(|catching| *catching) {
                return before(info);
            }
            let payload = info.payload();
            let text = payload
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned());
            let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
            let text = text.unwrap_or_else(|| "a panic".to_owned());
            // The folder depends on who built the program; without it, rows are the same everywhere.
            let place = info.location().map(|at| {
                let file = at.file().rsplit(['/', '\\']).next().unwrap_or_default();
                format!(" ({file}:{})", at.line())
            });
            let message = format!("{text}{}", place.unwrap_or_default());
            CAUGHT.with_borrow_mut(|caught| *caught = Some(message));
        }));
    });
    CATCHING.with_borrow_mut(|catching| *catching = true);
    let result = panic::catch_unwind(AssertUnwindSafe(work));
    CATCHING.with_borrow_mut(|catching| *catching = false);
    result.map_err(|_| {
        let message = CAUGHT.with_borrow_mut(Option::take);
        message.unwrap_or_else(|| "a panic".to_owned())
    })
}
