//! The hub between the robot's thread and all clients: it decimates and encodes each sample once, knows who
//! is in control, and answers requests. It never makes the robot wait.

mod control;
mod history;
mod samples;
mod state;
mod stops;
mod viewers;

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::Utf8Bytes;
use serde_json::{Value, json};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use wheeleg_config::faults::FaultSpec;
use wheeleg_telemetry::channels;

use self::history::{History, Reader};
use self::stops::{AskedStops, Stopped};
use crate::catalogue::Catalogue;
use crate::close::Close;
use crate::foxglove::Viewers;
use crate::live::{Answer, Input, Moving, Report, Robot, Signals, Status};
use crate::messages::{done, refused};
use crate::outbox::Outbox;
use crate::record;
use wheeleg_access::desk::{ClientId, Desk};
use wheeleg_access::reason::Reason;
use wheeleg_access::request::{BadRequest, Body};

/// How often the rings are emptied.
pub(crate) const PERIOD: Duration = Duration::from_millis(5);
/// How often the state is sent.
const STATE_PERIOD: Duration = Duration::from_millis(50);
/// How often batches are sent.
const BATCH_PERIOD: Duration = Duration::from_millis(20);
/// Time in which a command must have its ticket.
const TICKET: Duration = Duration::from_secs(2);
/// Events kept for clients that ask later.
pub const EVENTS: usize = 256;
/// Stops of one connection that may wait for an answer.
const STOPS: usize = 16;
/// Clients at a time; the last place is for a role that may control.
pub(crate) const CLIENTS: usize = 32;

/// Rights of a client.
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

struct Subscription {
    /// `None`: all samples.
    period_ns: Option<u64>,
    next_ns: u64,
    /// Samples that the robot's ring dropped, not reported yet.
    missed: u32,
}

struct Client {
    role: Role,
    name: String,
    session: String,
    outbox: Arc<Outbox>,
    subscriptions: BTreeMap<u16, Subscription>,
    /// It is on the robot's own computer.
    is_local: bool,
    /// It writes parameters for a viewer, and asks nobody to make room for it.
    writes: bool,
}

/// A request that has not ended.
struct Pending {
    client: ClientId,
    n: u64,
    since: Instant,
    /// Master time at which the master accepted it, µs.
    accepted_us: Option<u64>,
    what: Asked,
}

enum Asked {
    Take,
    Release,
    /// A release for another client.
    HandOver(ClientId),
    /// How long control is then reserved for the robot's own computer.
    Revoke {
        hold: Duration,
    },
    Other,
    Inject(FaultSpec),
    EndFault(FaultSpec),
}

impl Asked {
    /// Whether its answer decides if the asker is in control.
    fn is_of_control(&self) -> bool {
        matches!(self, Self::Take | Self::Release | Self::HandOver(_))
    }
}

/// A client's connection, for its requests.
pub(crate) struct Asking {
    id: ClientId,
    stops: StopsUnderWay,
}

/// Limits the stops of one connection that wait for an answer. A client that asks for more is not read until
/// then, and costs nobody else time or memory.
pub(crate) struct StopsUnderWay(Arc<Semaphore>);

impl StopsUnderWay {
    pub(crate) fn new() -> Self {
        Self(Arc::new(Semaphore::new(STOPS)))
    }

    /// Begins the next one, when it may; it ends when the permit is dropped.
    pub(crate) async fn begin(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.0).acquire_owned().await.ok()
    }
}

