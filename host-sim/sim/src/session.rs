//! A simulated robot that a program drives: step by step, to a time, with commands and faults from outside.
//! [`run`](crate::run) is its first caller.

use std::collections::VecDeque;
use wheeleg_config::faults::FaultSpec;
use wheeleg_config::{EventAction, RobotConfig, Scenario};

use wheeleg_master::Master;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::{Reject, Request, Ticket};
use wheeleg_master::event::Event;
use wheeleg_master::telemetry::Record;
use wheeleg_remote_host::Nodes;
use wheeleg_telemetry::Recorder;
use wheeleg_telemetry::event::{Act, Answer, Cause};

use crate::faults::{ActiveFaults, Schedule};
use crate::observe::Observer;
use crate::operator::{Operator, listen, record_answer};
use crate::world::{Happened, World};
use crate::{Boards, EnergyBalance, JointProbe, RunOutcome, SimError, setup};

/// One robot, from power-up on: boards, bus, master and plant on one clock, the operator who gets it ready
/// and carries out the scenario, and the observer that samples it.
///
/// The same scenario, robot, seed and inputs at the same times give the same recording, however the time is
/// divided into calls.
pub struct Session {
    world: World,
    operator: Operator,
    observer: Observer,
    schedule: Schedule,
    active: ActiveFaults,
    robot: RobotConfig,
    nodes: Nodes,
    cycle_ns: u64,
    duration_ns: u64,
    /// Simulated time at which the scenario began, if it has.
    start_ns: Option<u64>,
    over: bool,
    /// The master's record of the last cycle.
    record: Option<Record>,
    /// Ends of the requests of a console, until they are taken.
    outcomes: Option<VecDeque<(u64, Event)>>,
}

/// Most ends of requests that wait for their console; then the oldest goes.
const OUTCOMES: usize = 256;

/// Keeps the end of a request for its console, and values that a board has reported for it.
pub(crate) fn keep_outcome(outcomes: &mut VecDeque<(u64, Event)>, time_us: u64, event: &Event) {
    let ends = matches!(event, Event::Done(_) | Event::Refused { .. });
    if ends || matches!(event, Event::Parameter { .. }) {
        if outcomes.len() == OUTCOMES {
            outcomes.pop_front();
        }
        outcomes.push_back((time_us, *event));
    }
}

/// The faults of a scenario that are present from power-up on.
fn built_in(scenario: &Scenario) -> Vec<FaultSpec> {
    let faults = scenario.faults.iter();
    faults.filter(|f| f.kind.is_built_in()).copied().collect()
}

impl Session {
    /// Powers the robot up in the start pose of the scenario.
    ///
    /// # Errors
    /// [`SimError`] if the robot cannot do what the scenario asks for, a part refuses its parameters, or a
    /// built-in fault is impossible.
    pub fn new(
        boards: Boards,
        scenario: &Scenario,
        robot: &RobotConfig,
        seed: u64,
    ) -> Result<Self, SimError> {
        Self::build(boards, scenario, robot, seed, false)
    }

    /// Built in place: a session is large, and should not be moved about on the stack.
    fn build(
        boards: Boards,
        scenario: &Scenario,
        robot: &RobotConfig,
        seed: u64,
        live: bool,
    ) -> Result<Self, SimError> {
        scenario.check_with(robot).map_err(Box::new)?;
        let plant = setup::plant(scenario, robot);
        let master = setup::master(scenario, robot);
        let nodes = boards.nodes.clone();
        let mut world = World::new((scenario, robot), &plant, master, seed, boards)?;
        for fault in built_in(scenario) {
            world.inject(&fault, true)?;
        }
        Ok(Self {
            world,
            operator: Operator::new(scenario, robot),
            observer: Observer::default(),
            schedule: Schedule::new(&scenario.faults),
            active: ActiveFaults::default(),
            robot: robot.clone(),
            nodes,
            cycle_ns: (robot.bus.cycle_s * 1e9).round() as u64,
            duration_ns: if live {
                u64::MAX
            } else {
                (scenario.duration_s * 1e9).round() as u64
            },
            start_ns: live.then_some(0),
            over: false,
            record: None,
            outcomes: live.then(|| VecDeque::with_capacity(OUTCOMES)),
        })
    }

