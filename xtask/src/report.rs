//! The list of steps, their results, and the closing table.

use std::fmt;
use std::time::{Duration, Instant};

/// Why a step did not pass.
#[derive(Debug)]
pub(crate) enum StepError {
    /// The step ran and found something wrong.
    Failed(anyhow::Error),
    /// The step could not run: a tool is missing and may not be installed from here.
    Missing {
        /// The missing tool.
        tool: String,
        /// The one command that installs it.
        install: String,
    },
}

impl StepError {
    /// A tool that `cargo xtask setup` installs.
    pub(crate) fn not_set_up(tool: impl Into<String>) -> Self {
        Self::missing(tool, "cargo xtask setup")
    }

    /// A missing tool, with the command that installs it.
    pub(crate) fn missing(tool: impl Into<String>, install: impl Into<String>) -> Self {
        Self::Missing {
            tool: tool.into(),
            install: install.into(),
        }
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Failed(error) => write!(f, "{error:#}"),
            Self::Missing { tool, install } => f.write_str(&missing(tool, install)),
        }
    }
}

impl<E: Into<anyhow::Error>> From<E> for StepError {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

/// Result of a step.
pub(crate) type StepResult<T = ()> = Result<T, StepError>;

/// Outcome of a step.
#[derive(Debug, PartialEq, Eq, Clone)]
enum Outcome {
    Passed,
    Failed(String),
    NotRun { tool: String, install: String },
}

struct Row {
    name: String,
    outcome: Outcome,
    took: Duration,
}

/// The steps so far.
pub(crate) struct Report {
    rows: Vec<Row>,
}

impl Report {
    /// An empty report.
    pub(crate) fn new() -> Self {
        Self { rows: Vec::new() }
    }

    /// Runs a step and notes its outcome; `Some` only if it passed.
    pub(crate) fn step<T>(
        &mut self,
        name: impl Into<String>,
        run: impl FnOnce() -> StepResult<T>,
    ) -> Option<T> {
        let name = name.into();
        println!("==> {name}");
        let begin = Instant::now();
        let result = run();
        let took = begin.elapsed();
        let (value, outcome) = match result {
            Ok(value) => (Some(value), Outcome::Passed),
            Err(error @ StepError::Failed(_)) => (None, Outcome::Failed(error.to_string())),
            Err(StepError::Missing { tool, install }) => (None, Outcome::NotRun { tool, install }),
        };
        match &outcome {
            Outcome::Passed => println!("    passed in {:.1} s", took.as_secs_f64()),
            Outcome::Failed(why) => println!("    FAILED: {why}"),
            Outcome::NotRun { tool, install } => println!("{}", not_run(&name, tool, install)),
        }
        self.rows.push(Row {
            name,
            outcome,
            took,
        });
        value
    }

    /// True if there is at least one step and every one passed.
    pub(crate) fn all_passed(&self) -> bool {
        !self.rows.is_empty() && self.rows.iter().all(|row| row.outcome == Outcome::Passed)
    }
}

fn missing(tool: &str, install: &str) -> String {
    format!("missing {tool}; install with: {install}")
}

fn not_run(step: &str, tool: &str, install: &str) -> String {
    format!("NOT RUN: {step}: {}", missing(tool, install))
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self
            .rows
            .iter()
            .map(|row| row.name.chars().count())
            .max()
            .unwrap_or(0);
        writeln!(f)?;
        let (mut passed, mut failed, mut skipped) = (0, 0, 0);
        for row in &self.rows {
            let word = match row.outcome {
                Outcome::Passed => {
                    passed += 1;
                    "passed"
                }
                Outcome::Failed(_) => {
                    failed += 1;
                    "FAILED"
                }
                Outcome::NotRun { .. } => {
                    skipped += 1;
                    "NOT RUN"
                }
            };
            writeln!(
                f,
                "{word:<8} {:<width$} {:>7.1} s",
                row.name,
                row.took.as_secs_f64()
            )?;
        }
        writeln!(f)?;
        for row in &self.rows {
            match &row.outcome {
                Outcome::Passed => {}
                Outcome::Failed(why) => writeln!(f, "FAILED: {}: {why}", row.name)?,
                Outcome::NotRun { tool, install } => {
                    writeln!(f, "{}", not_run(&row.name, tool, install))?;
                }
            }
        }
        // A step that was not run has not passed; it is counted with the failed ones.
        write!(f, "{passed} passed, {} failed", failed + skipped)?;
        if skipped > 0 {
            write!(f, " ({skipped} of them NOT RUN)")?;
        }
        writeln!(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_report_has_not_passed() {
        assert!(!Report::new().all_passed());
    }

    #[test]
    fn a_missing_tool_is_neither_passed_nor_silent() {
        let mut report = Report::new();
        assert_eq!(report.step("one", || Ok(7)), Some(7));
        assert!(report.all_passed());
        let none = report.step("no_std check", || -> StepResult {
            Err(StepError::missing("target x", "rustup target add x"))
        });
        assert_eq!(none, None);
        assert!(!report.all_passed());
        let text = report.to_string();
        let line = "NOT RUN: no_std check: missing target x; install with: rustup target add x";
        assert!(text.lines().any(|l| l == line), "{text}");
        assert!(
            text.ends_with("1 passed, 1 failed (1 of them NOT RUN)\n"),
            "{text}"
        );
    }

    #[test]
    fn a_failure_is_named_with_its_cause() {
        let mut report = Report::new();
        report.step("good", || Ok(()));
        report.step("bad", || -> StepResult {
            Err(anyhow::anyhow!("inner").context("outer").into())
        });
        assert!(!report.all_passed());
        let text = report.to_string();
        assert!(
            text.lines().any(|l| l == "FAILED: bad: outer: inner"),
            "{text}"
        );
        assert!(text.ends_with("1 passed, 1 failed\n"), "{text}");
    }
}
