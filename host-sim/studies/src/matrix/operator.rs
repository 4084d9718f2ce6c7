//! An operator at a console, in simulated time and without a network: frames, doors and desk are those of the
//! server, and a script replaces the line between them.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use wheeleg_access::Key;
use wheeleg_access::desk::{Asker, ClientId, Desk};
use wheeleg_access::door::{Door, Entered};
use wheeleg_access::request::{Body, Order};
use wheeleg_master::command::CommandCode;
use wheeleg_master::dispatcher::Request;
use wheeleg_master::layer0::operator::OPERATOR_CLIENT;
use wheeleg_sim::Session;
use wheeleg_telemetry::Recorder;

use super::row::Connection;

/// Delay of a frame, µs, and of the robot's state for the operator.
const DELAY_US: u64 = 5_000;
/// The same on a slow line: more than the operator may be late.
const SLOW_US: u64 = 500_000;
/// How often the operator gets the robot's state, µs.
const PICTURE_US: u64 = 10_000;
/// How often the operator sends a beat, ms.
const BEAT_MS: u64 = 50;
/// How long the line is cut before the operator reconnects, ms.
const CUT_MS: u64 = 1_000;
/// Commands given meanwhile.
const QUEUED: u64 = 1_000;
/// How often an intruder tries, ms.
const INTRUDER_MS: u64 = 20;
/// Validity of a command, ms.
const VALID_MS: u64 = 500;

/// The robot, and its recorder.
pub(super) struct Robot<'a, 'r> {
    pub(super) session: &'a mut Session,
    pub(super) recorder: &'a mut Recorder<'r>,
}

impl Robot<'_, '_> {
    fn now_us(&self) -> u64 {
        self.session.now_ns() / 1_000
    }
}

/// Frames that must have no effect.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Intrusion {
    /// Number of frames.
    pub(super) frames: u32,
    /// Number of those that had an effect.
    pub(super) taken: u32,
}

/// A client and its side of the door.
struct Client {
    id: ClientId,
    key: Key,
    door: Door,
    n: u64,
}

impl Client {
    fn new(id: ClientId, begin: Instant) -> Self {
        // A different key for each session, as from the handshake.
        let key = Key::new([0x40 + id as u8; 32]);
        Self {
            id,
            door: Door::new(key.clone(), begin),
            key,
            n: 0,
        }
    }

    fn frame(&mut self, mut frame: Value) -> Vec<u8> {
        self.n += 1;
        frame["n"] = json!(self.n);
        self.key.seal(frame.to_string().as_bytes())
    }

    fn command(&mut self, seen_us: u64, name: &str, args: Value) -> Vec<u8> {
        self.frame(json!({ "seen_us": seen_us, "valid_ms": VALID_MS, "cmd": name, "args": args }))
    }
}

/// The server's side: who is in control, and what is passed to the master.
struct Counter {
    desk: Desk,
    /// The wall clock at power-up; only its differences count.
    begin: Instant,
    next_request: u32,
}

impl Counter {
    fn wall(&self, now_us: u64) -> Instant {
        self.begin + Duration::from_micros(now_us)
    }

    /// A frame arrives at a client's door; true if it has an effect.
    fn arrive(&mut self, client: &mut Client, frame: &[u8], robot: &mut Robot<'_, '_>) -> bool {
        let now_us = robot.now_us();
        let Some(Entered { body, limited, .. }) = client.door.open(frame, self.wall(now_us)) else {
            return false;
        };
        match body {
            Body::Beat { seen_us } => {
                let holds = self.desk.holds(client.id);
                if holds {
                    robot.session.beat(seen_us);
                }
                holds
            }
            Body::Give {
                order: Order::Robot(command),
                seen_us,
                valid_us,
                ..
            } if !limited && seen_us <= now_us => {
                let takes = command.code() == CommandCode::TakeControl;
                let name = format!("client {}", client.id);
                let asker = Asker {
                    client: client.id,
                    name: &name,
                    session: &name,
                    is_local: false,
                };
                if self.desk.ask(asker, takes).is_err() {
                    return false;
                }
                self.next_request += 1;
                let request = Request {
                    client: OPERATOR_CLIENT,
                    id: self.next_request,
                    deadline_us: seen_us + valid_us,
                    command,
                };
                let answer = robot.session.request(request, robot.recorder);
                matches!(answer, Some(Ok(_)))
            }
            _ => false,
        }
    }