    /// Powers a robot up for a person at a console: it is not armed, nothing moves by itself, and it lasts as
    /// long as it is stepped. The record begins with the power; ground, pose and the built-in faults come
    /// from the scenario.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn live(
        boards: Boards,
        scenario: &Scenario,
        robot: &RobotConfig,
        seed: u64,
    ) -> Result<Self, SimError> {
        let still = Scenario {
            events: Vec::new(),
            faults: built_in(scenario),
            ..scenario.clone()
        };
        Self::build(boards, &still, robot, seed, true)
    }

    /// Simulated time since power-up, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.world.now_ns()
    }

    /// Time of the scenario, s: since the robot stood at rest in its start pose. `None` during the start-up.
    #[must_use]
    pub fn scenario_s(&self) -> Option<f64> {
        self.scenario_ns().map(|ns| ns as f64 * 1e-9)
    }

    fn scenario_ns(&self) -> Option<u64> {
        self.start_ns.map(|start_ns| self.now_ns() - start_ns)
    }

    /// Whether the scenario has reached its end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Simulates up to `t_ns` since power-up, or to the end of the scenario if that is earlier.
    ///
    /// # Errors
    /// As [`run`](crate::run).
    pub fn step_to(&mut self, t_ns: u64, recorder: &mut Recorder) -> Result<(), SimError> {
        while !self.over && self.world.next_ns() <= t_ns {
            let happened = self.advance()?;
            self.handle(happened, recorder)?;
        }
        Ok(())
    }

    /// Keeps account of the mechanical energy from now on. The run takes about twice as long; its results are
    /// the same.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the pose of the robot is outside the model's range.
    pub fn account_for_energy(&mut self) -> Result<(), SimError> {
        self.world.account_for_energy()
    }

    /// The account so far; `None` if none is kept.
    ///
    /// # Errors
    /// As [`account_for_energy`](Self::account_for_energy).
    pub fn energy(&self) -> Result<Option<EnergyBalance>, SimError> {
        self.world.energy()
    }

    /// Gives a user command, now. A refusal is an event of the recording, as on the real console.
    pub fn submit(&mut self, command: Command, recorder: &mut Recorder) -> Answer {
        let t_ns = self.scenario_ns().unwrap_or(0);
        self.operator
            .submit(&mut self.world, command, t_ns, recorder)
    }

    /// Takes a request of a client of the master, now. `None`: the master is dead and does not answer.
    /// [`take_outcome`](Self::take_outcome) gives its end.
    pub fn request(
        &mut self,
        request: Request,
        recorder: &mut Recorder,
    ) -> Option<Result<Ticket, Reject>> {
        let t_ns = self.scenario_ns().unwrap_or(0);
        let code = request.command.code();
        let now_us = self.now_ns() / 1_000;
        let answer = self
            .world
            .master_alive()
            .then(|| self.world.master().submit_request(request, now_us));
        record_answer(code, answer, t_ns, recorder);
        answer
    }

    /// The operator in control has seen the robot as it was at `seen_us`.
    pub fn beat(&mut self, seen_us: u64) {
        let now_us = self.now_ns() / 1_000;
        self.world.master().beat(seen_us, now_us);
    }

    /// A client of the master reconnects.
    pub fn open_session(&mut self, client: u8) {
        self.world.master().open_session(client);
    }

    /// The oldest end of a request that nobody has taken yet, or the value of a parameter that came
    /// with it, with its time in µs.
    pub fn take_outcome(&mut self) -> Option<(u64, Event)> {
        self.outcomes.as_mut()?.pop_front()
    }

    /// The master's own record of the last bus cycle, if there was one.
    #[must_use]
    pub fn record(&self) -> Option<&Record> {
        self.record.as_ref()
    }

    /// Whether the master lives.
    #[must_use]
    pub fn master_alive(&self) -> bool {
        self.world.master_alive()
    }

    /// The master, read only.
    #[must_use]
    pub fn master(&self) -> &Master {
        self.world.master_ref()
    }

    /// Begins or ends a fault, now; its own times are ignored.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the fault cannot begin beside those under way, or is to end
    /// and is not under way; nothing has changed then. [`SimError::Remote`] if a board elsewhere
    /// refuses it, or one that restarts.
    pub fn inject(
        &mut self,
        fault: &FaultSpec,
        begin: bool,
        recorder: &mut Recorder,
    ) -> Result<(), SimError> {
        let t_ns = self.scenario_ns().unwrap_or(0);
        if begin {
            let now_ns = self.now_ns();
            self.active.begin(fault, now_ns, &self.robot, &self.nodes)?;
        } else {
            self.active.end(fault)?;
        }
        self.world.inject(fault, begin)?;
        recorder.set_disk_full(!self.world.faults().can_record());
        let act = if begin {
            Act::FaultBegins(*fault)
        } else {
            Act::FaultEnds(*fault)
        };
        recorder.event(t_ns, Cause::Scenario(act));
        Ok(())
    }

    /// The simulated world, for a caller that leads its boards over a line.
    pub(crate) fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// Shows every joint board and its cylinder after a tick.
    pub(crate) fn show(&self, watcher: &mut dyn FnMut(&JointProbe<'_>)) {
        let world = &self.world;
        for ((joint, board), cylinder) in (1..).zip(world.joints()).zip(&world.outputs().cylinders)
        {
            watcher(&JointProbe {
                now_s: world.now_ns() as f64 * 1e-9,
                joint,
                board: board.snapshot(),
                account: board.node.motion_account(),
                cylinder,
            });
        }
    }

    /// Simulates to the next event.
    pub(crate) fn advance(&mut self) -> Result<Happened, SimError> {
        self.world.step()
    }

    /// Lets operator, observer and scenario act on it.
    pub(crate) fn handle(
        &mut self,
        happened: Happened,
        recorder: &mut Recorder,
    ) -> Result<(), SimError> {
        match (happened, self.scenario_ns()) {
            (Happened::JointTick, None) => self.get_ready(recorder),
            (Happened::JointTick, Some(t_ns)) => self.tick(t_ns, recorder),
            (Happened::MasterCycle, _) => {
                self.cycle(recorder);
                Ok(())
            }
            (Happened::Delivery | Happened::WheelSample, _) => Ok(()),
        }
    }

    fn get_ready(&mut self, recorder: &mut Recorder) -> Result<(), SimError> {
        let ready = self.operator.prepare(&mut self.world);
        if !matches!(ready, Ok(false)) {
            // Also of a robot that does not get ready: the record says why.
            self.operator.report_start_up(recorder);
        }
        if ready? {
            self.start_ns = Some(self.now_ns());
            self.operator.begin(&mut self.world)?;
            self.observer.tick(&self.world, 0, recorder);
        }
        Ok(())
    }

    fn tick(&mut self, t_ns: u64, recorder: &mut Recorder) -> Result<(), SimError> {
        self.observer.tick(&self.world, t_ns, recorder);
        if t_ns >= self.duration_ns {
            self.over = true;
            return Ok(());
        }
        for (fault, begin) in self.schedule.due(t_ns) {
            self.inject(&fault, begin, recorder)?;
        }
        for event in self.operator.due(t_ns) {
            self.act(&event.action, t_ns, recorder);
        }
        let outcomes = &mut self.outcomes;
        let mut told = |time_us, event: &Event| {
            if let Some(outcomes) = outcomes {
                keep_outcome(outcomes, time_us, event);
            }
        };
        listen(self.world.master(), t_ns, recorder, &mut told);
        for note in self.world.take_notes() {
            recorder.event(t_ns, note);
        }
        Ok(())
    }

    fn cycle(&mut self, recorder: &mut Recorder) {
        let now_ns = self.now_ns();
        let record = self.world.master().take_telemetry();
        self.record = record.or(self.record);
        let Some(start_ns) = self.start_ns else {
            self.observer.pass(&self.world);
            return;
        };
        let t_ns = now_ns - start_ns;
        self.operator.flood(&mut self.world, t_ns, recorder);
        let times = (start_ns, now_ns);
        self.observer
            .cycle(&self.world, record, times, self.cycle_ns, recorder);
    }

    /// Carries out one event of the scenario.
    fn act(&mut self, action: &EventAction, t_ns: u64, recorder: &mut Recorder) {
        let command = match action {
            EventAction::KillMaster => {
                self.world.kill_master();
                recorder.event(t_ns, Cause::Scenario(Act::KillMaster));
                return;
            }
            EventAction::EStop => {
                recorder.event(t_ns, Cause::Scenario(Act::EStop));
                Command::EmergencyStop
            }
            EventAction::ClearFault => Command::ClearFault,
            EventAction::Command(command) => *command,
        };
        self.submit(command, recorder);
    }

    /// Records why the session ended. If a plant has left its range, also its last sound values, even during
    /// the start-up, which has no other samples.
    pub(crate) fn fail(&mut self, error: &SimError, recorder: &mut Recorder) {
        if matches!(error, SimError::Unphysical { .. }) && self.start_ns.is_none() {
            self.observer.tick(&self.world, 0, recorder);
        }
        let t_ns = self.scenario_ns().unwrap_or(0);
        recorder.event(t_ns, Cause::Failed(error.to_string()));
    }

    /// Ends the session; `stopped`: its driver ended it before the scenario's end.
    pub fn finish(mut self, stopped: bool, recorder: &mut Recorder) -> RunOutcome {
        let now_ns = self.now_ns();
        let link = self.observer.link();
        if link.errors() > 0 {
            let t_ns = self.scenario_ns().unwrap_or(0);
            recorder.event(t_ns, Cause::LineErrors(link));
        }
        RunOutcome {
            recorded_s: self.scenario_s().unwrap_or(0.0),
            simulated_s: now_ns as f64 * 1e-9,
            stopped,
            failure: None,
            pil: self.world.remote().map(|remote| remote.summary(now_ns)),
            line: self.world.audit(),
            link,
            down_times: self.world.take_down_times(),
        }
    }
}
