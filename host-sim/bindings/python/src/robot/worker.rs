//! The thread of a robot: its world stays on one thread, with the stack that it needs.

use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread;

use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_sim::SimError;

use super::live::Live;

/// Stack of the thread: a world is built on it in one piece.
const STACK: usize = 16 << 20;

type Job = Box<dyn FnOnce(&mut Live) + Send>;

/// A robot on its thread, which ends with this.
pub(super) struct Worker(Mutex<Sender<Job>>);

impl Worker {
    /// Powers a robot up, and waits until it stands in its start pose.
    ///
    /// # Errors
    /// [`SimError`] if it cannot be built or does not get ready.
    pub(super) fn start(
        scenario: &Scenario,
        robot: &RobotConfig,
        seed: u64,
    ) -> Result<Self, SimError> {
        let ended = |why: String| SimError::simulation(why, "end other programs, then try again");
        let (scenario, robot) = (scenario.clone(), robot.clone());
        let (jobs, to_do) = channel::<Job>();
        let (built, is_built) = sync_channel(1);
        let run = move || match Live::new(&scenario, &robot, seed) {
            Ok(live) => {
                let _ = built.send(Ok(()));
                work(live, &to_do);
            }
            Err(why) => {
                let _ = built.send(Err(why));
            }
        };
        thread::Builder::new()
            .name("robot".to_owned())
            .stack_size(STACK)
            .spawn(run)
            .map_err(|e| ended(format!("the robot's thread cannot be started: {e}")))?;
        let built = is_built.recv();
        built.unwrap_or_else(|_| Err(ended("the robot's thread ended as it began".to_owned())))?;
        Ok(Self(Mutex::new(jobs)))
    }

    /// Runs a job on the thread and waits for its result; `None` if the thread has ended.
    pub(super) fn ask<R: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Live) -> R + Send + 'static,
    ) -> Option<R> {
        let (answer, answered) = sync_channel(1);
        let job: Job = Box::new(move |live| {
            let _ = answer.send(act(live));
        });
        let sent = self.jobs().send(job);
        sent.ok()?;
        answered.recv().ok()
    }

    /// Takes the place of this one's robot.
    pub(super) fn take_over(&self, other: Self) {
        *self.jobs() = other.0.into_inner().unwrap_or_else(PoisonError::into_inner);
    }

    fn jobs(&self) -> std::sync::MutexGuard<'_, Sender<Job>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Works until nobody can ask any more.
fn work(mut live: Live, to_do: &Receiver<Job>) {
    while let Ok(job) = to_do.recv() {
        job(&mut live);
    }
}
