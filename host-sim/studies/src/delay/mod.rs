//! The start delay of a pneumatic joint: its distribution, its causes, and how to avoid it.
//!
//! The paper reports that model and robot agree except for a delay of 0.25 s, and leaves the cause to "a more
//! accurate model of the pneumatic circuit" (section 9). Here the robot's own vertical cylinder is on a bench
//! ([`crate::axis_sim`]), driven by the firmware's own law, and
//!
//! * [`starts`] measures how long a move takes to start, per kind of move;
//! * [`ablation`] removes the contributions, each alone and one after the other;
//! * [`predictions`] tests the predictions of the explanation, and of its rivals;
//! * [`preview`] shows the gain of an announced move.
//!
//! Nothing in the plant is fitted to a delay: the valves' conductance follows only from the stroke time.
//! Every trial is a pure function of axis, law and seed.

pub mod ablation;
mod charts;
pub mod kinds;
mod page;
pub mod predictions;
pub mod preview;
pub mod scaling;
pub mod starts;
mod tables;
pub mod trial;
mod valve_override;

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::PlantError;
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::MessageType;
use wheeleg_protocol::link::SlotTiming;

use crate::StudyError;
use crate::axis_sim::suite::AxisSimError;
use crate::study::schema::json;
use crate::study::{self, Ended, Finished, Job, Progress, Settings};
use trial::{BusPath, Law, Outcome, Start, Trial};
use wheeleg_config::{RobotConfig, brief};
use wheeleg_report::results::CSV;
use wheeleg_report::stats;

/// The paper's delay, and the band that counts as explained \[s\].
pub const PAPER_DELAY_S: f64 = 0.25;
/// Half of the band \[s\].
pub const PAPER_BAND_S: f64 = 0.05;
/// Largest start delay of an announced move \[s\].
pub const PREVIEW_LIMIT_S: f64 = 0.08;
/// Largest motion before an announced move \[mm\].
pub const EARLY_LIMIT_MM: f64 = 1.0;

/// Accepted masses \[kg\]; the step of a robot may allow less.
pub const MASS_KG: [f64; 2] = [0.1, 50.0];
/// Accepted loads \[N\]; the cylinders of a study may start only against less.
pub const LOAD_N: [f64; 2] = [-100.0, 100.0];
/// Accepted numbers of starts per kind of move and law.
pub const SEEDS: [u32; 2] = [1, 1000];

/// Options.
#[derive(Debug, Clone)]
pub struct Options {
    /// Starts per kind of move and law.
    pub seeds: u32,
    /// Mass that moves with the rod \[kg\].
    pub mass_kg: f64,
    /// Force on the rod \[N\], positive extends.
    pub load_n: f64,
}

impl Default for Options {
    /// 50 seeds; 1.5 kg, no load (ASSUMED: a rod with carriage, horizontal).
    fn default() -> Self {
        Self {
            seeds: 50,
            mass_kg: 1.5,
            load_n: 0.0,
        }
    }
}

/// All measurements.
#[derive(Debug, Serialize)]
pub struct Study {
    /// Name of the robot.
    pub robot: String,
    /// Fingerprint of its parameters.
    pub robot_hash: String,
    /// Starts per kind of move and law.
    pub seeds: u32,
    /// Moving mass \[kg\].
    pub mass_kg: f64,
    /// Load \[N\].
    pub load_n: f64,
    /// The way from master to board.
    pub bus: BusPath,
    /// Distributions.
    pub starts: starts::Starts,
    /// Contributions.
    pub ablation: ablation::Ablation,
    /// Predictions.
    pub predictions: predictions::Predictions,
    /// Announced moves.
    pub preview: preview::Preview,
}

/// The vertical cylinder of the robot's left leg on a bench.
#[must_use]
pub fn axis_of(robot: &RobotConfig, mass_kg: f64, load_n: f64) -> AxisParams {
    /// Left vertical, in the order of the joints.
    const VERTICAL: usize = 2;
    robot.axis(VERTICAL, mass_kg, load_n)
}

