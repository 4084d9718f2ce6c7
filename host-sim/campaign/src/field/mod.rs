//! The robot in the field: the built-in walks over terrain, each on several seeds, and the paper's claims
//! beside the measurements.
//!
//! A seed sets all noise and, if there are rocks, the field of rocks: another seed, another field. A
//! scenario's bars judge a run; a claim names the scenario that tests it, and its interpretation.
//!
//! The runs are the cases of a campaign, scenarios by seeds, in the folder `campaign` of the results: whoever
//! stops or kills them runs them again, and the page is made of the rows that are there.

mod charts;
mod claims;
mod controls;
mod page;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::plan::{Plan, Sources, Text, Value};
use wheeleg_config::{ConfigError, builtin};
use wheeleg_report::stats;
use wheeleg_studies::analysis::{Analyser, Target};
use wheeleg_studies::study::schema::json;
use wheeleg_studies::study::{self, Finished, Job, Settings};

pub use claims::{CLAIMS, Claim, Met};
pub use controls::{CONTROLS, Compared, Control};

use crate::run::run_in;
use crate::{CampaignError, Cases, Columns, Options as RunOptions, PlanFile, Row, Store};

/// The scenarios, in the order of the page.
pub const SCENARIOS: &[&str] = &[
    "sand-flat",
    "sand-slope-10",
    "sand-slope-10-legs-idle",
    "sand-slope-20",
    "sand-slope-20-legs-idle",
    "dry-sand-slope-20",
    "rocks-20",
    "rocks-30",
    "rock-30-single",
    "rock-30-single-legs-idle",
    "rock-30-boulder",
    "rock-slope",
    "walk",
    "turn",
    "spin",
    "pit",
    "sand-to-rock",
    "frozen-layer-1",
    "wall-30",
];

/// Goals beyond the paper's claims: marked as such, and a run that misses one is not a failure.
pub const STRETCH: &[&str] = &["rock-30-boulder"];

/// Whether a scenario is a stretch goal.
fn is_stretch(name: &str) -> bool {
    STRETCH.contains(&name)
}

/// Options.
#[derive(Debug, Clone)]
pub struct Options {
    /// Scenarios, of [`SCENARIOS`].
    pub scenarios: Vec<&'static str>,
    /// Seeds of each, 1 to this.
    pub seeds: u32,
    /// This program, to run cases that may crash the process; if `None`, they run in this process.
    pub program: Option<PathBuf>,
}

/// Folder of the campaign, among the results.
const CAMPAIGN: &str = "campaign";

impl Options {
    /// The plan: each scenario on each seed.
    fn plan(&self) -> Result<Plan, ConfigError> {
        let first = self.scenarios.first().copied().unwrap_or_default();
        let scenarios: Vec<String> = self.scenarios.iter().map(|s| format!("{s:?}")).collect();
        let text = format!(
            "name = \"field\"\nroot = 1\nfirst_seed = 1\nreplicates = {}\n\n\
             [base]\nscenario = {first:?}\n\n\
             [factor.scenario]\nparameter = \"scenario\"\ngrid = [{}]\n",
            self.seeds,
            scenarios.join(", ")
        );
        let file = "field.toml".to_owned();
        Plan::of(Sources::of(Text { file, text }, Path::new(""))?)
    }
}

/// A run, judged.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Run {
    /// Scenario.
    pub scenario: &'static str,
    /// Seed of noise and rocks.
    pub seed: u64,
    /// Its case in the campaign, for `wheeleg campaign replay`.
    pub case: String,
    /// Why it ended early; null if it did not.
    pub error: Option<String>,
    /// It came to its end and met all required bars.
    pub passed: bool,
    /// Hash of its log; empty without one.
    pub hash: String,
    /// The bars with their measurements; a run that ended early has none.
    pub bars: Vec<Target>,
}

