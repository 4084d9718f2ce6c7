//! Control of the robot, and requests from their begin to their end.

use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use wheeleg_master::command::{Command, CommandCode};

use super::{Asked, Client, Inner, Pending, Role, TICKET};
use crate::live::{Answer, Input, Status};
use crate::messages::{outcome, refused};
use wheeleg_access::desk::{Asker, ClientId, Denied, Ended};
use wheeleg_access::host::SPEED_OF_CONTROL;
use wheeleg_access::reason::Reason;
use wheeleg_access::request::{HostCommand, Order, Spoken};

const RELEASE: CommandCode = CommandCode::ReleaseControl;
/// The holder of control is notified of requests for it at most this often: a client that asks without end,
/// on however many connections, cannot fill the holder's queue.
const ASKED: Duration = Duration::from_secs(1);
/// Master time within which it has answered an accepted request for control: at its next cycle.
const CONTROL_US: u64 = 1_000_000;

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
            let text =
                "the view key allows viewing and stopping only; connect with the control key";
            return self.tell(id, &refused(n, Reason::Role, text));
        }
        let now = Instant::now();
        self.desk.free(now);
        let holds = self.desk.holds(id);
        let (input, what) = match order {
            Order::Robot(Command::EmergencyStop) => {
                let text = "a stop is not a queued command: send {\"op\":\"stop\"}";
                return self.tell(id, &refused(n, Reason::BadCommand, text));
            }
            Order::Robot(command) => {
                let takes = command.code() == CommandCode::TakeControl;
                // The master's answers may come in an unexpected order: a release sent behind a grant would
                // leave the master with a holder that nobody here knows.
                if takes
                    && self
                        .pending
                        .values()
                        .any(|p| p.client == id && p.what.is_of_control())
                {
                    let text = "what was asked for the control before is not answered yet";
                    return self.tell(id, &refused(n, Reason::Busy, text));
                }
                let asker = Asker {
                    client: id,
                    name: &client.name,
                    session: &client.session,
                    is_local: client.is_local,
                };
                match self.desk.ask(asker, takes) {
                    Ok(()) => {}
                    Err(Denied::Revoked) => {
                        return self.tell(id, &outcome(n, self.now_us(), &Answer::Revoked));
                    }
                    Err(Denied::Held) => {
                        // A holder who has ended is not notified; the next one is.
                        let holder = self.desk.holder().filter(|h| h.ended.is_none());
                        let holder = holder.map(|holder| holder.client);
                        let told = self
                            .asked
                            .is_some_and(|(told, at)| holder == Some(told) && now - at < ASKED);
                        if let Some(holder) = holder.filter(|_| !told && !client.writes) {
                            self.asked = Some((holder, now));
                            let asked = json!({ "op": "asked", "by": client.name, "session": client.session });
                            self.tell(holder, &asked);
                        }
                        return self.tell(id, &self.held(n, now));
                    }
                    Err(Denied::NotInControl) => {
                        let text = "take control first";
                        return self.tell(id, &refused(n, Reason::NotInControl, text));
                    }
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
                    by: takes.then(|| client.name.clone()),
                };
                (input, what)
            }
            Order::HandOver(to) => {
                if !holds {
                    let text = "take control first";
                    return self.tell(id, &refused(n, Reason::NotInControl, text));
                }
                let drives = |(other, client): &(&ClientId, &Client)| {
                    client.session == to && client.role == Role::Control && **other != id
                };
                let Some((&heir, _)) = self.clients.iter().find(drives) else {
                    let text = "`to`: no other client with the role `control` has this session";
                    return self.tell(id, &refused(n, Reason::BadArgument, text));
                };
                let spoken = Spoken {
                    cmd: RELEASE.name().to_owned(),
                    args: Map::new(),
                };
                let input = Input::Request {
                    id: self.next_request,
                    seen_us,
                    valid_us,
                    command: Command::ReleaseControl,
                    spoken,
                    by: None,
                };
                (input, Asked::HandOver(heir))
            }
            Order::Revoke { hold } => {
                if !client.is_local {
                    let text = "control can be revoked only on the robot's own computer";
                    return self.tell(id, &refused(n, Reason::Role, text));
                }
                let by = client.name.clone();
                let Some(holder) = self.desk.holder().map(|holder| holder.name.clone()) else {
                    // If nobody is in control, there is nothing to take away.
                    return self.tell_done(id, n);
                };
                let id = self.next_request;
                (Input::Revoked { id, holder, by }, Asked::Revoke { hold })
            }
            Order::Host(command) => {
                // The person at the robot's computer may inject faults while another drives.
                let breaks = matches!(command, HostCommand::Inject(_) | HostCommand::EndFault(_));
                let may_break = breaks && client.is_local;
                if !self.desk.may_command_host(id) && !may_break {
                    return self.tell(id, &self.held(n, now));
                }
                // The robot's thread judges the speed for a granted lease, not for a future one.
                let speeds =
                    matches!(command, HostCommand::Speed(speed) if speed > SPEED_OF_CONTROL);
                let mut pending = self.pending.values();
                if speeds && pending.any(|p| matches!(p.what, Asked::Take)) {
                    return self.tell(id, &outcome(n, self.now_us(), &Answer::TooFast));
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
        let revokes = match what {
            Asked::Revoke { hold } => Some(hold),
            _ => None,
        };
        if self.robot.inputs.push(input).is_err() {
            if takes && !holds {
                self.desk.withdraw(id);
            }
            return self.tell(
                id,
                &refused(n, Reason::Busy, "the queue to the robot is full"),
            );
        }
        if let Some(hold) = revokes {
            self.revoke(id, hold);
        }
        let pending = Pending {
            client: id,
            n,
            since: now,
            accepted_us: None,
            what,
        };
        self.pending.insert(self.next_request, pending);
        self.next_request = self.next_request.wrapping_add(1);
    }

    /// The answer to a client that asks for control while another holds it.
    fn held(&self, n: u64, now: Instant) -> Value {
        let name = self.desk.name().unwrap_or_default();
        let text = match self.desk.holder().map(|holder| holder.ended) {
            Some(None) => format!(
                "{name:?} has control: wait until it is released, or end it on the robot's computer with `wheeleg ctl revoke`"
            ),
            Some(Some(_)) => format!(
                "{name:?} is no longer in control, but its lease is not over: resume the clock if it is paused, then ask again"
            ),
            None => format!(
                "control is reserved for {name} for {:.0} s: ask again then",
                self.desk.reserved_for(now).as_secs_f64().ceil()
            ),
        };
        let mut answer = refused(n, Reason::ControlHeld, &text);
        answer["holder"] = json!(name);
        answer["age_ms"] = json!(self.age_ms());
        answer
    }

    /// Time since the holder last saw the robot, ms of master time.
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
            pending.accepted_us = Some(time_us);
            return self.tell(
                client,
                &json!({ "op": "answer", "n": n, "status": "accepted" }),
            );
        }
        let pending = self.pending.remove(&id);
        let mut message = outcome(n, time_us, &answer);
        let is_done = matches!(answer, Answer::Done);
        match pending.map(|p| p.what) {
            Some(Asked::Take) if is_done => {
                if !self.desk.grant(client, time_us) {
                    // The master has granted control that was revoked here. Nobody sends beats for it.
                    message = outcome(n, time_us, &Answer::Revoked);
                }
                if let Some(holder) = self.desk.holder().filter(|h| h.client == client) {
                    self.last_holder.clone_from(&holder.name);
                    self.last_is_gone = holder.ended == Some(Ended::Gone);
                    if holder.ended != Some(Ended::Revoked) {
                        self.revoked_by = None;
                    }
                }
            }
            Some(Asked::Take) => self.desk.withdraw(client),
            Some(Asked::Release) if is_done => self.desk.release(client),
            Some(Asked::HandOver(heir)) if is_done => self.handed_over(client, heir),
            Some(Asked::Inject(fault)) if is_done => {
                let lasts_us = (fault.kind.lasts_s(fault.value) * 1e6).round() as u64;
                self.faults.push((fault, time_us.saturating_add(lasts_us)));
            }
            Some(Asked::EndFault(fault)) if is_done => {
                self.faults.retain(|(active, _)| *active != fault);
            }
            _ => {}
        }
        self.tell(client, &message);
    }

    fn handed_over(&mut self, client: ClientId, heir: ClientId) {
        // If one of them is gone by now, it is a release.
        self.desk.release(client);
        let [from, to] = [client, heir].map(|id| self.clients.get(&id));
        let (Some(from), Some(to)) = (from, to) else {
            return;
        };
        let offered = json!({ "op": "offered", "by": from.name });
        let who = (&*to.name, &*to.session);
        self.desk.hand_over(client, heir, who, Instant::now());
        self.tell(heir, &offered);
    }

    /// A client ends the control of the holder, or of the client that has asked for it: from now on none of
    /// its commands or beats reach the robot, so the master ends the lease.
    fn revoke(&mut self, by: ClientId, hold: Duration) {
        let Some(client) = self.clients.get(&by) else {
            return;
        };
        let Some(holder) = self.desk.revoke(hold) else {
            return;
        };
        self.last_holder.clone_from(&holder.name);
        self.revoked_by = Some(client.name.clone());
        let (holder, revoked) = (holder.client, json!({ "op": "revoked", "by": client.name }));
        self.tell(holder, &revoked);
        // Its hand-over is a release now: control is reserved already.
        for pending in self.pending.values_mut() {
            if matches!(pending.what, Asked::HandOver(_)) {
                pending.what = Asked::Release;
            }
        }
    }

    pub(super) fn take_status(&mut self, status: Status) {
        self.desk
            .look(status.now_us, status.lease_seen_us.is_some());
        self.desk.free(Instant::now());
        self.look_at_stops(&status);
        self.status = Some(status);
        self.faults.retain(|(_, over_us)| *over_us > status.now_us);
    }

    pub(super) fn tell_unknown(&mut self, now: Instant) {
        let now_us = self.now_us();
        let is_late = |pending: &Pending| match pending.accepted_us {
            None => now - pending.since >= TICKET,
            // A master that has died since does not answer.
            Some(us) => pending.what.is_of_control() && now_us > us + CONTROL_US,
        };
        let late: Vec<u32> = self
            .pending
            .iter()
            .filter(|(_, pending)| is_late(pending))
            .map(|(id, _)| *id)
            .collect();
        for id in late {
            if let Some(Pending {
                client, n, what, ..
            }) = self.pending.remove(&id)
            {
                if matches!(what, Asked::Take) {
                    self.desk.withdraw(client);
                }
                self.tell(
                    client,
                    &json!({ "op": "answer", "n": n, "status": "unknown" }),
                );
            }
        }
        // The asker is gone, and nobody else needs the answer. Requests for control stay pending: the master
        // may still grant them.
        let clients = &self.clients;
        self.pending.retain(|_, p| {
            clients.contains_key(&p.client) || now - p.since < TICKET || p.what.is_of_control()
        });
    }
}
