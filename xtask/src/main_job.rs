//! The main job as a user runs it: release build, the three-step test, twice.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::process::{command, output, remove_folder, step_folder, wheeleg};
use crate::report::Report;
use crate::rust;

const SEED: &str = "1";

/// Builds, runs twice, compares. Returns the folder of the first run.
pub(crate) fn steps(report: &mut Report) -> Option<PathBuf> {
    report.step("release build", || Ok(rust::build_wheeleg()?))?;
    let first = report.step("main job: wheeleg run three-step", || {
        let summary = simulate("main-job-a")?;
        check_targets(&summary.json)?;
        println!("      {} times real time", summary.json["realtime_factor"]);
        Ok(summary)
    });
    report.step("same seed in another folder: same hash", || {
        let Some(first) = &first else {
            return Err(anyhow::anyhow!("the first run failed").into());
        };
        // Another depth, so that no length of a path can hide in the hash.
        let second = simulate("main-job-b/deeper/down")?;
        Ok(same_hash(&first.json, &second.json)?)
    });
    first.map(|summary| summary.folder)
}

struct Summary {
    folder: PathBuf,
    json: Value,
}

fn simulate(name: &str) -> Result<Summary> {
    let folder = step_folder(name);
    remove_folder(&folder)?;
    let stdout = output(
        command(wheeleg())
            .args(["run", "three-step", "--json", "--seed", SEED, "--out"])
            .arg(&folder),
    )?;
    let json: Value = serde_json::from_str(&stdout).context("--json: not one JSON object")?;
    check_file(&folder, &json)?;
    Ok(Summary { folder, json })
}

/// The file in the folder equals standard output.
fn check_file(folder: &Path, json: &Value) -> Result<()> {
    let path = folder.join("summary.json");
    let text = fs::read_to_string(&path).with_context(|| format!("{}", path.display()))?;
    let file: Value = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
    ensure!(file == *json, "summary.json differs from standard output");
    Ok(())
}

/// Every required target is met, and none in the paper's list is missing.
fn check_targets(json: &Value) -> Result<()> {
    let targets = json["targets"].as_array().context("no `targets`")?;
    for id in ["A19", "A20", "A21", "A22", "A23", "A25", "A26", "A27"] {
        ensure!(
            targets.iter().any(|target| target["id"]
                .as_str()
                .is_some_and(|found| found.starts_with(id))),
            "target {id} is not reported"
        );
    }
    let mut missed = Vec::new();
    for target in targets {
        println!(
            "      {:<12} {:>12} {:<8} [{}, {}] {}",
            target["id"].as_str().unwrap_or("?"),
            target["value"],
            target["unit"].as_str().unwrap_or("?"),
            target["min"],
            target["max"],
            target["pass"]
        );
        if target["required"] == Value::Bool(false) {
            continue;
        }
        let id = target["id"].as_str().context("a target without `id`")?;
        if target["pass"] != Value::Bool(true) {
            missed.push(id.to_owned());
        }
    }
    if !missed.is_empty() {
        bail!("targets missed: {}", missed.join(", "));
    }
    Ok(())
}

fn same_hash(first: &Value, second: &Value) -> Result<()> {
    let a = first["hash"].as_str().context("no `hash`")?;
    let b = second["hash"].as_str().context("no `hash`")?;
    println!("      {a}\n      {b}");
    ensure!(!a.is_empty() && a == b, "hashes differ: {a} and {b}");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn summary(pass: bool) -> Value {
        let ids = ["A19", "A20", "A21", "A22", "A23", "A25", "A26", "A27"];
        let targets: Vec<Value> = ids
            .iter()
            .map(|id| json!({"id": id, "value": 1.0, "unit": "mm", "min": 0.0, "max": 2.0, "required": true, "pass": pass || *id != "A27"}))
            .collect();
        json!({"hash": "ab", "targets": targets})
    }

    #[test]
    fn a_missed_or_absent_target_fails() {
        assert!(check_targets(&summary(true)).is_ok());
        let error = check_targets(&summary(false)).unwrap_err().to_string();
        assert!(error.contains("A27"), "{error}");
        let mut short = summary(true);
        short["targets"].as_array_mut().unwrap().remove(0);
        let error = check_targets(&short).unwrap_err().to_string();
        assert!(error.contains("A19"), "{error}");
    }

    #[test]
    fn hashes_must_be_there_and_equal() {
        assert!(same_hash(&summary(true), &summary(true)).is_ok());
        assert!(same_hash(&summary(true), &json!({"hash": "ac"})).is_err());
        assert!(same_hash(&json!({"hash": ""}), &json!({"hash": ""})).is_err());
    }
}
