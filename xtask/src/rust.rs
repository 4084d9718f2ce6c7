//! Format, lints and host tests.

use std::path::PathBuf;

use crate::process::{cargo, run, wheeleg};
use crate::report::StepResult;

/// All that needs neither boards nor an emulator's build tools: what `cargo xtask pil` builds is
/// left out. One selection for all steps, since each has its own set of features to build for.
pub(crate) const HOST: [&str; 3] = ["--workspace", "--exclude", "wheeleg-pil-unicorn"];

/// Seed of the property tests in the suite.
const PROPTEST_SEED: &str = "20030001";

/// Builds `targets` of the host's release build. With a test beside them, because what only
/// tests depend on adds features to what all depend on: without one everything would be
/// built a second time.
pub(crate) fn build(targets: &[&str]) -> anyhow::Result<()> {
    run(cargo()
        .args(["build", "--locked", "--release", "--test", "determinism"])
        .args(HOST)
        .args(targets))
}

/// Builds our program; its path.
pub(crate) fn build_wheeleg() -> anyhow::Result<PathBuf> {
    build(&["--bin", "wheeleg"])?;
    Ok(wheeleg())
}

/// The format of every crate.
pub(crate) fn fmt() -> StepResult {
    run(cargo().args(["fmt", "--all", "--check"]))?;
    Ok(())
}

/// Lints of every member and every target, warnings being errors. Tests that need images and
/// emulators to run need neither to be read.
pub(crate) fn clippy() -> StepResult {
    run(cargo().args(["clippy", "--locked"]).args(HOST).args([
        "--all-targets",
        "--features",
        "wheeleg-tests/pil,wheeleg-tests/qemu",
        "--",
        "-D",
        "warnings",
    ]))?;
    Ok(())
}

/// All host tests, doc tests and system tests, with the long ones that `cargo test` leaves out and
/// names as ignored. One failing test program does not hide the others. In the release build, which
/// the later steps need anyway and whose arithmetic and assertions are checked: a second build of
/// everything takes as long as the tests.
pub(crate) fn test() -> StepResult {
    // One seed for the property tests, so that the same sources give the same
    // verdict; `cargo test` alone draws new cases every time.
    run(cargo()
        .args(["test", "--locked", "--release", "--no-fail-fast"])
        .args(HOST)
        .args(["--", "--include-ignored"])
        .env("PROPTEST_RNG_SEED", PROPTEST_SEED))?;
    Ok(())
}
