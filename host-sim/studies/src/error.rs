//! Errors of studies, with their remedies.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;
use wheeleg_config::ConfigError;
use wheeleg_remote_host::RemoteError;
use wheeleg_report::ReportError;
use wheeleg_scene::SceneError;
use wheeleg_sim::SimError;
use wheeleg_telemetry::LogError;

use crate::check::vectors::VectorsError;
use crate::identify::LabError;

/// Any failure of the program outside the simulated robot.
#[derive(Debug, Error, Diagnostic)]
pub enum StudyError {
    /// A robot or scenario file is wrong or missing.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] Box<ConfigError>),

    /// A file of reference vectors cannot be compared.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Vectors(#[from] VectorsError),

    /// A result could not be drawn or written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Report(#[from] ReportError),

    /// The recording failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),

    /// The robot has no tree of links.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),

    /// A board elsewhere failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Remote(#[from] RemoteError),

    /// The simulation could not be built or continued.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Sim(#[from] SimError),

    /// A measurement cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Lab(#[from] LabError),

    /// Standard output takes no more.
    #[error("cannot write to standard output: {0}")]
    #[diagnostic(
        code(wheeleg::output),
        help(
            "the command has finished, and the files of a study are in its folder; redirect standard output elsewhere"
        )
    )]
    Stdout(std::io::Error),

    /// The study is impossible, or its result is not the requested one.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::simulation), help("{help}"))]
    Refused {
        /// What went wrong.
        what: String,
        /// What the user can do.
        help: String,
    },
}

impl StudyError {
    /// An output error for `path`.
    pub fn output(action: &'static str, path: impl Into<PathBuf>, reason: std::io::Error) -> Self {
        Self::Report(ReportError::output(action, path, reason))
    }

    /// A refusal with advice.
    pub fn refused(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Refused {
            what: what.into(),
            help: help.into(),
        }
    }
}

impl From<ConfigError> for StudyError {
    fn from(e: ConfigError) -> Self {
        Self::Config(Box::new(e))
    }
}
