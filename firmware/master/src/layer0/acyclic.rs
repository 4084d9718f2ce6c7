//! Acyclic requests: what to request from which node, and for whom.

use heapless::Deque;
use wheeleg_protocol::{Address, Message};

use crate::dispatcher::Ticket;

/// Number of requests that can wait. Arming needs [`ARMING_JOBS`], a stop 8, a clear 16.
pub const JOBS: usize = 32;

/// Number of requests for arming: one to each joint, four to each wheel.
pub const ARMING_JOBS: usize = 14;
/// Number of requests that change the profile of both wheels.
pub const PROFILE_JOBS: usize = 4;

/// Why a request is made; decides what its answer means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Enumeration.
    Identify,
    /// A question that the master itself asks ([`super::questions`]).
    Report,
    /// Checks whether a board that stored its parameters is still the one that was asked to.
    Saved(
        /// Whom to answer.
        Ticket,
    ),
    /// Part of arming, disarming or clearing all nodes.
    Group,
    /// Part of a HOLD of all axes; nobody waits for it.
    Stop,
    /// New speed and acceleration of a wheel's profile; nobody waits for it.
    Profile,
    /// A user command to one node.
    User(
        /// Whom to answer.
        Ticket,
    ),
}

impl Purpose {
    /// Whom to answer, if it is a user.
    #[must_use]
    pub const fn ticket(self) -> Option<Ticket> {
        match self {
            Self::User(ticket) | Self::Saved(ticket) => Some(ticket),
            _ => None,
        }
    }
}

/// A request that waits or is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Node that is asked.
    pub to: Address,
    /// Request.
    pub message: Message,
    /// Why, and for whom, it is made.
    pub purpose: Purpose,
    /// Latest time at which it may leave the queue, µs. Requests wait while a silent board is asked again, and a
    /// command that moves an axis must not arrive long after it was wanted.
    pub until_us: u64,
}

impl Job {
    /// A request without a time limit.
    #[must_use]
    pub const fn new(to: Address, message: Message, purpose: Purpose) -> Self {
        Self {
            to,
            message,
            purpose,
            until_us: u64::MAX,
        }
    }
}

/// Waiting requests, in order; stops overtake everything else.
#[derive(Debug, Default)]
pub struct Jobs {
    queue: Deque<Job, JOBS>,
}

impl Jobs {
    /// None waiting.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            queue: Deque::new(),
        }
    }

    /// Whether `count` more requests fit.
    #[must_use]
    pub fn has_room(&self, count: usize) -> bool {
        self.queue.len().saturating_add(count) <= self.queue.capacity()
    }

    /// Adds a request. Returns `false` if the queue is full; then nothing has changed.
    pub fn push(&mut self, job: Job) -> bool {
        self.queue.push_back(job).is_ok()
    }

    /// Takes the next request.
    pub fn pop(&mut self) -> Option<Job> {
        self.queue.pop_front()
    }

    /// The requests that wait, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Job> {
        self.queue.iter()
    }

    /// Drops the waiting requests that are `unwanted`, and calls `dropped` for the ticket of
    /// each user command among them.
    pub fn drop_where(&mut self, unwanted: impl Fn(&Job) -> bool, mut dropped: impl FnMut(Ticket)) {
        for _ in 0..self.queue.len() {
            let Some(job) = self.queue.pop_front() else {
                return;
            };
            if !unwanted(&job) {
                // There is room: the job has just been removed.
                let _fits = self.push(job);
            } else if let Some(ticket) = job.purpose.ticket() {
                dropped(ticket);
            }
        }
    }

    /// Drops all waiting requests, and calls `dropped` for the ticket of each
    /// user command among them.
    pub fn clear(&mut self, dropped: impl FnMut(Ticket)) {
        self.drop_where(|_| true, dropped);
    }

    /// Sends every node the same request, with nobody waiting for the answers: first to those that are `alive`, because
    /// a silent node would delay the others through its retries.
    pub fn ask_all(&mut self, message: Message, alive: impl Fn(usize) -> bool) {
        for wanted in [true, false] {
            for to in Address::nodes() {
                if to.slot().is_some_and(|index| alive(index) == wanted) {
                    // Eight requests fit the queue, which the caller has cleared.
                    let _fits = self.push(Job::new(to, message, Purpose::Stop));
                }
            }
        }
    }
}