/// A bar over the seeds.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Measured {
    /// Name of the measure.
    pub measure: String,
    /// Unit of all values.
    pub unit: &'static str,
    /// Its meaning.
    pub meaning: String,
    /// Lower end of the bar.
    pub min: Option<f64>,
    /// Upper end of the bar.
    pub max: Option<f64>,
    /// A run fails without it.
    pub required: bool,
    /// Runs in which it was measured.
    pub measured: u64,
    /// Runs in which it is met.
    pub met: u64,
    /// Mean of the runs with a value.
    pub mean: Option<f64>,
    /// Smallest of them.
    pub lowest: Option<f64>,
    /// Largest of them.
    pub highest: Option<f64>,
}

/// A scenario over its seeds.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Tried {
    /// Name.
    pub scenario: &'static str,
    /// Its description.
    pub description: String,
    /// Robot.
    pub robot: String,
    /// It is a goal beyond the claims.
    pub stretch: bool,
    /// Runs.
    pub runs: u64,
    /// Runs that passed.
    pub passed: u64,
    /// Share of runs that would pass, two-sided exact interval of 95 % (Clopper-Pearson).
    pub interval: [f64; 2],
    /// Bars.
    pub measured: Vec<Measured>,
}

impl Tried {
    fn of(name: &'static str, runs: &[&Run]) -> Result<Self, ConfigError> {
        let scenario = builtin::scenario(name)?;
        let passed = runs.iter().filter(|run| run.passed).count() as u64;
        let count = runs.len() as u64;
        let first = runs.iter().find(|run| !run.bars.is_empty());
        let measured = first.map_or(&[][..], |run| &run.bars).iter().map(|bar| {
            let same: Vec<&Target> = runs
                .iter()
                .flat_map(|run| run.bars.iter().filter(|b| b.id == bar.id))
                .collect();
            let values: Vec<f64> = same.iter().filter_map(|b| b.value).collect();
            Measured {
                measure: bar.id.clone(),
                unit: bar.unit,
                meaning: bar.description.clone(),
                min: bar.min,
                max: bar.max,
                required: bar.required,
                measured: values.len() as u64,
                met: same.iter().filter(|b| b.pass).count() as u64,
                mean: stats::mean(&values),
                lowest: values.iter().copied().reduce(f64::min),
                highest: values.iter().copied().reduce(f64::max),
            }
        });
        Ok(Self {
            scenario: name,
            description: scenario.description,
            robot: scenario.robot,
            stretch: is_stretch(name),
            runs: count,
            passed,
            interval: stats::clopper_pearson(passed, count),
            measured: measured.collect(),
        })
    }
}

/// The results.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Summary {
    /// Seeds of each scenario.
    seeds: u32,
    /// The paper's claims, without those whose scenario was not run.
    pub claims: Vec<claims::Judged>,
    /// Legs and wheels against only wheels, without those of which one side was not run.
    pub controls: Vec<Compared>,
    /// Scenarios.
    pub scenarios: Vec<Tried>,
    /// Runs, in order.
    pub runs: Vec<Run>,
}

impl Summary {
    fn of(options: &Options, runs: Vec<Run>) -> Result<Self, ConfigError> {
        let mut scenarios = Vec::new();
        for name in &options.scenarios {
            let of: Vec<&Run> = runs.iter().filter(|run| run.scenario == *name).collect();
            if !of.is_empty() {
                scenarios.push(Tried::of(name, &of)?);
            }
        }
        Ok(Self {
            seeds: options.seeds,
            claims: CLAIMS.iter().filter_map(|c| c.judge(&scenarios)).collect(),
            controls: CONTROLS
                .iter()
                .filter_map(|c| c.compare(&scenarios))
                .collect(),
            scenarios,
            runs,
        })
    }

    /// The runs that must pass: all but those of stretch goals.
    fn judged(&self) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(|run| !is_stretch(run.scenario))
    }

    /// Whether every run passed, except for stretch goals.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.judged().all(|run| run.passed)
    }
}

impl study::Summary for Summary {
    const SCHEMA: &'static str = "wheeleg.field/1";
}

