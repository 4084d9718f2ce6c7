//! What can go wrong with a log or a table.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;

/// A file of the recording that could not be written or read.
#[derive(Debug, Error, Diagnostic)]
pub enum LogError {
    /// A file or folder could not be created, written or read.
    #[error("cannot {action} `{}`: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::output),
        help("choose another folder with --out DIR, or make this one writable")
    )]
    Output {
        /// What was tried, for example "create the folder".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },

    /// The log writer failed after the file had been opened.
    #[error("cannot write the log: {0}")]
    #[diagnostic(
        code(wheeleg::log),
        help("the disk may be full; what was flushed so far stays readable")
    )]
    Log(#[from] mcap::McapError),
}

impl LogError {
    /// An output error for `path`.
    pub fn output(action: &'static str, path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Output {
            action,
            path: path.into(),
            reason,
        }
    }
}
