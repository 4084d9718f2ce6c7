//! The loop of the robot's thread.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::config::OPERATOR_TIMEOUT_US;
use wheeleg_master::dispatcher::Request;
use wheeleg_master::event::Event;
use wheeleg_master::layer0::operator::{OPERATOR_CLIENT, STOP_CLIENT};
use wheeleg_protocol::FaultBits;
use wheeleg_sim::{SimError, provenance};
use wheeleg_telemetry::{Keep, Recorder, ServerSample};

use super::machine::{Machine, only_simulated};
use super::pace::{Lateness, Pace};
use super::priority;
use super::sink::RingSink;
use super::{
    Answer, BoardStatus, INPUTS, Input, Live, Moving, Port, REPORTS, Report, SAMPLES, Signals,
    Status,
};
use crate::foxglove::ContactSink;
use crate::record::{Feed, FeedSink, Given};
use wheeleg_access::host::SPEED_OF_CONTROL;
use wheeleg_access::request::{HostCommand, Spoken};

/// How often both rings are read, ns of simulated time.
const TICK_NS: u64 = 1_000_000;
/// How often a recording gets the hash of everything so far, ns of simulated time.
const HASH_NS: u64 = 1_000_000_000;
/// Stack of the thread: it must hold a world while it is built.
const STACK: usize = 16 << 20;
/// A robot that stands still this long without being paused was out of sight: the master's own timeout.
const BLIND: Duration = Duration::from_micros(OPERATOR_TIMEOUT_US as u64);
/// Longest sleep, so that a stop is heard however slow the clock runs.
const NAP: Duration = Duration::from_millis(5);

/// Time of a clock that runs while the computer is suspended, where the system has one.
fn awake() -> Duration {
    #[cfg(target_os = "linux")]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
        Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
    }
    #[cfg(not(target_os = "linux"))]
    {
        static BEGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        BEGIN.get_or_init(Instant::now).elapsed()
    }
}

/// The hub's side of a robot that lives in its own thread.
pub(crate) struct Robot {
    /// Commands to it.
    pub(crate) inputs: rtrb::Producer<Input>,
    /// Its reports.
    pub(crate) reports: rtrb::Consumer<Report>,
    /// Its samples.
    pub(crate) samples: rtrb::Consumer<Moving>,
    /// Signals beside the rings.
    pub(crate) signals: Arc<Signals>,
    /// The thread.
    pub(crate) thread: JoinHandle<()>,
    /// It runs before ordinary threads.
    pub(crate) goes_first: bool,
}

/// Powers a robot up in a thread of its own. Its inputs and samples also go to `feed`.
///
/// # Errors
/// [`SimError`] if it cannot be built.
pub(crate) fn start(live: Live, feed: Feed, contacts: ContactSink) -> Result<Robot, SimError> {
    let (inputs, from_hub) = rtrb::RingBuffer::new(INPUTS);
    let (to_hub, reports) = rtrb::RingBuffer::new(REPORTS);
    let (to_samples, samples) = rtrb::RingBuffer::new(SAMPLES);
    let signals = Arc::new(Signals::default());
    let (built, is_built) = std::sync::mpsc::sync_channel(1);
    let beside = Arc::clone(&signals);
    let run = move || {
        let Live {
            scenario, robot, ..
        } = &live;
        let machine = match Machine::new(scenario, robot, live.port.as_ref()) {
            Ok(machine) => machine,
            Err(why) => {
                let _ = built.send(Err(why));
                return;
            }
        };
        // A clock that runs as fast as possible would leave nothing to others.
        let goes_first = live.speed.is_some() && priority::ask();
        let _ = built.send(Ok(goes_first));
        let cycle = Duration::from_secs_f64(robot.bus.cycle_s);
        let pace = Pace::new(cycle, live.speed, live.paused, Instant::now());
        let feed = Rc::new(RefCell::new(feed));
        let mut recorder = Recorder::new(Keep::nothing())
            .with(RingSink::new(to_samples, Arc::clone(&beside)))
            .with(FeedSink(Rc::clone(&feed)))
            .with(contacts);
        provenance(&mut recorder, scenario, robot, scenario.seed);
        Loop {
            machine,
            recorder,
            feed,
            pace,
            inputs: from_hub,
            reports: to_hub,
            signals: beside,
            port: live.port.clone(),
            cycle_ns: cycle.as_nanos() as u64,
            target_ns: 0,
            steps: 0,
            stops_heard: 0,
            stops: 0,
            seen_us: 0,
            listened: awake(),
            deaf: false,
            failed: false,
        }
        .run();
    };
    let thread = thread::Builder::new()
        .name("robot".to_owned())
        .stack_size(STACK)
        .spawn(run)
        .map_err(|e| {
            SimError::simulation(
                format!("the robot's thread cannot be started: {e}"),
                "end other programs, then try again",
            )
        })?;
    let goes_first = is_built.recv().unwrap_or_else(|_| {
        Err(SimError::simulation(
            "the robot's thread ended before it began",
            "please report this",
        ))
    })?;
    Ok(Robot {
        inputs,
        reports,
        samples,
        signals,
        thread,
        goes_first,
    })
}