/// Samples of a channel since the last turn.
#[derive(Default)]
struct Arrived {
    /// Number of the newest sample received.
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
    viewers: Viewers,
    desk: Desk,
    /// The holder of control that was last notified of a request for it, and when.
    asked: Option<(ClientId, Instant)>,
    /// Name of the client that was in control last.
    last_holder: String,
    /// Its connection ended while it was in control.
    last_is_gone: bool,
    /// Name of the client that took control away from it.
    revoked_by: Option<String>,
    pending: BTreeMap<u32, Pending>,
    arrived: Vec<Arrived>,
    history: History,
    /// The newest events, each as it was sent.
    events: VecDeque<Utf8Bytes>,
    faults: Vec<(FaultSpec, u64)>,
    /// The stop that is latched, or has just been asked for.
    stopped: Option<Stopped>,
    asked_stops: AskedStops,
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

pub(crate) use history::LONGEST_S;
pub(crate) use stops::StopBy;
pub(crate) use viewers::Looking;

/// The hub.
pub(crate) struct Hub {
    inner: Mutex<Inner>,
    signals: Arc<Signals>,
    /// Channels and commands.
    pub(crate) catalogue: Catalogue,
    pub(crate) robot_name: String,
    recordings: Arc<record::Shared>,
    stops: watch::Sender<Stops>,
    asked_stops: AskedStops,
}

/// Progress of stops.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Stops {
    /// Number of the last one that the master has accepted.
    taken: u64,
    /// It is being sent: the next SYNC has its bit, and a board answered the last one; or the clock stands.
    sent: bool,
    /// Master time, µs.
    now_us: u64,
}

impl Hub {
    pub(crate) fn new(
        robot: Robot,
        robot_name: String,
        recordings: Arc<record::Shared>,
        viewers: Viewers,
    ) -> (Arc<Self>, std::thread::JoinHandle<()>) {
        let now = Instant::now();
        let asked_stops = AskedStops::default();
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
                viewers,
                desk: Desk::default(),
                asked: None,
                last_holder: String::new(),
                last_is_gone: false,
                revoked_by: None,
                pending: BTreeMap::new(),
                history: History::new(),
                arrived: channels().iter().map(|_| Arrived::default()).collect(),
                events: VecDeque::with_capacity(EVENTS),
                faults: Vec::new(),
                stopped: None,
                asked_stops: asked_stops.clone(),
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
            asked_stops,
        };
        (Arc::new(hub), robot.thread)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the robot and closes all connections.
    pub(crate) fn end(&self) {
        self.signals.end();
        let inner = self.inner();
        for client in inner.clients.values() {
            client.outbox.close(Close::Ended);
        }
        inner.viewers.close(Close::Ended);
    }

    /// Whether there is a place for a client with this role.
    pub(crate) fn has_place(&self) -> bool {
        self.inner().taken_places() < CLIENTS
    }

