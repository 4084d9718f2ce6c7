//! Why a case has no result, in words for its row.

use wheeleg_config::ConfigError;
use wheeleg_sim::SimError;

/// All that is wrong with a file, on one line.
pub(crate) fn problems(error: &ConfigError) -> String {
    let problems = error.problems().iter().map(ToString::to_string);
    problems.collect::<Vec<_>>().join("; ")
}

/// What a row says of an error: of a file what is wrong in it.
pub(crate) fn why(error: &SimError) -> String {
    match error {
        SimError::Config(error) => problems(error),
        other => other.to_string(),
    }
}
