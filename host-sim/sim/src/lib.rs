//! Software in the loop: the board and master crates, natively, on a byte-timed
//! bus, around the simulated plant.
//!
//! A run starts with power-up. The boards test themselves, the master
//! enumerates and arms them, and the robot moves to its start pose; all of this
//! is simulated like the rest. Scenario time 0, where the record begins, is the
//! instant at which the robot stands at rest in that pose.

mod audit;
mod boards;
mod bus;
mod downtime;
mod edges;
mod error;
pub mod faults;
mod hal;
mod memory;
mod observe;
mod operator;
mod power;
mod setup;
mod strangers;
mod strike;
mod traffic;
mod words;
mod world;

use std::ops::ControlFlow;

use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::config::UniqueId;
use wheeleg_master::event::Event;
use wheeleg_node::joint::MotionAccount;
use wheeleg_node::snapshot::JointSnapshot;
use wheeleg_plant::assembly::CylinderOutputs;
use wheeleg_protocol::LinkQuality;

pub use self::audit::LineAudit;
pub use self::boards::{JointBoard, identity};
pub use self::downtime::DownTimes;
pub use self::error::SimError;
pub use self::power::BOARD_START_UP_NS;
pub use self::words::hex;

use self::observe::Observer;
use self::operator::Operator;
use self::world::{Happened, World};
use crate::faults::Schedule;
use wheeleg_config::{EventAction, RobotConfig, Scenario};
use wheeleg_remote_host::{Nodes, Outside, PilSummary};
use wheeleg_telemetry::{EventKind, Recorder};

/// Longest time from power-up to the end of commissioning, s.
const COMMISSION_S: f64 = 2.0;
/// Beginning of every event in the record that tells of the time before it.
pub const START_UP: &str = "start-up, ";

/// What a caller sees of one joint board and its cylinder after every tick, start-up
/// included, when it asks to ([`run_watched`]).
#[derive(Debug, Clone, Copy)]
pub struct WatchedJoint<'a> {
    /// Time since power-up, s.
    pub now_s: f64,
    /// Joint 1..=6.
    pub joint: u8,
    /// The board's internals.
    pub board: &'a JointSnapshot,
    /// What it makes of its piston.
    pub account: MotionAccount,
    /// What the cylinder is.
    pub cylinder: &'a CylinderOutputs,
}

/// Looks at every joint after every tick.
pub type JointWatcher<'a> = &'a mut dyn FnMut(&WatchedJoint<'_>);

/// Who is told of a run while it lasts.
pub struct Onlookers<'a> {
    progress: &'a mut dyn FnMut(f64) -> Control,
    watcher: Option<JointWatcher<'a>>,
}

impl<'a> Onlookers<'a> {
    /// One who is told the time, and can stop the run.
    pub fn new(progress: &'a mut dyn FnMut(f64) -> Control) -> Self {
        Self {
            progress,
            watcher: None,
        }
    }

    fn tick(&mut self, world: &World) {
        let Some(watcher) = &mut self.watcher else {
            return;
        };
        for ((joint, board), cylinder) in (1..).zip(world.joints()).zip(&world.outputs().cylinders)
        {
            watcher(&WatchedJoint {
                now_s: world.now_ns() as f64 * 1e-9,
                joint,
                board: board.snapshot(),
                account: board.motion_account(),
                cylinder,
            });
        }
    }
}

/// Whether to go on, as the caller of [`run`] decides at every bus cycle.
pub type Control = ControlFlow<()>;

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOutcome {
    /// Scenario time simulated and recorded, s.
    pub recorded_s: f64,
    /// All simulated time, start-up included, s.
    pub simulated_s: f64,
    /// The caller stopped the run before its end.
    pub stopped: bool,
    /// What boards outside of this process did, if there were any.
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
    let onlookers = Onlookers::new(progress);
    run_on(boards, scenario, robot, seed, nodes, recorder, onlookers)
}