struct Loop {
    machine: Machine,
    recorder: Recorder<'static>,
    feed: Rc<RefCell<Feed>>,
    pace: Pace,
    inputs: rtrb::Consumer<Input>,
    reports: rtrb::Producer<Report>,
    signals: Arc<Signals>,
    /// The port of real boards.
    port: Option<Port>,
    cycle_ns: u64,
    /// Simulated time reached.
    target_ns: u64,
    /// Cycles still to be simulated although the clock is paused.
    steps: u32,
    /// Requested stops that were heard.
    stops_heard: u64,
    /// Stops that the master has accepted.
    stops: u64,
    /// Newest beat passed to the master.
    seen_us: u64,
    /// When it listened last.
    listened: Duration,
    /// The computer was suspended under the operator, who is no longer heard: the master ends the lease, and
    /// all axes hold.
    deaf: bool,
    /// The simulation cannot continue.
    failed: bool,
}

impl Loop {
    fn run(mut self) {
        while !self.signals.end.load(Ordering::SeqCst) {
            self.listen();
            let now = Instant::now();
            let stands = self.failed || (self.pace.status().paused && self.steps == 0);
            if stands {
                self.pace.rebase(now);
                self.report_status();
                thread::sleep(NAP);
                continue;
            }
            let wait = self.pace.wait(now);
            if !wait.is_zero() {
                thread::sleep(wait.min(NAP));
                continue;
            }
            if let Some(lateness) = self.pace.begin(now) {
                self.tell_pace(&lateness);
            }
            self.steps = self.steps.saturating_sub(1);
            self.cycle();
        }
        let hash = self.recorder.hash();
        self.feed.borrow_mut().close(self.recorded_us(), &hash);
    }

    /// Time up to which the recording is complete, µs.
    fn recorded_us(&self) -> u64 {
        self.target_ns / 1_000
    }

    /// Reports the pace of the last second.
    fn tell_pace(&mut self, lateness: &Lateness) {
        let pace = self.pace.status();
        let count = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        let sample = ServerSample {
            late_p50_ms: lateness.p50_ms,
            late_p99_ms: lateness.p99_ms,
            late_max_ms: lateness.max_ms,
            factor: pace.factor,
            late: pace.late,
            shifts: pace.shifts,
            clients: count(self.signals.clients.load(Ordering::Relaxed) as u64),
            dropped: count(self.signals.dropped()),
        };
        self.recorder.server(self.target_ns, &sample);
    }

    /// Records an input of the robot, now.
    fn given(&mut self, given: Given) {
        let ms = self.target_ns / TICK_NS;
        if let Some(sample) = given.sample(&self.pace.status()) {
            self.recorder.session(self.target_ns, &sample);
        }
        self.feed.borrow_mut().given(ms, given);
    }

    fn given_pace(&mut self) {
        let pace = self.pace.status();
        self.given(Given::Pace {
            speed: pace.speed,
            paused: pace.paused,
        });
    }

