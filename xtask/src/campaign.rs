//! Campaigns: their table in a program that is not ours, and the long check.

mod slurm;

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, anyhow};
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

const SHIPPED: [Shipped; 4] = [
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
    let wheeleg = wheeleg();
    let campaigns = root().join("host-sim/campaigns");
    let mut plan = fs::read_to_string(campaigns.join(format!("{}.toml", shipped.plan)))
        .context("the shipped plan")?;
    for (whole, short) in shipped.cuts {
        if !plan.contains(whole) {
            return Err(anyhow!("{} has no `{whole}`", shipped.plan).into());
        }
        plan = plan.replace(whole, short);
    }
    let short = folder.join(format!("{}.toml", shipped.plan));
    fs::write(&short, plan)?;
    let parts = folder.join(shipped.plan);
    let table = folder.join(format!("{}.parquet", shipped.plan));
    run(command(&wheeleg)
        .args(["campaign", "run"])
        .arg(&short)
        .arg("--out")
        .arg(&parts))?;
    run(command(&wheeleg)
        .args(["campaign", "merge"])
        .arg(&parts)
        .arg("--out")
        .arg(&table))?;
    run(command(tools::python()?)
        .arg("tests/python/check_campaign.py")
        .arg(&table)
        .arg(campaigns.join(format!("{}.sql", shipped.plan)))
        .arg(shipped.rows.to_string()))?;
    Ok(())
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
    let wheeleg = rust::build_wheeleg()?;
    let folder = step_folder("pairs");
    fs::create_dir_all(&folder).context("the folder of the campaign")?;
    let shipped = root().join("host-sim/campaigns/three-step-spread.toml");
    let plan = fs::read_to_string(shipped).context("the shipped plan")?;
    let plan = plan
        .replace("samples = 100", &format!("samples = {PAIRS}"))
        .replace("block = 8", "block = 64");
    let [file, parts, table] =
        ["pairs.toml", "parts", "pairs.parquet"].map(|name| folder.join(name));
    fs::write(&file, plan).context("the plan")?;
    let campaign = |words: &[&str]| {
        let mut command = command(&wheeleg);
        command.arg("campaign").args(words);
        command
    };
    run(campaign(&["run"]).arg(&file).arg("--out").arg(&parts))?;
    let merged = output(campaign(&["merge"]).arg(&parts).arg("--out").arg(&table))?;
    let said = output(campaign(&["report", "--json"]).arg(&table))?;
    let findings: Value = serde_json::from_str(&said).context("the report")?;
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
    let hash = merged
        .lines()
        .find_map(|line| line.strip_prefix("hash "))
        .unwrap_or_default();
    Ok(format!(
        "{}; of {} pairs the second alone fails {}, the first alone {}, p = {:.2e}; hash {}",
        rates.join("; "),
        findings["paired"][0]["pairs"],
        pair["lost"],
        pair["gained"],
        pair["p"].as_f64().unwrap_or(f64::NAN),
        hash.trim()
    ))
}

/// Rows of cylinders, unless the environment asks for another number.
const ROWS: u64 = 1_000_000;
const ROWS_VARIABLE: &str = "WHEELEG_CYLINDER_ROWS";

/// The shipped spread of cylinders, with more samples: run, merged and told. Its folder is kept: stopped or killed,
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
    let wheeleg = rust::build_wheeleg()?;
    let folder = step_folder("cylinder-rows");
    fs::create_dir_all(&folder).context("the folder of the campaign")?;
    let shipped = root().join("host-sim/campaigns/cylinder-spread.toml");
    let plan = fs::read_to_string(shipped).context("the shipped plan")?;
    // Four axes and two controllers to each sample.
    let samples = rows.div_ceil(8);
    let rows = 8 * samples;
    let plan = plan.replace("samples = 250", &format!("samples = {samples}"));
    let name = |what: &str| folder.join(format!("{rows}{what}"));
    let [file, parts, table] = [name(".toml"), name(""), name(".parquet")];
    fs::write(&file, plan).context("the plan")?;
    let campaign = |words: &[&str]| {
        let mut command = command(&wheeleg);
        command.arg("campaign").args(words);
        command
    };
    let timed = |mut command: std::process::Command| -> anyhow::Result<(String, f64)> {
        let begun = Instant::now();
        let printed = output(&mut command)?;
        Ok((printed, begun.elapsed().as_secs_f64()))
    };
    let mut command = campaign(&["run"]);
    command.arg(&file).arg("--out").arg(&parts);
    let (ran, run_s) = timed(command)?;
    let mut command = campaign(&["merge"]);
    command.arg(&parts).arg("--out").arg(&table);
    let (merged, merge_s) = timed(command)?;
    let mut command = campaign(&["report"]);
    command.arg(&table);
    let (_, report_s) = timed(command)?;
    let line = |text: &str, word: &str| -> String {
        let found = text.lines().find_map(|line| line.strip_prefix(word));
        found.unwrap_or_default().trim().to_owned()
    };
    // What was there before was not computed now.
    let found = ran.lines().next().and_then(|line| {
        let words = line.strip_suffix(" of them found")?;
        words.rsplit(' ').next()?.parse::<u64>().ok()
    });
    let computed = rows - found.unwrap_or(0);
    Ok(format!(
        "{rows} rows of cylinders, {computed} computed now in {run_s:.0} s: {:.1} a second; failed {}; merged in \
         {merge_s:.1} s, told in {report_s:.1} s; hash {}",
        computed as f64 / run_s,
        line(&ran, "failed "),
        line(&merged, "hash ")
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
