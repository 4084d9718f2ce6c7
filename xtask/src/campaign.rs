//! Campaigns: their table in a program that is not ours, and the long check.

mod slurm;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::process::{command, empty_folder, figures, output, root, run, step_folder, wheeleg};
use crate::report::{Report, StepResult};
use crate::rust::measured;
use crate::{rust, tools};

/// A shipped plan, with its questions in SQL beside it: how it is cut short for the suite, and the rows that are left.
struct Shipped {
    plan: &'static str,
    cuts: &'static [(&'static str, &'static str)],
    rows: u32,
}

const SHIPPED: [Shipped; 5] = [
    Shipped {
        plan: "three-step-spread",
        cuts: &[("samples = 100", "samples = 5")],
        rows: 10,
    },
    Shipped {
        plan: "how-steep",
        cuts: &[
            ("replicates = 5", "replicates = 1"),
            ("[4, 6, 8, 10, 12, 15, 18, 21]", "[4, 21]"),
            (
                r#"["rock", "firm-sand", "volcanic-sand", "dry-sand", "loose-ash"]"#,
                r#"["rock", "loose-ash"]"#,
            ),
            ("[15, 60]", "[60]"),
        ],
        rows: 8,
    },
    Shipped {
        plan: "leg-design",
        cuts: &[
            ("samples = 3 ", "samples = 1 "),
            ("grid = [20]", "grid = [8]"),
            (
                r#""walk", "turn", "sand-slope-10", "rock-slope","#,
                r#""walk", "turn","#,
            ),
            (
                r#""sand-flat", "sand-to-rock", "rocks-20", "rocks-30","#,
                r#""sand-flat", "rocks-20","#,
            ),
            ("grid = [1.0, 0.8]\n", "grid = [1.0]\n"),
            ("grid = [10, 60, 110]", "grid = [10, 60]"),
            ("grid = [600, 500]", "grid = [600]"),
            ("grid = [1.0, 0.8, 1.25]", "grid = [1.0, 0.8]"),
        ],
        rows: 16,
    },
    Shipped {
        plan: "cylinder-spread",
        cuts: &[("samples = 250", "samples = 4")],
        rows: 32,
    },
    Shipped {
        plan: "first-step",
        cuts: &[("samples = 250", "samples = 8")],
        rows: 64,
    },
];

/// The shipped plans, cut short, their tables and their SQL in DuckDB.
pub(crate) fn steps(report: &mut Report) {
    report.step("campaign: the shipped SQL in DuckDB", || {
        let folder = step_folder("campaign");
        empty_folder(&folder)?;
        rust::build_wheeleg()?;
        for shipped in &SHIPPED {
            ask(shipped, &folder)?;
        }
        Ok(())
    });
}

fn ask(shipped: &Shipped, folder: &Path) -> StepResult {
    let file = folder.join(format!("{}.toml", shipped.plan));
    let parts = folder.join(shipped.plan);
    let table = folder.join(format!("{}.parquet", shipped.plan));
    fs::write(&file, replaced(shipped.plan, shipped.cuts)?)?;
    run(campaign("run").arg(&file).arg("--out").arg(&parts))?;
    merged(&parts, &table)?;
    run(command(tools::python()?)
        .arg("tests/python/check_campaign.py")
        .arg(&table)
        .arg(shipped_file(&format!("{}.sql", shipped.plan)))
        .arg(shipped.rows.to_string()))?;
    Ok(())
}

fn shipped_file(name: &str) -> PathBuf {
    root().join("host-sim/campaigns").join(name)
}

/// The text of a shipped plan with parts of it replaced.
fn replaced(plan: &str, parts: &[(&str, &str)]) -> anyhow::Result<String> {
    let file = shipped_file(&format!("{plan}.toml"));
    let mut text = fs::read_to_string(file).context("the shipped plan")?;
    for (shipped, instead) in parts {
        ensure!(text.contains(shipped), "{plan} has no `{shipped}`");
        text = text.replace(shipped, instead);
    }
    Ok(text)
}

/// `wheeleg campaign` with one of its commands.
fn campaign(what: &str) -> Command {
    let mut command = command(wheeleg());
    command.args(["campaign", what]);
    command
}

/// What a command prints as JSON.
fn told(command: &mut Command) -> anyhow::Result<Value> {
    let text = output(command.arg("--json"))?;
    serde_json::from_str(&text).context("--json: not one JSON value")
}

/// Merges a folder into a table; its hash.
fn merged(parts: &Path, table: &Path) -> anyhow::Result<String> {
    let merged = told(campaign("merge").arg(parts).arg("--out").arg(table))?;
    let hash = merged["hash"].as_str().context("no hash")?;
    Ok(hash.to_owned())
}

/// 200 cases by one thread, two, seven processes, and killed at 20 random times: one hash. Then
/// Slurm.
pub(crate) fn deep() -> StepResult<String> {
    let test = "however_it_is_run_the_table_is_the_same";
    let amounts = [
        ("WHEELEG_CAMPAIGN_SAMPLES", 100),
        ("WHEELEG_CAMPAIGN_KILLS", 20),
    ];
    let shared = measured(["campaign", test], &amounts, "campaign: ")?;
    Ok(format!("{shared}; {}", slurm::check()?))
}

