//! The hub between the robot's thread and everybody who looks: it decimates and encodes each
//! sample once, knows who is in control, and answers requests. It never makes the robot wait.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::Utf8Bytes;
use serde_json::{Value, json};
use tokio::sync::watch;
use wheeleg_config::faults::FaultSpec;
use wheeleg_master::command::{Command, CommandCode};
use wheeleg_telemetry::event::hold_name;
use wheeleg_telemetry::{OwnedSample, channels, phase};

use crate::catalogue::Catalogue;
use crate::live::{Answer, Input, Moving, Report, Robot, Signals, Status};
use crate::outbox::{Close, Outbox};
use crate::reason::Reason;
use crate::record;
use crate::request::{BadRequest, Body, HostCommand, Order, Spoken};
use crate::words::{done, event_json, outcome, refused, rounded};

/// How often the rings are emptied.
pub(crate) const PERIOD: Duration = Duration::from_millis(5);
/// How often the state is told.
const STATE_PERIOD: Duration = Duration::from_millis(50);
/// How often batches are sent.
const BATCH_PERIOD: Duration = Duration::from_millis(20);
/// Time in which a command must have its ticket.
const TICKET: Duration = Duration::from_secs(2);
/// Events that are kept for who asks later.
const EVENTS: usize = 256;
/// Clients at a time; the last place is for a role that may control.
pub(crate) const CLIENTS: usize = 32;

/// What a client may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// Look and stop.
    View,
    /// Drive.
    Control,
}

impl Role {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::View => "view",
            Self::Control => "control",
        }
    }
}

/// Number of a client at the hub.
pub(crate) type ClientId = u64;

struct Subscription {
    /// `None`: all samples.
    period_ns: Option<u64>,
    next_ns: u64,
    /// Samples that the robot's ring dropped, not told yet.
    missed: u32,
}

struct Client {
    role: Role,
    name: String,
    session: String,
    outbox: Arc<Outbox>,
    subscriptions: BTreeMap<u16, Subscription>,
}

/// Who holds the control, or has asked for it.
struct Holder {
    client: ClientId,
    name: String,
    session: String,
    /// Whether the master has granted it, and at which master time.
    granted_us: Option<u64>,
}

/// A request that is not at its end.
struct Pending {
    client: ClientId,
    n: u64,
    since: Instant,
    accepted: bool,
    what: Asked,
}

enum Asked {
    Take,
    Release,
    Other,
    Inject(FaultSpec),
    EndFault(FaultSpec),
}

/// What of a channel came since the last look.
#[derive(Default)]
struct Arrived {
    /// Number of the newest sample that came.
    number: u64,
    /// All samples since the last batch, encoded, while somebody wants all.
    batch: Vec<u8>,
    count: u32,
    missed: u32,
}

struct Inner {
    robot: Channels,
    next_request: u32,
    next_client: ClientId,
    clients: BTreeMap<ClientId, Client>,
    holder: Option<Holder>,
    pending: BTreeMap<u32, Pending>,
    arrived: Vec<Arrived>,
    events: VecDeque<Value>,
    faults: Vec<(FaultSpec, u64)>,
    status: Option<Status>,
    failure: Option<String>,
    state_due: Instant,
    batch_due: Instant,
}

/// Ends of the rings.
struct Channels {
    inputs: rtrb::Producer<Input>,
    reports: rtrb::Consumer<Report>,
    samples: rtrb::Consumer<Moving>,
}

/// The hub.
pub(crate) struct Hub {
    inner: Mutex<Inner>,
    signals: Arc<Signals>,
    /// Channels and commands.
    pub(crate) catalogue: Catalogue,
    robot_name: String,
    recordings: Arc<record::Shared>,
    stops: watch::Sender<Stops>,
}

/// How far stops have come.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Stops {
    /// Number of the last one that the master has taken.
    taken: u64,
    /// It goes out: the bit is in SYNC, or the clock stands.
    sent: bool,
    /// Master time, µs.
    now_us: u64,
}

