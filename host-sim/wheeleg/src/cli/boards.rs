//! `wheeleg boards`: the boards of a simulated robot, for a master in another program.

use std::process::ExitCode;

use clap::Args;
use wheeleg_config::builtin;
use wheeleg_remote_host::pty::Pty;
use wheeleg_sim::{LineBoards, SimError};
use wheeleg_studies::StudyError;
use wheeleg_telemetry::{Keep, Recorder};

use super::{print, stop_on_signals, tell};

/// Default scenario: a level floor.
const SCENARIO: &str = "stand";

/// Arguments of `wheeleg boards`.
#[derive(Debug, Args)]
pub(super) struct BoardsArgs {
    /// Built-in scenario or path of a TOML file: ground, pose and seed.
    #[arg(default_value = SCENARIO)]
    scenario: String,
    /// Robot (built in, or path of a TOML file), instead of the scenario's.
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Put the boards behind a pseudo-terminal, and print its path for `wheeleg serve --port`.
    #[arg(long, required = true)]
    pty: bool,
}

/// Runs the boards until told to stop.
pub(super) fn command(args: &BoardsArgs) -> Result<ExitCode, StudyError> {
    let stop = stop_on_signals()?;
    let scenario = builtin::scenario(&args.scenario)?;
    let robot = match &args.robot {
        Some(robot) => builtin::robot(robot)?,
        None => builtin::robot_of(&scenario, &args.scenario)?,
    };
    let mut boards = LineBoards::new(&scenario, &robot, scenario.seed)?;
    let mut pty = Pty::open().map_err(SimError::from)?;
    let path = pty.path();
    print(&format!(
        "eight boards of `{}` at {path}\n\
         drive them: wheeleg serve {} --robot {} --port {path}\n\
         Ctrl-C ends it.\n",
        robot.name, args.scenario, robot.name
    ))?;
    let mut recorder = Recorder::new(Keep::nothing());
    boards.serve(&mut pty, &mut recorder, &|| stop.signal().is_some())?;
    tell("the boards are switched off");
    let code = stop.signal().map_or(0, |signal| signal.exit_code());
    Ok(ExitCode::from(code))
}
