//! Responder's end of the acyclic service: a repeated request is answered
//! again, not executed again.

use super::timing::DUPLICATE_WINDOW_US;
use crate::address::Address;
use crate::fields::NackReason;
use crate::message::{Envelope, Message, Nack};

#[derive(Clone, Copy, Debug)]
struct Entry {
    source: Address,
    sequence: u16,
    request: Message,
    answer: Message,
    at_us: u64,
}

/// What to do with a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Execute it, answer, and [`DuplicateFilter::store`] the answer.
    Execute,
    /// A repetition: send this stored answer, execute nothing.
    Resend(Message),
    /// The sequence number was just used for another request: send this Nack,
    /// execute nothing.
    Refuse(Message),
}

/// Remembers the last answer to the requester.
///
/// One entry is enough: only the master sends requests, and it waits for an
/// answer before the next request to the same node. An entry is valid for
/// [`DUPLICATE_WINDOW_US`], longer than any requester repeats itself, so a
/// master that starts again with the same sequence numbers is not answered from
/// an earlier life.
#[derive(Clone, Copy, Debug, Default)]
pub struct DuplicateFilter {
    last: Option<Entry>,
}

impl DuplicateFilter {
    /// Nothing stored.
    #[must_use]
    pub const fn new() -> Self {
        Self { last: None }
    }

    /// Judges a request that arrived at `now_us`.
    #[must_use]
    pub fn judge(&self, envelope: Envelope, request: &Message, now_us: u64) -> Verdict {
        match &self.last {
            Some(last)
                if last.source == envelope.source
                    && last.sequence == envelope.sequence
                    && now_us.saturating_sub(last.at_us) <= DUPLICATE_WINDOW_US =>
            {
                if last.request.is_same_request(request) {
                    Verdict::Resend(last.answer)
                } else {
                    Verdict::Refuse(Message::Nack(Nack {
                        request: request.message_type().code(),
                        reason: NackReason::Duplicate,
                    }))
                }
            }
            _ => Verdict::Execute,
        }
    }

    /// Remembers the answer. A Nack with the reason Busy is not remembered: the
    /// requester repeats the request to have it executed.
    pub fn store(&mut self, envelope: Envelope, request: Message, answer: Message, now_us: u64) {
        if let Message::Nack(Nack {
            reason: NackReason::Busy,
            ..
        }) = answer
        {
            return;
        }
        self.last = Some(Entry {
            source: envelope.source,
            sequence: envelope.sequence,
            request,
            answer,
            at_us: now_us,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Ack, Disarm, Identify, MessageType};

    fn from_master(sequence: u16) -> Envelope {
        Envelope {
            source: Address::MASTER,
            destination: Address::of_slot(0).unwrap(),
            sequence,
        }
    }

    const DISARM: Message = Message::Disarm(Disarm {});
    const ACK: Message = Message::Ack(Ack {
        request: MessageType::Disarm.code(),
    });

    #[test]
    fn a_repetition_is_answered_and_not_executed() {
        let mut filter = DuplicateFilter::new();
        assert_eq!(filter.judge(from_master(7), &DISARM, 0), Verdict::Execute);
        filter.store(from_master(7), DISARM, ACK, 0);
        assert_eq!(
            filter.judge(from_master(7), &DISARM, 20_000),
            Verdict::Resend(ACK)
        );
        assert_eq!(
            filter.judge(from_master(8), &DISARM, 20_000),
            Verdict::Execute
        );
        assert!(matches!(
            filter.judge(from_master(7), &Message::Identify(Identify {}), 20_000),
            Verdict::Refuse(Message::Nack(Nack {
                reason: NackReason::Duplicate,
                ..
            }))
        ));
    }

    #[test]
    fn the_memory_ends_with_the_window() {
        let mut filter = DuplicateFilter::new();
        filter.store(from_master(7), DISARM, ACK, 1_000);
        let end = 1_000 + DUPLICATE_WINDOW_US;
        assert_eq!(
            filter.judge(from_master(7), &DISARM, end),
            Verdict::Resend(ACK)
        );
        assert_eq!(
            filter.judge(from_master(7), &DISARM, end + 1),
            Verdict::Execute
        );
    }

    #[test]
    fn busy_is_not_remembered() {
        let mut filter = DuplicateFilter::new();
        let busy = Message::Nack(Nack {
            request: MessageType::Disarm.code(),
            reason: NackReason::Busy,
        });
        filter.store(from_master(7), DISARM, busy, 0);
        assert_eq!(filter.judge(from_master(7), &DISARM, 1), Verdict::Execute);
    }
}
