//! What can go wrong with a campaign, and what to do about it.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;
use wheeleg_config::ConfigError;
use wheeleg_report::ReportError;
use wheeleg_studies::StudyError;
use wheeleg_telemetry::LogError;

/// Any failure of a campaign outside of its cases, which have a row of their own.
#[derive(Debug, Error, Diagnostic)]
pub enum CampaignError {
    /// Plan, scenario or robot are wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] Box<ConfigError>),

    /// A replay failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Study(#[from] Box<StudyError>),

    /// The report failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Report(#[from] ReportError),

    /// A file or folder cannot be written.
    #[error("cannot {action} `{}`: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::output),
        help("finished parts are intact; make room or the folder writable, and run again")
    )]
    Output {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },

    /// A file cannot be read, or is not what it should be.
    #[error("`{}` is not usable: {reason}", path.display())]
    #[diagnostic(code(wheeleg::campaign), help("{help}"))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
        /// What the user can do.
        help: String,
    },

    /// What was asked for cannot be done.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::campaign), help("{help}"))]
    Refused {
        /// What is wrong.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// Cases are missing.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::campaign::incomplete), help("{help}"))]
    Incomplete {
        /// What is missing.
        what: String,
        /// The command that fills the holes.
        help: String,
    },
}

impl CampaignError {
    pub(crate) fn output(
        action: &'static str,
        path: impl Into<PathBuf>,
        reason: std::io::Error,
    ) -> Self {
        Self::Output {
            action,
            path: path.into(),
            reason,
        }
    }

    pub(crate) fn unreadable(path: impl Into<PathBuf>, reason: impl ToString) -> Self {
        Self::Unreadable {
            path: path.into(),
            reason: reason.to_string(),
            help: "give a file that `wheeleg campaign` has written".to_owned(),
        }
    }

    pub(crate) fn refused(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Refused {
            what: what.into(),
            help: help.into(),
        }
    }

    /// Exit code of a program that ends with this error.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Output { .. } | Self::Report(ReportError::Output { .. }) => 74,
            Self::Study(e)
                if matches!(
                    **e,
                    StudyError::Log(LogError::Output { .. } | LogError::Log { .. })
                ) =>
            {
                74
            }
            Self::Incomplete { .. } => 3,
            _ => 2,
        }
    }
}

impl From<ConfigError> for CampaignError {
    fn from(e: ConfigError) -> Self {
        Self::Config(Box::new(e))
    }
}

impl From<StudyError> for CampaignError {
    fn from(e: StudyError) -> Self {
        match e {
            // Its exit code is that of a file that cannot be written.
            StudyError::Report(e) => Self::from(e),
            other => Self::Study(Box::new(other)),
        }
    }
}