    /// Simulates a bus cycle, listening at every tick.
    fn cycle(&mut self) {
        let end_ns = self.target_ns + self.cycle_ns;
        while self.target_ns < end_ns {
            self.listen();
            self.target_ns += TICK_NS;
            if let Err(why) = self.machine.step_to(self.target_ns, &mut self.recorder) {
                self.failed = true;
                let _ = self.reports.push(Report::Failed(Box::new(why)));
                break;
            }
            self.tell_outcomes();
        }
        let recorded = self.feed.borrow_mut().is_running();
        if recorded && self.target_ns.is_multiple_of(HASH_NS) {
            self.given(Given::Hash(self.recorder.hash()));
        }
        self.report_status();
    }

    fn listen(&mut self) {
        self.hear_stop();
        let now = awake();
        let stood = now.saturating_sub(self.listened) > BLIND;
        self.listened = now;
        self.deaf = (self.deaf || stood) && self.is_held();
        let seen_us = self.signals.seen_us.load(Ordering::Acquire);
        if seen_us != self.seen_us && !self.deaf {
            self.seen_us = seen_us;
            self.machine.beat(seen_us);
            self.given(Given::Beat(seen_us));
        }
        for _ in 0..INPUTS {
            let Ok(input) = self.inputs.pop() else {
                break;
            };
            let (id, answer) = match input {
                Input::Request {
                    id,
                    seen_us,
                    valid_us,
                    command,
                    spoken,
                    by,
                } => {
                    let deadline_us = seen_us.saturating_add(valid_us);
                    let request = Request {
                        client: OPERATOR_CLIENT,
                        id,
                        deadline_us,
                        command,
                    };
                    (id, self.request(request, seen_us, spoken, by))
                }
                Input::Host { id, command } => (id, self.host(id, command)),
                Input::Revoked { id, holder, by } => {
                    self.given(Given::Revoked { holder, by });
                    (id, Answer::Done)
                }
            };
            self.answer(id, answer);
        }
    }

    /// Somebody is in control.
    fn is_held(&self) -> bool {
        self.machine.master().layer0().lease().is_held()
    }

    /// Passes on a requested stop, without waiting for a ring or for the clock.
    fn hear_stop(&mut self) {
        let asked = self.signals.stops.load(Ordering::SeqCst);
        if asked == self.stops_heard || self.failed {
            return;
        }
        self.stops_heard = asked;
        let stop = Request {
            client: STOP_CLIENT,
            id: asked as u32,
            deadline_us: u64::MAX,
            command: Command::EmergencyStop,
        };
        self.given(Given::Stop(stop.id));
        // A dead master accepts none.
        if let Some(Ok(_)) = self.machine.request(stop, &mut self.recorder) {
            self.stops = asked;
        }
    }

    fn now_us(&self) -> u64 {
        self.machine.now_ns() / 1_000
    }

    fn request(
        &mut self,
        request: Request,
        seen_us: u64,
        spoken: Spoken,
        by: Option<String>,
    ) -> Answer {
        let now_us = self.now_us();
        let pace = self.pace.status();
        if self.failed {
            return Answer::NoMaster;
        }
        if pace.paused {
            return Answer::Paused;
        }
        if seen_us > now_us {
            return Answer::SeenInFuture;
        }
        if self.deaf {
            return Answer::Suspended;
        }
        let too_fast = pace.speed.is_none_or(|speed| speed > SPEED_OF_CONTROL);
        if too_fast && request.command.code() == CommandCode::TakeControl {
            return Answer::TooFast;
        }
        // Checked each time: an adapter that is plugged in again has its old setting.
        if request.command.code() == CommandCode::Arm
            && let Some(slow) = self.port.as_ref().and_then(Port::slow_adapter)
        {
            return Answer::SlowAdapter(Box::new(slow));
        }
        self.given(Given::Command {
            id: request.id,
            deadline_us: request.deadline_us,
            spoken,
            by,
        });
        match self.machine.request(request, &mut self.recorder) {
            Some(Ok(_)) => Answer::Accepted,
            Some(Err(why)) => Answer::Rejected(why),
            None => Answer::NoMaster,
        }
    }

