//! The two implementations of the board bus must agree: the Rust crate, and
//! the Python one that has `SPEC.md` as its only source.

use crate::process::{cargo, command, root, run, target_dir};
use crate::report::Report;
use crate::tools;

/// Streams made by each side.
const FRAMES: &str = "4000";

/// Builds the Rust side, runs the Python side.
pub(crate) fn steps(report: &mut Report) {
    report.step("conformance: Rust and Python agree on SPEC.md", || {
        let python = tools::python()?;
        run(cargo().args([
            "build",
            "--package",
            "wheeleg-protocol",
            "--example",
            "judge",
        ]))?;
        let judge = target_dir().join("debug").join("examples").join("judge");
        let folder = root().join("tests").join("conformance");
        run(command(python)
            .current_dir(&folder)
            .args(["-B", "agree.py", "../../protocol/SPEC.md"])
            .arg(judge)
            .arg(FRAMES))?;
        Ok(())
    });
}
