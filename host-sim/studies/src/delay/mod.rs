//! The start delay of a pneumatic joint: its distribution, its causes, and its end.
//!
//! The paper reports that model and robot agree but for a delay of 0.25 s, and
//! leaves the cause to "a more accurate model of the pneumatic circuit" (section 9).
//! Here the robot's own vertical cylinder stands on a bench ([`crate::bench`]), driven
//! by the firmware's own law, and
//!
//! * [`starts`] measures how long a move takes to start, per kind of move;
//! * [`ablation`] takes the contributions away, each alone and one after the other;
//! * [`predictions`] tests what the explanation foretells, and its rivals;
//! * [`notice`] shows what an announced move gains.
//!
//! Nothing in the plant is fitted to a delay: the valves' conductance follows from
//! the stroke time alone. Every trial is a pure function of axis, law and seed.

pub mod ablation;
mod charts;
mod hands;
pub mod kinds;
pub mod notice;
mod page;
pub mod predictions;
pub mod scaling;
pub mod starts;
mod tables;
pub mod trial;

use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::MessageType;
use wheeleg_protocol::link::SlotTiming;

use crate::StudyError;
use crate::bench::suite::BenchError;
use trial::{BusPath, Outcome, Trial};
use wheeleg_config::RobotConfig;
use wheeleg_report::output;
use wheeleg_report::subfolder;

/// The paper's delay, and the band that counts as explained \[s\].
pub const PAPER_DELAY_S: f64 = 0.25;
/// Half of the band \[s\].
pub const PAPER_BAND_S: f64 = 0.05;
/// Largest start delay of an announced move \[s\].
pub const NOTICED_LIMIT_S: f64 = 0.08;
/// Largest motion before an announced move \[mm\].
pub const EARLY_LIMIT_MM: f64 = 1.0;

/// What is asked for.
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
    /// 50 seeds; 1.5 kg, no load (ASSUMED: a rod with carriage, lying).
    fn default() -> Self {
        Self {
            seeds: 50,
            mass_kg: 1.5,
            load_n: 0.0,
        }
    }
}

/// Everything that was measured.
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
    pub notice: notice::Notice,
}

/// The vertical cylinder of the robot's left leg on a bench.
#[must_use]
pub fn axis_of(robot: &RobotConfig, mass_kg: f64, load_n: f64) -> AxisParams {
    /// Left vertical, in the order of the joints.
    const VERTICAL: usize = 2;
    let plant = &robot.plant;
    let mut cylinder = plant.cylinders[VERTICAL].clone();
    // A bench begins vented; pressures come from the moves.
    cylinder.initial_pressure_a_pa = plant.gas.ambient_pressure_pa;
    cylinder.initial_pressure_b_pa = plant.gas.ambient_pressure_pa;
    AxisParams {
        gas: plant.gas,
        supply: plant.supply,
        cylinder,
        moving_mass_kg: mass_kg,
        load_n,
        initial_stroke_m: 0.0,
        potentiometer: plant.potentiometers[VERTICAL],
        adc: plant.adc,
        step_ns: plant.step_ns,
    }
}

/// Cycle and SYNC of the robot's bus.
#[must_use]
pub fn bus_of(robot: &RobotConfig) -> BusPath {
    BusPath {
        cycle_s: robot.bus.cycle_s,
        frame_s: f64::from(SlotTiming::DEFAULT.frame_us(MessageType::Sync)) * 1e-6,
    }
}

