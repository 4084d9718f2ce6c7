//! Campaigns: their table in a program that is not ours, and the long check.

mod slurm;

use std::fs;

use anyhow::Context;

use crate::process::{cargo, command, figures, root, run, target_dir};
use crate::report::{Report, StepResult};
use crate::{rust, tools};

/// Samples of the shipped plan in the suite's check of its SQL, a case in each of two cells.
const SAMPLES: u32 = 5;

/// The shipped plan, cut short, its table and its SQL in DuckDB.
pub(crate) fn steps(report: &mut Report) {
    report.step("campaign: the shipped SQL in DuckDB", || {
        let folder = target_dir().join("xtask").join("campaign");
        if folder.exists() {
            fs::remove_dir_all(&folder)?;
        }
        fs::create_dir_all(&folder)?;
        rust::build(&["--bin", "wheeleg"])?;
        let wheeleg = target_dir().join("release").join("wheeleg");
        let plan = fs::read_to_string(root().join("host-sim/campaigns/three-step-spread.toml"))
            .context("the shipped plan")?;
        let short = folder.join("plan.toml");
        fs::write(
            &short,
            plan.replace("samples = 100", &format!("samples = {SAMPLES}")),
        )?;
        let (parts, table) = (folder.join("parts"), folder.join("cases.parquet"));
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
            .arg("host-sim/campaigns/campaign.sql")
            .arg((2 * SAMPLES).to_string()))?;
        Ok(())
    });
}

/// 200 cases by one thread, two, seven processes, and killed at 20 random times: one hash. Then
/// Slurm.
pub(crate) fn deep() -> StepResult<String> {
    let found = figures(
        cargo()
            .args(["test", "--locked", "--release", "--package", "wheeleg"])
            .args(["--test", "campaign", "--", "--exact", "--nocapture"])
            .arg("however_it_is_run_the_table_is_the_same")
            .env("WHEELEG_CAMPAIGN_SAMPLES", "100")
            .env("WHEELEG_CAMPAIGN_KILLS", "20"),
        |line| line.contains("campaign: "),
    )?;
    let first = found.into_iter().next();
    let shared = first.context("no line with `campaign: `")?;
    Ok(format!("{shared}; {}", slurm::check()?))
}
