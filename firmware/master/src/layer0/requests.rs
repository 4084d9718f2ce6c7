//! Acyclic part of the cycle: sends requests, judges answers, enumerates.

use wheeleg_protocol::link::{CYCLE_US, GiveUp, Outcome, SlotTiming, Step};
use wheeleg_protocol::{Address, Disarm, Discover, Envelope, Identify, Message};

use super::acyclic::{Job, Purpose};
use super::cycle::frame_of;
use super::nodes::Enumerated;
use super::{GroupKind, Layer0, Power};
use crate::TxBytes;
use crate::dispatcher::{Refusal, Ticket};
use crate::event::{Event, Events};

impl Layer0 {
    /// The request to send at `now_us`, if one is due and its answer will be in
    /// before the next SYNC.
    pub fn next_acyclic(&mut self, now_us: u64, events: &mut Events) -> Option<TxBytes> {
        let into = now_us.saturating_sub(self.cycle_start_us);
        let into_us = u32::try_from(into).unwrap_or(CYCLE_US);
        // Two rounds: the end of one request, and the start of the next.
        for _ in 0..2 {
            match self.requester.poll(now_us) {
                Step::Wait => return None,
                Step::Send { envelope, request } => {
                    let timing = SlotTiming::DEFAULT;
                    if !timing.exchange_fits(request.message_type(), into_us) {
                        return None;
                    }
                    self.requester.sent(now_us);
                    self.counters.requests = self.counters.requests.wrapping_add(1);
                    return Some(frame_of(&request, envelope.destination, envelope.sequence));
                }
                Step::GaveUp(reason) => self.gave_up(reason, now_us, events),
                Step::Idle => {
                    let job = self.next_job()?;
                    if self.requester.start(job.to, job.message).is_ok() {
                        self.in_flight = Some(job);
                    }
                }
            }
        }
        None
    }

    /// Waiting requests first; otherwise asks a present node that is not known.
    fn next_job(&mut self) -> Option<Job> {
        if let Some(job) = self.jobs.pop() {
            return Some(job);
        }
        let to = self.nodes.next_unknown(self.ask_from)?;
        self.ask_from = usize::from(to.raw());
        let node = to.slot().and_then(|index| self.nodes.get(index));
        Some(Job {
            to,
            message: if node.is_some_and(|node| node.in_vain) {
                Discover {}.into()
            } else {
                Identify {}.into()
            },
            purpose: Purpose::Identify,
        })
    }

    fn gave_up(&mut self, reason: GiveUp, now_us: u64, events: &mut Events) {
        self.counters.unanswered = self.counters.unanswered.wrapping_add(1);
        if let Some(job) = self.in_flight.take() {
            let node = job.to.raw();
            let reason = match reason {
                GiveUp::NoAnswer { .. } => Refusal::NoAnswer { node },
                GiveUp::StillBusy { .. } => Refusal::NodeBusy { node },
            };
            self.conclude(job, Err(reason), now_us, events);
        }
    }

    /// Takes a frame from the bus that is no slot reply.
    pub(super) fn on_answer(
        &mut self,
        envelope: Envelope,
        message: &Message,
        now_us: u64,
        events: &mut Events,
    ) {
        let Some(outcome) = self.requester.on_message(envelope, message) else {
            if let Message::Identity(_) = message {
                // Nobody asked any more: a second board answers a question to one.
                self.identified(envelope.source, Ok(*message), now_us, events);
            }
            self.counters.unexpected = self.counters.unexpected.wrapping_add(1);
            return;
        };
        let Some(job) = self.in_flight.take() else {
            return;
        };
        let result = match outcome {
            Outcome::Answered(answer) => Ok(answer),
            Outcome::Refused(reason) => Err(Refusal::NodeRefused {
                node: job.to.raw(),
                reason,
            }),
        };
        self.conclude(job, result, now_us, events);
    }