/// Runs trials on two threads, in order, and tells `bar`.
fn run_all(trials: &[Trial], bar: &ProgressBar) -> Result<Vec<Outcome>, StudyError> {
    let work = || {
        trials
            .par_iter()
            .map(|trial| {
                let outcome = trial.run();
                bar.inc(1);
                outcome
            })
            .collect::<Result<Vec<_>, BenchError>>()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    let outcomes = match pool {
        Ok(pool) => pool.install(work),
        // Without threads of its own the pool of the program does it.
        Err(_) => work(),
    };
    outcomes.map_err(|e| {
        StudyError::refused(
            format!("a start cannot be simulated: {e}"),
            "check the cylinder, valves and supply of the robot file; the message is in SI units",
        )
    })
}

/// Median; `None` of nothing.
fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Quantile, interpolated; `None` of nothing.
fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = share * last as f64;
    let low = sorted.get(at.floor() as usize)?;
    let high = sorted.get(at.ceil() as usize)?;
    Some(low + (high - low) * at.fract())
}

/// Mean start delay of outcomes \[s\]; `None` if one of them never started.
fn mean_delay(outcomes: &[Outcome]) -> Option<f64> {
    let delays: Option<Vec<f64>> = outcomes.iter().map(|o| o.delay_s).collect();
    let delays = delays?;
    (!delays.is_empty()).then(|| delays.iter().sum::<f64>() / delays.len() as f64)
}

/// Measures everything.
///
/// # Errors
/// [`StudyError::Refused`] if the robot's cylinder cannot be simulated or does not move.
pub fn study(robot: &RobotConfig, options: &Options) -> Result<Study, StudyError> {
    let axis = axis_of(robot, options.mass_kg, options.load_n);
    let bus = bus_of(robot);
    let weight_n = robot.reference.m6_kg * robot.reference.gravity_m_s2;
    let bar = progress_bar();
    let part = |what: &'static str| bar.set_message(what);
    part("distributions");
    let starts = starts::measure(&axis, options.seeds, &bar)?;
    part("ablation");
    let ablation = ablation::measure(&axis, bus, weight_n, options.seeds, &bar)?;
    part("announced moves");
    let notice = notice::measure(&axis, options.seeds.min(8), &bar)?;
    part("predictions");
    let predictions = predictions::measure(&axis, &starts, &notice, options.seeds, &bar)?;
    bar.finish_and_clear();
    Ok(Study {
        robot: robot.name.clone(),
        robot_hash: robot.fingerprint(),
        seeds: options.seeds,
        mass_kg: options.mass_kg,
        load_n: options.load_n,
        bus,
        starts,
        ablation,
        predictions,
        notice,
    })
}

/// Files that were written.
#[derive(Debug)]
pub struct Finished {
    /// The page.
    pub report: PathBuf,
    /// What was measured.
    pub study: Study,
}

impl Study {
    /// What `summary.json` holds.
    ///
    /// # Panics
    /// Never: every field has a JSON form.
    #[must_use]
    pub fn summary(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}

/// Measures and writes everything into `folder`. Results of an earlier run in it are set
/// aside in its folders `previous`, `previous-2`, …
///
/// # Errors
/// [`StudyError`] if something cannot be simulated, drawn or written.
pub fn write(
    folder: &Path,
    robot: &RobotConfig,
    options: &Options,
) -> Result<Finished, StudyError> {
    output::prepare(folder)?;
    let study = study(robot, options)?;
    tables::write(&subfolder(folder, "csv")?, &study)?;
    let plots = subfolder(folder, "figures")?;
    let mut drawn = Vec::new();
    for figure in charts::figures(&study) {
        let svg = figure.svg();
        save(&plots.join(format!("{}.svg", figure.id)), &svg)?;
        drawn.push((figure, svg));
    }
    save(
        &folder.join("summary.json"),
        &format!("{:#}\n", study.summary()),
    )?;
    let report = folder.join("report.html");
    save(&report, &page::render(&study, &drawn)?)?;
    Ok(Finished { report, study })
}

fn save(path: &Path, text: &str) -> Result<(), StudyError> {
    std::fs::write(path, text).map_err(|e| StudyError::output("write", path, e))
}

fn progress_bar() -> ProgressBar {
    // Draws on stderr, and only if that is a terminal. The length grows as parts begin.
    let bar = ProgressBar::new(0);
    let style = ProgressStyle::with_template("delay {wide_bar} {pos}/{len} starts  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