    fn host(&mut self, id: u32, command: HostCommand) -> Answer {
        let now = Instant::now();
        let paces = matches!(
            command,
            HostCommand::Pause | HostCommand::Step(_) | HostCommand::Speed(_)
        );
        if paces && !self.machine.is_simulated() {
            return Answer::Simulation(Box::new(only_simulated("the clock can be set for")));
        }
        match command {
            HostCommand::Pause => {
                self.steps = 0;
                self.pace.pause(true, now);
            }
            HostCommand::Resume => self.pace.pause(false, now),
            HostCommand::Step(_) if !self.pace.status().paused => {
                return Answer::Simulation(Box::new(SimError::simulation(
                    "the simulation is not paused: it steps by itself",
                    "pause it first: `wheeleg ctl pause`",
                )));
            }
            HostCommand::Step(cycles) => self.steps = cycles,
            HostCommand::Speed(speed) => {
                if self.is_held() && speed > SPEED_OF_CONTROL {
                    return Answer::TooFast;
                }
                self.pace.set_speed(Some(speed), now);
            }
            HostCommand::Inject(_) | HostCommand::EndFault(_) if self.failed => {
                return Answer::NoMaster;
            }
            HostCommand::Inject(fault) => return self.inject(&fault, true),
            HostCommand::EndFault(fault) => return self.inject(&fault, false),
            HostCommand::RecordStart => {
                let begun = self.feed.borrow_mut().begin(id, self.recorded_us());
                return recorded(begun);
            }
            HostCommand::RecordStop => {
                let hash = self.recorder.hash();
                let ended = self
                    .feed
                    .borrow_mut()
                    .end(Some(id), self.recorded_us(), hash);
                return recorded(ended);
            }
        }
        self.given_pace();
        Answer::Done
    }

    fn inject(&mut self, fault: &wheeleg_config::faults::FaultSpec, begin: bool) -> Answer {
        match self.machine.inject(fault, begin, &mut self.recorder) {
            Ok(()) => {
                self.given(Given::Fault(*fault, begin));
                Answer::Done
            }
            Err(why) => Answer::Simulation(Box::new(why)),
        }
    }

    fn answer(&mut self, id: u32, answer: Answer) {
        let time_us = self.now_us();
        // If the hub does not listen, the answer is lost; the robot continues.
        let _ = self.reports.push(Report::Answer {
            id,
            time_us,
            answer,
        });
    }

    fn tell_outcomes(&mut self) {
        while let Some((time_us, event)) = self.machine.take_outcome() {
            let (ticket, answer) = match event {
                Event::Done(ticket) => (ticket, Answer::Done),
                Event::Refused { ticket, reason } => (ticket, Answer::Refused(ticket.code, reason)),
                Event::Parameter { node, id, raw } => {
                    let board = node;
                    let _ = self.reports.push(Report::Parameter { board, id, raw });
                    continue;
                }
                _ => continue,
            };
            if ticket.client == OPERATOR_CLIENT {
                let _ = self.reports.push(Report::Answer {
                    id: ticket.id,
                    time_us,
                    answer,
                });
            }
        }
    }

    fn report_status(&mut self) {
        // Answers take precedence if the hub does not keep up.
        if self.reports.slots() < REPORTS / 2 {
            return;
        }
        let _ = self.reports.push(Report::Status(self.status()));
    }

    fn status(&self) -> Status {
        let master = self.machine.master();
        let record = self.machine.record();
        let mut boards = [BoardStatus {
            mode: None,
            faults: FaultBits::NONE,
        }; 8];
        for (board, reply) in boards.iter_mut().zip(record.iter().flat_map(|r| r.replies)) {
            if let Some(reply) = reply {
                board.mode = Some(reply.mode);
                board.faults = reply.active_faults;
            }
        }
        Status {
            now_us: self.now_us(),
            simulated: self.machine.is_simulated(),
            alive: !self.failed && self.machine.master_alive(),
            ready: master.is_ready(),
            armed: master.is_armed(),
            hold: master.layer0().hold(),
            emergency_stop: record.is_some_and(|r| r.emergency_stop),
            phase: master.layer0().phase(),
            step: record.map_or(0, |r| r.step),
            lease_seen_us: master.layer0().lease().seen_us(),
            boards,
            pace: self.pace.status(),
            stops: self.stops,
        }
    }
}

/// The recorder answers once its files are there.
fn recorded(asked: Result<(), &str>) -> Answer {
    match asked {
        Ok(()) => Answer::Accepted,
        Err(why) => Answer::NotRecorded(why.to_owned()),
    }
}
