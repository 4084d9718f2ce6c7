//! Errors of logs and tables.

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
        help("choose another place with --out, or make this one writable")
    )]
    Output {
        /// The attempted action, for example "create the folder".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },

    /// A log that could not be read.
    #[error("cannot read the log `{}`: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::log),
        help("give the folder of a run, or the file log.mcap in it, that this user may read")
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },

    /// The log writer failed after the file had been opened.
    #[error("cannot write the log `{}`: {}", path.display(), message(.reason))]
    #[diagnostic(
        code(wheeleg::log),
        help(
            "the disk may be full; what was written of the log is recovered by `wheeleg log recover`"
        )
    )]
    Log {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        reason: mcap::McapError,
    },

    /// A log made from another one, which stays unchanged, could not be written.
    #[error("cannot write the log `{}`: {}", path.display(), message(.reason))]
    #[diagnostic(
        code(wheeleg::output),
        help("the disk may be full; write to another one with --out, or make room on this one")
    )]
    Made {
        /// The new file.
        path: PathBuf,
        /// What went wrong.
        reason: mcap::McapError,
    },

    /// Tables that could not be completed.
    #[error("cannot finish {count} of the tables, the first is `{}`: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::output),
        help("choose another folder with --out DIR, or make room in this one")
    )]
    Tables {
        /// How many.
        count: usize,
        /// The first of them.
        path: PathBuf,
        /// What the operating system said of it.
        reason: std::io::Error,
    },

    /// A recovered log that cannot be read back.
    #[error("`{}` was written and cannot be read back: {}", path.display(), message(.reason))]
    #[diagnostic(
        code(wheeleg::log),
        help("the disk may be at fault; write to another one")
    )]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: mcap::McapError,
    },

    /// A file that is not an MCAP log.
    #[error("`{}` is not an MCAP log: it does not start like one", path.display())]
    #[diagnostic(
        code(wheeleg::log),
        help("the log of a run is the file log.mcap in its folder")
    )]
    NotALog {
        /// The file.
        path: PathBuf,
    },

    /// A log of another program.
    #[error("there is no message of a channel of Wheeleg in `{}`", path.display())]
    #[diagnostic(
        code(wheeleg::log),
        help("it is a log of another program; `wheeleg channels` lists what ours hold")
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },

    /// A log without a readable message.
    #[error("there is no message in `{}` that can be recovered", path.display())]
    #[diagnostic(
        code(wheeleg::log),
        help("a log has its first messages after a quarter of a simulated second")
    )]
    Empty {
        /// The file.
        path: PathBuf,
    },

    /// A recovered log that does not hold what was written to it.
    #[error("`{}` was written with {written} messages and has {found} when it is read back", path.display())]
    #[diagnostic(
        code(wheeleg::log),
        help("the disk may be at fault; write to another one")
    )]
    Unsound {
        /// The file.
        path: PathBuf,
        /// Messages written.
        written: u64,
        /// Messages found.
        found: u64,
    },
}

/// What went wrong, without the messages of the layers between.
fn message(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(reason) => reason.to_string(),
        other => other.to_string(),
    }
}

impl LogError {
    /// A log at `path` that could not be read.
    pub(crate) fn read(path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Read {
            path: path.into(),
            reason,
        }
    }

    /// A log at `path` that could not be written, though it could be created.
    pub(crate) fn log(path: impl Into<PathBuf>, reason: mcap::McapError) -> Self {
        Self::Log {
            path: path.into(),
            reason,
        }
    }

    /// A log at `path`, made from another one, that could not be written.
    pub fn made(path: impl Into<PathBuf>, reason: mcap::McapError) -> Self {
        Self::Made {
            path: path.into(),
            reason,
        }
    }

    /// An output error for `path`.
    pub fn output(action: &'static str, path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Output {
            action,
            path: path.into(),
            reason,
        }
    }
}
