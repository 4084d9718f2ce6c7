//! Who is in control, and requests from their begin to their end.

use std::time::Instant;

use serde_json::{Value, json};
use wheeleg_master::command::{Command, CommandCode};

use super::{Asked, ClientId, Holder, Inner, Pending, Role, TICKET};
use crate::live::{Answer, Input, Status};
use crate::messages::{outcome, refused};
use crate::reason::Reason;
use crate::request::{HostCommand, Order, Spoken};

impl Inner {
    pub(super) fn give(
        &mut self,
        id: ClientId,
        n: u64,
        (order, spoken): (Order, Spoken),
        seen_us: u64,
        valid_us: u64,
    ) {
        let Some(client) = self.clients.get(&id) else {
            return;
        };
        if client.role != Role::Control {
            let text = "the view key may look and stop; connect with the control key";
            return self.tell(id, &refused(n, Reason::Role, text));
        }
        let holds = self.holder.as_ref().is_some_and(|h| h.client == id);
        let (input, what) = match order {
            Order::Robot(Command::EmergencyStop) => {
                let text = "a stop is no command that waits: send {\"op\":\"stop\"}";
                return self.tell(id, &refused(n, Reason::BadCommand, text));
            }
            Order::Robot(command) => {
                let takes = command.code() == CommandCode::TakeControl;
                match &self.holder {
                    Some(other) if takes && !holds => {
                        let asked = json!({ "op": "asked", "by": client.name });
                        let answer = self.held(n, other);
                        self.tell(other.client, &asked);
                        return self.tell(id, &answer);
                    }
                    None if takes => {
                        self.holder = Some(Holder {
                            client: id,
                            name: client.name.clone(),
                            session: client.session.clone(),
                            granted_us: None,
                        });
                    }
                    _ if !holds => {
                        let text = "take the control first";
                        return self.tell(id, &refused(n, Reason::NotInControl, text));
                    }
                    _ => {}
                }
                let what = match command.code() {
                    CommandCode::TakeControl => Asked::Take,
                    CommandCode::ReleaseControl => Asked::Release,
                    _ => Asked::Other,
                };
                let input = Input::Request {
                    id: self.next_request,
                    seen_us,
                    valid_us,
                    command,
                    spoken,
                };
                (input, what)
            }
            Order::Host(command) => {
                if let Some(other) = self.holder.as_ref().filter(|_| !holds) {
                    let answer = self.held(n, other);
                    return self.tell(id, &answer);
                }
                let what = match &command {
                    HostCommand::Inject(fault) => Asked::Inject(*fault),
                    HostCommand::EndFault(fault) => Asked::EndFault(*fault),
                    _ => Asked::Other,
                };
                let id = self.next_request;
                (Input::Host { id, command }, what)
            }
        };
        let takes = matches!(what, Asked::Take);
        if self.robot.inputs.push(input).is_err() {
            if takes && !holds {
                self.holder = None;
            }
            return self.tell(
                id,
                &refused(n, Reason::Busy, "the queue to the robot is full"),
            );
        }
        let pending = Pending {
            client: id,
            n,
            since: Instant::now(),
            accepted: false,
            what,
        };
        self.pending.insert(self.next_request, pending);
        self.next_request = self.next_request.wrapping_add(1);
    }

    /// The answer to who wants what another holds.
    pub(super) fn held(&self, n: u64, holder: &Holder) -> Value {
        let text = format!("{:?} holds the control", holder.name);
        let mut answer = refused(n, Reason::ControlHeld, &text);
        answer["holder"] = json!(holder.name);
        answer["age_ms"] = json!(self.age_ms());
        answer
    }

    /// Time since the holder has seen the robot, ms of master time.
    pub(super) fn age_ms(&self) -> Option<u64> {
        let status = self.status?;
        let seen_us = status.lease_seen_us?;
        Some(status.now_us.saturating_sub(seen_us) / 1_000)
    }

    pub(super) fn answered(&mut self, id: u32, time_us: u64, answer: Answer) {
        let Some(pending) = self.pending.get_mut(&id) else {
            return;
        };
        let (client, n) = (pending.client, pending.n);
        if matches!(answer, Answer::Accepted) {
            pending.accepted = true;
            return self.tell(
                client,
                &json!({ "op": "answer", "n": n, "status": "accepted" }),
            );
        }
        let pending = self.pending.remove(&id);
        let message = outcome(n, time_us, &answer);
        let is_done = matches!(answer, Answer::Done);
        let holder = self.holder.as_mut().filter(|h| h.client == client);
        match (pending.map(|p| p.what), holder) {
            (Some(Asked::Take), Some(holder)) if is_done => {
                holder.granted_us.get_or_insert(time_us);
            }
            (Some(Asked::Take), Some(holder)) if holder.granted_us.is_none() => self.holder = None,
            (Some(Asked::Release), Some(_)) if is_done => self.holder = None,
            (Some(Asked::Inject(fault)), _) if is_done => {
                let lasts_us = (fault.kind.lasts_s(fault.value) * 1e6).round() as u64;
                self.faults.push((fault, time_us.saturating_add(lasts_us)));
            }
            (Some(Asked::EndFault(fault)), _) if is_done => {
                self.faults.retain(|(active, _)| *active != fault);
            }
            _ => {}
        }
        self.tell(client, &message);
    }

    pub(super) fn take_status(&mut self, status: Status) {
        // The master knows best whether anybody is in control.
        let lost = self.holder.as_ref().is_some_and(|holder| {
            let granted = holder.granted_us;
            granted.is_some_and(|us| status.now_us > us && status.lease_seen_us.is_none())
        });
        if lost {
            self.holder = None;
        }
        self.status = Some(status);
        self.faults.retain(|(_, over_us)| *over_us > status.now_us);
    }

    pub(super) fn tell_unknown(&mut self, now: Instant) {
        let late: Vec<u32> = self
            .pending
            .iter()
            .filter(|(_, pending)| !pending.accepted && now - pending.since >= TICKET)
            .map(|(id, _)| *id)
            .collect();
        for id in late {
            if let Some(Pending {
                client, n, what, ..
            }) = self.pending.remove(&id)
            {
                if matches!(what, Asked::Take)
                    && self.holder.as_ref().is_some_and(|h| h.granted_us.is_none())
                {
                    self.holder = None;
                }
                self.tell(
                    client,
                    &json!({ "op": "answer", "n": n, "status": "unknown" }),
                );
            }
        }
        // Whoever asked is gone, and nobody else is told.
        let clients = &self.clients;
        self.pending
            .retain(|_, p| clients.contains_key(&p.client) || now - p.since < TICKET);
    }
}