    /// Takes the master's state of control.
    fn look(&mut self, session: &Session) {
        let now_us = session.now_ns() / 1_000;
        let held = session.master().layer0().lease().is_held();
        if let Some(client) = self.desk.holder().map(|h| h.client).filter(|_| held) {
            self.desk.grant(client, now_us);
        }
        self.desk.look(now_us, held);
    }
}

/// An operator in control while a robot walks, and the failure of the connection.
pub(super) struct Operator {
    connection: Connection,
    counter: Counter,
    holder: Client,
    intruder: Client,
    /// Frames on their way, with their time of arrival, µs.
    line: Vec<(u64, Vec<u8>)>,
    /// Newest master time shown to the operator, µs.
    shown_us: u64,
    /// Frames of the holder that an intruder has kept.
    kept: Vec<Vec<u8>>,
    /// Frames that must have no effect.
    pub(super) intrusion: Intrusion,
}

impl Operator {
    pub(super) fn new(connection: Connection) -> Self {
        let begin = Instant::now();
        Self {
            connection,
            counter: Counter {
                desk: Desk::default(),
                begin,
                next_request: 0,
            },
            holder: Client::new(1, begin),
            intruder: Client::new(2, begin),
            line: Vec::new(),
            shown_us: 0,
            kept: Vec::new(),
            intrusion: Intrusion::default(),
        }
    }

    /// Runs a millisecond of the scenario, its number `ms`; `since_ms`: after the instant.
    pub(super) fn tick(&mut self, ms: u64, since_ms: Option<u64>, robot: &mut Robot<'_, '_>) {
        let now_us = robot.now_us();
        self.counter.look(robot.session);
        let cut = match (self.connection, since_ms) {
            (Connection::Lost, Some(_)) => true,
            (Connection::Reconnects, Some(since)) => since < CUT_MS,
            _ => false,
        };
        let blind = cut || (self.connection == Connection::HalfOpen && since_ms.is_some());
        if !blind {
            let picture_us = now_us.saturating_sub(DELAY_US) / PICTURE_US * PICTURE_US;
            self.shown_us = self.shown_us.max(picture_us);
        }
        let delay_us = match (self.connection, since_ms) {
            (Connection::Slow, Some(_)) => SLOW_US,
            _ => DELAY_US,
        };
        if (self.connection, since_ms) == (Connection::Reconnects, Some(CUT_MS)) {
            self.reconnect(now_us, robot);
        }
        let frame = match ms {
            0 => Some(self.holder.command(self.shown_us, "TakeControl", json!({}))),
            _ if ms.is_multiple_of(BEAT_MS) => {
                let beat = json!({ "op": "beat", "seen_us": self.shown_us });
                Some(self.holder.frame(beat))
            }
            _ => None,
        };
        if let Some(frame) = frame.filter(|_| !cut) {
            self.line.push((now_us + delay_us, frame));
        }
        while let Some(at) = self.line.iter().position(|(us, _)| *us <= now_us) {
            let (_, frame) = self.line.remove(at);
            if since_ms.is_some() {
                self.forge(&frame, robot);
            }
            self.counter.arrive(&mut self.holder, &frame, robot);
            self.kept.push(frame);
        }
        if since_ms.is_some_and(|since| since.is_multiple_of(INTRUDER_MS)) {
            match self.connection {
                Connection::SecondClient => self.intrude(now_us, robot),
                Connection::Replay => self.replay(robot),
                _ => {}
            }
        }
    }

    /// Tries a frame that must have no effect, at a door of `key` that is as far as the holder's.
    fn try_door(&mut self, frame: &[u8], key: Option<Key>, robot: &mut Robot<'_, '_>) {
        let now = self.counter.wall(robot.now_us());
        let mut client = Client {
            id: self.holder.id,
            key: self.holder.key.clone(),
            door: key.map_or_else(|| self.holder.door.clone(), |key| Door::new(key, now)),
            n: 0,
        };
        self.intrusion.frames += 1;
        let taken = self.counter.arrive(&mut client, frame, robot);
        self.intrusion.taken += u32::from(taken);
    }

