//! The robot's own thread: it owns the session, keeps time, and waits for nobody. It takes no lock and writes
//! no file; messages pass through rings, the most important ones through atomics beside them.

mod adapter;
mod machine;
mod pace;
mod priority;
mod robot;
mod sink;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

use wheeleg_config::builtin::{self, Source};
use wheeleg_config::{ConfigError, RobotConfig, Scenario};
use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::dispatcher::{Refusal, Reject};
use wheeleg_master::event::HoldReason;
use wheeleg_master::setpoint::Phase;
use wheeleg_protocol::{FaultBits, NodeMode};
use wheeleg_remote_host::serial::HilOptions;
use wheeleg_sim::SimError;
use wheeleg_telemetry::OwnedSample;

use wheeleg_access::request::{HostCommand, Spoken};

pub use adapter::SlowAdapter;
pub(crate) use robot::{Robot, start};

/// Commands that may wait for the robot.
pub(crate) const INPUTS: usize = 64;
/// Samples that may wait for the hub: about one second.
pub(crate) const SAMPLES: usize = 16_384;
/// Reports that may wait for the hub.
pub(crate) const REPORTS: usize = 1_024;

/// Inputs of the simulation.
#[derive(Debug, Clone)]
pub struct Live {
    /// Ground, pose and seed.
    pub scenario: Scenario,
    /// The robot.
    pub robot: RobotConfig,
    /// The scenario's file, for recordings.
    pub scenario_toml: String,
    /// The robot's file, for recordings.
    pub robot_toml: String,
    /// Ratio of simulated to wall time; `None`: as fast as possible.
    pub speed: Option<f64>,
    /// Whether the clock is paused at first.
    pub paused: bool,
    /// The serial port at which the boards are; `None`: they are simulated.
    pub port: Option<Port>,
}

/// Boards at a serial port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Which.
    pub options: HilOptions,
    /// Number of the master's first request; different at every start.
    pub first_sequence: u16,
    /// Where the system describes its adapter.
    ports: PathBuf,
}

impl Port {
    /// The port named by `text`, with its rate if not the default: `/dev/ttyUSB0@115200`.
    ///
    /// # Errors
    /// [`SimError`] if it names none.
    pub fn parse(text: &str) -> Result<Self, SimError> {
        let mut first = [0; 2];
        // If the system has no random number, a board may take the first request for an old one; the master
        // asks again.
        let _ = getrandom::fill(&mut first);
        Ok(Self {
            options: HilOptions::parse(text)?,
            first_sequence: u16::from_le_bytes(first),
            ports: adapter::PORTS.into(),
        })
    }

    /// The same, described in another folder; for tests.
    #[doc(hidden)]
    #[must_use]
    pub fn told_of_in(self, ports: &Path) -> Self {
        Self {
            ports: ports.to_owned(),
            ..self
        }
    }

    /// Its adapter, if that is too slow for the bus.
    #[must_use]
    pub fn slow_adapter(&self) -> Option<SlowAdapter> {
        SlowAdapter::at(&self.options.port, &self.ports)
    }
}

impl Live {
    /// A robot in real time: `scenario` and `robot` are built in, or paths; without `robot`, the
    /// scenario's.
    ///
    /// # Errors
    /// [`ConfigError`] if there is no such file, or if it is wrong.
    pub fn load(scenario: &str, robot: Option<&str>) -> Result<Self, ConfigError> {
        let source = builtin::scenario_source(scenario)?;
        let parsed = Scenario::parse(&source.file, &source.text)?;
        let robot = match robot {
            Some(robot) => builtin::robot_source(robot)?,
            None => builtin::robot_source_of(&parsed.robot, scenario)?,
        };
        Self::of(&source, &robot)
    }

    /// The same from files that are read already.
    ///
    /// # Errors
    /// [`ConfigError`] if one is wrong.
    pub(crate) fn of(scenario: &Source, robot: &Source) -> Result<Self, ConfigError> {
        Ok(Self {
            scenario: Scenario::parse(&scenario.file, &scenario.text)?,
            robot: RobotConfig::parse(&robot.file, &robot.text)?,
            scenario_toml: scenario.text.clone(),
            robot_toml: robot.text.clone(),
            speed: Some(1.0),
            paused: false,
            port: None,
        })
    }
}

/// A request of the hub to the robot.
#[derive(Debug)]
pub(crate) enum Input {
    /// A command to the master, for the holder of control.
    Request {
        /// Number of the request at the hub and at the master.
        id: u32,
        /// Newest master time shown to the sender, µs.
        seen_us: u64,
        /// How long after it the command may begin, µs.
        valid_us: u64,
        /// The command.
        command: Command,
        /// The same as its sender wrote it.
        spoken: Spoken,
        /// Name of the client that takes control.
        by: Option<String>,
    },
    /// A command to the simulation.
    Host {
        /// Number of the request at the hub.
        id: u32,
        /// The command.
        command: HostCommand,
    },
    /// Control was revoked, at the hub. The robot does not notice; its recording does.
    Revoked {
        /// Number of the request at the hub.
        id: u32,
        /// Name of the client that was in control, or had asked for it.
        holder: String,
        /// Name of the client that revoked it.
        by: String,
    },
}

