//! Software in the loop: the board and master crates, natively, on a byte-timed
//! bus, around the simulated plant.
//!
//! A run starts with power-up. The boards test themselves, the master
//! enumerates and arms them, and the robot moves to its start pose; all of this
//! is simulated like the rest. Scenario time 0, where the record begins, is the
//! instant at which the robot stands at rest in that pose.
//!
//! # Glossary
//!
//! * **session**: one simulated robot that a program drives
//! * **board**: application, hardware model, memory and clock at one address
//! * **operator**: the simulated person at the controls, who arms the robot and gives the commands of the
//!   scenario
//! * **line**: a serial port or pipe between a master here and boards elsewhere, or the other way round
//! * **observer**: samples the robot for the recorder; not the observer of `control`, which estimates
//!   pressures
//! * **rogue node**: a node on the bus that should not be there
//! * **down**: without power, or with a stopped program (of a board)

mod audit;
mod board;
mod boards;
mod bus;
mod client;
mod clock;
mod down;
mod downtime;
mod energy;
mod error;
pub mod faults;
mod hal;
mod line;
mod memory;
mod observe;
mod operator;
mod provenance;
mod rogue_nodes;
mod session;
mod setup;
mod standing;
mod unphysical;
mod world;

use std::ops::ControlFlow;

use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::config::UniqueId;
use wheeleg_master::event::Event;
use wheeleg_node::joint::MotionAccount;
use wheeleg_node::snapshot::JointSnapshot;
use wheeleg_plant::assembly::CylinderOutputs;
use wheeleg_protocol::{LinkQuality, Node};

pub use self::audit::LineAudit;
pub use self::boards::{JointBoard, identity};
pub use self::downtime::DownTimes;
pub use self::energy::EnergyBalance;
pub use self::error::SimError;
pub use self::line::{Line, LineBoards, LineMaster, PortLine, unmeasured};
pub use self::provenance::provenance;
pub use self::session::Session;
pub use self::world::BOARD_START_UP_NS;

use self::world::{Happened, World};
use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_remote_host::{Nodes, PilSummary, RemoteBoards};
use wheeleg_telemetry::Recorder;
use wheeleg_telemetry::event::Cause;

/// Longest time from power-up to the end of commissioning, s.
const COMMISSION_S: f64 = 2.0;

/// One joint board and its cylinder after a tick, start-up included, for a caller of [`run_watched`].
#[derive(Debug, Clone, Copy)]
pub struct JointProbe<'a> {
    /// Time since power-up, s.
    pub now_s: f64,
    /// Joint 1..=6.
    pub joint: u8,
    /// The board's internals.
    pub board: &'a JointSnapshot,
    /// Its account of the piston's motion.
    pub account: MotionAccount,
    /// The true state of the cylinder.
    pub cylinder: &'a CylinderOutputs,
}

/// Looks at every joint after every tick.
pub type ProbeFn<'a> = &'a mut dyn FnMut(&JointProbe<'_>);

/// Callbacks during a run.
pub struct Observers<'a> {
    progress: &'a mut dyn FnMut(f64) -> Control,
    watcher: Option<ProbeFn<'a>>,
}

impl<'a> Observers<'a> {
    /// An observer that gets the time, and can stop the run.
    pub fn new(progress: &'a mut dyn FnMut(f64) -> Control) -> Self {
        Self {
            progress,
            watcher: None,
        }
    }

    /// Adds one that sees every joint board in every tick.
    #[must_use]
    pub fn watching(self, watcher: ProbeFn<'a>) -> Self {
        Self {
            watcher: Some(watcher),
            ..self
        }
    }
}

/// Whether to continue; the caller of [`run`] decides at every bus cycle.
pub type Control = ControlFlow<()>;

/// How a run ended.
#[derive(Debug)]
pub struct RunOutcome {
    /// Scenario time simulated and recorded, s.
    pub recorded_s: f64,
    /// All simulated time, start-up included, s.
    pub simulated_s: f64,
    /// The caller stopped the run before its end, or it failed.
    pub stopped: bool,
    /// Why the run ended early: the robot did not get ready, the plant left the range of its model, a board
    /// elsewhere failed. The time simulated until then is recorded.
    pub failure: Option<SimError>,
    /// Summary of the boards outside of this process, if there were any.
    pub pil: Option<PilSummary>,
    /// Frames that were sent and accepted.
    pub line: LineAudit,
    /// Frames and errors that the master counted, by kind.
    pub link: LinkQuality,
    /// When boards outside were down.
    pub down_times: DownTimes,
}

/// Runs a scenario and records it.
///
/// `progress` is called once per bus cycle with the scenario time in s, negative
/// during start-up; the run ends early when it breaks.
///
/// # Errors
/// [`SimError::Simulation`] when a part refuses its parameters, the robot does
/// not get ready, or the plant leaves the range of its model.
pub fn run(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    recorder: &mut Recorder,
    progress: &mut dyn FnMut(f64) -> Control,
) -> Result<RunOutcome, SimError> {
    let native = Nodes::default();
    run_with(scenario, robot, seed, &native, recorder, progress)
}

/// As [`run`], with some or all nodes outside of this process.
///
/// # Errors
/// As [`run`]; also when a board outside does not come up or stops.
pub fn run_with(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    nodes: &Nodes,
    recorder: &mut Recorder,
    progress: &mut dyn FnMut(f64) -> Control,
) -> Result<RunOutcome, SimError> {
    let boards = Boards::connect(nodes, robot)?;
    let observers = Observers::new(progress);
    run_on(boards, scenario, robot, seed, recorder, observers)?.whole()
}

