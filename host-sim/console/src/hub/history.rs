//! The last minute of every channel, for who asks later: of channels with a rate at most 50 samples a
//! second of master time, of those that are told on change every one.

use std::collections::VecDeque;

use axum::body::Bytes;
use wheeleg_telemetry::channels;

/// Longest time that is kept, s.
pub(crate) const LONGEST_S: u8 = 60;
const LONGEST_NS: u64 = LONGEST_S as u64 * 1_000_000_000;
/// Between two samples of a channel with a rate, ns.
const PERIOD_NS: u64 = 20_000_000;
/// Bytes of a channel that are kept at most: a minute of the largest one has a third of them.
const BYTES_MAX: usize = 1 << 20;
/// What a sample costs beside its bytes.
const OVERHEAD: usize = 64;

/// Samples of a channel.
#[derive(Default)]
struct Kept {
    on_change: bool,
    next_ns: u64,
    bytes: usize,
    samples: VecDeque<(u64, Bytes)>,
}

/// Samples of all channels, each as a frame has it.
pub(super) struct History(Vec<Kept>);

impl History {
    pub(super) fn new() -> Self {
        let of = |on_change| Kept {
            on_change,
            ..Kept::default()
        };
        Self(channels().iter().map(|def| of(def.rate_hz == 0)).collect())
    }

    /// Whether every sample of this channel is kept.
    pub(super) fn keeps_all(&self, channel: u16) -> bool {
        self.0[usize::from(channel)].on_change
    }

    /// Whether a sample of this time is to be kept.
    pub(super) fn wants(&self, channel: u16, t_ns: u64) -> bool {
        let kept = &self.0[usize::from(channel)];
        kept.on_change || t_ns >= kept.next_ns
    }

    pub(super) fn keep(&mut self, channel: u16, t_ns: u64, sample: Bytes) {
        let kept = &mut self.0[usize::from(channel)];
        kept.next_ns = (t_ns / PERIOD_NS + 1) * PERIOD_NS;
        kept.bytes += sample.len() + OVERHEAD;
        kept.samples.push_back((t_ns, sample));
        while let Some((old_ns, old)) = kept.samples.front()
            && (old_ns + LONGEST_NS < t_ns || kept.bytes > BYTES_MAX)
        {
            kept.bytes -= old.len() + OVERHEAD;
            kept.samples.pop_front();
        }
    }

    /// Samples from `from_ns` on, the oldest first.
    pub(super) fn since(&self, channel: u16, from_ns: u64) -> Vec<Bytes> {
        let samples = &self.0[usize::from(channel)].samples;
        let first = samples.partition_point(|(t_ns, _)| *t_ns < from_ns);
        let rest = samples.iter().skip(first);
        rest.map(|(_, sample)| sample.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_is_kept_at_50_a_second_and_events_one_by_one() {
        let index = |topic| {
            let index = channels().iter().position(|def| def.topic == topic);
            index.expect("a channel") as u16
        };
        let (joint, events) = (index("/joint/1"), index("/events"));
        let mut history = History::new();
        assert!(!history.keeps_all(joint) && history.keeps_all(events));
        let sample = Bytes::from_static(&[0; 100]);
        for ms in 0..90_000 {
            let t_ns = ms * 1_000_000;
            for channel in [joint, events] {
                if history.wants(channel, t_ns) {
                    history.keep(channel, t_ns, sample.clone());
                }
            }
        }
        let minute = history.since(joint, 0).len();
        assert!((3_000..=3_001).contains(&minute), "{minute}");
        assert_eq!(history.since(joint, 89_980_000_000).len(), 1);
        assert_eq!(history.since(joint, 89_981_000_000).len(), 0);
        // Without a rate memory is the limit: the oldest go.
        let kept = history.since(events, 0).len();
        assert_eq!(kept, BYTES_MAX / (100 + OVERHEAD));
        assert_eq!(history.since(events, 89_999_000_000).len(), 1);
    }
}
