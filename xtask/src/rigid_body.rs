//! The robot's dynamics against a rigid-body library that is not ours, and the robot on rigid ground
//! against another physics engine.

use std::fs;
use std::path::Path;

use anyhow::Result;

use crate::process::{command, empty_folder, output, run, step_folder, target_dir, wheeleg};
use crate::report::Report;
use crate::rust;
use crate::tools;

const ROBOT: &str = "wheeleg-2003";
const SEED: &str = "1";
const STATES: &str = "200";

/// Exports the robot, computes the same states with our dynamics and with Pinocchio, compares them; then
/// falsifies the export in many places, each of which must be noticed.
pub(crate) fn steps(report: &mut Report) {
    let folder = step_folder("rigid-body");
    let (urdf, states) = (folder.join("robot.urdf"), folder.join("states.json"));
    let made = report.step("rigid body: export of robot and states", || {
        Ok(export(&folder, &urdf, &states)?)
    });
    let compare = |options: &[&str]| {
        let python = tools::python()?;
        run(command(python)
            .arg("tests/python/check_rigid_body.py")
            .args([&urdf, &states])
            .args(options))?;
        Ok(())
    };
    if made.is_some() {
        report.step("rigid body: Pinocchio on the same states", || compare(&[]));
        report.step("rigid body: a falsified robot is noticed", || {
            compare(&["--seeded-errors"])
        });
    }
    report.step("rigid body: MuJoCo on the same ground", || {
        let results = folder.join("terrain.json");
        let example = target_dir().join("release/examples/rigid_terrain");
        fs::create_dir_all(&folder).map_err(anyhow::Error::from)?;
        rust::build(&["--example", "rigid_terrain"])?;
        fs::write(&results, output(&mut command(example))?).map_err(anyhow::Error::from)?;
        let python = tools::python()?;
        run(command(python)
            .arg("tests/python/check_terrain.py")
            .arg(&results))?;
        Ok(())
    });
}

fn export(folder: &Path, urdf: &Path, states: &Path) -> Result<()> {
    empty_folder(folder)?;
    rust::build(&["--bin", "wheeleg", "--example", "floating_states"])?;
    run(command(wheeleg())
        .args(["export", "urdf", ROBOT, "--out"])
        .arg(urdf))?;
    let text = output(
        command(target_dir().join("release/examples/floating_states")).args([ROBOT, SEED, STATES]),
    )?;
    fs::write(states, text)?;
    Ok(())
}
