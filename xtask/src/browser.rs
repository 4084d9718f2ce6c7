//! The report of a run, opened in a browser that is not ours.

use std::path::Path;

use anyhow::anyhow;

use crate::process::{command, run};
use crate::report::{Report, StepError};
use crate::tools;

/// The browser, and the Debian package that has it.
pub(crate) const CHROMIUM: &str = "chromium";

/// Without a run there is nothing to open, which is a failure, not a skipped step.
pub(crate) fn steps(report: &mut Report, run_dir: Option<&Path>) {
    report.step("report in a browser", || {
        let run_dir = run_dir.ok_or_else(|| anyhow!("there is no run to open"))?;
        if !tools::have(CHROMIUM) {
            let install = format!("apt-get install -y {CHROMIUM}");
            return Err(StepError::missing(CHROMIUM, install));
        }
        let python = tools::python()?;
        // A relative folder is meant from where the user stands, not from the root.
        run(command(python)
            .arg("tests/python/check_report.py")
            .arg(std::path::absolute(run_dir)?))?;
        Ok(())
    });
}