/// Tables as large as they get: merge, report, first row.
pub(crate) fn large() -> StepResult<String> {
    let test = "a_large_table_is_merged_and_told_in_time";
    let rows = ("WHEELEG_CAMPAIGN_ROWS", 1_000_000);
    measured(["large", test], &[rows], "large: ")
}

/// Random robots that both laws meet.
const PAIRS: u32 = 10_000;

/// The shipped comparison of both laws, with more robots. Its folder is kept: stopped or killed, the same command goes
/// on, with the same program.
pub(crate) fn pairs() -> StepResult<String> {
    rust::build_wheeleg()?;
    let folder = step_folder("pairs");
    fs::create_dir_all(&folder).context("the folder of the campaign")?;
    let samples = format!("samples = {PAIRS}");
    let plan = replaced(
        "three-step-spread",
        &[("samples = 100", &samples), ("block = 8", "block = 64")],
    )?;
    let [file, parts, table] =
        ["pairs.toml", "parts", "pairs.parquet"].map(|name| folder.join(name));
    fs::write(&file, plan).context("the plan")?;
    run(campaign("run").arg(&file).arg("--out").arg(&parts))?;
    let hash = merged(&parts, &table)?;
    let findings = told(campaign("report").arg(&table))?;
    let findings = &findings["findings"];
    let cells = findings["passed"].as_array().into_iter().flatten();
    let rates = cells.map(|cell| {
        let [low, high] =
            [0_usize, 1].map(|end| 1e2 * cell[1]["exact"][end].as_f64().unwrap_or(f64::NAN));
        let of = |key: &str| cell[1][key].clone();
        let name = cell[0].as_str().unwrap_or_default();
        format!(
            "{name}: {} of {} ({low:.1} to {high:.1} %)",
            of("met"),
            of("of")
        )
    });
    let rates: Vec<String> = rates.collect();
    let pair = &findings["paired"][0]["passed"];
    Ok(format!(
        "{}; of {} pairs the second alone fails {}, the first alone {}, p = {:.2e}; hash {}",
        rates.join("; "),
        findings["paired"][0]["pairs"],
        pair["lost"],
        pair["gained"],
        pair["p"].as_f64().unwrap_or(f64::NAN),
        hash
    ))
}

/// Rows of cylinders, unless the environment asks for another number.
const ROWS: u64 = 1_000_000;
const ROWS_VARIABLE: &str = "WHEELEG_CYLINDER_ROWS";

/// The shipped first steps, with more samples: run, merged and told. Its folder is kept: stopped or killed,
/// the same command goes on, with the same program and number.
pub(crate) fn cylinder_rows() -> StepResult<String> {
    let rows = match std::env::var(ROWS_VARIABLE) {
        Ok(text) => text
            .parse::<u64>()
            .ok()
            .filter(|rows| *rows > 0)
            .with_context(|| {
                format!("{ROWS_VARIABLE} = {text}: allowed are whole numbers from 1")
            })?,
        Err(_) => ROWS,
    };
    rust::build_wheeleg()?;
    let folder = step_folder("cylinder-rows");
    fs::create_dir_all(&folder).context("the folder of the campaign")?;
    // Four axes and two controllers to each sample.
    let samples = rows.div_ceil(8);
    let rows = 8 * samples;
    let samples = format!("samples = {samples}");
    let plan = replaced(
        "first-step",
        &[("samples = 250", &samples), ("block = 500", "block = 4000")],
    )?;
    let name = |what: &str| folder.join(format!("{rows}{what}"));
    let [file, parts, table] = [name(".toml"), name(""), name(".parquet")];
    fs::write(&file, plan).context("the plan")?;
    let count = |key: &str| -> anyhow::Result<u64> {
        let status = told(campaign("status").arg(&parts))?;
        status[key].as_u64().with_context(|| format!("no {key}"))
    };
    // What was there before is not computed now.
    let before = if parts.exists() { count("rows")? } else { 0 };
    let begun = Instant::now();
    run(campaign("run").arg(&file).arg("--out").arg(&parts))?;
    let run_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let hash = merged(&parts, &table)?;
    let merge_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    run(campaign("report").arg(&table))?;
    let report_s = begun.elapsed().as_secs_f64();
    let computed = rows - before;
    Ok(format!(
        "{rows} rows of cylinders, {computed} computed now in {run_s:.0} s: {:.1} a second; failed {}; merged in \
         {merge_s:.1} s, told in {report_s:.1} s; hash {hash}",
        computed as f64 / run_s,
        count("failed")?,
    ))
}

/// The manifest in a validator that has the schemas of Kubernetes.
pub(crate) fn kubernetes() -> StepResult<String> {
    let python = tools::deep_python("kubernetes_validate")?;
    let wheeleg = rust::build_wheeleg()?;
    let folder = step_folder("kubernetes");
    empty_folder(&folder)?;
    let told = figures(
        command(python)
            .arg("tests/python/check_kubernetes.py")
            .arg(wheeleg)
            .arg(&folder),
        |line| line.starts_with("kubernetes: "),
    )?;
    Ok(told.join("; "))
}
