//! Notices about clients for the person at the server, kept until they are printed.

use std::sync::{Mutex, PoisonError};

/// Lines that may wait. Only clients with a key could fill it; nobody reads more than this at once.
const MOST: usize = 32;

/// Lines that wait.
#[derive(Debug, Default)]
pub(crate) struct Notices(Mutex<Vec<String>>);

impl Notices {
    /// Adds a line.
    pub(crate) fn tell(&self, line: String) {
        let mut lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() < MOST {
            lines.push(line);
        }
    }

    /// All that wait.
    pub(crate) fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
