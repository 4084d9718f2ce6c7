//! A master that leads boards over a line.

use std::collections::VecDeque;

use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::{Reject, Request, Ticket};
use wheeleg_master::event::Event;
use wheeleg_master::telemetry::Record;
use wheeleg_master::{Master, MasterConfig};
use wheeleg_telemetry::Recorder;
use wheeleg_telemetry::event::Cause;

use super::Line;
use crate::clock::NS_PER_US;
use crate::observe::{Observer, UNMEASURED, rim_mm_per_count};
use crate::operator::{listen, record_answer};
use crate::session::keep_outcome;
use crate::{SimError, setup};

/// Time between two looks at the line, ns.
const TICK_NS: u64 = 1_000_000;

/// Fields of telemetry that no board reports, by the schema of their channel.
#[must_use]
pub fn unmeasured() -> &'static [(&'static str, &'static [&'static str])] {
    &UNMEASURED
}

/// The same master as in a [`Session`](crate::Session), with boards that it knows only by their replies: no
/// plant, no injection of faults.
pub struct LineMaster<L> {
    master: Master,
    line: L,
    observer: Observer,
    record: Option<Record>,
    outcomes: VecDeque<(u64, Event)>,
    counts_to_mm: f64,
    cycle_ns: u64,
    now_ns: u64,
    next_ns: u64,
    next_cycle_ns: u64,
    was_broken: bool,
}

impl<L: Line> LineMaster<L> {
    /// A master that has heard no board. Gait and wheels are those of the robot, the side that
    /// steps and the behaviours those of the scenario. `first_sequence` differs from start to
    /// start, so that no board takes a request for the repetition of an old one.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the master refuses the robot's gait.
    pub fn new(
        scenario: &Scenario,
        robot: &RobotConfig,
        first_sequence: u16,
        line: L,
    ) -> Result<Self, SimError> {
        let config = MasterConfig {
            wheel_sample_us: setup::wheel_sample_us(robot)?,
            first_sequence,
            ..setup::master(scenario, robot)
        };
        let refused = |e: &dyn std::fmt::Display| {
            SimError::simulation(
                format!("the master refuses its parameters: {e}"),
                format!("correct the gait of the robot `{}`", robot.name),
            )
        };
        let master = Master::new(config).map_err(|e| refused(&e))?;
        Ok(Self {
            master,
            line,
            observer: Observer::default(),
            record: None,
            outcomes: VecDeque::new(),
            counts_to_mm: rim_mm_per_count(&robot.plant, 0),
            cycle_ns: (robot.bus.cycle_s * 1e9).round() as u64,
            now_ns: 0,
            next_ns: 0,
            next_cycle_ns: 0,
            was_broken: false,
        })
    }

    /// Newest time of the line's clock, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The master, read only.
    #[must_use]
    pub fn master(&self) -> &Master {
        &self.master
    }

    /// The master's own record of the last bus cycle, if there was one.
    #[must_use]
    pub fn record(&self) -> Option<&Record> {
        self.record.as_ref()
    }

    /// The line.
    pub fn line(&mut self) -> &mut L {
        &mut self.line
    }

    /// Takes a request of a client of the master, now. [`take_outcome`](Self::take_outcome) gives its end.
    ///
    /// # Errors
    /// [`Reject`]: refused at the door.
    pub fn request(&mut self, request: Request, recorder: &mut Recorder) -> Result<Ticket, Reject> {
        let code = request.command.code();
        let answer = self.master.submit_request(request, self.now_ns / NS_PER_US);
        record_answer(code, Some(answer), self.now_ns, recorder);
        answer
    }

    /// The operator in control has seen the robot as it was at `seen_us`.
    pub fn beat(&mut self, seen_us: u64) {
        self.master.beat(seen_us, self.now_ns / NS_PER_US);
    }

    /// The oldest end of a request that nobody has taken yet, with its time in µs.
    pub fn take_outcome(&mut self) -> Option<(u64, Event)> {
        self.outcomes.pop_front()
    }

    /// Leads the boards until the line's clock shows `t_ns`.
    pub fn step_to(&mut self, t_ns: u64, recorder: &mut Recorder) {
        while self.next_ns <= t_ns {
            self.listen_until(self.next_ns);
            self.watch_line(recorder);
            if self.now_ns >= self.next_cycle_ns {
                self.cycle(recorder);
                // A missed cycle is not made up for.
                let missed = (self.now_ns - self.next_cycle_ns) / self.cycle_ns;
                self.next_cycle_ns += (missed + 1) * self.cycle_ns;
            }
            if let Some(bytes) = self.master.next_acyclic(self.now_ns / NS_PER_US) {
                self.line.send(&bytes);
            }
            self.tell(recorder);
            self.next_ns += TICK_NS;
        }
    }

    fn listen_until(&mut self, t_ns: u64) {
        let master = &mut self.master;
        let mut heard = |bytes: &[u8], at_ns: u64| master.on_bus_bytes(bytes, at_ns / NS_PER_US);
        self.now_ns = self.line.wait(t_ns, &mut heard);
    }

    /// Reports a broken line, which leaves the axes disarmed when it is back.
    fn watch_line(&mut self, recorder: &mut Recorder) {
        let broken = self.line.broken();
        if broken.is_some() == self.was_broken {
            return;
        }
        self.was_broken = broken.is_some();
        let cause = match broken {
            Some(why) => Cause::LineBroken(why.to_owned()),
            None => Cause::LineMended,
        };
        recorder.event(self.now_ns, cause);
        if !self.was_broken {
            // Only the full queue of a master that is already busy with a stop refuses it.
            let _ = self.master.submit(Command::Disarm, self.now_ns / NS_PER_US);
        }
    }

    fn cycle(&mut self, recorder: &mut Recorder) {
        let sync = self.master.cycle(self.now_ns / NS_PER_US);
        self.line.send(&sync);
        if let Some(record) = self.master.take_telemetry() {
            self.observer.heard(&record, self.counts_to_mm, recorder);
            self.record = Some(record);
        }
    }

    fn tell(&mut self, recorder: &mut Recorder) {
        let outcomes = &mut self.outcomes;
        let mut told = |time_us, event: &Event| keep_outcome(outcomes, time_us, event);
        listen(&mut self.master, self.now_ns, recorder, &mut told);
    }
}
