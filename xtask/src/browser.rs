//! The report of a run, opened in a browser that is not ours, and a robot driven from it.

use std::path::Path;

use anyhow::anyhow;

use crate::process::{command, run, target_dir};
use crate::report::{Report, StepError};
use crate::{rust, tools};

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
    report.step("console in a browser", || {
        if !tools::have(CHROMIUM) {
            let install = format!("apt-get install -y {CHROMIUM}");
            return Err(StepError::missing(CHROMIUM, install));
        }
        rust::build(&["--bin", "wheeleg"])?;
        let release = target_dir().join("release");
        run(command(tools::python()?)
            .arg("tests/python/check_console.py")
            .arg(release.join("wheeleg"))
            .arg(target_dir().join("console-shots")))?;
        Ok(())
    });
}