/// Cycle and SYNC of the robot's bus.
#[must_use]
pub fn bus_of(robot: &RobotConfig) -> BusPath {
    BusPath {
        cycle_s: robot.bus.cycle_s,
        frame_s: f64::from(SlotTiming::DEFAULT.frame_us(MessageType::Sync)) * 1e-6,
    }
}

/// Refuses a mass that the step of the robot cannot follow, and a load against which one of the
/// cylinders of the study would never start.
fn ensure_starts(robot: &RobotConfig, options: &Options) -> Result<(), StudyError> {
    let axis = axis_of(robot, options.mass_kg, options.load_n);
    let bores = scaling::all_bores(&axis);
    let least_kg = bores.iter().filter_map(wheeleg_config::least_mass_kg);
    if let Some(least_kg) = least_kg.reduce(f64::max) {
        return Err(StudyError::refused(
            format!(
                "`--mass` = {} kg is too little for the step of {}: allowed are {} to {} kg",
                brief(options.mass_kg),
                robot.file,
                brief(least_kg),
                brief(MASS_KG[1]),
            ),
            format!(
                "`numerics.step` = {} us, `friction.bristle_damping` and `end_stop.stiffness` of \
                 the robot file decide what the step can follow",
                axis.step_ns / 1000
            ),
        ));
    }
    let most_n = scaling::most_load_n(&axis);
    // Without force left there is none for a load.
    if most_n < 0.0 {
        let (most_n, bore_m) = scaling::most_friction_n(&axis);
        return Err(StudyError::refused(
            format!(
                "`friction.static` = {:.1} N of {} is more than the cylinders of this study break away \
                 from: allowed are up to {:.1} N",
                axis.cylinder.friction.static_n,
                robot.file,
                (most_n * 10.0).floor() * 0.1
            ),
            format!(
                "other bores are tried beside the robot's own, {} mm with this friction among them; \
                 `supply.set_pressure` = {:.2} bar decides what moves them",
                brief(bore_m * 1e3),
                axis.supply.set_pressure_pa * 1e-5,
            ),
        ));
    }
    if options.load_n <= most_n {
        return ensure_moves(&bores, options, &robot.file);
    }
    Err(StudyError::refused(
        format!(
            "`--load` = {} N is more than the cylinders of this study start against: allowed are up \
             to {:.1} N",
            brief(options.load_n),
            (most_n * 10.0).floor() * 0.1
        ),
        format!(
            "other bores are tried beside the robot's own; `supply.set_pressure` = {:.2} bar and \
             `friction.static` = {:.1} N of {} decide what is left on the weakest",
            axis.supply.set_pressure_pa * 1e-5,
            axis.cylinder.friction.static_n,
            robot.file
        ),
    ))
}

/// Starts every cylinder of the study once from both of its ends, so that one that cannot be simulated, or
/// never moves, is reported before anything is measured.
fn ensure_moves(bores: &[AxisParams], options: &Options, file: &str) -> Result<(), StudyError> {
    let given = format!(
        "`--mass` = {} kg, `--load` = {} N",
        brief(options.mass_kg),
        brief(options.load_n)
    );
    for bored in bores {
        for start in [Start::HomeHeld, Start::StopHeld] {
            let outcome = Trial::new(bored, Law::Paper, start, 1).run();
            let outcome = outcome.map_err(|e| match &e {
                AxisSimError::Plant(PlantError::Parameter { .. }) => not_bored(bored, file, &e),
                _ => not_simulated(&given, &e),
            })?;
            // Every bore of the study has to start from home.
            if start == Start::HomeHeld && outcome.delay_s.is_none() {
                return Err(StudyError::refused(
                    format!(
                        "{given}: a cylinder of {} mm never starts from `{}`",
                        brief(bored.cylinder.bore_m * 1e3),
                        start.name()
                    ),
                    "give less --mass or --load, or more `supply.set_pressure` in the robot file",
                ));
            }
        }
    }
    Ok(())
}

/// The error for a bore of the study that the plant does not accept.
fn not_bored(bored: &AxisParams, file: &str, error: &AxisSimError) -> StudyError {
    StudyError::refused(
        format!(
            "{file}: `[cylinder]` with the bore of {} mm that this study tries: {error}",
            brief(bored.cylinder.bore_m * 1e3)
        ),
        "volumes and friction of `[cylinder]` and `[friction]` grow with the area of the bore: give a \
         `cylinder.bore` nearer to those of 16 to 25 mm, or the less of what leaves its range",
    )
}

