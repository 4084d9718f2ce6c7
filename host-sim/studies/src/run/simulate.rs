//! One run from a scenario to its judgement: common to all ways of running a case, with files or without.

use std::ops::ControlFlow;

use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_sim::{self as sil, Boards, Observers, RunOutcome, SimError};
use wheeleg_telemetry::{LogError, Recorder, Recording};

use crate::analysis::{Analyser, Analysis};

/// A run that was simulated and judged.
#[derive(Debug)]
pub struct Simulated {
    /// How it ended.
    pub outcome: RunOutcome,
    /// Its hash, and the data that the recorder was set to keep.
    pub recording: Recording,
    /// Targets and other findings.
    pub analysis: Analysis,
    /// The first error of each sink that had one.
    pub failed: Vec<LogError>,
}

/// Simulates a scenario and judges it while it lasts. `progress` gets the scenario time in s at every bus
/// cycle, negative before the scenario begins, and can end the run. The hash does not depend on what the
/// recorder keeps or writes.
///
/// # Errors
/// [`SimError`] when a part refuses its parameters; not for a run that fails on its way
/// ([`RunOutcome::failure`]).
pub fn simulate(
    boards: Boards,
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    recorder: Recorder<'_>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Simulated, SimError> {
    let mut analyser = Analyser::new(scenario, robot);
    let mut recorder = recorder.with(&mut analyser);
    sil::provenance(&mut recorder, scenario, robot, seed);
    let observers = Observers::new(progress);
    let outcome = sil::run_on(boards, scenario, robot, seed, &mut recorder, observers);
    let (recording, failed) = recorder.close();
    Ok(Simulated {
        outcome: outcome?,
        recording,
        analysis: analyser.finish(),
        failed,
    })
}
