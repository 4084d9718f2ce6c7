//! Reads a log into an export: up to the first message that fails, or until it is stopped.

use std::ops::ControlFlow;
use std::path::Path;

use crate::StudyError;
use crate::study::Progress;

/// A log being read.
pub(super) struct Reading<'a> {
    progress: &'a Progress,
    failed: Option<StudyError>,
}

impl<'a> Reading<'a> {
    pub(super) fn begin(log: &Path, progress: &'a Progress) -> Self {
        progress.begin(format!("reading {}", log.display()), 0);
        Self {
            progress,
            failed: None,
        }
    }

    /// Whether to go on after the message of `t_ns`, given its result.
    pub(super) fn after(&mut self, t_ns: u64, result: Result<(), StudyError>) -> ControlFlow<()> {
        self.progress.at(t_ns / 1_000_000);
        self.failed = result.err();
        if self.failed.is_some() || self.progress.is_stopped() {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    /// Whether the log was read to its end; false if it was stopped.
    ///
    /// # Errors
    /// The error of the message that failed.
    pub(super) fn end(self) -> Result<bool, StudyError> {
        match self.failed {
            Some(failed) => Err(failed),
            None => Ok(!self.progress.is_stopped()),
        }
    }
}
