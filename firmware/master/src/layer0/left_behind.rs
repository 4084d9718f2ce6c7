//! Boards that stay armed while no other board is: the master has restarted without their noticing,
//! or a request to disarm was lost. They are reported, and requested to disarm.

use wheeleg_protocol::{Address, Disarm, Message};

use super::Layer0;
use super::acyclic::{Job, Purpose};
use super::nodes::is_armed;
use crate::event::{Event, Events};
use crate::finding::Finding;
use crate::setpoint::NODES;

/// Cycles for which a board may show that it is armed: its replies until it has received the request to disarm,
/// including one repetition.
const PATIENCE: u8 = 5;
/// Cycles until it is asked again.
const AGAIN: u8 = 100;

/// Number of cycles for which each board has been armed although none should be.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LeftBehind([u8; NODES]);

/// Action for a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Measure {
    /// It is reported, and asked to disarm.
    Name,
    /// It is asked again.
    Ask,
}

impl LeftBehind {
    /// Takes whether the newest reply of node index 0..8 shows that it is armed; a missing reply shows nothing.
    fn shows(&mut self, index: usize, armed: Option<bool>) -> Option<Measure> {
        let cycles = self.0.get_mut(index)?;
        if !armed? {
            *cycles = 0;
            return None;
        }
        *cycles = cycles.saturating_add(1);
        match *cycles {
            PATIENCE => Some(Measure::Name),
            AGAIN => {
                // It is reported only once.
                *cycles = PATIENCE;
                Some(Measure::Ask)
            }
            _ => None,
        }
    }
}

impl Layer0 {
    /// A cycle in which no board should be armed.
    pub(super) fn disarm_left_behind(&mut self, now_us: u64, events: &mut Events) {
        let disarms = |job: &Job| matches!(job.message, Message::Disarm(_));
        let under_way = self.in_flight.as_ref().is_some_and(disarms);
        if self.group.is_some() || under_way || self.jobs.iter().any(disarms) {
            // They are already being asked.
            return;
        }
        for to in Address::nodes() {
            let index = to.slot().unwrap_or(NODES);
            let reply = self.nodes.get(index).and_then(|node| node.reply);
            let armed = reply.map(|reply| is_armed(reply.mode));
            let measure = self.left_behind.shows(index, armed);
            if measure == Some(Measure::Name) {
                let (node, finding) = (Some(to.raw()), Finding::LeftArmed);
                events.push(now_us, Event::Found { node, finding });
            }
            if measure.is_some() {
                // If the queue is full, it is asked next time.
                let _fits = self
                    .jobs
                    .push(Job::new(to, Disarm {}.into(), Purpose::Stop));
            }
        }
    }
}
