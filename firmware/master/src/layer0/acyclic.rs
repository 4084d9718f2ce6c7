//! Acyclic requests: what is to be asked of which node, and on whose behalf.

use heapless::Deque;
use wheeleg_protocol::{Address, Message};

use crate::dispatcher::Ticket;

/// Requests that can wait. Arming needs 14, a stop 8.
pub const JOBS: usize = 32;

/// Why a request is made; decides what its answer means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Enumeration.
    Identify,
    /// Part of arming, disarming or clearing all nodes.
    Group,
    /// Part of a HOLD of all axes; nobody waits for it.
    Stop,
    /// A user command to one node.
    User(
        /// Whom to answer.
        Ticket,
    ),
}

/// A request that waits or is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Node asked.
    pub to: Address,
    /// Request.
    pub message: Message,
    /// On whose behalf.
    pub purpose: Purpose,
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

    /// Adds a request. `false` if the queue is full; then nothing changed.
    pub fn push(&mut self, job: Job) -> bool {
        self.queue.push_back(job).is_ok()
    }

    /// Free places.
    #[must_use]
    pub fn free(&self) -> usize {
        JOBS.saturating_sub(self.queue.len())
    }

    /// Takes the next request.
    pub fn pop(&mut self) -> Option<Job> {
        self.queue.pop_front()
    }

    /// Whether none waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// Replaces all waiting requests by the stop of every node, and calls
    /// `dropped` for the ticket of each user command that was waiting.
    pub fn stop_all(&mut self, message: Message, mut dropped: impl FnMut(Ticket)) {
        while let Some(job) = self.queue.pop_front() {
            if let Purpose::User(ticket) = job.purpose {
                dropped(ticket);
            }
        }
        for to in Address::nodes() {
            // Eight of them fit the queue just emptied.
            let _fits = self.push(Job {
                to,
                message,
                purpose: Purpose::Stop,
            });
        }
    }
}
