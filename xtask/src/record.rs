//! The record of long checks: a dated line for each, so that the repository shows what was last checked, and
//! when.

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;

use anyhow::{Context, Result};

use crate::process::{ask, command, root};

const RECORD: &str = "docs/records/deep.md";

/// Appends a line: date, commit, check, result.
pub(crate) fn note(name: &str, result: &Result<String, impl Display>) -> Result<()> {
    let text = match result {
        Ok(text) => text.clone(),
        Err(error) => format!("FAILED: {error}"),
    };
    let date = ask(command("date").args(["-u", "+%F"])).unwrap_or_else(|| "undated".to_owned());
    let commit = ask(command("git").args(["rev-parse", "--short", "HEAD"]));
    let commit = commit.unwrap_or_else(|| "-".to_owned());
    let first = text.lines().next().unwrap_or_default().replace('|', "/");
    let first = first.replace(&format!("{}/", root().display()), "");
    let mut file = OpenOptions::new()
        .append(true)
        .open(root().join(RECORD))
        .context(RECORD)?;
    writeln!(file, "| {date} | {commit} | {name} | {first} |")?;
    Ok(())
}
