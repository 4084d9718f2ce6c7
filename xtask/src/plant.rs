//! The pneumatic plant against an independent integration.

use std::fs;
use std::path::Path;

use anyhow::Result;

use crate::process::{command, run, step_folder};
use crate::report::Report;
use crate::rust;
use crate::tools;

/// One axis with the polytropic law is enough for a commit; the script takes any.
const AXES: [&str; 2] = ["bench-vq110u", "heavy-40x250"];

/// Exports valve sequences with the plant's trajectories, and lets scipy
/// integrate the same equations with tight tolerances.
pub(crate) fn steps(report: &mut Report) {
    let folder = step_folder("plant");
    let made = report.step("plant: export of valve sequences", || Ok(export(&folder)?));
    if made.is_none() {
        return;
    }
    for axis in AXES {
        report.step(format!("plant: scipy on the sequences of {axis}"), || {
            let python = tools::python()?;
            run(command(python)
                .arg("tests/python/check_plant.py")
                .arg(folder.join(axis).with_extension("json")))?;
            Ok(())
        });
    }
    report.step("plant: scipy sees a spoilt parameter", || {
        let python = tools::python()?;
        run(command(python)
            .args(["tests/python/check_plant.py", "--spoil"])
            .arg(folder.join(AXES[0]).with_extension("json")))?;
        Ok(())
    });
}

fn export(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)?;
    let wheeleg = rust::build_wheeleg()?;
    for axis in AXES {
        run(command(&wheeleg).args(["plant", "check", axis]))?;
        run(command(&wheeleg)
            .args(["plant", "export", axis, "--out"])
            .arg(folder.join(axis).with_extension("json")))?;
    }
    Ok(())
}
