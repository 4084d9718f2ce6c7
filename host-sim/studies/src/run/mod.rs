//! One run, from names to files.

mod boards;
mod figures;
mod ground;
mod html;
mod motion;
mod report;
mod simulate;
mod summary;

pub use simulate::{Simulated, simulate};
pub use summary::{RunInfo, Summary};

use std::fs::File;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use self::figures::Source;
use crate::StudyError;
use crate::study::{Finished, Job, Settings, Stop};
use wheeleg_config::faults::FaultSpec;
use wheeleg_config::{EventAction, LawChoice, Motion, RobotConfig, Scenario, builtin};
use wheeleg_remote_host::Nodes;
use wheeleg_report::results::{CSV, LOG};
use wheeleg_scene::Scene;
use wheeleg_sim::faults;
use wheeleg_sim::{Boards, DownTimes, Session, SimError};
use wheeleg_telemetry::{Keep, LogFile, Recorder, Tables};

/// Options of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Built-in scenario or path.
    pub scenario: String,
    /// Robot instead of the scenario's.
    pub robot: Option<String>,
    /// Law of all joints instead of the robot's.
    pub law: Option<LawChoice>,
    /// Seed instead of the scenario's.
    pub seed: Option<u64>,
    /// Where each node runs.
    pub nodes: Nodes,
    /// Faults in addition to the scenario's own.
    pub faults: Vec<FaultSpec>,
    /// Folder for the results instead of `runs/<scenario>-seed<N>`.
    pub out: Option<PathBuf>,
    /// Figures as PNG, too.
    pub png: bool,
    /// The run is to be compared with one with all nodes in this program ([`repeat_natively`]).
    pub compared: bool,
}

/// A run that was simulated and judged.
#[derive(Debug)]
pub struct Run {
    /// Contents of `summary.json`.
    pub summary: Summary,
    /// Why the run ended early; everything until then is recorded and judged.
    pub failure: Option<SimError>,
    /// When boards outside were down.
    pub down_times: DownTimes,
}

/// Samples per second in the CSV files; 500 per second are in the MCAP log.
const CSV_RATE_HZ: u32 = 100;
/// Measured on the built-in scenario that writes most, `rocks-20`, and rounded up: log, bytes per simulated
/// second.
const LOG_BYTES_PER_S: f64 = 400e3;
/// The same for the tables.
const TABLE_BYTES_PER_S: f64 = 130e3;
/// From this duration on the program announces the disk space of a run, s.
const LONG_S: f64 = 60.0;
/// Room reserved for the summary while log and tables fill the disk, bytes: the first of these that is
/// available.
const RESERVES_BYTES: [usize; 3] = [256 * 1024, 64 * 1024, 32 * 1024];

/// Runs a scenario: log, tables, figures, summary, report. `stop` ends it at
/// the next bus cycle and the files are finished all the same. Results of an
/// earlier run in the same folder are set aside in its folders `previous`,
/// `previous-2`, …
///
/// # Errors
/// Any [`StudyError`]. A log that was begun is closed and stays readable. A file that cannot be written once
/// the run has begun is not an error: the run is still judged, and [`Finished::unwritten`] names the file.
/// Nor is a simulation that fails on its way: [`Run::failure`] says why.
pub fn run(options: &Options, stop: &Stop) -> Result<Finished<Run>, StudyError> {
    run_on(options, stop, None)
}

/// Runs a scenario again with all nodes in this program. Boards that a fault affects are down at the same
/// times as in the run before: the comparison leaves out how long a processor takes to start.
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
    let mut robot = match &options.robot {
        Some(robot) => builtin::robot(robot)?,
        None => builtin::robot_of(&scenario, &options.scenario)?,
    };
    if let Some(law) = options.law {
        robot.set_law(law);
    }
    faults::check(&scenario, &robot, &options.nodes)?;
    if options.compared {
        faults::ensure_comparable(&scenario, &options.nodes)?;
    }
    let seed = options.seed.unwrap_or(scenario.seed);
    let folder = options
        .out
        .clone()
        .unwrap_or_else(|| default_out(&scenario.name, seed));
    // A board that does not answer must not cost the results of an earlier run.
    let boards = match kept {
        Some(kept) => Boards::native_with(kept.clone()),
        None => Boards::connect(&options.nodes, &robot)?,
    };
    let settings = Settings {
        out: folder,
        png: options.png,
        stop: stop.clone(),
    };
    run_with((&scenario, &robot, seed), boards, &settings)
}

/// Runs a scenario on a robot, both read already: all nodes in this program; otherwise as [`run`].
///
/// # Errors
/// As [`run`].
pub fn run_read(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    settings: &Settings,
) -> Result<Finished<Run>, StudyError> {
    faults::check(scenario, robot, &Nodes::default())?;
    run_with((scenario, robot, seed), Boards::default(), settings)
}