/// As [`run`], with `watcher` called for every joint after every tick, in the time of
/// the start-up, too.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    recorder: &mut Recorder,
    watcher: JointWatcher<'_>,
) -> Result<RunOutcome, SimError> {
    let native = Nodes::default();
    let onlookers = Onlookers {
        progress: &mut |_| Control::Continue(()),
        watcher: Some(watcher),
    };
    run_on(
        Boards::default(),
        scenario,
        robot,
        seed,
        &native,
        recorder,
        onlookers,
    )
}

/// What a run has in place of boards that find their own way.
#[derive(Default)]
pub struct Boards {
    /// Those outside of this process; `None`: all are here.
    outside: Option<Outside>,
    /// Of those here, when they are down after a fault, if not when they would be.
    kept: DownTimes,
}

impl Boards {
    /// Connects those that are outside.
    ///
    /// # Errors
    /// As [`Outside::connect`].
    pub fn connect(nodes: &Nodes, robot: &RobotConfig) -> Result<Self, SimError> {
        Ok(Self {
            outside: Outside::connect(nodes, robot)?,
            kept: DownTimes::default(),
        })
    }

    /// All here, and down when the boards of another run were.
    pub fn native_with(kept: DownTimes) -> Self {
        Self {
            outside: None,
            kept,
        }
    }
}

/// As [`run_with`], on boards that are connected already.
///
/// # Errors
/// As [`run_with`].
pub fn run_on(
    boards: Boards,
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    nodes: &Nodes,
    recorder: &mut Recorder,
    mut onlookers: Onlookers<'_>,
) -> Result<RunOutcome, SimError> {
    let plant = setup::plant(scenario, robot);
    let master = setup::master(scenario, robot);
    let mut world = World::new(robot, &plant, master, seed, boards)?;
    let mut operator = Operator::new(scenario, &robot.start_up);
    let mut observer = Observer::default();
    let mut schedule = Schedule::new(&scenario.faults);
    for fault in scenario.faults.iter().filter(|f| f.kind.is_built_in()) {
        world.strike(fault, true)?;
    }
    let cycle_ns = (robot.bus.cycle_s * 1e9).round() as u64;
    let duration_ns = (scenario.duration_s * 1e9).round() as u64;
    let mut start_ns: Option<u64> = None;
    let mut stopped = false;

    loop {
        let happened = world.step()?;
        let now_ns = world.now_ns();
        if matches!(happened, Happened::JointTick) {
            onlookers.tick(&world);
        }
        match (happened, start_ns) {
            (Happened::JointTick, None) if operator.prepare(&mut world)? => {
                start_ns = Some(now_ns);
                operator.report_start_up(recorder);
                operator.begin(&mut world)?;
                observer.tick(&world, 0, recorder);
            }
            (Happened::JointTick, Some(start_ns)) => {
                let t_ns = now_ns - start_ns;
                observer.tick(&world, t_ns, recorder);
                if t_ns >= duration_ns {
                    break;
                }
                for (fault, begin) in schedule.due(t_ns) {
                    world.strike(&fault, begin)?;
                    recorder.set_disk_full(!world.faults().can_record());
                    let what = if begin { "begins" } else { "ends" };
                    let text = format!("fault {fault} {what}");
                    recorder.event(t_ns, EventKind::Scenario, text);
                }
                for event in operator.due(t_ns) {
                    act(&event.action, &mut world, &operator, t_ns, recorder)?;
                }
                operator.listen(&mut world, t_ns, recorder);
                for note in world.take_notes() {
                    recorder.event(t_ns, EventKind::Command, format!("service: {note}"));
                }
            }
            (Happened::MasterCycle, started) => {
                let record = world.master().take_telemetry();
                if let Some(start_ns) = started {
                    operator.flood(&mut world, now_ns - start_ns, recorder);
                    observer.cycle(&world, record, (start_ns, now_ns), cycle_ns, recorder);
                } else {
                    observer.pass(&world);
                }
                let t_s = started.map_or(-1.0, |start_ns| (now_ns - start_ns) as f64 * 1e-9);
                if (onlookers.progress)(t_s).is_break() {
                    stopped = true;
                    break;
                }
            }
            _ => {}
        }
    }
    let now_ns = world.now_ns();
    let link = observer.link();
    if link.errors() > 0 {
        let t_ns = now_ns - start_ns.unwrap_or(now_ns);
        recorder.event(t_ns, EventKind::Info, link_text(&link));
    }
    Ok(RunOutcome {
        recorded_s: start_ns.map_or(0.0, |start_ns| (now_ns - start_ns) as f64 * 1e-9),
        simulated_s: now_ns as f64 * 1e-9,
        stopped,
        pil: world
            .outside()
            .map(|outside| outside.summary(nodes, now_ns)),
        line: world.audit(),
        link,
        down_times: world.take_down_times(),
    })
}

