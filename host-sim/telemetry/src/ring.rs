//! The sink that holds the last seconds of every channel, for live use.

use std::collections::VecDeque;

use super::samples::channels;
use super::sink::{Sink, Taken};

/// One message of the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Simulated time, ns.
    pub t_ns: u64,
    /// JSON, as in the log.
    pub payload: Vec<u8>,
}

/// The last seconds of every channel at its declared rate, in bounded memory.
#[derive(Debug)]
pub struct Ring {
    span_ns: u64,
    channels: Vec<VecDeque<Message>>,
}

/// Most messages of a channel that is written on change: those of the last seconds could be any
/// number.
const ON_CHANGE: usize = 1_000;

impl Ring {
    /// An empty ring for `span_s` seconds (above 0).
    #[must_use]
    pub fn new(span_s: f64) -> Self {
        Self {
            span_ns: (span_s.max(0.0) * 1e9) as u64,
            channels: vec![VecDeque::new(); channels().len()],
        }
    }

    /// The messages of a channel, oldest first; `channel` is its index in
    /// [`channels`](crate::channels). A channel without messages for a while keeps its last.
    pub fn messages(&self, channel: usize) -> impl ExactSizeIterator<Item = &Message> {
        self.channels[channel].iter()
    }
}

impl Sink for Ring {
    fn take(&mut self, taken: &Taken<'_>) {
        if !taken.due {
            return;
        }
        let ring = &mut self.channels[taken.channel];
        let oldest = (taken.t_ns + 1).saturating_sub(self.span_ns);
        let most = match channels()[taken.channel].rate_hz {
            0 => ON_CHANGE,
            _ => usize::MAX,
        };
        // The room of a message that is too old serves the new one.
        let mut payload = Vec::new();
        while ring.len() >= most || ring.front().is_some_and(|m| m.t_ns < oldest) {
            payload = ring.pop_front().map_or(payload, |m| m.payload);
        }
        payload.clear();
        taken.sample.encode_json(&mut payload);
        let t_ns = taken.t_ns;
        ring.push_back(Message { t_ns, payload });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Act, Cause};
    use crate::{JointSample, Recorder};

    #[test]
    fn it_holds_the_last_seconds_and_no_more() {
        let mut ring = Ring::new(2.0);
        let mut recorder = Recorder::in_memory().with(&mut ring);
        for ms in 0..10_000_u64 {
            let sample = JointSample {
                position_mm: ms as f64,
                ..JointSample::default()
            };
            recorder.joint(ms * 1_000_000, 0, sample);
            recorder.event(ms * 1_000_000, Cause::Scenario(Act::EStop));
        }
        recorder.finish().expect("no file");
        // 500 Hz.
        assert_eq!(ring.messages(0).len(), 1000);
        let first = ring.messages(0).next().expect("messages");
        assert_eq!(first.t_ns, 8_000_000_000);
        let value: serde_json::Value = serde_json::from_slice(&first.payload).expect("JSON");
        assert_eq!(value["position_mm"], 8000);
        assert_eq!(ring.messages(15).len(), ON_CHANGE);
        assert_eq!(ring.messages(1).len(), 0);
    }
}
