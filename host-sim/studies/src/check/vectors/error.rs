//! Errors in a file of vectors.

use std::fmt;

use miette::Diagnostic;
use thiserror::Error;

/// Most problems that one message lists.
const LISTED: usize = 12;

/// One error at one place of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Path of the key, such as `cases[3].leg.q[1]`.
    pub path: String,
    /// The value found, shortened.
    pub value: String,
    /// The expected value.
    pub expected: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is {}; expected {}",
            self.path, self.value, self.expected
        )
    }
}

/// A file of vectors that cannot be compared.
#[derive(Debug, Error, Diagnostic)]
pub enum VectorsError {
    /// The file cannot be read.
    #[error("cannot read `{file}`: {reason}")]
    #[diagnostic(
        code(wheeleg::vectors::read),
        help("give the path of a JSON file of reference vectors")
    )]
    Read {
        /// The file.
        file: String,
        /// The operating system's reason.
        reason: std::io::Error,
    },
    /// The file is not JSON.
    #[error("`{file}` is not JSON: {reason}")]
    #[diagnostic(code(wheeleg::vectors::json), help("{}", json_help(reason)))]
    Json {
        /// The file.
        file: String,
        /// Line, column and cause.
        reason: serde_json::Error,
    },
    /// The file does not follow the schema.
    #[error("`{file}` is not a file of reference vectors:\n{}", list(problems))]
    #[diagnostic(
        code(wheeleg::vectors::schema),
        help(
            "the schema is described in host-sim/plant/MODEL.md section 13, with tests/vectors/model-7.json as its example"
        )
    )]
    Malformed {
        /// The file.
        file: String,
        /// All errors, in the order of the file.
        problems: Vec<Problem>,
    },
}

impl VectorsError {
    pub(super) fn malformed(file: &str, problems: Vec<Problem>) -> Self {
        Self::Malformed {
            file: file.to_owned(),
            problems,
        }
    }
}

fn json_help(reason: &serde_json::Error) -> &'static str {
    if reason.is_eof() {
        "the file ends too early: it is empty or was cut off"
    } else {
        "numbers must be finite: JSON has no NaN and no infinity"
    }
}

fn list(problems: &[Problem]) -> String {
    let mut lines: Vec<String> = problems
        .iter()
        .take(LISTED)
        .map(|p| format!("  {p}"))
        .collect();
    if problems.len() > LISTED {
        lines.push(format!("  and {} more", problems.len() - LISTED));
    }
    lines.join("\n")
}