/// The error for a trial that leaves the model: `given` are the values of the command line.
fn not_simulated(given: &str, error: &AxisSimError) -> StudyError {
    let cause = match error {
        AxisSimError::Unphysical { help, .. } => format!("; {help}"),
        _ => String::new(),
    };
    StudyError::refused(
        format!("{given}: a start cannot be simulated: {error}"),
        format!("`--mass` stands for `moving.mass`, `--load` for the load{cause}"),
    )
}

/// Runs trials; their outcomes are in order.
fn run_all(what: &str, trials: &[Trial], progress: &Progress) -> Result<Vec<Outcome>, Ended> {
    progress.all(what, trials, |trial| {
        let sheet = &trial.sheet;
        let given = || {
            format!(
                "`--mass` = {} kg, `--load` = {} N",
                brief(sheet.moving_mass_kg),
                brief(sheet.load_n)
            )
        };
        let outcome = trial.run();
        outcome.map_err(|e| not_simulated(&given(), &e))
    })
}

/// Mean start delay of outcomes \[s\]; `None` if one of them never started.
fn mean_delay(outcomes: &[Outcome]) -> Option<f64> {
    let delays: Option<Vec<f64>> = outcomes.iter().map(|o| o.delay_s).collect();
    stats::mean(&delays?)
}

/// Measurements until the study ended or was stopped.
#[derive(Debug)]
struct Collected {
    starts: starts::Starts,
    ablation: Option<ablation::Ablation>,
    preview: Option<preview::Preview>,
    predictions: Option<predictions::Predictions>,
    /// Why it failed early, unless it was stopped.
    failure: Option<StudyError>,
}

impl Collected {
    /// Measures one part after the other, until one fails or the study is stopped; earlier measurements are
    /// kept.
    fn measure(robot: &RobotConfig, options: &Options, progress: &Progress) -> Self {
        let axis = axis_of(robot, options.mass_kg, options.load_n);
        let bus = bus_of(robot);
        let weight_n = robot.reference.m6_kg * robot.reference.gravity_m_s2;
        let seeds = options.seeds;
        let mut collected = Self {
            starts: starts::Starts::default(),
            ablation: None,
            preview: None,
            predictions: None,
            failure: None,
        };
        let mut measure = || -> Result<(), Ended> {
            starts::measure(&axis, seeds, progress, &mut collected.starts)?;
            collected.ablation = Some(ablation::measure(&axis, bus, weight_n, seeds, progress)?);
            let preview = preview::measure(&axis, seeds.min(8), progress)?;
            let preview = collected.preview.insert(preview);
            let starts = &collected.starts;
            let predictions = predictions::measure(&axis, starts, preview, seeds, progress)?;
            collected.predictions = Some(predictions);
            Ok(())
        };
        let ended = measure();
        collected.failure = Ended::kept(ended).err();
        collected
    }

    /// The parts of the study, and which of them are done.
    fn parts(&self) -> Vec<(String, bool)> {
        let kinds = trial::Law::ALL
            .into_iter()
            .flat_map(|law| trial::Start::ALL.map(|start| (law, start)));
        let mut parts: Vec<(String, bool)> = kinds
            .map(|(law, start)| {
                let name = format!("starts under the {} law: {}", law.name(), start.name());
                (name, self.starts.of(law, start).is_some())
            })
            .collect();
        parts.extend([
            ("ablation".to_owned(), self.ablation.is_some()),
            ("announced moves".to_owned(), self.preview.is_some()),
            ("predictions".to_owned(), self.predictions.is_some()),
        ]);
        parts
    }

    /// Contents of `summary.json`.
    fn summary<'a>(&'a self, robot: &'a RobotConfig, options: &Options) -> Summary<'a> {
        Summary {
            robot: &robot.name,
            robot_hash: robot.fingerprint(),
            seeds: options.seeds,
            mass_kg: options.mass_kg,
            load_n: options.load_n,
            bus: bus_of(robot),
            starts: &self.starts,
            ablation: self.ablation.as_ref(),
            predictions: self.predictions.as_ref(),
            preview: self.preview.as_ref(),
            failure: self.failure.as_ref().map(ToString::to_string),
        }
    }

