//! Errors that end a simulation early. Faults of the simulated robot are results, not errors.

use miette::Diagnostic;
use thiserror::Error;
use wheeleg_config::ConfigError;
use wheeleg_remote_host::RemoteError;
use wheeleg_telemetry::LogError;

/// Why a simulation could not be built or continued.
#[derive(Debug, Error, Diagnostic)]
pub enum SimError {
    /// A part refuses its parameters, or a fault cannot be injected.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::simulation), help("{help}"))]
    Simulation {
        /// What went wrong.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// The robot does not get ready: boards are missing or differ, or it does not reach its start pose.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::simulation), help("{help}"))]
    NotReady {
        /// How far it got, and what it reported.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// The plant has left the range of its model: the run ends at once.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::unphysical), help("{help}"))]
    Unphysical {
        /// When, which part, and its last known values.
        what: String,
        /// The parameters that are the likely cause.
        help: String,
    },

    /// The robot cannot do what the scenario asks for.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] Box<ConfigError>),

    /// A board elsewhere failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Remote(#[from] RemoteError),

    /// The recording failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
}

impl SimError {
    /// A simulation error with advice.
    pub fn simulation(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Simulation {
            what: what.into(),
            help: help.into(),
        }
    }
}
