//! Acyclic part of the cycle: sends requests, judges answers, enumerates.

use wheeleg_protocol::frame::encoded_len;
use wheeleg_protocol::link::{CYCLE_US, GiveUp, Outcome, SlotTiming, Step};
use wheeleg_protocol::{
    Address, Disarm, Discover, Envelope, FaultRecord, Identify, LinkRecord, LinkReport, Message,
};

use super::acyclic::{Job, Purpose};
use super::cycle::frame_of;
use super::nodes::Enumerated;
use super::{GroupKind, Layer0, Power};
use crate::TxBytes;
use crate::dispatcher::{Refusal, Ticket};
use crate::event::{Event, Events};
use crate::finding::Finding;
use crate::setpoint::NODES;

impl Layer0 {
    /// The request to send at `now_us`, if one is due and its answer will arrive before the next SYNC.
    pub fn next_acyclic(&mut self, now_us: u64, events: &mut Events) -> Option<TxBytes> {
        let into = now_us.saturating_sub(self.cycle_start_us);
        let into_us = u32::try_from(into).unwrap_or(CYCLE_US);
        // Two iterations: the end of one request, and the start of the next.
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
                    let job = self.next_job(now_us, events)?;
                    if self.requester.start(job.to, job.message).is_ok() {
                        self.in_flight = Some(job);
                    }
                }
            }
        }
        None
    }

    /// Waiting requests first, then the master's own questions; otherwise asks a present node that is not known.
    fn next_job(&mut self, now_us: u64, events: &mut Events) -> Option<Job> {
        while let Some(job) = self.jobs.pop() {
            match job.purpose.ticket() {
                Some(ticket) if now_us > job.until_us => {
                    let reason = Refusal::Expired;
                    events.push(now_us, Event::Refused { ticket, reason });
                }
                _ => return Some(job),
            }
        }
        let liveness = &self.liveness;
        let errors = self.decoder.quality().errors();
        let question = self
            .questions
            .next(self.cycle, errors, |index| liveness.alive(index));
        if let Some((to, message)) = question {
            return Some(Job::new(to, message, Purpose::Report));
        }
        let to = self.nodes.next_unknown(self.ask_from)?;
        self.ask_from = usize::from(to.raw());
        let node = to.slot().and_then(|index| self.nodes.get(index));
        let message = if node.is_some_and(|node| node.identify_failed) {
            Discover {}.into()
        } else {
            Identify {}.into()
        };
        Some(Job::new(to, message, Purpose::Identify))
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

    /// Takes a frame from the bus that is not a slot reply. Returns false if it was not requested.
    fn on_answer(
        &mut self,
        envelope: Envelope,
        message: &Message,
        now_us: u64,
        events: &mut Events,
    ) -> bool {
        let Some(outcome) = self.requester.on_message(envelope, message) else {
            if let Message::Identity(_) = message {
                // It was not expected any more: a second board answers a question to one.
                self.identified(envelope.source, Ok(*message), now_us, events);
            }
            self.counters.unexpected = self.counters.unexpected.wrapping_add(1);
            return false;
        };
        let Some(job) = self.in_flight.take() else {
            return true;
        };
        let result = match outcome {
            Outcome::Answered(answer) => Ok(answer),
            Outcome::Refused(reason) => Err(Refusal::NodeRefused {
                node: job.to.raw(),
                reason,
            }),
        };
        self.conclude(job, result, now_us, events);
        true
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
            Purpose::Report => self.reported(job.to, result, now_us, events),
            Purpose::Group => self.group_answer(result.err(), now_us, events),
            // A node that does not brake is still frozen by its set-point; its own supervision stops it when it no
            // longer receives SYNC.
            Purpose::Stop => {}
            // A wheel that has kept its old profile still arrives; its speed shows it.
            Purpose::Profile => {}
            Purpose::Saved(ticket) => self.saved(ticket, job.to, result, now_us, events),
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
            self.nodes.identify_failed(from);
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
                    firmware: identity.firmware,
                },
            ),
            Enumerated::Foreign(identity) => {
                let found = identity.unique_id;
                if let Some(commissioned) = self.nodes.commissioned(from) {
                    let belongs = self.nodes.home_of(found);
                    events.push(
                        now_us,
                        Event::ForeignBoard {
                            node,
                            commissioned,
                            found,
                            belongs,
                        },
                    );
                }
            }
            Enumerated::Role(_) => events.push(now_us, Event::WrongRole(node)),
            Enumerated::DuplicateId(unique_ids) => {
                events.push(now_us, Event::DuplicateAddress { node, unique_ids });
            }
            Enumerated::Unknown => {}
        }
    }

    /// The answer to one of the master's own questions. An unanswered question is not repeated, because a board that
    /// comes back is asked again.
    fn reported(
        &mut self,
        from: Address,
        result: Result<Message, Refusal>,
        now_us: u64,
        events: &mut Events,
    ) {
        let (node, Some(index)) = (from.raw(), from.slot()) else {
            return;
        };
        match result {
            Ok(Message::FaultRecord(record)) => {
                let ago_us = ago_us(&record, now_us);
                let diagnosis = Event::Diagnosis {
                    node,
                    record,
                    ago_us,
                };
                events.push(now_us, diagnosis);
                // Ask for the events that led to it.
                self.questions.log(index);
                self.nodes.forget_count(from);
            }
            Ok(Message::LinkRecord(record)) => {
                self.heard(from, record, now_us, events);
            }
            Ok(Message::LogRecords(records)) => {
                for entry in records.iter() {
                    events.push(now_us, Event::Log { node, entry });
                }
                if records.lost > 0 {
                    let records = records.lost;
                    events.push(now_us, Event::LogLost { node, records });
                }
                if records.left > 0 {
                    self.questions.log(index);
                }
            }
            _ => {}
        }
    }

    /// Takes a board's link record. Returns true if the board was not reset since the last one.
    fn heard(
        &mut self,
        from: Address,
        record: LinkRecord,
        now_us: u64,
        events: &mut Events,
    ) -> bool {
        let (node, index) = (from.raw(), from.slot().unwrap_or(NODES));
        let known = self.nodes.get(index).is_some_and(|n| n.frames.is_some());
        let went_on = self.nodes.counted(from, record.frames);
        if known && !went_on {
            self.questions.why(index);
        }
        events.push(now_us, Event::Link { node, record });
        if self.sums.heard(index, record.parameters) {
            let (node, finding) = (Some(node), Finding::OtherParameters);
            events.push(now_us, Event::Found { node, finding });
        }
        if let Some(babbler) = self.line.heard(index, &record) {
            let (node, finding) = (Some(babbler.raw()), Finding::Babbler);
            events.push(now_us, Event::Found { node, finding });
        }
        went_on
    }

    /// A board reports that it has stored its parameters. If it was reset meanwhile, it has not stored those that were
    /// sent to it.
    fn saved(
        &mut self,
        ticket: Ticket,
        from: Address,
        result: Result<Message, Refusal>,
        now_us: u64,
        events: &mut Events,
    ) {
        let reason = match result {
            Ok(Message::LinkRecord(record)) if self.heard(from, record, now_us, events) => {
                events.push(now_us, Event::Done(ticket));
                return;
            }
            Err(reason) => reason,
            Ok(_) => Refusal::NodeReset { node: from.raw() },
        };
        events.push(now_us, Event::Refused { ticket, reason });
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
            // Armed once the replies show it, see `confirm_arming`.
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

    /// One node refused or stayed behind: the others are disarmed again. Other waiting jobs are dropped, and their
    /// users notified.
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
            Ok(_) if matches!(job.message, Message::ParamSave(_)) => {
                let look = Job::new(job.to, LinkReport {}.into(), Purpose::Saved(ticket));
                if !self.jobs.push(look) {
                    let reason = Refusal::Busy;
                    events.push(now_us, Event::Refused { ticket, reason });
                }
            }
            Ok(answer) => {
                if let Message::Position(position) = answer {
                    let joint = job.to.raw();
                    let stroke_mm = wheeleg_units::PositionMm::from_raw(position.position_raw);
                    events.push(now_us, Event::Position { joint, stroke_mm });
                }
                if let Message::ParamValue(value) = answer {
                    let (node, id, raw) = (job.to.raw(), value.id, value.value);
                    events.push(now_us, Event::Parameter { node, id, raw });
                }
                events.push(now_us, Event::Done(ticket));
            }
            Err(reason) => events.push(now_us, Event::Refused { ticket, reason }),
        }
    }

    /// Takes bytes received from the bus; the last one ended at `t_end_us`.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end_us: u64, events: &mut Events) {
        let mut sound = false;
        for &byte in bytes {
            self.line.byte();
            let Some(Ok(frame)) = self.decoder.push(byte) else {
                continue;
            };
            let encoded = encoded_len(frame.payload.len());
            self.line.sound(encoded);
            sound = true;
            let envelope = Envelope::from(frame.header);
            let parsed = Message::parse(&frame);
            if envelope.source == Address::MASTER {
                // The master's own bytes, received from the shared line.
                continue;
            }
            match parsed {
                Ok(Message::SlotReply(reply)) if envelope.destination == Address::MASTER => {
                    self.on_reply(envelope.source, reply);
                }
                Ok(message) => {
                    if !self.on_answer(envelope, &message, t_end_us, events) {
                        self.line.unasked(envelope.source, encoded);
                    }
                }
                Err(_) => {
                    self.line.unasked(envelope.source, encoded);
                    self.counters.unexpected = self.counters.unexpected.wrapping_add(1);
                }
            }
        }
        if !sound {
            let into_us = t_end_us.saturating_sub(self.cycle_start_us);
            self.line.stretch(bytes, into_us);
        }
    }
}

/// Time since a board's first fault. All clocks count microseconds modulo 2^32.
const fn ago_us(record: &FaultRecord, now_us: u64) -> u32 {
    let here_us = record.first_time_us.wrapping_add(record.clock_offset_us);
    (now_us as u32).wrapping_sub(here_us)
}
