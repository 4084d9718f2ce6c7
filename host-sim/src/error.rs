//! The error type of the program: what went wrong, and what to do about it.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;

use crate::config::ConfigError;

/// Any failure of the program outside the simulated robot.
///
/// Faults of the simulated robot are results, not errors: they are in the
/// recording.
#[derive(Debug, Error, Diagnostic)]
pub enum SimError {
    /// A robot or scenario file is wrong or missing.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] Box<ConfigError>),

    /// A file of reference vectors cannot be compared.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Vectors(#[from] crate::check::vectors::VectorsError),

    /// A file or folder could not be written or created.
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

    /// Drawing a figure failed.
    #[error("cannot draw {figure}: {reason}")]
    #[diagnostic(
        code(wheeleg::plot),
        help("the run itself is complete; its log and summary are in the same folder")
    )]
    Plot {
        /// Name of the figure.
        figure: String,
        /// What the plotting library said.
        reason: String,
    },

    /// The report template failed.
    #[error("cannot render the report: {0}")]
    #[diagnostic(
        code(wheeleg::report),
        help("the run itself is complete; its log and summary are in the same folder")
    )]
    Report(#[from] minijinja::Error),

    /// The simulation could not be built or continued.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::simulation), help("{help}"))]
    Simulation {
        /// What went wrong.
        what: String,
        /// What the user can do.
        help: String,
    },
}

impl SimError {
    /// An output error for `path`.
    pub fn output(action: &'static str, path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Output {
            action,
            path: path.into(),
            reason,
        }
    }

    /// A simulation error with advice.
    pub fn simulation(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Simulation {
            what: what.into(),
            help: help.into(),
        }
    }
}

impl From<ConfigError> for SimError {
    fn from(e: ConfigError) -> Self {
        Self::Config(Box::new(e))
    }
}