impl Hub {
    pub(crate) fn new(
        robot: Robot,
        robot_name: String,
        recordings: Arc<record::Shared>,
    ) -> (Arc<Self>, std::thread::JoinHandle<()>) {
        let now = Instant::now();
        let hub = Self {
            inner: Mutex::new(Inner {
                robot: Channels {
                    inputs: robot.inputs,
                    reports: robot.reports,
                    samples: robot.samples,
                },
                next_request: 1,
                next_client: 1,
                clients: BTreeMap::new(),
                holder: None,
                pending: BTreeMap::new(),
                arrived: channels().iter().map(|_| Arrived::default()).collect(),
                events: VecDeque::with_capacity(EVENTS),
                faults: Vec::new(),
                status: None,
                failure: None,
                state_due: now,
                batch_due: now,
            }),
            signals: robot.signals,
            catalogue: Catalogue::new(),
            robot_name,
            recordings,
            stops: watch::Sender::new(Stops::default()),
        };
        (Arc::new(hub), robot.thread)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the robot and closes everybody.
    pub(crate) fn end(&self) {
        self.signals.end();
        for client in self.inner().clients.values() {
            client.outbox.close(Close::Ended);
        }
    }

    /// Whether a client with this role finds a place.
    pub(crate) fn has_place(&self) -> bool {
        self.inner().clients.len() < CLIENTS
    }

    /// A client whose key was right.
    pub(crate) fn enter(
        &self,
        role: Role,
        name: &str,
        session: &str,
        outbox: &Arc<Outbox>,
    ) -> Option<(ClientId, u64)> {
        let mut inner = self.inner();
        let places = match role {
            Role::Control => CLIENTS,
            Role::View => CLIENTS - 1,
        };
        if inner.clients.len() >= places {
            return None;
        }
        let id = inner.next_client;
        inner.next_client += 1;
        inner.clients.insert(
            id,
            Client {
                role,
                name: name.to_owned(),
                session: session.to_owned(),
                outbox: Arc::clone(outbox),
                subscriptions: BTreeMap::new(),
            },
        );
        let now_us = inner.status.map_or(0, |status| status.now_us);
        Some((id, now_us))
    }

    /// A client is gone. Control that it holds ends with its beats, at the master.
    pub(crate) fn leave(&self, id: ClientId) {
        self.inner().clients.remove(&id);
    }

    /// What a client asks; `limited`: it asks too often.
    pub(crate) fn ask(self: &Arc<Self>, id: ClientId, n: u64, body: Body, limited: bool) {
        let mut inner = self.inner();
        match body {
            Body::Beat { seen_us } => {
                let holds = inner.holder.as_ref().is_some_and(|h| h.client == id);
                if holds {
                    self.signals.beat(seen_us);
                }
            }
            Body::Stop => {
                drop(inner);
                let hub = Arc::clone(self);
                tokio::spawn(async move {
                    let answer = match hub.stop().await {
                        Some(now_us) => done(n, now_us),
                        None => refused(
                            n,
                            Reason::NotConfirmed,
                            "NOT CONFIRMED within 200 ms: cut the air",
                        ),
                    };
                    hub.inner().tell(id, &answer);
                });
            }
            _ if limited => inner.tell(
                id,
                &refused(n, Reason::Busy, "too many frames: at most 100 per second"),
            ),
            Body::Subscribe { channels, hz } => {
                inner.subscribe(id, &channels, hz);
                inner.tell_done(id, n);
            }
            Body::Unsubscribe { channels } => {
                if let Some(client) = inner.clients.get_mut(&id) {
                    client.subscriptions.retain(|c, _| !channels.contains(c));
                }
                inner.tell_done(id, n);
            }
            Body::Refused(BadRequest { reason, text }) => {
                inner.tell(id, &refused(n, reason, &text));
            }
            Body::Give {
                order,
                spoken,
                seen_us,
                valid_us,
            } => inner.give(id, n, (order, spoken), seen_us, valid_us),
        }
    }

    /// Stops the robot; the master time at which it was confirmed, or `None` after 200 ms.
    pub(crate) async fn stop(&self) -> Option<u64> {
        let number = self.signals.stop();
        let mut stops = self.stops.subscribe();
        let confirmed = stops.wait_for(|stops| stops.taken >= number && stops.sent);
        let confirmed = tokio::time::timeout(Duration::from_millis(200), confirmed).await;
        Some(confirmed.ok()?.ok()?.now_us)
    }

    /// The state, as told to everybody.
    pub(crate) fn state(&self) -> String {
        self.state_of(&self.inner())
    }

    fn state_of(&self, inner: &Inner) -> String {
        let recording = self.recordings.status().map(|recording| {
            json!({
                "id": recording.id,
                "since_us": recording.since_us,
                "dropped": self.recordings.dropped(),
                "failure": recording.failure,
            })
        });
        inner.state(&self.robot_name, self.signals.dropped(), &recording)
    }

    /// The newest events, oldest first.
    pub(crate) fn events(&self, last: usize) -> Value {
        let inner = self.inner();
        let skip = inner.events.len().saturating_sub(last);
        let events: Vec<Value> = inner.events.iter().skip(skip).cloned().collect();
        json!({ "events": events })
    }

    /// The faults that are under way.
    pub(crate) fn active_faults(&self) -> Vec<String> {
        self.inner().active_faults()
    }

    /// Empties the rings, and tells everybody what is due.
    pub(crate) fn turn(&self) {
        let now = Instant::now();
        let mut inner = self.inner();
        let mut newest_status = None;
        while let Ok(report) = inner.robot.reports.pop() {
            match report {
                Report::Status(status) => newest_status = Some(status),
                Report::Answer {
                    id,
                    time_us,
                    answer,
                } => inner.answered(id, time_us, answer),
                Report::Failed(why) => inner.failure = Some(why.to_string()),
            }
        }
        if let Some(status) = newest_status {
            inner.take_status(status);
            self.stops.send_replace(Stops {
                taken: status.stops,
                sent: status.emergency_stop || status.pace.paused,
                now_us: status.now_us,
            });
        }
        for (id, what) in self.recordings.take_answers() {
            let answer = what.map_or_else(Answer::NotRecorded, |()| Answer::Done);
            let now_us = inner.now_us();
            inner.answered(id, now_us, answer);
        }
        inner.take_samples();
        if now >= inner.batch_due {
            inner.batch_due = now + BATCH_PERIOD;
            inner.send_batches();
        }
        if now >= inner.state_due {
            inner.state_due = now + STATE_PERIOD;
            inner.tell_unknown(now);
            let state = self.state_of(&inner);
            inner.tell_state(state);
        }
    }
}

impl Inner {
    fn tell(&self, id: ClientId, message: &Value) {
        if let Some(client) = self.clients.get(&id) {
            client.outbox.ordered(message.to_string().into());
        }
    }

