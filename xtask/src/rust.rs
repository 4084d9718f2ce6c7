//! Format, lints and host tests.

use std::path::PathBuf;

use anyhow::Context;

use crate::process::{cargo, figures, run, wheeleg};
use crate::report::StepResult;

/// Everything that needs neither boards nor an emulator's build tools: without the builds of `cargo xtask
/// pil`. One selection for all steps, since each selection needs its own set of features.
pub(crate) const HOST: [&str; 3] = ["--workspace", "--exclude", "wheeleg-pil-unicorn"];

/// Seed of the property tests in the suite.
const PROPTEST_SEED: &str = "20030001";

/// Builds `targets` of the host's release build, together with a test, because dependencies of tests add
/// features to common dependencies: without a test everything would be built a second time.
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
        "wheeleg-tests/ablation,wheeleg-tests/pil,wheeleg-tests/qemu",
        "--",
        "-D",
        "warnings",
    ]))?;
    Ok(())
}

/// All host tests, doc tests and system tests, with the long ones that `cargo test` lists as ignored. One
/// failing test program does not hide the others. In the release build, which the later steps need anyway and
/// whose arithmetic and assertions are checked: a second build of everything takes as long as the tests.
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

/// Runs one test by name in the build of the suite, as often as these variables say, and returns the line of
/// its output that has `marker`. It is also printed if the test fails.
pub(crate) fn measured(
    [program, test]: [&str; 2],
    amounts: &[(&str, u32)],
    marker: &str,
) -> StepResult<String> {
    let mut test_run = cargo();
    test_run
        .args(["test", "--locked", "--release"])
        .args(HOST)
        .args(["--test", program, "--", "--exact"])
        .args(["--include-ignored", "--nocapture", test]);
    for (variable, amount) in amounts {
        test_run.env(variable, amount.to_string());
    }
    let found = figures(&mut test_run, |line| line.contains(marker))?;
    let first = found.into_iter().next();
    Ok(first.with_context(|| format!("no line with `{marker}`"))?)
}