/// Powers the robot up and takes its boards over for the commissioned ones; gives
/// their unique ids, addresses 1 to 8.
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
    let mut world = World::new(robot, &plant, master, seed, boards)?;
    for fault in scenario.faults.iter().filter(|f| f.kind.is_built_in()) {
        world.strike(fault, true)?;
    }
    let mut ids = [[0; 12]; 8];
    let mut said: Vec<String> = Vec::new();
    let mut asked = false;
    let limit_ns = (robot.start_up.limit_s.min(COMMISSION_S) * 1e9) as u64;
    while world.now_ns() < limit_ns {
        world.step()?;
        // Every board has been asked who it is by then, more than once.
        if !asked && world.now_ns() >= limit_ns / 2 {
            asked = true;
            world
                .submit(Command::Commission)
                .map_err(|why| operator::refused(&Command::Commission, &why))?;
        }
        while let Some((_, event)) = world.master().take_event() {
            match event {
                Event::Commissioned { node, unique_id } => {
                    ids[usize::from(node) - 1] = unique_id;
                }
                Event::Done(ticket) if ticket.code == CommandCode::Commission => return Ok(ids),
                Event::Link { .. } | Event::Log { .. } | Event::NodeReady(_) => {}
                other => said.push(words::describe(&other)),
            }
        }
    }
    Err(SimError::simulation(
        format!("the boards cannot be commissioned: {}", said.join("; ")),
        "mend what the master names, and try again",
    ))
}

/// What the master counted on the line, in words.
fn link_text(link: &LinkQuality) -> String {
    let kinds = [
        ("overflow", link.overflow),
        ("truncated", link.truncated),
        ("short", link.short),
        ("crc", link.crc),
        ("version", link.version),
        ("length", link.length),
        ("address", link.address),
    ];
    let kinds = kinds.iter().filter(|(_, count)| *count > 0);
    let kinds: Vec<String> = kinds
        .map(|(kind, count)| format!("{kind} {count}"))
        .collect();
    format!(
        "master: {} sound frames heard, broken ones: {}",
        link.frames,
        kinds.join(", ")
    )
}

/// Carries out one event of the scenario.
fn act(
    action: &EventAction,
    world: &mut World,
    operator: &Operator<'_>,
    t_ns: u64,
    recorder: &mut Recorder,
) -> Result<(), SimError> {
    match action {
        EventAction::KillMaster => {
            world.kill_master();
            recorder.event(
                t_ns,
                EventKind::Scenario,
                "the master dies and stays silent",
            );
            Ok(())
        }
        EventAction::EStop => {
            recorder.event(t_ns, EventKind::Scenario, "E-stop pressed");
            operator.submit(world, Command::EmergencyStop, t_ns, recorder)
        }
        EventAction::ClearFault => operator.submit(world, Command::ClearFault, t_ns, recorder),
        EventAction::Command(command) => operator.submit(world, *command, t_ns, recorder),
    }
}
