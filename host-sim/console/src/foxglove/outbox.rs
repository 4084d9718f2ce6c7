//! Queue of messages for one viewer. Of samples and of the time the newest wins; of events the oldest are
//! dropped, and the viewer gets their number; a viewer that lets answers pile up is closed.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use axum::body::Bytes;
use axum::extract::ws::Message;
use serde_json::json;

use super::channels::Channel;
use crate::close::Close;
use crate::mailbox::{Mailbox, Waiting};

/// Answers that may wait.
const ANSWERS_MAX: usize = 256;
/// Bytes of answers that may wait.
const ANSWER_BYTES_MAX: usize = 128 * 1024;
/// Events that may wait.
const EVENTS_MAX: usize = 256;
/// Bytes of events that may wait.
const EVENT_BYTES_MAX: usize = 64 * 1024;

/// First bytes of binary messages.
const DATA: u8 = 1;
const TIME: u8 = 2;

/// A message of a channel.
#[derive(Debug, Clone)]
struct Data {
    /// The viewer's number of its subscription.
    subscription: u32,
    t_ns: u64,
    payload: Bytes,
}

impl Data {
    fn message(&self) -> Message {
        let mut out = Vec::with_capacity(13 + self.payload.len());
        out.push(DATA);
        out.extend_from_slice(&self.subscription.to_le_bytes());
        out.extend_from_slice(&self.t_ns.to_le_bytes());
        out.extend_from_slice(&self.payload);
        Message::Binary(out.into())
    }
}

/// Messages for one viewer.
#[derive(Default)]
pub(crate) struct Queue {
    answers: VecDeque<Message>,
    answer_bytes: usize,
    time_ns: Option<u64>,
    events: VecDeque<Data>,
    event_bytes: usize,
    /// Dropped events, not reported yet.
    lost: u64,
    newest: BTreeMap<Channel, Data>,
    /// Channel that was sent last: the next one in order follows, so that none starves.
    turn: Option<Channel>,
}

/// Messages that wait for one viewer.
pub(crate) type Outbox = Mailbox<Queue>;

impl Outbox {
    /// Queues an answer, or a message that the viewer must get.
    pub(crate) fn answer(&self, message: Message) {
        self.put(|contents| {
            let queue = &mut contents.messages;
            queue.answer_bytes += length(&message);
            queue.answers.push_back(message);
            if queue.answers.len() > ANSWERS_MAX || queue.answer_bytes > ANSWER_BYTES_MAX {
                contents.close(Close::TooSlow);
            }
        });
    }

    /// Queues the time of the master, ns.
    pub(crate) fn time(&self, t_ns: u64) {
        self.put(|contents| contents.messages.time_ns = Some(t_ns));
    }

    /// Queues a message of a channel.
    pub(crate) fn data(&self, channel: Channel, subscription: u32, t_ns: u64, payload: Bytes) {
        let data = Data {
            subscription,
            t_ns,
            payload,
        };
        self.put(|contents| contents.messages.add(channel, data));
    }

    /// Drops the messages of ended subscriptions.
    pub(crate) fn forget(&self, ended: &BTreeSet<u32>) {
        let queue = &mut self.contents().messages;
        let goes_on = |data: &Data| !ended.contains(&data.subscription);
        queue.newest.retain(|_, data| goes_on(data));
        queue.events.retain(goes_on);
        queue.event_bytes = queue.events.iter().map(|d| d.payload.len()).sum();
    }
}

impl Queue {
    fn add(&mut self, channel: Channel, data: Data) {
        if !channel.is_ordered() {
            self.newest.insert(channel, data);
            return;
        }
        self.event_bytes += data.payload.len();
        self.events.push_back(data);
        while self.events.len() > EVENTS_MAX || self.event_bytes > EVENT_BYTES_MAX {
            let Some(dropped) = self.events.pop_front() else {
                break;
            };
            self.event_bytes -= dropped.payload.len();
            self.lost += 1;
        }
    }
}

