//! A listener that knows what was sent: it counts frames that a receiver accepts although nobody sent them.

use std::collections::VecDeque;

use wheeleg_protocol::{Decoder, Header};

/// Frames remembered: more than are on their way at a time, even delayed ones.
const MEMORY: usize = 64;

/// What the line did to frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LineAudit {
    /// Frames that were put on the line.
    pub sent: u64,
    /// Frames that a receiver accepts.
    pub accepted: u64,
    /// Frames among them that nobody sent.
    pub wrong: u64,
}

/// Compares accepted frames with sent ones.
#[derive(Debug, Default)]
pub(super) struct Audit {
    memory: VecDeque<(Header, Vec<u8>)>,
    decoder: Decoder,
    counts: LineAudit,
}

impl Audit {
    /// A transmission as its sender sends it.
    pub(super) fn sent(&mut self, bytes: &[u8]) {
        let mut decoder = Decoder::new();
        for byte in bytes {
            let Some(Ok(frame)) = decoder.push(*byte) else {
                continue;
            };
            self.counts.sent += 1;
            if self.memory.len() == MEMORY {
                self.memory.pop_front();
            }
            self.memory
                .push_back((frame.header, frame.payload.to_vec()));
        }
    }

    /// Bytes as they are heard.
    pub(super) fn heard(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let Some(Ok(frame)) = self.decoder.push(*byte) else {
                continue;
            };
            self.counts.accepted += 1;
            let mut sent = self.memory.iter();
            let known = sent.any(|(header, payload)| {
                *header == frame.header && payload.as_slice() == frame.payload
            });
            self.counts.wrong += u64::from(!known);
        }
    }

    /// The counts.
    pub(super) fn counts(&self) -> LineAudit {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::{Address, Disarm, Envelope, MAX_ENCODED, Message};

    #[test]
    fn a_frame_that_nobody_sent_is_told_from_a_sound_and_a_broken_one() {
        let frame = |sequence: u16| {
            let envelope = Envelope {
                source: Address::MASTER,
                destination: Address::new(3).expect("a joint"),
                sequence,
            };
            let mut buffer = [0; MAX_ENCODED];
            let disarm = Message::from(Disarm {});
            disarm.emit(envelope, &mut buffer).expect("fits").to_vec()
        };
        let mut audit = Audit::default();
        audit.sent(&frame(1));
        audit.heard(&frame(1));
        let mut broken = frame(1);
        broken[4] ^= 1;
        audit.heard(&broken);
        audit.heard(&frame(2));
        let counts = audit.counts();
        assert_eq!((counts.sent, counts.accepted, counts.wrong), (1, 2, 1));
    }
}
