//! Errors of boards elsewhere.

use miette::Diagnostic;
use thiserror::Error;

/// A board that does not come up, stops, or is not the requested one; with the remedy.
#[derive(Debug, Error, Diagnostic)]
#[error("{what}")]
#[diagnostic(code(wheeleg::simulation), help("{help}"))]
pub struct RemoteError {
    /// What went wrong.
    pub what: String,
    /// What the user can do.
    pub help: String,
}

impl RemoteError {
    /// An error with advice.
    pub fn new(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            help: help.into(),
        }
    }
}
