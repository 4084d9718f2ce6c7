//! Suspends a program that has changed its terminal: Ctrl-Z and `kill -TSTP`, until `fg`.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGCONT, SIGTSTP};
use signal_hook::{flag, low_level};

/// Whether the program should suspend, or did.
#[derive(Debug)]
pub struct Suspend {
    asked: Arc<AtomicBool>,
    continued: Arc<AtomicBool>,
}

impl Suspend {
    /// From here on a request to suspend the program (SIGTSTP) waits until the program checks for it.
    ///
    /// # Errors
    /// The operating system's error if a handler cannot be set.
    pub fn on_signals() -> std::io::Result<Self> {
        let suspend = Self {
            asked: Arc::default(),
            continued: Arc::default(),
        };
        flag::register(SIGTSTP, Arc::clone(&suspend.asked))?;
        flag::register(SIGCONT, Arc::clone(&suspend.continued))?;
        Ok(suspend)
    }

    /// Whether it was requested since the last check.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.asked.swap(false, Ordering::SeqCst)
    }

    /// Whether the program was continued since the last check: it may have been stopped without a request
    /// (SIGSTOP).
    #[must_use]
    pub fn was_continued(&self) -> bool {
        self.continued.swap(false, Ordering::SeqCst)
    }

    /// Stops this program until it is continued.
    ///
    /// # Errors
    /// The operating system's error if it cannot be stopped.
    pub fn stop(&self) -> std::io::Result<()> {
        low_level::emulate_default_handler(SIGTSTP)?;
        self.continued.store(false, Ordering::SeqCst);
        Ok(())
    }
}
