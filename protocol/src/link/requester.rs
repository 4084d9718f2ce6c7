//! Requester's end of the acyclic service: sequence, timeout, retry, give up.

use super::timing::{CYCLE_US, DUPLICATE_WINDOW_US};
use crate::address::Address;
use crate::fields::NackReason;
use crate::message::{Envelope, Message, Nack};

/// How long and how often a request is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequesterConfig {
    timeout_us: u32,
    attempts: u8,
}

impl RequesterConfig {
    /// Five attempts, two bus cycles each.
    pub const DEFAULT: Self = Self {
        timeout_us: 2 * CYCLE_US,
        attempts: 5,
    };

    /// `timeout_us` is the time from sending to the next attempt. `None` if
    /// there is no attempt, the timeout is shorter than a bus cycle, or the
    /// attempts together outlast the responder's memory of duplicates: a late
    /// repetition would then be executed twice.
    #[must_use]
    pub const fn new(timeout_us: u32, attempts: u8) -> Option<Self> {
        let total = (timeout_us as u64).saturating_mul(attempts as u64);
        if attempts == 0 || timeout_us < CYCLE_US || total >= DUPLICATE_WINDOW_US {
            None
        } else {
            Some(Self {
                timeout_us,
                attempts,
            })
        }
    }
}

const _: () = assert!(
    RequesterConfig::new(
        RequesterConfig::DEFAULT.timeout_us,
        RequesterConfig::DEFAULT.attempts
    )
    .is_some()
);

/// Why a request was not accepted for sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// An earlier request is still open.
    Busy,
    /// The message is no request, or the destination is no node.
    NotARequest,
}

/// Why a request ended without its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GiveUp {
    /// Nothing came back.
    NoAnswer {
        /// How often it was sent.
        attempts: u8,
    },
    /// The node stayed busy.
    StillBusy {
        /// How often it was sent.
        attempts: u8,
    },
}

impl core::fmt::Display for GiveUp {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoAnswer { attempts } => write!(f, "no answer after {attempts} attempts"),
            Self::StillBusy { attempts } => {
                write!(f, "the node is still busy after {attempts} attempts")
            }
        }
    }
}

/// What to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// No request is open.
    Idle,
    /// Wait for the answer.
    Wait,
    /// Send this; then call [`Requester::sent`].
    Send {
        /// Source, destination and sequence.
        envelope: Envelope,
        /// The request.
        request: Message,
    },
    /// The request is over without an answer.
    GaveUp(GiveUp),
}

/// How a request was answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// With its answer: Ack, or the message asked for.
    Answered(Message),
    /// With a refusal.
    Refused(NackReason),
}

#[derive(Clone, Copy, Debug)]
struct Open {
    envelope: Envelope,
    request: Message,
    sent: u8,
    sent_at_us: Option<u64>,
    busy: bool,
}

/// One open request at a time to one or several nodes.
///
/// A repetition carries the sequence of the first attempt, so the node answers
/// it without executing it twice. The next request gets the next sequence.
#[derive(Clone, Copy, Debug)]
pub struct Requester {
    config: RequesterConfig,
    next_sequence: u16,
    open: Option<Open>,
}

impl Requester {
    /// Starts with `first_sequence`; take one that differs from run to run.
    #[must_use]
    pub const fn new(config: RequesterConfig, first_sequence: u16) -> Self {
        Self {
            config,
            next_sequence: first_sequence,
            open: None,
        }
    }

    /// Opens a request; returns its sequence.
    ///
    /// # Errors
    /// [`Refusal`]: one is open already, or this is no request to a node.
    pub fn start(&mut self, destination: Address, request: Message) -> Result<u16, Refusal> {
        if self.open.is_some() {
            return Err(Refusal::Busy);
        }
        if !destination.is_node() || request.message_type().answer().is_none() {
            return Err(Refusal::NotARequest);
        }
        let sequence = self.next_sequence;
        self.next_sequence = sequence.wrapping_add(1);
        self.open = Some(Open {
            envelope: Envelope {
                source: Address::MASTER,
                destination,
                sequence,
            },
            request,
            sent: 0,
            sent_at_us: None,
            busy: false,
        });
        Ok(sequence)
    }

    /// What to do at `now_us`. Giving up is reported once and closes the request.
    pub fn poll(&mut self, now_us: u64) -> Step {
        let Some(open) = &self.open else {
            return Step::Idle;
        };
        let waiting = open
            .sent_at_us
            .is_some_and(|at| now_us.saturating_sub(at) < u64::from(self.config.timeout_us));
        if waiting {
            return Step::Wait;
        }
        if open.sent >= self.config.attempts {
            let attempts = open.sent;
            let reason = if open.busy {
                GiveUp::StillBusy { attempts }
            } else {
                GiveUp::NoAnswer { attempts }
            };
            self.open = None;
            return Step::GaveUp(reason);
        }
        Step::Send {
            envelope: open.envelope,
            request: open.request,
        }
    }

    /// Records that the request of [`Step::Send`] went out at `now_us`. Until then [`Self::poll`] keeps
    /// asking: a request may have to wait for room in the cycle.
    pub fn sent(&mut self, now_us: u64) {
        if let Some(open) = &mut self.open {
            open.sent = open.sent.saturating_add(1);
            open.sent_at_us = Some(now_us);
        }
    }

