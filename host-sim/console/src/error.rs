//! Errors that keep the console from starting or a client from its robot.

use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;
use wheeleg_config::ConfigError;
use wheeleg_sim::SimError;

/// An error of the console.
#[derive(Debug, Error, Diagnostic)]
pub enum ConsoleError {
    /// A file of a key cannot be used.
    #[error("{}: {what}", .path.display())]
    #[diagnostic(code(wheeleg::key), help("{help}"))]
    Key {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// The server cannot listen at the address.
    #[error("cannot listen at {address}: {what}")]
    #[diagnostic(code(wheeleg::listen), help("{help}"))]
    Listen {
        /// Which address.
        address: String,
        /// What is wrong.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// A server cannot be reached, or does not speak as it should.
    #[error("{url}: {what}")]
    #[diagnostic(code(wheeleg::link), help("{help}"))]
    Link {
        /// Address of the server.
        url: String,
        /// What is wrong.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// Something is wrong with the page or with this computer.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::console), help("{help}"))]
    Other {
        /// What is wrong.
        what: String,
        /// What the user can do.
        help: String,
    },

    /// The robot or the scenario of a recording is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] Box<ConfigError>),

    /// The simulated robot could not be built.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Sim(#[from] SimError),
}

impl ConsoleError {
    pub(crate) fn other(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Other {
            what: what.into(),
            help: help.into(),
        }
    }
}
