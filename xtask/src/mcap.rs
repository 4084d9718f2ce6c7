//! The log of a run, opened by a reader that is not ours.

use std::fs;
use std::path::Path;

use anyhow::anyhow;

use crate::process::{command, empty_folder, run, step_folder};
use crate::report::{Report, StepResult};
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
        // A relative folder is relative to the user's current folder, not to the root.
        let run_dir = std::path::absolute(run_dir)?;
        run(command(python)
            .arg("tests/python/check_mcap.py")
            .arg(run_dir))?;
        Ok(())
    });
    report.step("MCAP log and its exports in programs of others", || {
        let run_dir = run_dir.ok_or_else(|| anyhow!("there is no run to open"))?;
        viewers(&std::path::absolute(run_dir)?)
    });
    report.step(
        "MCAP log that was cut off, recovered, in the Python reader",
        || {
            let run_dir = run_dir.ok_or_else(|| anyhow!("there is no run to open"))?;
            let folder = step_folder("recovered");
            // The checker wants one log in a folder.
            let cut = folder.with_extension("cut.mcap");
            empty_folder(&folder)?;
            let log = fs::read(std::path::absolute(run_dir)?.join("log.mcap"))?;
            fs::write(&cut, &log[..log.len() * 3 / 5])?;
            run(command(rust::build_wheeleg()?)
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

/// Checks frames, joints, scene, tables and bag of a run with the formats' own readers.
fn viewers(run_dir: &Path) -> StepResult<()> {
    let folder = step_folder("exports");
    empty_folder(&folder)?;
    let wheeleg = rust::build_wheeleg()?;
    let summary: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(run_dir.join("summary.json"))?)?;
    let robot = summary["robot"].as_str().unwrap_or("wheeleg-2003");
    let (urdf, tables, bag) = (
        folder.join("robot.urdf"),
        folder.join("parquet"),
        folder.join("ros2"),
    );
    run(command(&wheeleg)
        .args(["export", "urdf", robot, "--out"])
        .arg(&urdf))?;
    for (format, out) in [("parquet", &tables), ("ros2", &bag)] {
        let mut export = command(&wheeleg);
        run(export
            .args(["export", format])
            .arg(run_dir)
            .arg("--out")
            .arg(out))?;
    }
    run(command(tools::python()?)
        .arg("tests/python/check_viewers.py")
        .args([run_dir, &urdf, &tables, &bag])
        .arg("docs/guide/log.sql"))?;
    Ok(())
}
