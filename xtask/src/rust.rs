//! Format, lints and host tests.

use crate::process::{cargo, run};
use crate::report::StepResult;

/// Seed of the property tests in the suite.
const PROPTEST_SEED: &str = "20030001";

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
        // Its build tools may be missing; `cargo xtask pil` looks after it.
        "--exclude",
        "wheeleg-pil-unicorn",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ]))?;
    // Tests that need images and emulators to run need neither to be read.
    let emulated = ["--package", "wheeleg-tests", "--features", "pil,qemu"];
    run(cargo()
        .args(["clippy", "--locked", "--no-deps", "--tests"])
        .args(emulated)
        .args(["--", "-D", "warnings"]))?;
    Ok(())
}

/// All host tests, doc tests and system tests. One failing test program does
/// not hide the others.
pub(crate) fn test() -> StepResult {
    // One seed for the property tests, so that the same sources give the same
    // verdict; `cargo test` alone draws new cases every time.
    run(cargo()
        .args(["test", "--locked", "--workspace", "--no-fail-fast"])
        .args(["--exclude", "wheeleg-pil-unicorn"])
        .env("PROPTEST_RNG_SEED", PROPTEST_SEED))?;
    Ok(())
}
