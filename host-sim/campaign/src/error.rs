//! Errors of a campaign, with what the user can do about them.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;
use wheeleg_config::ConfigError;
use wheeleg_report::ReportError;
use wheeleg_studies::StudyError;
use wheeleg_telemetry::LogError;

/// Any failure of a campaign outside its cases; a failed case has a row instead.
#[derive(Debug, Error, Diagnostic)]
pub enum CampaignError {
    /// A plan, scenario or robot is wrong.
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
        /// The operation that failed.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        reason: std::io::Error,
    },

    /// A file cannot be read, or is not what it should be.
    #[error("`{}` is not usable: {reason}", path.display())]
    #[diagnostic(code(wheeleg::campaign), help("{help}"))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
        /// What the user can do.
        help: String,
    },

    /// The request cannot be carried out.
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
        /// The command that fills the gaps.
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
            // This one has the exit code of a file that cannot be written.
            StudyError::Report(e) => Self::from(e),
            other => Self::Study(Box::new(other)),
        }
    }
}
