//! The robot in the field: the built-in walks over terrain, each on several seeds, and the paper's claims
//! beside the measurements.
//!
//! A seed sets all noise and, if there are rocks, the field of rocks: another seed, another field. A
//! scenario's bars judge a run; a claim names the scenario that tests it, and its interpretation.

mod charts;
mod claims;
mod controls;
mod page;

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::{ConfigError, builtin};
use wheeleg_report::stats;
use wheeleg_sim::Boards;
use wheeleg_telemetry::{Keep, Recorder};

pub use claims::{CLAIMS, Claim, Met};
pub use controls::{CONTROLS, Compared, Control};

use crate::StudyError;
use crate::analysis::Target;
use crate::run::simulate;
use crate::study::schema::json;
use crate::study::{self, Finished, Job, Settings};

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
}

/// A run, judged.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Run {
    /// Scenario.
    pub scenario: &'static str,
    /// Seed of noise and rocks.
    pub seed: u64,
    /// Why it ended early; null if it did not.
    pub error: Option<String>,
    /// It came to its end and met all required bars.
    pub passed: bool,
    /// Hash of its log.
    pub hash: String,
    /// The bars with their measurements.
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

/// One run in memory; `None` if it was stopped before its end.
fn tried(
    (name, seed): (&'static str, u64),
    stop: &study::Progress,
) -> Result<Option<Run>, StudyError> {
    let scenario = builtin::scenario_on_ground(name, seed)?;
    let robot = builtin::robot_of(&scenario, name)?;
    let recorder = Recorder::new(Keep::nothing());
    let simulated = simulate(
        Boards::default(),
        &scenario,
        &robot,
        seed,
        recorder,
        &mut |_| {
            if stop.is_stopped() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    )?;
    if simulated.outcome.stopped && simulated.outcome.failure.is_none() {
        return Ok(None);
    }
    let error = simulated.outcome.failure.map(|why| why.to_string());
    Ok(Some(Run {
        scenario: name,
        seed,
        passed: error.is_none() && simulated.analysis.passed(),
        error,
        hash: simulated.recording.hash,
        bars: simulated.analysis.targets,
    }))
}

/// Runs everything and writes page, pictures and summary.
///
/// # Errors
/// [`StudyError`] if a scenario or robot is wrong, or a result cannot be drawn or written.
pub fn write(options: &Options, settings: &Settings) -> Result<Finished<Summary>, StudyError> {
    let job = Job::begin("field", settings, &[])?;
    let cases: Vec<(&'static str, u64)> = options
        .scenarios
        .iter()
        .flat_map(|name| (1..=u64::from(options.seeds)).map(|seed| (*name, seed)))
        .collect();
    let results = job
        .progress
        .each("runs", &cases, |case| tried(*case, &job.progress))?;
    let runs: Vec<Run> = results.into_iter().flatten().flatten().collect();
    let (done, of) = (runs.len() as u64, cases.len() as u64);
    let stopped = job.progress.stopped(done, of, "runs");
    let summary = Summary::of(options, runs)?;
    let text = json(&summary, stopped.as_ref());
    let why = stopped.clone();
    Ok(job.finish(summary, text, stopped, |job, summary| {
        let drawn = job.draw(charts::figures(summary));
        (page::render(summary, why.as_ref(), &drawn), drawn)
    }))
}
