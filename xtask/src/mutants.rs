//! Mutations of the code that decides safe states: each is built and tested; one that no test notices must be
//! listed in `firmware/SURVIVORS.md` with a reason.

use std::collections::BTreeSet;
use std::fs;

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::process::{cargo, empty_folder, root, run, succeeds, target_dir};
use crate::report::{Report, StepError, StepResult};

/// Pinned, because another version makes other mutations.
const VERSION: &str = "27.1.0";

/// Files whose mistakes could leave an axis energised, and the packages whose tests must notice. Each group
/// is built and tested together.
const GROUPS: [(&[&str], &[&str]); 4] = [
    (
        &[
            "firmware/node/src/board.rs",
            "firmware/node/src/clock.rs",
            "firmware/node/src/mode.rs",
            "firmware/node/src/faults.rs",
            "firmware/node/src/debounce.rs",
            "firmware/node/src/overrun.rs",
            "firmware/node/src/checksum.rs",
            "firmware/node/src/sensor.rs",
            "firmware/node/src/supervisor.rs",
            "firmware/node/src/store/mod.rs",
            "firmware/node/src/joint/air.rs",
            "firmware/node/src/joint/no_motion_detector.rs",
            "firmware/node/src/joint/node.rs",
            "firmware/node/src/joint/outputs.rs",
            "firmware/node/src/joint/precharge.rs",
            "firmware/node/src/joint/reference.rs",
            "firmware/node/src/joint/requests.rs",
            "firmware/node/src/joint/settings.rs",
            "firmware/node/src/time.rs",
            "firmware/node/src/wheel/encoder.rs",
            "firmware/node/src/wheel/motion.rs",
            "firmware/node/src/wheel/node.rs",
            "firmware/node/src/wheel/outputs.rs",
            "firmware/node/src/wheel/requests.rs",
        ],
        &["wheeleg-node"],
    ),
    (
        &["protocol/src/link/supervisor.rs"],
        &["wheeleg-protocol", "wheeleg-node"],
    ),
    (
        &["firmware/control/src/valve.rs"],
        &["wheeleg-control", "wheeleg-node"],
    ),
    (
        &[
            "firmware/master/src/layer0/acyclic.rs",
            "firmware/master/src/layer0/commands.rs",
            "firmware/master/src/layer0/cycle.rs",
            "firmware/master/src/layer0/left_behind.rs",
            "firmware/master/src/layer0/line.rs",
            "firmware/master/src/layer0/liveness.rs",
            "firmware/master/src/layer0/nodes.rs",
            "firmware/master/src/layer0/questions.rs",
            "firmware/master/src/layer0/reflex.rs",
            "firmware/master/src/layer0/requests.rs",
            "firmware/master/src/layer0/safety.rs",
            "firmware/master/src/layer0/sums.rs",
            "firmware/master/src/layer0/wheels.rs",
            "firmware/master/src/layer1/square.rs",
        ],
        &["wheeleg-master"],
    ),
];

/// Mutants that live, with their reasons.
const SURVIVORS: &str = "firmware/SURVIVORS.md";

#[derive(Args)]
pub(crate) struct Options {
    /// Only files whose path contains this.
    file: Option<String>,
}

/// `cargo xtask mutants`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    let wanted = |file: &&str| {
        let part = options.file.as_deref();
        part.is_none_or(|part| file.contains(part))
    };
    for (index, (files, packages)) in GROUPS.iter().enumerate() {
        let files: Vec<&str> = files.iter().copied().filter(wanted).collect();
        if files.is_empty() {
            continue;
        }
        report.step(format!("mutants: {}", files.join(", ")), || {
            println!("    {}", group(index, &files, packages)?);
            Ok(())
        });
    }
}

/// All files; a sentence about the result.
pub(crate) fn run_all() -> StepResult<String> {
    let mut texts = Vec::new();
    for (index, (files, packages)) in GROUPS.iter().enumerate() {
        texts.push(group(index, files, packages)?);
    }
    Ok(texts.join("; "))
}

fn install() -> StepResult {
    let there = || succeeds(cargo().args(["mutants", "--version"]));
    if there() {
        return Ok(());
    }
    let install = ["install", "cargo-mutants", "--locked", "--version", VERSION];
    let _ = run(cargo().args(install));
    if there() {
        Ok(())
    } else {
        let command = format!("cargo {}", install.join(" "));
        Err(StepError::missing("cargo-mutants", command))
    }
}

