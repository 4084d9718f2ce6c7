//! Mutations of the code that decides safe states: each is built and tested;
//! one that no test notices must stand in `firmware/SURVIVORS.md` with a reason.

use std::collections::BTreeSet;
use std::fs;

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::process::{cargo, root, run, succeeds, target_dir};
use crate::report::{Report, StepError, StepResult};

/// Pinned, because another version makes other mutations.
const VERSION: &str = "27.1.0";

/// Files whose mistakes could leave an axis energised, and the packages whose
/// tests must notice.
const MODULES: [(&str, &[&str]); 4] = [
    ("firmware/node/src/mode.rs", &["wheeleg-node"]),
    ("firmware/node/src/faults.rs", &["wheeleg-node"]),
    ("firmware/node/src/supervisor.rs", &["wheeleg-node"]),
    (
        "protocol/src/link/supervisor.rs",
        &["wheeleg-protocol", "wheeleg-node"],
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
    for (file, packages) in MODULES {
        if options
            .file
            .as_deref()
            .is_some_and(|part| !file.contains(part))
        {
            continue;
        }
        report.step(format!("mutants: {file}"), || {
            println!("    {}", module(file, packages)?);
            Ok(())
        });
    }
}

/// All files; a sentence about the result.
pub(crate) fn run_all() -> StepResult<String> {
    let mut texts = Vec::new();
    for (file, packages) in MODULES {
        texts.push(module(file, packages)?);
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

fn module(file: &str, packages: &[&str]) -> StepResult<String> {
    install()?;
    let out = target_dir().join("mutants").join(file.replace('/', "-"));
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    fs::create_dir_all(&out)?;
    let status = cargo()
        .args(["mutants", "--no-shuffle", "--jobs=1", "--colors=never"])
        .args(["--timeout=120", "--test-workspace=false"])
        .args(["--file", file, "--output"])
        .arg(&out)
        .args(
            packages
                .iter()
                .map(|package| format!("--test-package={package}")),
        )
        .status()
        .context("cargo mutants")?;
    // 0: all caught; 2: some missed; 3: some timed out, which counts as caught.
    if !matches!(status.code(), Some(0 | 2 | 3)) {
        return Err(anyhow::anyhow!("cargo mutants ended with {status}").into());
    }
    let lines = |name: &str| {
        let path = out.join("mutants.out").join(name);
        fs::read_to_string(&path).with_context(|| format!("{}", path.display()))
    };
    let caught = lines("caught.txt")?.lines().count() + lines("timeout.txt")?.lines().count();
    let missed = lines("missed.txt")?;
    let reasons = fs::read_to_string(root().join(SURVIVORS)).unwrap_or_default();
    judge(file, &missed, &reasons)?;
    let survivors = missed.lines().count();
    Ok(format!(
        "{file}: {caught} caught, {survivors} survive with a reason"
    ))
}

/// A mutant's name without its place in the file, which moves with every edit.
fn name_of(line: &str) -> &str {
    line.split_once(": ").map_or(line, |(_, name)| name).trim()
}

/// Every survivor has a reason, and every reason of this file a survivor.
fn judge(file: &str, missed: &str, reasons: &str) -> Result<()> {
    let missed: BTreeSet<&str> = missed.lines().map(name_of).collect();
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
    }
}
