//! Format, lints and host tests.

use crate::process::{cargo, run};
use crate::report::StepResult;

/// The format of every crate.
pub(crate) fn fmt() -> StepResult {
    run(cargo().args(["fmt", "--all", "--check"]))?;
    Ok(())
}

/// Lints of every member and every target, warnings being errors.
pub(crate) fn clippy() -> StepResult {
    run(cargo().args([
        "clippy",
        "--locked",
        "--workspace",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ]))?;
    Ok(())
}

/// All host tests, doc tests and system tests. One failing test program does
/// not hide the others.
pub(crate) fn test() -> StepResult {
    run(cargo().args(["test", "--locked", "--workspace", "--no-fail-fast"]))?;
    Ok(())
}
