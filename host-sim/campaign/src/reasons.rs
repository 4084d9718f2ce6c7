//! Explains in a row why its case has no result.

use wheeleg_config::ConfigError;
use wheeleg_sim::SimError;

/// All problems of a file, on one line.
pub(crate) fn problems(error: &ConfigError) -> String {
    let problems = error.problems().iter().map(ToString::to_string);
    problems.collect::<Vec<_>>().join("; ")
}

/// Text of an error for a row; for a file, the problems in it.
pub(crate) fn why(error: &SimError) -> String {
    match error {
        SimError::Config(error) => problems(error),
        other => other.to_string(),
    }
}
