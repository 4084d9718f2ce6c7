//! `--json`: standard output carries one line for machines and nothing else.

use std::fs::File;
use std::io::Write;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::report::Report;

/// Where figures for machines go.
pub(crate) struct Machine(File);

impl Machine {
    /// If `wanted`, keeps standard output for the figures: all texts for people from now on, of this program
    /// and those that it starts, go to standard error. `None`, and a failed step, if the system does not give
    /// another handle.
    pub(crate) fn of(report: &mut Report, wanted: bool) -> Option<Option<Self>> {
        if !wanted {
            return Some(None);
        }
        match Self::begin() {
            Ok(machine) => Some(Some(machine)),
            Err(error) => report.step("standard output for machines", || Err(error.into())),
        }
    }

    fn begin() -> Result<Self> {
        let kept = rustix::io::dup(std::io::stdout()).context("cannot keep standard output")?;
        rustix::stdio::dup2_stdout(std::io::stderr()).context("cannot join the outputs")?;
        Ok(Self(kept.into()))
    }

    /// Prints figures as one line.
    ///
    /// # Errors
    /// Nobody reads any more.
    pub(crate) fn print(mut self, figures: &Value) -> Result<()> {
        writeln!(self.0, "{figures}").context("cannot print the figures")
    }
}
