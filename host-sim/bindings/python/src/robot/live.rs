//! A robot as its thread has it.

use std::cell::RefCell;
use std::rc::Rc;

use serde::{Deserialize, Serialize};
use wheeleg_config::{RobotConfig, Scenario, command};
use wheeleg_master::command::Command;
use wheeleg_sim::{Boards, Session, SimError, provenance};
use wheeleg_telemetry::event::Answer;
use wheeleg_telemetry::messages::reject;
use wheeleg_telemetry::{Keep, Recorder};

use super::seen::{Happened, Seen, SeenSink, Sight};

const MS: u64 = 1_000_000;

/// A command given.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Given {
    /// Time since the scenario began, ms.
    at_ms: u64,
    /// As in a scenario.
    command: String,
}

/// Data of a saved state.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Saved {
    /// Time since the scenario began, ms.
    at_ms: u64,
    given: Vec<Given>,
    /// Of the log until then.
    hash: String,
}

/// Session, record and the commands given.
pub(super) struct Live {
    session: Session,
    recorder: Recorder<'static>,
    seen: Rc<RefCell<Seen>>,
    /// When the scenario began, since power-up, ms.
    start_ms: u64,
    now_ms: u64,
    given: Vec<Given>,
}

impl Live {
    /// A robot in its start pose.
    ///
    /// # Errors
    /// [`SimError`] if it cannot be built or does not get ready.
    pub(super) fn new(
        scenario: &Scenario,
        robot: &RobotConfig,
        seed: u64,
    ) -> Result<Self, SimError> {
        let mut session = Session::new(Boards::default(), scenario, robot, seed)?;
        let seen = Rc::<RefCell<Seen>>::default();
        let mut recorder = Recorder::new(Keep::nothing()).with(SeenSink(Rc::clone(&seen)));
        provenance(&mut recorder, scenario, robot, seed);
        // It begins in a tick, and ticks are on whole ms.
        let mut now_ms = 0;
        while session.scenario_s().is_none() {
            now_ms += 1;
            session.step_to(now_ms * MS, &mut recorder)?;
        }
        Ok(Self {
            session,
            recorder,
            seen,
            start_ms: now_ms,
            now_ms,
            given: Vec::new(),
        })
    }

    /// Simulates, and returns the observable values at every `every_ms`.
    ///
    /// # Errors
    /// [`SimError`] if the plant leaves its range.
    pub(super) fn run(&mut self, ms: u64, every_ms: u64) -> Result<Vec<Sight>, SimError> {
        let end_ms = self.now_ms + ms;
        let mut sights = Vec::new();
        while self.now_ms < end_ms && !self.session.is_over() {
            self.now_ms = end_ms.min(self.now_ms + every_ms);
            self.session.step_to(self.now_ms * MS, &mut self.recorder)?;
            sights.push(self.sight());
        }
        Ok(sights)
    }

    /// The current observable values.
    pub(super) fn sight(&self) -> Sight {
        self.seen.borrow().sight(self.time_s())
    }

    /// Time of the scenario, s.
    pub(super) fn time_s(&self) -> f64 {
        self.session.scenario_s().unwrap_or(0.0)
    }

    pub(super) fn is_over(&self) -> bool {
        self.session.is_over()
    }

    /// Gives a command; `text` is the same as text.
    ///
    /// # Errors
    /// The master's refusal.
    pub(super) fn command(&mut self, text: String, command: Command) -> Result<(), String> {
        let at_ms = self.now_ms - self.start_ms;
        self.given.push(Given {
            at_ms,
            command: text,
        });
        let name = command.code().name();
        match self.session.submit(command, &mut self.recorder) {
            Answer::Accepted => Ok(()),
            Answer::Rejected(why) => Err(format!("the master refuses {name}: {}", reject(&why))),
            Answer::Nothing => Err(format!("the master is dead and does not hear {name}")),
        }
    }

    /// Events since the last call.
    pub(super) fn take_events(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.seen.borrow_mut().events)
    }

    /// Of the log until now.
    pub(super) fn hash(&self) -> String {
        self.recorder.hash()
    }

    /// Data of this state.
    pub(super) fn saved(&self) -> Saved {
        Saved {
            at_ms: self.now_ms - self.start_ms,
            given: self.given.clone(),
            hash: self.hash(),
        }
    }

    /// From the start pose to a state.
    ///
    /// # Errors
    /// Why it is not reached.
    pub(super) fn repeat(&mut self, saved: &Saved) -> Result<(), String> {
        for given in &saved.given {
            self.go_to(given.at_ms)?;
            let read = command(&given.command).map_err(|e| e.to_string())?;
            // One that was refused then is refused again.
            let _ = self.command(given.command.clone(), read);
        }
        self.go_to(saved.at_ms)?;
        if self.hash() == saved.hash {
            Ok(())
        } else {
            Err("this state is of another scenario, robot, seed or program".to_owned())
        }
    }

    fn go_to(&mut self, at_ms: u64) -> Result<(), String> {
        let now_ms = self.now_ms - self.start_ms;
        let ms = at_ms.saturating_sub(now_ms);
        self.run(ms, ms.max(1)).map(drop).map_err(|e| e.to_string())
    }
}
