//! The robot led by the robot's thread: a simulated one, or the boards at the end of a line.

use wheeleg_config::RobotConfig;
use wheeleg_config::Scenario;
use wheeleg_config::faults::FaultSpec;
use wheeleg_master::Master;
use wheeleg_master::dispatcher::{Reject, Request, Ticket};
use wheeleg_master::event::Event;
use wheeleg_master::telemetry::Record;
use wheeleg_remote_host::port::BusPort;
use wheeleg_sim::{Boards, LineMaster, PortLine, Session, SimError};
use wheeleg_telemetry::Recorder;

use super::Port;

/// Boxed: both are large, and should not be moved about.
pub(super) enum Machine {
    /// Boards, plant and master in this program, on a clock of its own.
    Simulated(Box<Session>),
    /// The master here, its boards at a serial port, in wall-clock time.
    Line(Box<LineMaster<PortLine>>),
}

impl Machine {
    /// Powers a robot up, or opens the port.
    ///
    /// # Errors
    /// [`SimError`] if it cannot be built, or the port cannot be opened.
    pub(super) fn new(
        scenario: &Scenario,
        robot: &RobotConfig,
        port: Option<&Port>,
    ) -> Result<Self, SimError> {
        let Some(port) = port else {
            let session = Session::live(Boards::default(), scenario, robot, scenario.seed)?;
            return Ok(Self::Simulated(Box::new(session)));
        };
        let line = PortLine::new(BusPort::open(&port.options)?);
        let master = LineMaster::new(scenario, robot, port.first_sequence, line)?;
        Ok(Self::Line(Box::new(master)))
    }

    pub(super) fn is_simulated(&self) -> bool {
        matches!(self, Self::Simulated(_))
    }

    pub(super) fn step_to(&mut self, t_ns: u64, recorder: &mut Recorder) -> Result<(), SimError> {
        match self {
            Self::Simulated(session) => session.step_to(t_ns, recorder),
            Self::Line(master) => {
                master.step_to(t_ns, recorder);
                Ok(())
            }
        }
    }

    pub(super) fn now_ns(&self) -> u64 {
        match self {
            Self::Simulated(session) => session.now_ns(),
            Self::Line(master) => master.now_ns(),
        }
    }

    /// `None`: the master is dead.
    pub(super) fn request(
        &mut self,
        request: Request,
        recorder: &mut Recorder,
    ) -> Option<Result<Ticket, Reject>> {
        match self {
            Self::Simulated(session) => session.request(request, recorder),
            Self::Line(master) => Some(master.request(request, recorder)),
        }
    }

    pub(super) fn beat(&mut self, seen_us: u64) {
        match self {
            Self::Simulated(session) => session.beat(seen_us),
            Self::Line(master) => master.beat(seen_us),
        }
    }

    pub(super) fn take_outcome(&mut self) -> Option<(u64, Event)> {
        match self {
            Self::Simulated(session) => session.take_outcome(),
            Self::Line(master) => master.take_outcome(),
        }
    }

    pub(super) fn record(&self) -> Option<&Record> {
        match self {
            Self::Simulated(session) => session.record(),
            Self::Line(master) => master.record(),
        }
    }

    pub(super) fn master(&self) -> &Master {
        match self {
            Self::Simulated(session) => session.master(),
            Self::Line(master) => master.master(),
        }
    }

    pub(super) fn master_alive(&self) -> bool {
        match self {
            Self::Simulated(session) => session.master_alive(),
            Self::Line(_) => true,
        }
    }

    /// # Errors
    /// [`SimError`] if the fault cannot begin or end, or the boards are real.
    pub(super) fn inject(
        &mut self,
        fault: &FaultSpec,
        begin: bool,
        recorder: &mut Recorder,
    ) -> Result<(), SimError> {
        match self {
            Self::Simulated(session) => session.inject(fault, begin, recorder),
            Self::Line(_) => Err(only_simulated("faults can be injected into")),
        }
    }
}

/// Error for actions that only a simulated robot allows.
pub(super) fn only_simulated(what: &str) -> SimError {
    SimError::simulation(
        format!("{what} a simulated robot only: these boards are on a serial port"),
        "start `wheeleg serve` without --port",
    )
}