    fn now_us(&self) -> u64 {
        self.status.map_or(0, |status| status.now_us)
    }

    fn tell_done(&self, id: ClientId, n: u64) {
        self.tell(id, &done(n, self.now_us()));
    }

    fn subscribe(&mut self, id: ClientId, channels: &[u16], hz: Option<u32>) {
        let Some(client) = self.clients.get_mut(&id) else {
            return;
        };
        for &channel in channels {
            let subscription = Subscription {
                period_ns: hz.map(|hz| 1_000_000_000 / u64::from(hz.max(1))),
                next_ns: 0,
                missed: 0,
            };
            client.subscriptions.insert(channel, subscription);
        }
    }

    fn give(
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
    fn held(&self, n: u64, holder: &Holder) -> Value {
        let text = format!("{:?} holds the control", holder.name);
        let mut answer = refused(n, Reason::ControlHeld, &text);
        answer["holder"] = json!(holder.name);
        answer["age_ms"] = json!(self.age_ms());
        answer
    }

    /// Time since the holder has seen the robot, ms of master time.
    fn age_ms(&self) -> Option<u64> {
        let status = self.status?;
        let seen_us = status.lease_seen_us?;
        Some(status.now_us.saturating_sub(seen_us) / 1_000)
    }

    fn answered(&mut self, id: u32, time_us: u64, answer: Answer) {
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

    fn take_status(&mut self, status: Status) {
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

    fn tell_unknown(&mut self, now: Instant) {
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

    fn take_samples(&mut self) {
        let mut wanted = vec![(false, false); self.arrived.len()];
        for client in self.clients.values() {
            for (channel, subscription) in &client.subscriptions {
                match subscription.period_ns {
                    Some(_) => wanted[usize::from(*channel)].0 = true,
                    None => wanted[usize::from(*channel)].1 = true,
                }
            }
        }
        let mut newest: BTreeMap<u16, Moving> = BTreeMap::new();
        let mut missed: BTreeMap<u16, u32> = BTreeMap::new();
        for _ in 0..crate::live::SAMPLES {
            let Ok(moving) = self.robot.samples.pop() else {
                break;
            };
            let channel = usize::from(moving.channel);
            let arrived = &mut self.arrived[channel];
            let gap = moving.number - arrived.number - 1;
            arrived.number = moving.number;
            if let OwnedSample::Event(event) = &moving.sample {
                let event = event_json(moving.t_ns, event);
                tell_event(&self.clients, &mut self.events, event);
            }
            let (some, all) = wanted[channel];
            if gap > 0 {
                let gap = u32::try_from(gap).unwrap_or(u32::MAX);
                arrived.missed = arrived.missed.saturating_add(gap);
                *missed.entry(moving.channel).or_default() += gap;
            }
            if all {
                arrived.batch.extend_from_slice(&moving.t_ns.to_le_bytes());
                moving.sample.pack(&mut arrived.batch);
                arrived.count += 1;
            }
            if some {
                newest.insert(moving.channel, moving);
            }
        }
        let mut encoded: BTreeMap<u16, Bytes> = BTreeMap::new();
        for client in self.clients.values_mut() {
            for (channel, subscription) in &mut client.subscriptions {
                let (Some(period_ns), Some(moving)) = (subscription.period_ns, newest.get(channel))
                else {
                    continue;
                };
                subscription.missed += missed.get(channel).copied().unwrap_or(0);
                if moving.t_ns < subscription.next_ns {
                    continue;
                }
                subscription.next_ns = (moving.t_ns / period_ns + 1) * period_ns;
                let body = encoded.entry(*channel).or_insert_with(|| encode(moving));
                let missed = std::mem::take(&mut subscription.missed);
                client.outbox.newest(*channel, missed, body.clone());
            }
        }
    }

    fn send_batches(&mut self) {
        for (channel, arrived) in self.arrived.iter_mut().enumerate() {
            let missed = std::mem::take(&mut arrived.missed);
            if arrived.count == 0 {
                continue;
            }
            let body = Bytes::from(std::mem::take(&mut arrived.batch));
            let count = std::mem::take(&mut arrived.count);
            let channel = channel as u16;
            for client in self.clients.values() {
                let subscription = client.subscriptions.get(&channel);
                if subscription.is_some_and(|s| s.period_ns.is_none()) {
                    client.outbox.batch(channel, count, missed, body.clone());
                }
            }
        }
    }

    fn active_faults(&self) -> Vec<String> {
        let text = |(fault, _): &(FaultSpec, u64)| {
            let text = fault.to_string();
            // Its time is that of its begin, which is always now.
            text.split('@').next().unwrap_or_default().to_owned()
        };
        self.faults.iter().map(text).collect()
    }

    fn tell_state(&self, text: String) {
        let text = Utf8Bytes::from(text);
        for client in self.clients.values() {
            client.outbox.state(text.clone());
        }
    }

    fn state(&self, robot: &str, dropped: u64, recording: &Option<Value>) -> String {
        let Some(status) = self.status else {
            return r#"{"op":"state","master_us":0,"alive":false}"#.to_owned();
        };
        let holder = self.holder.as_ref().filter(|h| h.granted_us.is_some());
        let control = holder.map(|holder| {
            json!({ "holder": holder.name, "session": holder.session, "age_ms": self.age_ms() })
        });
        let boards = (1..).zip(&status.boards).map(|(address, board): (u8, _)| {
            let faults = board.faults.iter().map(|fault| {
                json!({
                    "number": fault.code(),
                    "name": fault.name(),
                    "cause": fault.sentence(),
                    "remedy": fault.remedy(),
                })
            });
            json!({
                "address": address,
                "present": board.mode.is_some(),
                "mode": board.mode.map(|mode| mode.name().to_ascii_lowercase()),
                "faults": faults.collect::<Vec<_>>(),
            })
        });
        let pace = status.pace;
        json!({
            "op": "state",
            "master_us": status.now_us,
            "alive": status.alive,
            "ready": status.ready,
            "armed": status.armed,
            "hold": status.hold.as_ref().map(hold_name),
            "emergency_stop": status.emergency_stop,
            "phase": phase::name(status.phase),
            "stepping": status.phase.is_stepping(),
            "step": status.step,
            "robot": robot,
            "simulated": true,
            "failure": self.failure,
            "control": control,
            "pace": {
                "speed": pace.speed,
                "paused": pace.paused,
                "factor": rounded(pace.factor),
                "late_ms": rounded(pace.late_ms),
                "late_max_ms": rounded(pace.late_max_ms),
                "shifts": pace.shifts,
                "dropped": dropped,
            },
            "faults": self.active_faults(),
            "recording": recording,
            "boards": boards.collect::<Vec<_>>(),
            "clients": self.clients.len(),
        })
        .to_string()
    }
}

fn encode(moving: &Moving) -> Bytes {
    let mut out = Vec::with_capacity(160);
    out.extend_from_slice(&moving.t_ns.to_le_bytes());
    moving.sample.pack(&mut out);
    out.into()
}

fn tell_event(clients: &BTreeMap<ClientId, Client>, events: &mut VecDeque<Value>, event: Value) {
    let text = Utf8Bytes::from(event.to_string());
    for client in clients.values() {
        client.outbox.ordered(text.clone());
    }
    if events.len() == EVENTS {
        events.pop_front();
    }
    events.push_back(event);
}