    /// Tries the holder's next frame with each of its bits flipped, and under another key.
    fn forge(&mut self, frame: &[u8], robot: &mut Robot<'_, '_>) {
        if self.connection != Connection::BadMac {
            return;
        }
        for bit in 0..8 * frame.len() {
            let mut forged = frame.to_vec();
            forged[bit / 8] ^= 1 << (bit % 8);
            self.try_door(&forged, None, robot);
        }
        let disarm = json!({ "n": self.holder.n, "seen_us": self.shown_us, "valid_ms": VALID_MS,
            "cmd": "Disarm", "args": {} });
        let forged = self.intruder.key.seal(disarm.to_string().as_bytes());
        self.try_door(&forged, None, robot);
    }

    /// Repeats frames of the holder: at its own door and at another's.
    fn replay(&mut self, robot: &mut Robot<'_, '_>) {
        for frame in self.kept.clone() {
            self.try_door(&frame, None, robot);
            let other = self.intruder.key.clone();
            self.try_door(&frame, Some(other), robot);
        }
        // A future frame before its turn.
        let next = json!({ "n": self.holder.n + 2, "op": "beat", "seen_us": self.shown_us });
        let early = self.holder.key.seal(next.to_string().as_bytes());
        self.try_door(&early, None, robot);
    }

    /// Lets another client with the control key send commands, take control and send beats.
    fn intrude(&mut self, now_us: u64, robot: &mut Robot<'_, '_>) {
        let intruder = &mut self.intruder;
        let frames = [
            intruder.command(now_us, "TakeControl", json!({})),
            intruder.frame(json!({ "op": "beat", "seen_us": now_us })),
            intruder.command(now_us, "Hold", json!({})),
            intruder.command(now_us, "Disarm", json!({})),
            intruder.command(now_us, "ReleaseControl", json!({})),
        ];
        for frame in frames {
            let taken = self.counter.arrive(&mut self.intruder, &frame, robot);
            self.intrusion.frames += 1;
            self.intrusion.taken += u32::from(taken);
        }
    }

    /// A client reconnects, takes control and sends the commands that were given while it was cut off.
    fn reconnect(&mut self, now_us: u64, robot: &mut Robot<'_, '_>) {
        let cut_us = now_us - CUT_MS * 1_000;
        // Frames for the old session are not valid in the new one.
        let queued = |of: &mut Client, i: u64| {
            let args = json!({ "joint": 3, "stroke": 60.0 });
            of.command(cut_us + i * CUT_MS * 1_000 / QUEUED, "JointReference", args)
        };
        let mut frames: Vec<Vec<u8>> = (0..QUEUED / 10)
            .map(|i| queued(&mut self.holder, i))
            .collect();
        let mut anew = Client::new(3, self.counter.wall(now_us));
        for frame in &frames {
            let mut closed = Client::new(3, self.counter.wall(now_us));
            let taken = self.counter.arrive(&mut closed, frame, robot);
            self.intrusion.frames += 1;
            self.intrusion.taken += u32::from(taken);
        }
        let take = anew.command(now_us, "TakeControl", json!({}));
        self.counter.arrive(&mut anew, &take, robot);
        frames = (0..QUEUED).map(|i| queued(&mut anew, i)).collect();
        for frame in &frames {
            let taken = self.counter.arrive(&mut anew, frame, robot);
            self.intrusion.frames += 1;
            self.intrusion.taken += u32::from(taken);
        }
        self.holder = anew;
        self.line.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_master::command::Command;

    #[test]
    fn a_door_is_not_opened_by_another_sessions_frame() {
        let begin = Instant::now();
        let (mut a, mut b) = (Client::new(1, begin), Client::new(2, begin));
        let frame = a.command(0, "Arm", json!({}));
        assert!(b.door.open(&frame, begin).is_none());
        let entered = a.door.open(&frame, begin).expect("its own");
        let Body::Give { order, .. } = entered.body else {
            panic!("{entered:?}");
        };
        assert_eq!(order, Order::Robot(Command::Arm));
        let _ = b.frame(json!({ "op": "stop" }));
    }
}
