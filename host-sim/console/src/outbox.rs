//! Messages that wait for one client. Each kind handles a slow client in its own way: of the state and of
//! newest samples, the newest wins; of all samples, the oldest are dropped and counted; answers and events
//! must not be lost, so a client that lets them pile up is closed.

use std::collections::{BTreeMap, VecDeque};

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};

use crate::close::Close;
use crate::mailbox::{Mailbox, Waiting};

/// Answers and events that may wait.
const ORDERED_MAX: usize = 256;
/// Bytes of answers and events that may wait.
const ORDERED_BYTES_MAX: usize = 64 * 1024;
/// Bytes of batches that may wait.
const BATCH_BYTES_MAX: usize = 128 * 1024;
/// Batches of a channel that may wait: one second.
const BATCHES_MAX: usize = 50;
/// Version of the binary layout.
const VERSION: u8 = 1;

/// Waiting samples of a channel.
struct Samples {
    channel: u16,
    count: u32,
    missed: u32,
    body: Bytes,
}

impl Samples {
    fn message(&self) -> Message {
        let mut out = Vec::with_capacity(7 + self.body.len());
        out.push(VERSION);
        out.extend_from_slice(&self.channel.to_le_bytes());
        out.extend_from_slice(&self.missed.to_le_bytes());
        out.extend_from_slice(&self.body);
        Message::Binary(out.into())
    }
}

/// Messages for one client.
#[derive(Default)]
pub(crate) struct Queue {
    ordered: VecDeque<Utf8Bytes>,
    ordered_bytes: usize,
    state: Option<Utf8Bytes>,
    newest: BTreeMap<u16, Samples>,
    batches: VecDeque<Samples>,
    batch_bytes: usize,
    /// Samples of dropped batches, until a frame of the channel reports them.
    lost: BTreeMap<u16, u32>,
}

/// Messages that wait for one client.
pub(crate) type Outbox = Mailbox<Queue>;

impl Outbox {
    /// Queues an answer or event.
    pub(crate) fn ordered(&self, text: Utf8Bytes) {
        self.put(|contents| {
            let queue = &mut contents.messages;
            queue.ordered_bytes += text.len();
            queue.ordered.push_back(text);
            if queue.ordered.len() > ORDERED_MAX || queue.ordered_bytes > ORDERED_BYTES_MAX {
                contents.close(Close::TooSlow);
            }
        });
    }

    /// Queues the state of the robot.
    pub(crate) fn state(&self, text: Utf8Bytes) {
        self.put(|contents| contents.messages.state = Some(text));
    }

    /// Queues the newest sample of a channel.
    pub(crate) fn newest(&self, channel: u16, missed: u32, body: Bytes) {
        self.put(|contents| contents.messages.replace(channel, missed, body));
    }

    /// Queues all samples of a channel since the last batch.
    pub(crate) fn batch(&self, channel: u16, count: u32, missed: u32, body: Bytes) {
        let samples = Samples {
            channel,
            count,
            missed,
            body,
        };
        self.put(|contents| contents.messages.add(samples));
    }
}

impl Queue {
    fn replace(&mut self, channel: u16, missed: u32, body: Bytes) {
        let overtaken = self
            .newest
            .get(&channel)
            .map_or(0, |old| old.missed.saturating_add(1));
        let samples = Samples {
            channel,
            count: 1,
            missed: missed.saturating_add(overtaken),
            body,
        };
        self.newest.insert(channel, samples);
    }

    fn add(&mut self, samples: Samples) {
        let channel = samples.channel;
        self.batch_bytes += samples.body.len();
        self.batches.push_back(samples);
        let of_channel = |queue: &Self| {
            let waiting = queue.batches.iter();
            waiting.filter(|batch| batch.channel == channel).count()
        };
        while self.batch_bytes > BATCH_BYTES_MAX || of_channel(self) > BATCHES_MAX {
            let full = self.batch_bytes > BATCH_BYTES_MAX;
            let oldest = self
                .batches
                .iter()
                .position(|batch| full || batch.channel == channel);
            let Some(dropped) = oldest.and_then(|at| self.batches.remove(at)) else {
                break;
            };
            self.batch_bytes -= dropped.body.len();
            *self.lost.entry(dropped.channel).or_default() += dropped.count + dropped.missed;
        }
    }
}

impl Waiting for Queue {
    fn next(&mut self) -> Option<Message> {
        if let Some(text) = self.ordered.pop_front() {
            self.ordered_bytes -= text.len();
            return Some(Message::Text(text));
        }
        if let Some(text) = self.state.take() {
            return Some(Message::Text(text));
        }
        if let Some((_, samples)) = self.newest.pop_first() {
            return Some(samples.message());
        }
        let mut batch = self.batches.pop_front()?;
        self.batch_bytes -= batch.body.len();
        let lost = self.lost.remove(&batch.channel).unwrap_or(0);
        batch.missed = batch.missed.saturating_add(lost);
        Some(batch.message())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missed(message: &Message) -> u32 {
        let Message::Binary(bytes) = message else {
            panic!("{message:?}");
        };
        u32::from_le_bytes(bytes[3..7].try_into().expect("a header"))
    }

    #[test]
    fn the_newest_wins_and_what_it_overtakes_is_counted() {
        let outbox = Outbox::default();
        for n in 0..10_u8 {
            outbox.newest(3, 0, Bytes::from(vec![n]));
            outbox.state(Utf8Bytes::from_static("{}"));
        }
        assert!(matches!(outbox.next(), Some(Message::Text(_))));
        let newest = outbox.next().expect("a sample");
        assert_eq!(missed(&newest), 9);
        assert!(matches!(newest, Message::Binary(bytes) if bytes[7] == 9));
        assert!(outbox.next().is_none());
    }

    #[test]
    fn of_batches_the_oldest_go_and_a_later_one_tells() {
        let outbox = Outbox::default();
        for _ in 0..BATCHES_MAX + 7 {
            outbox.batch(1, 20, 0, Bytes::from_static(b"x"));
        }
        let first = outbox.next().expect("a batch");
        assert_eq!(missed(&first), 7 * 20);
        assert_eq!(missed(&outbox.next().expect("a batch")), 0);
        let big = Bytes::from(vec![0; 50_000]);
        for _ in 0..100 {
            outbox.batch(2, 1, 0, big.clone());
        }
        assert!(outbox.contents().messages.batch_bytes <= BATCH_BYTES_MAX);
    }

    #[test]
    fn who_lets_answers_pile_up_is_closed() {
        let outbox = Outbox::default();
        for _ in 0..=ORDERED_MAX {
            assert!(outbox.contents().close.is_none());
            outbox.ordered(Utf8Bytes::from_static("{}"));
        }
        // Further requests are not kept.
        for _ in 0..ORDERED_MAX {
            outbox.ordered(Utf8Bytes::from_static("{}"));
            outbox.batch(1, 1, 0, Bytes::from_static(b"x"));
        }
        let contents = outbox.contents();
        let Queue {
            ordered, batches, ..
        } = &contents.messages;
        assert_eq!((ordered.len(), batches.len()), (0, 0));
        drop(contents);
        let close = outbox.next().expect("a close");
        assert!(matches!(close, Message::Close(Some(frame)) if frame.code == 4004));
    }
}
