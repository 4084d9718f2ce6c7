//! The log hash of every built-in scenario, compared with an earlier record.
//!
//! A refactoring leaves them all unchanged.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use serde_json::Value;

use crate::process::{command, output, remove_folder, step_folder, wheeleg};
use crate::report::Report;
use crate::rust;

/// Printed digits: enough to distinguish runs.
const DIGITS: usize = 16;

#[derive(Args)]
pub(crate) struct Options {
    /// A record with rows `| scenario | hash |`; of several rows of a scenario the last counts.
    /// A hash that differs fails.
    #[arg(long, value_name = "FILE")]
    earlier: Option<PathBuf>,
}

/// `cargo xtask hashes`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    report.step("release build", || Ok(rust::build_wheeleg()?));
    report.step("hashes of all built-in scenarios", || {
        let hashes = hashes()?;
        println!("| scenario | hash |\n|---|---|");
        for (scenario, hash) in &hashes {
            println!("| {scenario} | {hash} |");
        }
        match &options.earlier {
            Some(file) => Ok(compare(&hashes, &read(file)?)?),
            None => Ok(()),
        }
    });
}

/// Scenarios in the order of `wheeleg list`, each with the start of its hash.
fn hashes() -> Result<Vec<(String, String)>> {
    let list = json(&["list", "--json"])?;
    let scenarios = list["scenarios"].as_array().context("no scenarios")?;
    let names = scenarios.iter().filter_map(|s| s["name"].as_str());
    let folder = step_folder("hashes");
    let folder = folder.to_str().context("path of the target folder")?;
    let hash = |name: &str| -> Result<(String, String)> {
        let summary = json(&["run", name, "--json", "--out", folder])?;
        let hash = summary["hash"].as_str().and_then(|h| h.get(..DIGITS));
        Ok((name.to_owned(), hash.context("no hash")?.to_owned()))
    };
    let all = names.map(hash).collect();
    remove_folder(folder.as_ref())?;
    all
}

fn json(arguments: &[&str]) -> Result<Value> {
    let text = output(command(wheeleg()).args(arguments))?;
    serde_json::from_str(&text).context("--json: not one JSON object")
}

/// The rows of a record.
fn read(file: &Path) -> Result<Vec<(String, String)>> {
    let text = fs::read_to_string(file).with_context(|| format!("{}", file.display()))?;
    let rows = rows(&text);
    ensure!(
        !rows.is_empty(),
        "{}: no rows `| scenario | hash |`",
        file.display()
    );
    Ok(rows)
}

/// Rows whose second cell is a hash.
fn rows(text: &str) -> Vec<(String, String)> {
    let is_hash = |cell: &str| cell.len() == DIGITS && cell.bytes().all(|b| b.is_ascii_hexdigit());
    let cells = text.lines().filter_map(|line| {
        let mut cells = line.split('|').map(str::trim).skip(1);
        Some((cells.next()?, cells.next()?))
    });
    let rows = cells.filter(|(_, hash)| is_hash(hash));
    rows.map(|(name, hash)| (name.to_owned(), hash.to_owned()))
        .collect()
}

fn compare(now: &[(String, String)], earlier: &[(String, String)]) -> Result<()> {
    let mut differs = Vec::new();
    for (name, hash) in now {
        match earlier.iter().rev().find(|(n, _)| n == name) {
            Some((_, before)) if before == hash => {}
            Some((_, before)) => differs.push(format!("{name}: {before} is now {hash}")),
            None => differs.push(format!("{name}: not in the record")),
        }
    }
    if !differs.is_empty() {
        bail!("{}", differs.join("; "));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_row_counts_and_what_differs_is_named() {
        let text = "| scenario | hash |\n|---|---|\n| stand | 0123456789abcdef |\n\
                    | walk | 00000000000000aa | more |\n| stand | fedcba9876543210 |\n";
        let earlier = rows(text);
        assert_eq!(earlier.len(), 3);
        let now = |stand: &str| vec![("stand".to_owned(), stand.to_owned())];
        assert!(compare(&now("fedcba9876543210"), &earlier).is_ok());
        let error = compare(&now("0123456789abcdef"), &earlier).expect_err("differs");
        assert!(error.to_string().contains("stand: fedcba9876543210 is now"));
        let new = vec![("new".to_owned(), "00000000000000aa".to_owned())];
        assert!(compare(&new, &earlier).is_err());
    }
}
