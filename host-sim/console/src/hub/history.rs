//! The last minute of every channel, for clients that ask later: of channels with a rate at most 50 samples a
//! second of master time, of those that are sent on change every one.

use std::collections::VecDeque;

use axum::body::Bytes;
use wheeleg_telemetry::channels;

/// Longest time that is kept, s.
pub(crate) const LONGEST_S: u8 = 60;
const LONGEST_NS: u64 = LONGEST_S as u64 * 1_000_000_000;
/// Time between two samples of a channel with a rate, ns.
const PERIOD_NS: u64 = 20_000_000;
/// Most bytes kept of a channel: three times a minute of the largest one.
const BYTES_MAX: usize = 1 << 20;
/// Cost of a sample in addition to its bytes.
const OVERHEAD: usize = 64;

/// Samples of a channel.
#[derive(Default)]
struct Kept {
    on_change: bool,
    next_ns: u64,
    bytes: usize,
    /// Number of the oldest one, since power-up.
    first: u64,
    samples: VecDeque<(u64, Bytes)>,
}

/// A reader of samples piece by piece: the number of its next one, and its end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reader {
    channel: u16,
    next: u64,
    end: u64,
}

/// Samples of all channels, each as in a frame.
pub(super) struct History(Vec<Kept>);

impl History {
    pub(super) fn new() -> Self {
        let of = |on_change| Kept {
            on_change,
            ..Kept::default()
        };
        Self(channels().iter().map(|def| of(def.rate_hz == 0)).collect())
    }

    /// Keeps a sample of this time, if it is due.
    pub(super) fn see(&mut self, channel: u16, t_ns: u64, encode: impl FnOnce() -> Bytes) {
        let kept = &mut self.0[usize::from(channel)];
        if t_ns < kept.next_ns {
            return;
        }
        if !kept.on_change {
            kept.next_ns = (t_ns / PERIOD_NS + 1) * PERIOD_NS;
        }
        let sample = encode();
        kept.bytes += sample.len() + OVERHEAD;
        kept.samples.push_back((t_ns, sample));
        while let Some((old_ns, old)) = kept.samples.front()
            && (old_ns + LONGEST_NS < t_ns || kept.bytes > BYTES_MAX)
        {
            kept.bytes -= old.len() + OVERHEAD;
            kept.samples.pop_front();
            kept.first += 1;
        }
    }

    /// A reader of the samples from `from_ns` until now.
    pub(super) fn reader(&self, channel: u16, from_ns: u64) -> Reader {
        let Kept { first, samples, .. } = &self.0[usize::from(channel)];
        let before = samples.partition_point(|(t_ns, _)| *t_ns < from_ns);
        Reader {
            channel,
            next: first + before as u64,
            end: first + samples.len() as u64,
        }
    }

    /// The next samples of a reader, at most `most`, the oldest first; those dropped meanwhile are left out.
    pub(super) fn read(&self, reader: &mut Reader, most: usize) -> Vec<Bytes> {
        let Kept { first, samples, .. } = &self.0[usize::from(reader.channel)];
        let begin = reader.next.max(*first);
        let end = reader.end.min(begin + most as u64);
        reader.next = end;
        let count = end.saturating_sub(begin) as usize;
        let piece = samples.iter().skip((begin - first) as usize).take(count);
        piece.map(|(_, sample)| sample.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_telemetry::channel_index;

    fn index(topic: &str) -> u16 {
        channel_index(topic).expect("a channel") as u16
    }

    fn sample() -> Bytes {
        Bytes::from_static(&[0; 100])
    }

    #[test]
    fn a_minute_is_kept_at_50_a_second_and_events_one_by_one() {
        let (joint, events) = (index("/joint/1"), index("/events"));
        let mut history = History::new();
        for ms in 0..90_000 {
            for channel in [joint, events] {
                history.see(channel, ms * 1_000_000, sample);
            }
        }
        let since = |channel, from_ns| {
            let mut reader = history.reader(channel, from_ns);
            history.read(&mut reader, usize::MAX >> 1).len()
        };
        let minute = since(joint, 0);
        assert!((3_000..=3_001).contains(&minute), "{minute}");
        assert_eq!(since(joint, 89_980_000_000), 1);
        assert_eq!(since(joint, 89_981_000_000), 0);
        // Without a rate memory is the limit: the oldest are dropped.
        assert_eq!(since(events, 0), BYTES_MAX / (100 + OVERHEAD));
        assert_eq!(since(events, 89_999_000_000), 1);
    }

    /// Unread samples are dropped as without a reader; it gets those that were there when it began.
    #[test]
    fn a_slow_reader_keeps_nothing_and_comes_to_an_end() {
        let events = index("/events");
        let mut history = History::new();
        let see = |history: &mut History, s: u64| {
            history.see(events, s * 1_000_000_000, || Bytes::from(vec![s as u8; 8]));
        };
        (0..10).for_each(|s| see(&mut history, s));
        let mut reader = history.reader(events, 2_000_000_000);
        let mut read = |history: &History, most| -> Vec<u8> {
            let piece = history.read(&mut reader, most);
            piece.iter().map(|sample| sample[0]).collect()
        };
        assert_eq!(read(&history, 3), [2, 3, 4]);
        see(&mut history, 67);
        // 5 and 6 are older than a minute by now; 67 came after the reader began.
        assert_eq!(read(&history, 2), [7, 8]);
        assert_eq!(read(&history, 64), [9]);
        assert!(read(&history, 64).is_empty());
        let mut late = history.reader(events, 0);
        see(&mut history, 200);
        assert_eq!(history.read(&mut late, 64).len(), 0);
        assert_eq!(history.read(&mut late, 64).len(), 0);
    }
}