    /// Adds a client whose key was right.
    pub(crate) fn enter(
        &self,
        role: Role,
        (name, session): (&str, &str),
        is_local: bool,
        outbox: &Arc<Outbox>,
    ) -> Option<(Asking, u64)> {
        let mut inner = self.inner();
        let places = match role {
            Role::Control => CLIENTS,
            Role::View => CLIENTS - 1,
        };
        if inner.taken_places() >= places {
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
                is_local,
                writes: false,
            },
        );
        let now_us = inner.status.map_or(0, |status| status.now_us);
        let stops = StopsUnderWay::new();
        Some((Asking { id, stops }, now_us))
    }

    /// Removes a client. Without its beats the master ends its lease.
    pub(crate) fn leave(&self, asking: &Asking) {
        let mut inner = self.inner();
        inner.clients.remove(&asking.id);
        inner.last_is_gone |= inner.desk.holds(asking.id);
        inner.desk.leave(asking.id);
    }

    /// Handles a client's request; `limited`: it asks too often.
    pub(crate) async fn ask(self: &Arc<Self>, asking: &Asking, n: u64, body: Body, limited: bool) {
        let id = asking.id;
        if matches!(body, Body::Stop) {
            let under_way = asking.stops.begin().await;
            let hub = Arc::clone(self);
            tokio::spawn(async move {
                let answer = match hub.stop(StopBy::Client(id)).await {
                    Some(now_us) => done(n, now_us),
                    None => refused(
                        n,
                        Reason::NotConfirmed,
                        "NOT CONFIRMED within 200 ms: cut the air",
                    ),
                };
                hub.inner().tell(id, &answer);
                drop(under_way);
            });
            return;
        }
        let mut inner = self.inner();
        match body {
            Body::Beat { seen_us } => {
                if inner.desk.holds(id) {
                    self.signals.beat(seen_us);
                }
            }
            // Handled above: it waits for its answer without the lock.
            Body::Stop => {}
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

    /// Stops the robot; returns the master time of the confirmation, or `None` after 200 ms.
    pub(crate) async fn stop(&self, by: StopBy) -> Option<u64> {
        // The stop waits for nothing slow.
        let number = self.asked_stops.stop(&self.signals, by);
        self.inner().name_stops();
        let mut stops = self.stops.subscribe();
        let confirmed = stops.wait_for(|stops| stops.taken >= number && stops.sent);
        let confirmed = tokio::time::timeout(Duration::from_millis(200), confirmed).await;
        Some(confirmed.ok()?.ok()?.now_us)
    }

    /// The state, as sent to all clients.
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
    pub(crate) fn events(&self, last: usize) -> String {
        let inner = self.inner();
        let skip = inner.events.len().saturating_sub(last);
        let events: Vec<Utf8Bytes> = inner.events.iter().skip(skip).cloned().collect();
        drop(inner);
        let events: Vec<&str> = events.iter().map(Utf8Bytes::as_str).collect();
        format!(r#"{{"events":[{}]}}"#, events.join(","))
    }

    /// A reader of the samples of a channel in the last seconds of master time.
    pub(crate) fn reader(&self, channel: u16, seconds: u8) -> Reader {
        let inner = self.inner();
        let now_ns = inner.now_us() * 1_000;
        let from_ns = now_ns.saturating_sub(u64::from(seconds) * 1_000_000_000);
        inner.history.reader(channel, from_ns)
    }

    /// Its next samples, at most `most`, the oldest first, each as in a frame; none: there are no more.
    /// Samples that are no longer kept are left out: a slow reader holds nothing back.
    pub(crate) fn samples(&self, reader: &mut Reader, most: usize) -> Vec<Bytes> {
        self.inner().history.read(reader, most)
    }

    /// The boards' parameters.
    pub(crate) fn parameters(&self) -> String {
        self.inner().viewers.parameters.document().to_owned()
    }

    /// The faults that are under way.
    pub(crate) fn active_faults(&self) -> Vec<String> {
        self.inner().active_faults()
    }

    /// Empties the rings, and sends all clients the due messages.
    pub(crate) fn turn(&self) {
        let now = Instant::now();
        let mut inner = self.inner();
        inner.name_stops();
        let mut newest_status = None;
        while let Ok(report) = inner.robot.reports.pop() {
            match report {
                Report::Status(status) => newest_status = Some(status),
                Report::Answer {
                    id,
                    time_us,
                    answer,
                } => inner.answered(id, time_us, answer),
                Report::Parameter { board, id, raw } => inner.viewers.told((board, id), raw),
                Report::Failed(why) => inner.failure = Some(why.to_string()),
            }
        }
        if let Some(status) = newest_status {
            inner.take_status(status);
            self.stops.send_replace(Stops {
                taken: status.stops,
                // If no board answers, nobody knows whether any of them hears it.
                sent: (status.emergency_stop && status.hears()) || status.pace.paused,
                now_us: status.now_us,
            });
        }
        for (id, what) in self.recordings.take_answers() {
            let answer = what.map_or_else(Answer::NotRecorded, |()| Answer::Done);
            let now_us = inner.now_us();
            inner.answered(id, now_us, answer);
        }
        inner.take_samples();
        inner.viewers.draw_contacts();
        if now >= inner.batch_due {
            inner.batch_due = now + BATCH_PERIOD;
            inner.send_batches();
            inner.viewers.tell_time(inner.now_us() * 1_000);
        }
        if now >= inner.state_due {
            inner.state_due = now + STATE_PERIOD;
            inner.tell_unknown(now);
            self.signals.connected(inner.taken_places());
            let state = self.state_of(&inner);
            inner.tell_state(state);
        }
    }
}

impl Inner {
    /// Places taken by clients and viewers.
    fn taken_places(&self) -> usize {
        self.clients.len() + self.viewers.count()
    }

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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn of_one_connection_some_stops_are_under_way_at_a_time() {
        let stops = StopsUnderWay::new();
        let mut under_way = Vec::new();
        for _ in 0..STOPS {
            under_way.push(stops.begin().await.expect("it begins"));
        }
        let short = Duration::from_millis(20);
        let next = tokio::time::timeout(short, stops.begin()).await;
        assert!(next.is_err(), "one more than allowed");
        under_way.pop();
        let next = tokio::time::timeout(short, stops.begin()).await;
        assert!(next.is_ok_and(|next| next.is_some()), "it ended");
    }
}