impl Waiting for Queue {
    fn next(&mut self) -> Option<Message> {
        if let Some(message) = self.answers.pop_front() {
            self.answer_bytes -= length(&message);
            return Some(message);
        }
        if let Some(t_ns) = self.time_ns.take() {
            let mut out = vec![TIME];
            out.extend_from_slice(&t_ns.to_le_bytes());
            return Some(Message::Binary(out.into()));
        }
        if self.lost > 0 {
            let lost = std::mem::take(&mut self.lost);
            return Some(status(1, &format!("{lost} events are missing: too slow")));
        }
        if let Some(data) = self.events.pop_front() {
            self.event_bytes -= data.payload.len();
            return Some(data.message());
        }
        let after = self.turn.and_then(|last| {
            let mut rest = self
                .newest
                .range((std::ops::Bound::Excluded(last), std::ops::Bound::Unbounded));
            rest.next().map(|(channel, _)| *channel)
        });
        let channel = after.or_else(|| self.newest.keys().next().copied())?;
        self.turn = Some(channel);
        let data = self.newest.remove(&channel)?;
        Some(data.message())
    }
}

/// A message for the person at the viewer; level 0: information, 1: warning, 2: error.
pub(crate) fn status(level: u8, text: &str) -> Message {
    let message = json!({ "op": "status", "level": level, "message": text });
    Message::Text(message.to_string().into())
}

fn length(message: &Message) -> usize {
    match message {
        Message::Text(text) => text.len(),
        Message::Binary(bytes) => bytes.len(),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_telemetry::Derived;

    fn subscription(message: &Message) -> u32 {
        let Message::Binary(bytes) = message else {
            panic!("{message:?}");
        };
        assert_eq!(bytes[0], DATA);
        u32::from_le_bytes(bytes[1..5].try_into().expect("four bytes"))
    }

    #[test]
    fn the_newest_wins_and_no_channel_starves() {
        let outbox = Outbox::default();
        let fill = |t_ns| {
            for index in 0..3 {
                let channel = Channel::of_registry(index);
                outbox.data(channel, u32::from(index), t_ns, Bytes::from_static(b"{}"));
            }
        };
        let mut sent = Vec::new();
        for t_ns in 0..9 {
            fill(t_ns);
            fill(t_ns);
            let message = outbox.next().expect("a message");
            let Message::Binary(bytes) = &message else {
                panic!("{message:?}");
            };
            assert_eq!(bytes[5], t_ns as u8, "an old one");
            sent.push(subscription(&message));
        }
        assert_eq!(sent, [0, 1, 2, 0, 1, 2, 0, 1, 2]);
        outbox.forget(&BTreeSet::from([1]));
        let rest: Vec<u32> = std::iter::from_fn(|| outbox.next())
            .map(|m| subscription(&m))
            .collect();
        assert_eq!(rest, [0]);
    }

    #[test]
    fn events_come_in_order_and_what_goes_is_told() {
        let outbox = Outbox::default();
        let log = Channel::of_derived(Derived::Log);
        for n in 0..EVENTS_MAX + 7 {
            outbox.data(log, 1, n as u64, Bytes::from_static(b"{}"));
        }
        let told = outbox.next().expect("a message");
        assert!(matches!(told, Message::Text(t) if t.contains("7 events")));
        let first = outbox.next().expect("an event");
        assert!(matches!(first, Message::Binary(bytes) if bytes[5] == 7));
        let big = Bytes::from(vec![b' '; 10_000]);
        for n in 0..100 {
            outbox.data(log, 1, n, big.clone());
        }
        assert!(outbox.contents().messages.event_bytes <= EVENT_BYTES_MAX);
    }

    #[test]
    fn who_lets_answers_pile_up_is_closed() {
        let outbox = Outbox::default();
        for _ in 0..=ANSWERS_MAX {
            assert!(outbox.contents().close.is_none());
            outbox.answer(status(0, ""));
        }
        // Further requests are not kept.
        for _ in 0..ANSWERS_MAX {
            outbox.answer(status(0, ""));
        }
        assert_eq!(outbox.contents().messages.answers.len(), 0);
        let close = outbox.next().expect("a close");
        assert!(matches!(close, Message::Close(Some(frame)) if frame.code == 4004));
    }
}