/// Mutates a copy of the sources, as cargo-mutants does itself; its build stays below the target folder for
/// the next time.
fn group(index: usize, files: &[&str], packages: &[&str]) -> StepResult<String> {
    install()?;
    let folder = target_dir().join("mutants");
    let out = folder.join(index.to_string());
    empty_folder(&out)?;
    let log = fs::File::create(out.join("log.txt"))?;
    let status = cargo()
        .args(["mutants", "--no-shuffle", "--jobs=1", "--colors=never"])
        .args(["--timeout=30", "--test-workspace=false"])
        .args(files.iter().flat_map(|file| ["--file", file]))
        .args(packages.iter().map(|name| format!("--test-package={name}")))
        .arg("--output")
        .arg(&out)
        .env("CARGO_TARGET_DIR", folder.join("build"))
        // Short builds: there are some five hundred of them, each with one changed line.
        .env("CARGO_PROFILE_TEST_INCREMENTAL", "true")
        .env("CARGO_PROFILE_TEST_OPT_LEVEL", "1")
        .env("CARGO_PROFILE_TEST_DEBUG", "false")
        .env("CARGO_PROFILE_DEV_DEBUG", "false")
        .stdout(log.try_clone()?)
        .stderr(log)
        .status()
        .context("cargo mutants")?;
    // 0: all caught; 2: some missed; 3: some timed out, which counts as caught.
    if !matches!(status.code(), Some(0 | 2 | 3)) {
        let log = out.join("log.txt");
        let why = format!("cargo mutants ended with {status}; see {}", log.display());
        return Err(anyhow::anyhow!(why).into());
    }
    let lines = |name: &str| {
        let path = out.join("mutants.out").join(name);
        fs::read_to_string(&path).with_context(|| format!("{}", path.display()))
    };
    let caught = lines("caught.txt")?.lines().count();
    let hung = lines("timeout.txt")?.lines().count();
    let unviable = lines("unviable.txt")?.lines().count();
    let missed = lines("missed.txt")?;
    let reasons = fs::read_to_string(root().join(SURVIVORS)).unwrap_or_default();
    for file in files {
        judge(file, &missed, &reasons)?;
    }
    let survivors = missed.lines().count();
    Ok(format!(
        "{} files: {caught} mutants caught, {hung} hung, {survivors} survive with a written \
         reason, {unviable} did not compile",
        files.len()
    ))
}

/// A mutant's name without its place in the file, which moves with every edit. One reason covers all mutants
/// of a file with the same name.
fn name_of(line: &str) -> &str {
    line.split_once(": ").map_or(line, |(_, name)| name).trim()
}

/// Every survivor has a reason, and every reason of this file a survivor.
fn judge(file: &str, missed: &str, reasons: &str) -> Result<()> {
    let of_file = |line: &&str| line.split(':').next() == Some(file);
    let missed: BTreeSet<&str> = missed.lines().filter(of_file).map(name_of).collect();
    let section = reasons
        .split("\n## ")
        .find(|section| section.starts_with(file))
        .unwrap_or_default();
    let known: BTreeSet<&str> = section
        .lines()
        .filter_map(|line| line.strip_prefix("- `")?.split('`').next())
        .collect();
    let unexplained: Vec<_> = missed.difference(&known).collect();
    let stale: Vec<_> = known.difference(&missed).collect();
    if !unexplained.is_empty() || !stale.is_empty() {
        bail!(
            "{file}: survivors without a reason in {SURVIVORS}: {unexplained:#?}; reasons without a survivor: {stale:#?}"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const REASONS: &str = "# Survivors\n\n## a.rs\n\n- `replace f with ()`: why\n\n## b.rs\n\n- `replace g with 1`: why\n";

    #[test]
    fn a_survivor_needs_a_reason_and_a_reason_a_survivor() {
        let line = "a.rs:10:5: replace f with ()\n";
        assert!(judge("a.rs", line, REASONS).is_ok());
        assert!(judge("a.rs", "a.rs:10:5: replace h with ()\n", REASONS).is_err());
        assert!(judge("b.rs", "", REASONS).is_err());
        assert!(judge("c.rs", "", REASONS).is_ok());
        // The survivors of another file are judged with that file.
        assert!(judge("c.rs", line, REASONS).is_ok());
    }
}