/// As [`run`], with `watcher` called for every joint after every tick, also during start-up.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    recorder: &mut Recorder,
    watcher: ProbeFn<'_>,
) -> Result<RunOutcome, SimError> {
    let mut go_on = |_| Control::Continue(());
    let observers = Observers::new(&mut go_on).watching(watcher);
    let boards = Boards::default();
    run_on(boards, scenario, robot, seed, recorder, observers)?.whole()
}

/// The boards of a run that do not simply run here.
#[derive(Default)]
pub struct Boards {
    /// Where each of them runs.
    nodes: Nodes,
    /// Those outside of this process; `None`: all are here.
    remote: Option<RemoteBoards>,
    /// When boards here are down after a fault, if not at their own times.
    replayed: DownTimes,
}

impl Boards {
    /// Connects the boards that are outside.
    ///
    /// # Errors
    /// As [`RemoteBoards::connect`].
    pub fn connect(nodes: &Nodes, robot: &RobotConfig) -> Result<Self, SimError> {
        Ok(Self {
            nodes: nodes.clone(),
            remote: RemoteBoards::connect(nodes, robot)?,
            replayed: DownTimes::default(),
        })
    }

    /// Whether all are here.
    #[must_use]
    pub const fn are_here(&self) -> bool {
        self.remote.is_none()
    }

    /// All boards here, and down when those of another run were.
    pub fn native_with(replayed: DownTimes) -> Self {
        Self {
            nodes: Nodes::default(),
            remote: None,
            replayed,
        }
    }
}

/// As [`run_with`], on boards that are connected already; if the run fails on its way, its outcome holds what
/// there is of it ([`RunOutcome::failure`]).
///
/// # Errors
/// [`SimError::Simulation`] when a part refuses its parameters.
pub fn run_on(
    boards: Boards,
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    recorder: &mut Recorder,
    mut observers: Observers<'_>,
) -> Result<RunOutcome, SimError> {
    let mut session = Session::new(boards, scenario, robot, seed)?;
    let driven = drive(&mut session, recorder, &mut observers);
    if let Err(error) = &driven {
        session.fail(error, recorder);
    }
    let stopped = !session.is_over();
    let outcome = session.finish(stopped, recorder);
    Ok(RunOutcome {
        failure: driven.err(),
        ..outcome
    })
}

/// Simulates to the end of the scenario, or until an observer stops it.
fn drive(
    session: &mut Session,
    recorder: &mut Recorder,
    observers: &mut Observers<'_>,
) -> Result<(), SimError> {
    while !session.is_over() {
        let happened = session.advance()?;
        if happened == Happened::JointTick
            && let Some(watcher) = &mut observers.watcher
        {
            session.show(watcher);
        }
        session.handle(happened, recorder)?;
        if happened == Happened::MasterCycle {
            let t_s = session.scenario_s().unwrap_or(-1.0);
            if (observers.progress)(t_s).is_break() {
                break;
            }
        }
    }
    Ok(())
}

impl RunOutcome {
    /// The outcome of a run that did not fail.
    ///
    /// # Errors
    /// [`RunOutcome::failure`].
    fn whole(mut self) -> Result<Self, SimError> {
        match self.failure.take() {
            Some(failure) => Err(failure),
            None => Ok(self),
        }
    }
}

/// Powers the robot up and accepts its boards as the commissioned ones; gives their unique ids, addresses 1
/// to 8.
///
/// # Errors
/// [`SimError::Simulation`] with the reason if a board is missing, doubled, of
/// another version or of the wrong kind.
pub fn commission(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    nodes: &Nodes,
) -> Result<[UniqueId; 8], SimError> {
    let boards = Boards::connect(nodes, robot)?;
    let plant = setup::plant(scenario, robot);
    let master = setup::master(scenario, robot);
    let mut world = World::new((scenario, robot), &plant, master, seed, boards)?;
    for fault in scenario.faults.iter().filter(|f| f.kind.is_built_in()) {
        world.inject(fault, true)?;
    }
    let mut ids = [[0; 12]; 8];
    let mut said: Vec<String> = Vec::new();
    let mut asked = false;
    let limit_ns = (robot.start_up.limit_s.min(COMMISSION_S) * 1e9) as u64;
    while world.now_ns() < limit_ns {
        world.step()?;
        // By then every board has been asked for its identity more than once.
        if !asked && world.now_ns() >= limit_ns / 2 {
            asked = true;
            world
                .submit(Command::Commission)
                .map_err(|why| operator::refused(&Command::Commission, &why))?;
        }
        while let Some((_, event)) = world.master().take_event() {
            match event {
                Event::Commissioned { node, unique_id } => {
                    if let Some(node) = Node::new(node) {
                        ids[node.index()] = unique_id;
                    }
                }
                Event::Done(ticket) if ticket.code == CommandCode::Commission => return Ok(ids),
                Event::Link { .. } | Event::Log { .. } | Event::NodeReady(_) => {}
                other => said.push(Cause::Master(other).to_string()),
            }
        }
    }
    Err(SimError::simulation(
        format!("the boards cannot be commissioned: {}", said.join("; ")),
        "fix what the master reports, and try again",
    ))
}