/// A report of the robot to the hub.
#[derive(Debug)]
pub(crate) enum Report {
    /// Its state, once per bus cycle.
    Status(Status),
    /// The answer to a request.
    Answer {
        /// Number of the request.
        id: u32,
        /// Master time, µs.
        time_us: u64,
        /// The answer.
        answer: Answer,
    },
    /// A board has reported the value of a parameter.
    Parameter {
        /// Board.
        board: u8,
        /// Number of the parameter.
        id: u16,
        /// Raw value.
        raw: i32,
    },
    /// The simulation cannot continue.
    Failed(Box<SimError>),
}

/// The answer to a request.
#[derive(Debug)]
pub(crate) enum Answer {
    /// It is queued; its end comes later.
    Accepted,
    /// It is done.
    Done,
    /// Refused at the master's door.
    Rejected(Reject),
    /// Refused later.
    Refused(CommandCode, Refusal),
    /// The clock is paused.
    Paused,
    /// The sender claims to have seen the future.
    SeenInFuture,
    /// The computer was suspended since the sender saw the robot.
    Suspended,
    /// Control was revoked, and the sender's lease is not over.
    Revoked,
    /// The master is dead.
    NoMaster,
    /// The clock runs too fast for a client to be in control.
    TooFast,
    /// The serial adapter is too slow for the bus.
    SlowAdapter(Box<SlowAdapter>),
    /// The simulation refuses.
    Simulation(Box<SimError>),
    /// Nothing is recorded, or no longer.
    NotRecorded(String),
}

/// State of the robot at the end of a bus cycle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Status {
    /// Master time, µs.
    pub(crate) now_us: u64,
    /// The boards are simulated, not at a serial port.
    pub(crate) simulated: bool,
    /// The master lives.
    pub(crate) alive: bool,
    /// Every board is present and compatible.
    pub(crate) ready: bool,
    /// All axes are armed.
    pub(crate) armed: bool,
    /// Why all axes hold.
    pub(crate) hold: Option<HoldReason>,
    /// The stop bit is in SYNC.
    pub(crate) emergency_stop: bool,
    /// Phase of the motion.
    pub(crate) phase: Phase,
    /// Step of the gait, from 0.
    pub(crate) step: u16,
    /// Newest master time that the holder of control has seen, µs.
    pub(crate) lease_seen_us: Option<u64>,
    /// Boards 1 to 8.
    pub(crate) boards: [BoardStatus; 8],
    /// Pace of the clock.
    pub(crate) pace: PaceStatus,
    /// Number of requested stops that were accepted.
    pub(crate) stops: u64,
}

impl Status {
    /// Whether any board has answered in the last cycle.
    pub(crate) fn hears(&self) -> bool {
        self.boards.iter().any(|board| board.mode.is_some())
    }
}

/// One board.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoardStatus {
    /// It answered in the last cycle, in this mode.
    pub(crate) mode: Option<NodeMode>,
    /// Its faults.
    pub(crate) faults: FaultBits,
}

/// Pace of the clock.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PaceStatus {
    /// Requested ratio of simulated to wall time; `None`: as fast as possible.
    pub(crate) speed: Option<f64>,
    /// The clock is paused.
    pub(crate) paused: bool,
    /// Ratio of simulated to wall time over the last second.
    pub(crate) factor: f64,
    /// How late the last cycle began, ms.
    pub(crate) late_ms: f64,
    /// Largest lateness of a cycle in the last second, ms.
    pub(crate) late_max_ms: f64,
    /// Cycles since the start that began more than 5 ms late, and their SYNC with them.
    pub(crate) late: u32,
    /// How often the base of the clock was shifted.
    pub(crate) shifts: u32,
}

/// A sample on its way to the hub.
#[derive(Debug)]
pub(crate) struct Moving {
    /// Index of the channel.
    pub(crate) channel: u16,
    /// Number of the sample in its channel: a gap means that the ring was full.
    pub(crate) number: u64,
    /// Simulated time, ns.
    pub(crate) t_ns: u64,
    /// The sample.
    pub(crate) sample: OwnedSample,
}

/// Messages beside the rings, so that no full ring can hold them up.
#[derive(Debug, Default)]
pub(crate) struct Signals {
    /// Number of requested stops.
    stops: AtomicU64,
    /// Newest master time that the holder of control has seen, µs.
    seen_us: AtomicU64,
    /// The robot's thread is to end.
    end: AtomicBool,
    /// Samples that found the ring full.
    dropped: AtomicU64,
    /// Clients and viewers that are connected.
    clients: AtomicUsize,
}

impl Signals {
    /// Asks for a stop, and returns the number that [`Status::stops`] reaches when it is accepted.
    pub(crate) fn stop(&self) -> u64 {
        self.stops.fetch_add(1, Ordering::SeqCst) + 1
    }

    /// Number of requested stops.
    #[cfg(test)]
    pub(crate) fn stops(&self) -> u64 {
        self.stops.load(Ordering::SeqCst)
    }

    /// The holder of control has seen the robot.
    pub(crate) fn beat(&self, seen_us: u64) {
        self.seen_us.store(seen_us, Ordering::Release);
    }

    /// Ends the robot's thread.
    pub(crate) fn end(&self) {
        self.end.store(true, Ordering::SeqCst);
    }

    /// Sets the number of connected clients and viewers.
    pub(crate) fn connected(&self, clients: usize) {
        self.clients.store(clients, Ordering::Relaxed);
    }

    /// Samples that found the ring full.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}
