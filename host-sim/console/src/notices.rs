//! What the person at the server should know of its clients, until it is taken and told.

use std::sync::{Mutex, PoisonError};

/// Lines that may wait. Whoever could fill it has a key; more than this at once nobody reads.
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
