//! Campaigns: their table in a program that is not ours, and the long check.

mod slurm;

use std::fs;
use std::path::Path;

use anyhow::{Context, anyhow};

use crate::process::{command, empty_folder, root, run, step_folder, wheeleg};
use crate::report::{Report, StepResult};
use crate::rust::measured;
use crate::{rust, tools};

/// A shipped plan, with its questions in SQL beside it: how it is cut short for the suite, and the rows that are left.
struct Shipped {
    plan: &'static str,
    cuts: &'static [(&'static str, &'static str)],
    rows: u32,
}

const SHIPPED: [Shipped; 3] = [
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