    fn conclude(
        &mut self,
        job: Job,
        result: Result<Message, Refusal>,
        now_us: u64,
        events: &mut Events,
    ) {
        match job.purpose {
            Purpose::Identify => self.identified(job.to, result, now_us, events),
            Purpose::Group => self.group_answer(result.err(), now_us, events),
            // A node that does not brake is frozen by its set-point all the same;
            // its own supervision stops it when it stops hearing SYNC.
            Purpose::Stop => {}
            // A wheel that kept its old profile still arrives; its speed shows it.
            Purpose::Profile => {}
            Purpose::User(ticket) => self.user_answer(ticket, job, result, now_us, events),
        }
    }

    fn identified(
        &mut self,
        from: Address,
        result: Result<Message, Refusal>,
        now_us: u64,
        events: &mut Events,
    ) {
        let Ok(Message::Identity(identity)) = result else {
            self.nodes.in_vain(from);
            return;
        };
        let node = from.raw();
        match self.nodes.identify(from, identity, self.schema_hash) {
            Enumerated::Ready(_) => events.push(now_us, Event::NodeReady(node)),
            Enumerated::Schema(identity) => events.push(
                now_us,
                Event::SchemaMismatch {
                    node,
                    master: self.schema_hash,
                    theirs: identity.schema_hash,
                },
            ),
            Enumerated::Role(_) => events.push(now_us, Event::WrongRole(node)),
            Enumerated::Twins(unique_ids) => {
                events.push(now_us, Event::DuplicateAddress { node, unique_ids });
            }
            Enumerated::Unknown => {}
        }
    }

    fn group_answer(&mut self, failed: Option<Refusal>, now_us: u64, events: &mut Events) {
        let Some(group) = &mut self.group else {
            return;
        };
        group.failed = group.failed.or(failed);
        group.left = group.left.saturating_sub(1);
        let (kind, ticket, left, failed) = (group.kind, group.ticket, group.left, group.failed);
        match (kind, failed) {
            (GroupKind::Arm, Some(reason)) => {
                self.group = None;
                self.abort_arming(now_us, events);
                events.push(now_us, Event::Refused { ticket, reason });
            }
            // Armed when the replies say so: see `confirm_arming`.
            (GroupKind::Arm, None) => {}
            _ if left > 0 => {}
            (_, Some(reason)) => {
                self.group = None;
                events.push(now_us, Event::Refused { ticket, reason });
            }
            (_, None) => {
                self.group = None;
                events.push(now_us, Event::Disarmed);
                events.push(now_us, Event::Done(ticket));
            }
        }
    }

    /// One node refused or stayed behind: the others are disarmed again. What
    /// else was waiting is dropped, and its users are told.
    pub(super) fn abort_arming(&mut self, now_us: u64, events: &mut Events) {
        self.power = Power::Disarmed;
        let reason = Refusal::Interrupted;
        self.jobs
            .clear(|ticket| events.push(now_us, Event::Refused { ticket, reason }));
        let liveness = &self.liveness;
        self.jobs
            .ask_all(Disarm {}.into(), |index| liveness.alive(index));
    }

    fn user_answer(
        &mut self,
        ticket: Ticket,
        job: Job,
        result: Result<Message, Refusal>,
        now_us: u64,
        events: &mut Events,
    ) {
        match result {
            Ok(answer) => {
                if let Message::Position(position) = answer {
                    let joint = job.to.raw();
                    let stroke_mm = wheeleg_units::PositionMm::from_raw(position.position_raw);
                    events.push(now_us, Event::Position { joint, stroke_mm });
                }
                events.push(now_us, Event::Done(ticket));
            }
            Err(reason) => events.push(now_us, Event::Refused { ticket, reason }),
        }
    }

    /// Takes bytes received from the bus; the last one ended at `t_end_us`.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end_us: u64, events: &mut Events) {
        for &byte in bytes {
            let Some(Ok(frame)) = self.decoder.push(byte) else {
                continue;
            };
            let envelope = Envelope::from(frame.header);
            let parsed = Message::parse(&frame);
            if envelope.source == Address::MASTER {
                // Our own bytes, heard on the shared line.
                continue;
            }
            match parsed {
                Ok(Message::SlotReply(reply)) if envelope.destination == Address::MASTER => {
                    self.on_reply(envelope.source, reply);
                }
                Ok(message) => self.on_answer(envelope, &message, t_end_us, events),
                Err(_) => self.counters.unexpected = self.counters.unexpected.wrapping_add(1),
            }
        }
    }
}
