//! The log of a run, opened by a reader that is not ours.

use std::fs;
use std::path::Path;

use anyhow::anyhow;

use crate::process::{command, run, target_dir};
use crate::report::Report;
use crate::{rust, tools};

/// First the checker is checked (it must refuse broken logs), then the run's log.
/// Without a run there is nothing to open, which is a failure, not a skipped step.
pub(crate) fn steps(report: &mut Report, run_dir: Option<&Path>) {
    report.step("MCAP checker refuses broken logs", || {
        let python = tools::python()?;
        run(command(python)
            .args(["-m", "unittest", "discover", "--start-directory"])
            .arg("tests/python"))?;
        Ok(())
    });
    report.step("MCAP log in the Python reader", || {
        let run_dir = run_dir.ok_or_else(|| anyhow!("there is no run to open"))?;
        let python = tools::python()?;
        // A relative folder is meant from where the user stands, not from the root.
        let run_dir = std::path::absolute(run_dir)?;
        run(command(python)
            .arg("tests/python/check_mcap.py")
            .arg(run_dir))?;
        Ok(())
    });
    report.step(
        "MCAP log that was cut off, recovered, in the Python reader",
        || {
            let run_dir = run_dir.ok_or_else(|| anyhow!("there is no run to open"))?;
            let folder = target_dir().join("xtask").join("recovered");
            // The checker wants one log in a folder.
            let cut = folder.with_extension("cut.mcap");
            if folder.exists() {
                fs::remove_dir_all(&folder)?;
            }
            fs::create_dir_all(&folder)?;
            let log = fs::read(std::path::absolute(run_dir)?.join("log.mcap"))?;
            fs::write(&cut, &log[..log.len() * 3 / 5])?;
            rust::build(&["--bin", "wheeleg"])?;
            run(command(target_dir().join("release").join("wheeleg"))
                .args(["log", "recover"])
                .arg(&cut)
                .arg("--out")
                .arg(folder.join("log.mcap")))?;
            run(command(tools::python()?)
                .arg("tests/python/check_mcap.py")
                .arg(&folder))?;
            Ok(())
        },
    );
}