/// The bars of a scenario, not measured.
fn bars_of(name: &str) -> Result<Vec<Target>, ConfigError> {
    let scenario = builtin::scenario(name)?;
    let robot = builtin::robot_of(&scenario, name)?;
    Ok(Analyser::new(&scenario, &robot).finish().targets)
}

/// The rows of a scenario as runs. A run that ended early has measured nothing.
fn runs<'a>(
    scenario: &'static str,
    rows: impl Iterator<Item = &'a Row>,
    columns: &Columns,
) -> Result<Vec<Run>, ConfigError> {
    let bars = bars_of(scenario)?;
    let run = |row: &Row| Run {
        scenario,
        seed: row.seed,
        case: row.case.to_string(),
        error: row.error.clone(),
        passed: row.passed == Some(true),
        hash: row.log_hash.clone().unwrap_or_default(),
        bars: bars
            .iter()
            .map(|bar| {
                let figure = row.figure(columns, &bar.id);
                Target {
                    value: figure.value,
                    // Without limits there is nothing to miss.
                    pass: figure.pass.unwrap_or(figure.value.is_some()),
                    ..bar.clone()
                }
            })
            .collect(),
    };
    Ok(rows.map(run).collect())
}

/// Runs everything and writes page, pictures and summary. Runs that an earlier process of the same program has
/// finished are not repeated.
///
/// # Errors
/// [`CampaignError`] if a scenario or robot is wrong, or a result cannot be drawn or written.
pub fn write(options: &Options, settings: &Settings) -> Result<Finished<Summary>, CampaignError> {
    let plan = options.plan()?;
    let cases = Cases::new(&plan)?;
    let file = PlanFile::of(&plan, cases.work_s());
    let folder = settings.out.join(CAMPAIGN);
    // Runs of other scenarios, seeds or another program go with the results that were made of them.
    let also: &[&str] = match Store::is_of_another(&folder, &file)? {
        true => &[CAMPAIGN],
        false => &[],
    };
    let job = Job::begin_with("field", settings, &[], also)?;
    let store = Store::create(&folder, file, &settings.stop)?;
    let run_options = RunOptions {
        program: options.program.clone(),
        ..RunOptions::whole(&settings.stop)
    };
    let (ran, rows) = run_in(&job, &store, &cases, &run_options)?;
    let stopped = job.progress.stopped(rows.len() as u64, ran.of, "runs");
    let mut all = Vec::new();
    for scenario in &options.scenarios {
        // The one factor is the scenario.
        let own = |row: &&Row| row.factors == [Value::Text((*scenario).to_owned())];
        all.extend(runs(scenario, rows.iter().filter(own), cases.columns())?);
    }
    let summary = Summary::of(options, all)?;
    let text = json(&summary, stopped.as_ref());
    let why = stopped.clone();
    Ok(job.finish(summary, text, stopped, |job, summary| {
        let drawn = job.draw(charts::figures(summary));
        (page::render(summary, why.as_ref(), &drawn), drawn)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Outcome;
    use crate::compute::row_of;
    use crate::row::Status;

    #[test]
    fn a_claim_whose_runs_all_ended_early_stands_as_not_met() {
        let options = Options {
            scenarios: vec!["rocks-30"],
            seeds: 2,
            program: None,
        };
        let plan = options.plan().expect("usable");
        let cases = Cases::new(&plan).expect("built in");
        let ended = |index| {
            let outcome = Outcome::without(Status::Error, "left physics".to_owned());
            row_of(&cases, &cases.case(index), 2, outcome)
        };
        let rows = [ended(0), ended(1)];
        let runs = runs("rocks-30", rows.iter(), cases.columns()).expect("built in");
        let summary = Summary::of(&options, runs).expect("built in");
        let seeds: Vec<u64> = summary.runs.iter().map(|run| run.seed).collect();
        assert_eq!(seeds, [1, 2]);
        assert!(!summary.passed());
        let met: Vec<Met> = summary.claims.iter().map(|claim| claim.met).collect();
        assert_eq!(met, [Met::NotMet; 2]);
    }
}