fn run_with(
    (scenario, robot, seed): (&Scenario, &RobotConfig, u64),
    boards: Boards,
    settings: &Settings,
) -> Result<Finished<Run>, StudyError> {
    // A refused run costs no earlier results, and leaves no folder.
    let scene = Scene::new(robot, scenario)?;
    if boards.are_here() {
        ensure_possible(scenario, robot, seed)?;
    } else {
        scenario.check_with(robot)?;
    }
    let files = scenario.files();
    let mut reads: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    reads.push(Path::new(&robot.file));
    let job = Job::begin(&scenario.name, settings, &reads)?;
    announce(scenario.duration_s);
    let reserve = reserve(job.folder());
    let log = job.folder().join(LOG);
    // If there is no room for the log, nothing else is created.
    let log_file = LogFile::create(&log)?.with(scene)?;
    let tables = job.subfolder(CSV)?;
    let recorder = Recorder::new(keep(scenario))
        .with(log_file)
        .with(Tables::create(&tables, CSV_RATE_HZ)?);
    let duration_ms = (scenario.duration_s * 1e3).round() as u64;
    job.progress.begin(
        format!("{:.0} s simulated", scenario.duration_s),
        duration_ms,
    );
    let begun = Instant::now();
    let simulated = simulate(boards, scenario, robot, seed, recorder, &mut |t_s| {
        job.progress.at((t_s * 1e3) as u64);
        if job.progress.is_stopped() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })?;
    let wall_s = begun.elapsed().as_secs_f64();
    let Simulated {
        outcome,
        recording,
        analysis,
        failed,
    } = simulated;
    for error in failed {
        job.keep::<()>(Err(error.into()));
    }
    // Writes to a removed file vanish without an error.
    for gone in [&log, &tables].into_iter().filter(|path| !path.exists()) {
        let removed = std::io::Error::other("somebody has removed it during the run");
        job.keep::<()>(Err(StudyError::output("find again", gone, removed)));
    }

    let info = RunInfo {
        seed,
        failure: outcome.failure.as_ref().map(ToString::to_string),
        simulated_s: outcome.simulated_s,
        recorded_s: outcome.recorded_s,
        wall_s,
        complete: !outcome.stopped,
        pil: outcome.pil,
    };
    let mut summary = Summary::new(scenario, robot, &recording, &analysis, info);
    summary.unwritten = job.unwritten().iter().map(ToString::to_string).collect();
    drop(reserve);
    let recorded_ms = (summary.recorded_s * 1e3).round() as u64;
    let stopped = job
        .progress
        .stopped(recorded_ms, duration_ms, "ms of the scenario")
        .filter(|_| !summary.complete);
    let source = Source {
        scenario,
        robot,
        recording: &recording,
        analysis: &analysis,
    };
    let run = Run {
        summary,
        failure: outcome.failure,
        down_times: outcome.down_times,
    };
    Ok(report::write(job, &source, run, stopped))
}

/// Builds the robot as a trial. A simulated robot is large: this one is gone from the stack before the one
/// that runs.
#[inline(never)]
fn ensure_possible(scenario: &Scenario, robot: &RobotConfig, seed: u64) -> Result<(), SimError> {
    Session::new(Boards::default(), scenario, robot, seed).map(drop)
}

/// Longest run whose phases the page shows, s.
const PHASES_S: f64 = 600.0;

/// Samples to keep for figures and page: the analysis sees every sample as it comes.
fn keep(scenario: &Scenario) -> Keep {
    let mut events = scenario.events.iter();
    let shown = events.find(|e| !matches!(e.action, EventAction::Command(_)));
    let near_s: Vec<f64> = shown.iter().map(|e| e.at_s).collect();
    let all = Keep::bounded(scenario.duration_s, &near_s).without(&["/bus"]);
    // The phases of a gait, for the page: a long run has too many to see.
    let all = if scenario.duration_s > PHASES_S {
        all.without(&["/master"])
    } else {
        all
    };
    // Slip is drawn for walks, rims around an event.
    match shown {
        Some(_) => all,
        None if matches!(scenario.motion, Motion::Walk(_)) => all,
        None => all.without(&["/wheel/7", "/wheel/8"]),
    }
}

/// Approximate size of the log of a run of this many seconds, bytes.
#[must_use]
pub fn log_bytes(duration_s: f64) -> f64 {
    LOG_BYTES_PER_S * duration_s
}

/// The same for its tables.
#[must_use]
pub fn table_bytes(duration_s: f64) -> f64 {
    TABLE_BYTES_PER_S * duration_s
}

/// Announces the disk space of a long run.
fn announce(duration_s: f64) {
    if duration_s >= LONG_S {
        let log = log_bytes(duration_s) * 1e-9;
        let tables = table_bytes(duration_s) * 1e-9;
        let told = format!(
            "{duration_s:.0} s to simulate: about {log:.3} GB of log and {tables:.3} GB of tables"
        );
        // Standard error may be closed or full.
        let _ = writeln!(std::io::stderr(), "{told}");
    }
}

/// Room on the disk for the summary, released when dropped; `None` if there is none.
fn reserve(folder: &Path) -> Option<File> {
    RESERVES_BYTES.into_iter().find_map(|bytes| {
        let mut file = tempfile::tempfile_in(folder).ok()?;
        file.write_all(&vec![0; bytes]).ok()?;
        Some(file)
    })
}

/// Default folder of a run's results.
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
            law: None,
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

    /// A board of another interface keeps the robot from getting ready.
    #[test]
    fn a_run_that_fails_leaves_log_summary_and_page() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("results");
        let options = Options {
            scenario: "stand".to_owned(),
            robot: None,
            law: None,
            seed: None,
            nodes: Nodes::default(),
            faults: vec!["other-interface:joint3@0s".parse().expect("a fault")],
            out: Some(folder.clone()),
            png: false,
            compared: false,
        };
        let finished = run(&options, &Stop::default()).expect("a run with results");
        let failure = finished.result.failure.expect("it does not get ready");
        assert!(
            matches!(failure, wheeleg_sim::SimError::NotReady { .. }),
            "{failure}"
        );
        let summary = std::fs::read_to_string(folder.join("summary.json")).expect("written");
        let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
        assert_eq!(summary["failure"], failure.to_string());
        assert_eq!(summary["complete"], false);
        let page = std::fs::read_to_string(&finished.report).expect("written");
        assert!(page.contains("did not get ready"));
        assert!(folder.join("log.mcap").exists());
    }
}