    /// Takes a message from the bus; returns the outcome if it answers the open request. For everything else
    /// (late answers, other nodes, other types) `None`.
    pub fn on_message(&mut self, envelope: Envelope, message: &Message) -> Option<Outcome> {
        let open = self.open.as_mut()?;
        let request_type = open.request.message_type();
        if envelope.source != open.envelope.destination
            || envelope.destination != Address::MASTER
            || envelope.sequence != open.envelope.sequence
            || open.sent == 0
        {
            return None;
        }
        let outcome = match message {
            Message::Nack(nack) if nack.request != request_type.code() => return None,
            Message::Ack(ack) if ack.request != request_type.code() => return None,
            Message::Nack(Nack {
                reason: NackReason::Busy,
                ..
            }) => {
                // Try again after the timeout.
                open.busy = true;
                return None;
            }
            Message::Nack(nack) => Outcome::Refused(nack.reason),
            other if Some(other.message_type()) == request_type.answer() => {
                Outcome::Answered(*other)
            }
            _ => return None,
        };
        self.open = None;
        Some(outcome)
    }

    /// Forgets the open request, as at an emergency stop.
    pub fn cancel(&mut self) {
        self.open = None;
    }

    /// Whether a request is open.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        self.open.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Ack, Disarm, Identify, MessageType, Sync};
    use crate::sync::{SyncFlags, SyncSlots};

    const DISARM: Message = Message::Disarm(Disarm {});
    const ACK: Message = Message::Ack(Ack {
        request: MessageType::Disarm.code(),
    });

    fn node() -> Address {
        Address::joint(3).unwrap()
    }

    fn answer(sequence: u16) -> Envelope {
        Envelope {
            source: node(),
            destination: Address::MASTER,
            sequence,
        }
    }

    #[test]
    fn retries_with_the_same_sequence_then_gives_up() {
        let mut requester = Requester::new(RequesterConfig::DEFAULT, 41);
        assert_eq!(requester.start(node(), DISARM), Ok(41));
        assert_eq!(requester.start(node(), DISARM), Err(Refusal::Busy));
        let mut sequences = 0;
        for attempt in 0..5_u64 {
            let now = attempt * 20_000;
            match requester.poll(now) {
                Step::Send { envelope, .. } => {
                    assert_eq!(envelope.sequence, 41);
                    sequences += 1;
                }
                other => panic!("{other:?}"),
            }
            requester.sent(now);
            assert_eq!(requester.poll(now + 19_999), Step::Wait);
        }
        assert_eq!(sequences, 5);
        assert_eq!(
            requester.poll(100_000),
            Step::GaveUp(GiveUp::NoAnswer { attempts: 5 })
        );
        assert_eq!(requester.poll(100_001), Step::Idle);
        assert_eq!(requester.start(node(), DISARM), Ok(42));
    }

    #[test]
    fn only_the_right_answer_counts() {
        let mut requester = Requester::new(RequesterConfig::DEFAULT, 1);
        requester.start(node(), DISARM).unwrap();
        assert_eq!(requester.on_message(answer(1), &ACK), None, "not yet sent");
        requester.sent(0);
        assert_eq!(requester.on_message(answer(2), &ACK), None);
        let mut other = answer(1);
        other.source = Address::joint(4).unwrap();
        assert_eq!(requester.on_message(other, &ACK), None);
        let wrong = Message::Ack(Ack {
            request: MessageType::Arm.code(),
        });
        assert_eq!(requester.on_message(answer(1), &wrong), None);
        assert_eq!(
            requester.on_message(answer(1), &Message::Identify(Identify {})),
            None
        );
        assert_eq!(
            requester.on_message(answer(1), &ACK),
            Some(Outcome::Answered(ACK))
        );
        assert_eq!(requester.on_message(answer(1), &ACK), None, "late repeat");
    }

    #[test]
    fn busy_is_tried_again_and_refusals_are_final() {
        let nack = |reason| {
            Message::Nack(Nack {
                request: MessageType::Disarm.code(),
                reason,
            })
        };
        let mut requester = Requester::new(RequesterConfig::DEFAULT, 1);
        requester.start(node(), DISARM).unwrap();
        requester.sent(0);
        assert_eq!(
            requester.on_message(answer(1), &nack(NackReason::Busy)),
            None
        );
        assert!(matches!(requester.poll(20_000), Step::Send { .. }));
        requester.sent(20_000);
        assert_eq!(
            requester.on_message(answer(1), &nack(NackReason::WrongMode)),
            Some(Outcome::Refused(NackReason::WrongMode))
        );
        assert!(!requester.is_busy());
    }

    #[test]
    fn broadcasts_and_cyclic_messages_are_no_requests() {
        let mut requester = Requester::new(RequesterConfig::DEFAULT, 1);
        for destination in [Address::MASTER, Address::BROADCAST] {
            assert_eq!(
                requester.start(destination, DISARM),
                Err(Refusal::NotARequest)
            );
        }
        let sync = Message::Sync(Sync {
            cycle: 0,
            master_time_us: 0,
            flags: SyncFlags::NONE,
            slots: SyncSlots::NONE,
        });
        assert_eq!(requester.start(node(), sync), Err(Refusal::NotARequest));
        assert_eq!(requester.start(node(), ACK), Err(Refusal::NotARequest));
    }

    #[test]
    fn configurations_that_could_execute_twice_are_refused() {
        assert_eq!(RequesterConfig::new(20_000, 0), None);
        assert_eq!(RequesterConfig::new(9_999, 5), None);
        assert_eq!(RequesterConfig::new(100_000, 5), None);
        assert!(RequesterConfig::new(99_999, 5).is_some());
    }
}
