//! Reports of the master to its user: a bounded queue of events.

use heapless::Deque;
use wheeleg_protocol::{FaultRecord, LinkRecord, LogEntry, Warning};
use wheeleg_units::PositionMm;

use crate::behaviour::Act;
use crate::config::UniqueId;
use crate::contact::{Sector, Side};
use crate::dispatcher::{Refusal, Ticket};
use crate::finding::Finding;

/// Why all axes hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoldReason {
    /// A node missed three consecutive cycles.
    NodeLost(
        /// Bus address.
        u8,
    ),
    /// A node reported a fault.
    NodeFault {
        /// Bus address.
        node: u8,
        /// Active fault bits, protocol's table of faults.
        faults: u16,
    },
    /// A node that was armed no longer is, although this was not requested: it has restarted.
    NodeDisarmed(
        /// Bus address.
        u8,
    ),
    /// The supply-pressure switch opened.
    SupplyLost,
    /// Layer 1 produced nothing for 100 ms.
    LayerOneStalled,
    /// Layer 1 has not come back: the behaviours of its walk have ended, and no leg moves any more.
    LayerOneGone,
    /// The operator in control has seen nothing new for too long.
    OperatorLost,
    /// An E-stop was commanded.
    EmergencyStop,
}

/// An event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A command was carried out.
    Done(
        /// Its ticket.
        Ticket,
    ),
    /// A command that had been queued was refused.
    Refused {
        /// Its ticket.
        ticket: Ticket,
        /// Why.
        reason: Refusal,
    },
    /// A node was identified and its interface matches.
    NodeReady(
        /// Bus address.
        u8,
    ),
    /// A node's interface differs: the robot will not arm.
    SchemaMismatch {
        /// Bus address.
        node: u8,
        /// The master's schema hash.
        master: u64,
        /// The node's schema hash.
        theirs: u64,
        /// The node's firmware version: major, minor, patch.
        firmware: [u8; 3],
    },
    /// A node is not the kind of board that belongs at its address.
    WrongRole(
        /// Bus address.
        u8,
    ),
    /// Two boards answer at one address: the robot will not arm.
    DuplicateAddress {
        /// Bus address.
        node: u8,
        /// Their unique ids.
        unique_ids: [UniqueId; 2],
    },
    /// A board is not the one that was commissioned at its address: the robot will not arm.
    ForeignBoard {
        /// Bus address.
        node: u8,
        /// Unique id that was commissioned.
        commissioned: UniqueId,
        /// Unique id found.
        found: UniqueId,
        /// Address at which the board found was commissioned, if at any.
        belongs: Option<u8>,
    },
    /// A board was accepted as the one at its address.
    Commissioned {
        /// Bus address.
        node: u8,
        /// Its unique id.
        unique_id: UniqueId,
    },
    /// Something is wrong with a board or with the line.
    Found {
        /// Bus address; `None`: unknown.
        node: Option<u8>,
        /// The finding.
        finding: Finding,
    },
    /// A board has reported why it stopped or started, at the master's own request.
    Diagnosis {
        /// Bus address.
        node: u8,
        /// Its answer.
        record: FaultRecord,
        /// Time since its first fault, µs, modulo 2^32. A fault may be older than this master.
        ago_us: u32,
    },
    /// A board has reported what it has received; boards are asked in turn.
    Link {
        /// Bus address.
        node: u8,
        /// Its answer.
        record: LinkRecord,
    },
    /// A record of a board's log.
    Log {
        /// Bus address.
        node: u8,
        /// The record; its time is the board's.
        entry: LogEntry,
    },
    /// Number of records for which a board's log had no room.
    LogLost {
        /// Bus address.
        node: u8,
        /// How many.
        records: u16,
    },
    /// Value of a board's parameter, read or newly in force.
    Parameter {
        /// Bus address.
        node: u8,
        /// Number of the parameter.
        id: u16,
        /// Raw value.
        raw: i32,
    },
    /// A node missed three consecutive cycles.
    NodeLost(
        /// Bus address.
        u8,
    ),
    /// A node answers, for the first time or after it was lost.
    NodeBack(
        /// Bus address.
        u8,
    ),
    /// All axes are armed.
    Armed,
    /// All axes are disarmed.
    Disarmed,
    /// All axes were commanded to hold; the gait is over.
    Hold(
        /// Why.
        HoldReason,
    ),
    /// The start pose is reached.
    Homed,
    /// The start pose was not reached in time.
    HomingFailed {
        /// First joint (1..=6) out of tolerance.
        joint: u8,
    },
    /// A behaviour acts.
    Behaviour(
        /// What it does.
        Act,
    ),
    /// The gait is over.
    GaitDone {
        /// Steps done.
        steps: u16,
    },
    /// The foot trajectory is over.
    TrajectoryDone,
    /// A foot's switches closed.
    TouchDown {
        /// Which foot.
        side: Side,
        /// Side of the foot that touches, in the robot's frame; `None` if flat.
        sector: Option<Sector>,
    },
    /// All of a foot's switches opened.
    LiftOff(
        /// Which foot.
        Side,
    ),
    /// A switch of a foot does not follow the other three.
    FootSwitch {
        /// Which foot.
        side: Side,
        /// Side of the foot it is on, in the robot's frame.
        sector: Option<Sector>,
        /// Its problem.
        warning: Warning,
    },
    /// Answer to `TransmitPosition`.
    Position {
        /// 1..=6.
        joint: u8,
        /// Measured stroke, mm.
        stroke_mm: PositionMm,
    },
}

