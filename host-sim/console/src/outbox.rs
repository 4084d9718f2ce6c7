//! What waits for one client. Each kind has its own answer to a client that is slow: of the state
//! and of newest samples, the newest wins; of all samples, the oldest go and are counted; of
//! answers and events none may be lost, so a client that lets them pile up is closed.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes};
use tokio::sync::Notify;

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

/// Why a connection is closed, by the table of PROTOCOL.md.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Close {
    /// The key is wrong, or the answer to `hello` is malformed.
    WrongKey,
    /// The key is wrong once more.
    Wait,
    /// The client wants to drive where others could read and change what it sends.
    LookOnly,
    /// The client has loaded other lists.
    OtherHash,
    /// A frame is not authentic, not the next, or malformed.
    BadFrame,
    /// The client does not take what it is sent.
    TooSlow,
    /// The client does not answer `hello`.
    Timeout,
    /// The server ends.
    Ended,
}

impl Close {
    /// Code of the close frame.
    pub(crate) const fn code(self) -> u16 {
        match self {
            Self::WrongKey | Self::Wait | Self::LookOnly => 4001,
            Self::OtherHash => 4002,
            Self::BadFrame => 4003,
            Self::TooSlow => 4004,
            Self::Timeout => 4005,
            Self::Ended => 4006,
        }
    }

    /// Name that stays the same.
    pub(crate) const fn reason(self) -> &'static str {
        match self {
            Self::WrongKey => "wrong_key",
            Self::Wait => "wait",
            Self::LookOnly => "look_only",
            Self::OtherHash => "other_hash",
            Self::BadFrame => "bad_frame",
            Self::TooSlow => "too_slow",
            Self::Timeout => "timeout",
            Self::Ended => "ended",
        }
    }

    pub(crate) fn message(self) -> Message {
        Message::Close(Some(CloseFrame {
            code: self.code(),
            reason: Utf8Bytes::from_static(self.reason()),
        }))
    }
}

/// Samples of a channel that wait.
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

#[derive(Default)]
struct Queue {
    close: Option<Close>,
    ordered: VecDeque<Utf8Bytes>,
    ordered_bytes: usize,
    state: Option<Utf8Bytes>,
    newest: BTreeMap<u16, Samples>,
    batches: VecDeque<Samples>,
    batch_bytes: usize,
    /// Samples of batches that were dropped, until a frame of the channel tells.
    lost: BTreeMap<u16, u32>,
}

/// What waits for one client.
#[derive(Default)]
pub(crate) struct Outbox {
    queue: Mutex<Queue>,
    wake: Notify,
}

impl Outbox {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Closes the connection, after nothing else.
    pub(crate) fn close(&self, why: Close) {
        self.queue().close.get_or_insert(why);
        self.wake.notify_one();
    }

    /// An answer or event.
    pub(crate) fn ordered(&self, text: Utf8Bytes) {
        let mut queue = self.queue();
        queue.ordered_bytes += text.len();
        queue.ordered.push_back(text);
        if queue.ordered.len() > ORDERED_MAX || queue.ordered_bytes > ORDERED_BYTES_MAX {
            queue.close.get_or_insert(Close::TooSlow);
        }
        drop(queue);
        self.wake.notify_one();
    }

    /// The state of the robot.
    pub(crate) fn state(&self, text: Utf8Bytes) {
        self.queue().state = Some(text);
        self.wake.notify_one();
    }

    /// The newest sample of a channel.
    pub(crate) fn newest(&self, channel: u16, missed: u32, body: Bytes) {
        let mut queue = self.queue();
        let overtaken = queue
            .newest
            .get(&channel)
            .map_or(0, |old| old.missed.saturating_add(1));
        let samples = Samples {
            channel,
            count: 1,
            missed: missed.saturating_add(overtaken),
            body,
        };
        queue.newest.insert(channel, samples);
        drop(queue);
        self.wake.notify_one();
    }

    /// All samples of a channel since the last batch.
    pub(crate) fn batch(&self, channel: u16, count: u32, missed: u32, body: Bytes) {
        let mut queue = self.queue();
        queue.batch_bytes += body.len();
        queue.batches.push_back(Samples {
            channel,
            count,
            missed,
            body,
        });
        let of_channel = |queue: &Queue| {
            let waiting = queue.batches.iter();
            waiting.filter(|batch| batch.channel == channel).count()
        };
        while queue.batch_bytes > BATCH_BYTES_MAX || of_channel(&queue) > BATCHES_MAX {
            let full = queue.batch_bytes > BATCH_BYTES_MAX;
            let oldest = queue
                .batches
                .iter()
                .position(|batch| full || batch.channel == channel);
            let Some(dropped) = oldest.and_then(|at| queue.batches.remove(at)) else {
                break;
            };
            queue.batch_bytes -= dropped.body.len();
            *queue.lost.entry(dropped.channel).or_default() += dropped.count + dropped.missed;
        }
        drop(queue);
        self.wake.notify_one();
    }

    /// What is to be sent next; a close is the last.
    fn next(&self) -> Option<Message> {
        let mut queue = self.queue();
        if let Some(why) = queue.close {
            return Some(why.message());
        }
        if let Some(text) = queue.ordered.pop_front() {
            queue.ordered_bytes -= text.len();
            return Some(Message::Text(text));
        }
        if let Some(text) = queue.state.take() {
            return Some(Message::Text(text));
        }
        if let Some((_, samples)) = queue.newest.pop_first() {
            return Some(samples.message());
        }
        let mut batch = queue.batches.pop_front()?;
        queue.batch_bytes -= batch.body.len();
        let lost = queue.lost.remove(&batch.channel).unwrap_or(0);
        batch.missed = batch.missed.saturating_add(lost);
        Some(batch.message())
    }

    /// Waits for what is to be sent next.
    pub(crate) async fn wait(&self) -> Message {
        loop {
            if let Some(message) = self.next() {
                return message;
            }
            self.wake.notified().await;
        }
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
        assert!(outbox.queue().batch_bytes <= BATCH_BYTES_MAX);
    }

    #[test]
    fn who_lets_answers_pile_up_is_closed() {
        let outbox = Outbox::default();
        for _ in 0..=ORDERED_MAX {
            assert!(outbox.queue().close.is_none());
            outbox.ordered(Utf8Bytes::from_static("{}"));
        }
        let close = outbox.next().expect("a close");
        assert!(matches!(close, Message::Close(Some(frame)) if frame.code == 4004));
    }
}