    /// The whole study, if it is complete.
    fn study(self, robot: &RobotConfig, options: &Options) -> Option<Study> {
        Some(Study {
            robot: robot.name.clone(),
            robot_hash: robot.fingerprint(),
            seeds: options.seeds,
            mass_kg: options.mass_kg,
            load_n: options.load_n,
            bus: bus_of(robot),
            starts: self.starts,
            ablation: self.ablation?,
            predictions: self.predictions?,
            preview: self.preview?,
        })
    }
}

/// Contents of `summary.json`. A part is null if the study was stopped before it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Summary<'a> {
    /// Name of the robot.
    robot: &'a str,
    /// Fingerprint of its parameters.
    robot_hash: String,
    /// Starts per kind of move and law.
    seeds: u32,
    /// Moving mass \[kg\].
    mass_kg: f64,
    /// Load \[N\].
    load_n: f64,
    /// The way from master to board.
    bus: BusPath,
    /// Distributions.
    starts: &'a starts::Starts,
    /// Contributions.
    ablation: Option<&'a ablation::Ablation>,
    /// Predictions.
    predictions: Option<&'a predictions::Predictions>,
    /// Announced moves.
    preview: Option<&'a preview::Preview>,
    /// Why a part failed; those before it are there.
    failure: Option<String>,
}

impl study::Summary for Summary<'_> {
    const SCHEMA: &'static str = "wheeleg.delay/1";
}

/// Measures everything.
///
/// # Errors
/// [`StudyError::Refused`] if the robot's cylinder cannot be simulated or does not move.
pub fn study(robot: &RobotConfig, options: &Options) -> Result<Study, StudyError> {
    ensure_starts(robot, options)?;
    let mut collected = Collected::measure(robot, options, &Progress::silent());
    if let Some(failure) = collected.failure.take() {
        return Err(failure);
    }
    // Nothing stops the silent one.
    let study = collected.study(robot, options);
    study.ok_or_else(|| StudyError::refused("the study was stopped", ""))
}

/// Measures and writes everything; returns the study itself if it was not stopped.
///
/// # Errors
/// [`StudyError`] if a start with these options cannot be simulated or never comes, or the folder cannot
/// be used. A part that fails later is named in [`Finished::unwritten`], and those before it are kept.
pub fn write(
    robot: &RobotConfig,
    options: &Options,
    settings: &Settings,
) -> Result<Finished<Option<Study>>, StudyError> {
    ensure_starts(robot, options)?;
    let job = Job::begin("delay", settings, &[Path::new(&robot.file)])?;
    let mut collected = Collected::measure(robot, options, &job.progress);
    let parts = collected.parts();
    let done = parts.iter().filter(|(_, done)| *done).count() as u64;
    let stopped = job.progress.stopped(done, parts.len() as u64, "parts");
    let summary = json(&collected.summary(robot, options), stopped.as_ref());
    let failure = collected.failure.take();
    if failure.is_some() || stopped.is_some() {
        let how = match (&failure, &stopped) {
            (Some(failure), _) => format!("ended by an error after {done} parts: {failure}"),
            (None, Some(stopped)) => stopped.to_string(),
            (None, None) => String::new(),
        };
        let page = Job::stopped_page("Start delay of a pneumatic joint", &how, &parts);
        let rest = |_: &Job, _: &_| (page, Vec::new());
        job.keep::<()>(failure.map_or(Ok(()), Err));
        return Ok(job.finish(None, summary, stopped, rest));
    }
    let study = collected.study(robot, options);
    let study = study.ok_or_else(|| StudyError::refused("a part is missing", ""))?;
    let finished = job.finish(study, summary, None, |job, study| {
        let folder = job.subfolder(CSV);
        job.keep(folder.and_then(|folder| tables::write(&folder, study)));
        let drawn = job.draw(charts::figures(study));
        (page::render(study, &drawn), drawn)
    });
    Ok(finished.map(Some))
}