/// Capacity for events kept for the user.
pub const EVENT_DEPTH: usize = 32;

/// How long an event stays in a full queue; the lowest weight goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Weight {
    /// It will be repeated, or is reported elsewhere.
    Routine,
    /// It happened once.
    Told,
    /// A person must know why the robot has stopped or does not start, and which board is to blame.
    Cause,
    /// It ends a command of the user, or answers one: the sender is waiting for it.
    Outcome,
}

impl Event {
    const fn weight(&self) -> Weight {
        match self {
            Self::Link { .. } | Self::Log { .. } | Self::LogLost { .. } => Weight::Routine,
            Self::Hold(_)
            | Self::Found { .. }
            | Self::Diagnosis { .. }
            | Self::NodeLost(_)
            | Self::SchemaMismatch { .. }
            | Self::WrongRole(_)
            | Self::DuplicateAddress { .. }
            | Self::ForeignBoard { .. }
            | Self::HomingFailed { .. } => Weight::Cause,
            Self::Done(_)
            | Self::Refused { .. }
            | Self::Parameter { .. }
            | Self::Position { .. } => Weight::Outcome,
            _ => Weight::Told,
        }
    }
}

/// Bounded queue of events. When it is full, the oldest event of the lowest weight is dropped, which may be the new
/// one: the outcome of a command stays as long as there is anything else to drop.
#[derive(Debug, Default)]
pub struct Events {
    queue: Deque<(u64, Event), EVENT_DEPTH>,
    lost: u32,
}

impl Events {
    /// An empty queue.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            queue: Deque::new(),
            lost: 0,
        }
    }

    /// Adds an event that happened at `time_us`.
    pub fn push(&mut self, time_us: u64, event: Event) {
        if self.queue.is_full() && !self.made_room(&event) {
            return;
        }
        // Cannot fail: a place has just been freed.
        let _stored = self.queue.push_back((time_us, event));
    }

    /// Rotates the queue once and leaves one event out; returns false if the new event is to be dropped.
    #[cold]
    fn made_room(&mut self, newcomer: &Event) -> bool {
        self.lost = self.lost.wrapping_add(1);
        let weights = || self.queue.iter().map(|(_, event)| event.weight());
        let least = weights().min().unwrap_or(Weight::Outcome);
        if least > newcomer.weight() {
            return false;
        }
        let spare = weights().position(|weight| weight == least).unwrap_or(0);
        for place in 0..EVENT_DEPTH {
            if let Some(event) = self.queue.pop_front()
                && place != spare
            {
                let _stored = self.queue.push_back(event);
            }
        }
        true
    }

    /// Takes the oldest event with its time in µs.
    pub fn pop(&mut self) -> Option<(u64, Event)> {
        self.queue.pop_front()
    }

    /// Number of events lost to a full queue since start-up (wraps).
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::CommandCode;

    fn done(id: u32) -> Event {
        Event::Done(Ticket {
            client: 0,
            id,
            code: CommandCode::Disarm,
        })
    }

    fn drained(events: &mut Events) -> Vec<Event> {
        std::iter::from_fn(|| events.pop().map(|(_, event)| event)).collect()
    }

    #[test]
    fn a_full_queue_keeps_outcomes_and_the_newest_in_their_order() {
        let mut events = Events::new();
        events.push(0, done(1));
        for node in 0..40 {
            events.push(1, Event::NodeReady(node));
        }
        events.push(2, done(2));
        assert_eq!(events.lost(), 42 - EVENT_DEPTH as u32);
        let mut wanted = vec![done(1)];
        wanted.extend((10..40).map(Event::NodeReady));
        wanted.push(done(2));
        assert_eq!(drained(&mut events), wanted);
    }

    #[test]
    fn of_outcomes_alone_the_oldest_goes_and_nothing_less_pushes_one_out() {
        let mut events = Events::new();
        for id in 0..=EVENT_DEPTH as u32 {
            events.push(0, done(id));
        }
        events.push(1, Event::NodeReady(1));
        events.push(1, Event::Hold(HoldReason::EmergencyStop));
        let wanted: Vec<Event> = (1..=EVENT_DEPTH as u32).map(done).collect();
        assert_eq!((drained(&mut events), events.lost()), (wanted, 3));
    }

    #[test]
    fn what_stopped_the_robot_outlives_what_comes_again() {
        let mut events = Events::new();
        let lost = |records| Event::LogLost { node: 1, records };
        let stop = Event::Hold(HoldReason::EmergencyStop);
        events.push(0, stop);
        events.push(0, Event::NodeReady(1));
        for records in 2..EVENT_DEPTH as u16 {
            events.push(0, lost(records));
        }
        for id in 0..EVENT_DEPTH as u32 - 1 {
            events.push(1, done(id));
        }
        let mut wanted = vec![stop];
        wanted.extend((0..EVENT_DEPTH as u32 - 1).map(done));
        assert_eq!(drained(&mut events), wanted);
    }
}
