//! One run from names to files.

mod boards;
mod figures;
mod html;
mod report;
mod summary;

pub use summary::{RunInfo, Summary};

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::StudyError;
use crate::analysis;
use crate::study::{Finished, Job, Settings, Stop};
use wheeleg_config::faults::FaultSpec;
use wheeleg_config::{RobotConfig, Scenario, builtin};
use wheeleg_remote_host::Nodes;
use wheeleg_sim::faults;
use wheeleg_sim::{self as sil, Boards, DownTimes};
use wheeleg_telemetry::Recorder;

/// What to run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Built-in scenario or path.
    pub scenario: String,
    /// Robot instead of the scenario's.
    pub robot: Option<String>,
    /// Seed instead of the scenario's.
    pub seed: Option<u64>,
    /// Where each node runs.
    pub nodes: Nodes,
    /// Faults beside the scenario's own.
    pub faults: Vec<FaultSpec>,
    /// Folder for the results instead of `runs/<scenario>-seed<N>`.
    pub out: Option<PathBuf>,
    /// Figures as PNG, too.
    pub png: bool,
    /// The run is to equal one with all nodes in this program ([`repeat_natively`]).
    pub compared: bool,
}

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Contents of `summary.json`.
    pub summary: Summary,
    /// When boards outside were down.
    pub down_times: DownTimes,
}

/// Runs a scenario: log, tables, figures, summary, report. `stop` ends it at
/// the next bus cycle and the files are finished all the same. Results of an
/// earlier run in the same folder are set aside in its folders `previous`,
/// `previous-2`, …
///
/// # Errors
/// Any [`StudyError`]. A log that was begun is closed and stays readable.
pub fn run(options: &Options, stop: &Stop) -> Result<Finished<Run>, StudyError> {
    run_on(options, stop, None)
}

/// Runs a scenario once more with all nodes in this program. Boards that a fault strikes
/// are down when those of the run before were: how long a processor takes to start is no
/// part of what is compared.
///
/// # Errors
/// As [`run`].
pub fn repeat_natively(
    options: &Options,
    stop: &Stop,
    before: &Run,
    out: PathBuf,
) -> Result<Finished<Run>, StudyError> {
    let options = Options {
        nodes: Nodes::default(),
        out: Some(out),
        compared: false,
        ..options.clone()
    };
    run_on(&options, stop, Some(&before.down_times))
}

fn run_on(
    options: &Options,
    stop: &Stop,
    kept: Option<&DownTimes>,
) -> Result<Finished<Run>, StudyError> {
    let mut scenario = builtin::scenario(&options.scenario)?;
    scenario.faults.extend_from_slice(&options.faults);
    let robot = match &options.robot {
        Some(robot) => builtin::robot(robot)?,
        None => builtin::robot_of(&scenario.robot, &options.scenario)?,
    };
    faults::check(&scenario, &robot, &options.nodes)?;
    if options.compared {
        faults::ensure_comparable(&scenario, &options.nodes)?;
    }
    let seed = options.seed.unwrap_or(scenario.seed);
    let folder = options
        .out
        .clone()
        .unwrap_or_else(|| default_out(&scenario.name, seed));
    // A board that does not answer must not cost the results of the run before.
    let boards = match kept {
        Some(kept) => Boards::native_with(kept.clone()),
        None => Boards::connect(&options.nodes, &robot)?,
    };
    let settings = Settings {
        out: folder,
        png: options.png,
        stop: stop.clone(),
    };
    let job = Job::begin(&scenario.name, &settings)?;
    let mut recorder = Recorder::create(&job.folder().join("log.mcap"))?;
    provenance(&mut recorder, &scenario, &robot, seed);
    let duration_ms = (scenario.duration_s * 1e3).round() as u64;
    job.progress.begin(
        format!("{:.0} s simulated", scenario.duration_s),
        duration_ms,
    );
    let begun = Instant::now();
    let outcome = sil::run_on(
        boards,
        &scenario,
        &robot,
        seed,
        &mut recorder,
        sil::Onlookers::new(&mut |t_s| {
            job.progress.at((t_s * 1e3) as u64);
            if job.progress.is_stopped() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        }),
    );
    let closed = recorder.finish();
    let wall_s = begun.elapsed().as_secs_f64();
    let outcome = outcome?;
    let recording = closed?;

    let info = RunInfo {
        seed,
        simulated_s: outcome.simulated_s,
        recorded_s: outcome.recorded_s,
        wall_s,
        complete: !outcome.stopped,
        pil: outcome.pil,
    };
    let analysis = analysis::analyse(&scenario, &robot, &recording);
    let summary = Summary::new(&scenario, &robot, &recording, &analysis, info);
    let recorded_ms = (summary.recorded_s * 1e3).round() as u64;
    let stopped = job
        .progress
        .stopped(recorded_ms, duration_ms, "ms of the scenario")
        .filter(|_| !summary.complete);
    let run = Run {
        summary,
        down_times: outcome.down_times,
    };
    report::write(job, &scenario, &robot, &recording, &analysis, run, stopped)
}

/// What went into the run, as messages at time zero: part of the log and of
/// the hash, so without paths and wall-clock times.
fn provenance(recorder: &mut Recorder, scenario: &Scenario, robot: &RobotConfig, seed: u64) {
    recorder.provenance("program", concat!("wheeleg ", env!("CARGO_PKG_VERSION")));
    recorder.provenance("scenario", &scenario.name);
    recorder.provenance("robot", &robot.name);
    recorder.provenance("seed", seed.to_string());
    for fault in &scenario.faults {
        recorder.provenance("fault", fault.to_string());
    }
    for p in &robot.parameters {
        recorder.provenance(
            "parameter",
            format!("{} = {} {}", p.path, p.value_text(), p.unit),
        );
    }
}

/// Folder of a run's results where none is given.
fn default_out(scenario: &str, seed: u64) -> PathBuf {
    Path::new("runs").join(format!("{scenario}-seed{seed}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_remote_host::NodeKind;

    #[test]
    fn a_port_that_does_not_open_costs_no_earlier_results() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("results");
        std::fs::create_dir(&folder).expect("created");
        std::fs::write(folder.join("summary.json"), "earlier").expect("written");
        let mut nodes = Nodes::default();
        nodes.0[0] = NodeKind::Hil(temporary.path().join("no-port"));
        let options = Options {
            scenario: builtin::DEFAULT_SCENARIO.to_owned(),
            robot: None,
            seed: None,
            nodes,
            faults: Vec::new(),
            out: Some(folder.clone()),
            png: false,
            compared: false,
        };
        let error = run(&options, &Stop::default())
            .expect_err("no such port")
            .to_string();
        assert!(error.contains("no-port"), "{error}");
        let kept = std::fs::read_to_string(folder.join("summary.json"));
        assert_eq!(kept.expect("kept"), "earlier");
        assert!(!folder.join("previous").exists() && !folder.join("log.mcap").exists());
    }
}
