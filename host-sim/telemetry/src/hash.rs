//! The determinism hash over the telemetry of a run.

use super::registry::Sample;

/// BLAKE3 over (channel name, time, field values) of every sample of every channel, in the order and at the
/// rate in which the loop gives them. It leaves out the channels of a live robot's server: its inputs, and
/// how it keeps pace with the wall clock.
///
/// It does not depend on the output: a run without a log file, or with another encoding, decimation or
/// compression, has the same hash. The same binary, scenario, robot and seed give the same hash in any folder
/// and at any time of day, so nothing in it may come from the computer's clock.
///
/// Byte layout per sample: length of the channel name (u8), name, simulated time in nanoseconds
/// (u64, little-endian), then the fields as [`Sample::bytes`] lays them out. The name fixes the
/// fields, so the concatenation is unambiguous.
#[derive(Debug, Clone)]
pub struct TelemetryHash {
    hasher: blake3::Hasher,
    pending: Vec<u8>,
}

/// BLAKE3 reaches its full rate on inputs of several kilobytes.
const BATCH_BYTES: usize = 64 * 1024;

impl Default for TelemetryHash {
    fn default() -> Self {
        Self {
            hasher: blake3::Hasher::new(),
            pending: Vec::with_capacity(BATCH_BYTES + 4096),
        }
    }
}

impl TelemetryHash {
    /// Adds one sample.
    pub fn update<S: Sample>(&mut self, topic: &str, t_ns: u64, sample: &S) {
        self.pending.push(topic.len() as u8);
        self.pending.extend_from_slice(topic.as_bytes());
        self.pending.extend_from_slice(&t_ns.to_le_bytes());
        sample.bytes(&mut self.pending);
        if self.pending.len() >= BATCH_BYTES {
            self.hasher.update(&self.pending);
            self.pending.clear();
        }
    }

    /// The hash of everything added so far, as 64 hexadecimal digits.
    #[must_use]
    pub fn hex(&self) -> String {
        let mut hasher = self.hasher.clone();
        hasher.update(&self.pending);
        hasher.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FootSample, ProvenanceSample};

    fn foot(normal_force_n: f64, switches: u8) -> FootSample {
        FootSample {
            normal_force_n,
            switches,
            ..FootSample::default()
        }
    }

    fn hash(samples: &[(&str, u64, FootSample)]) -> String {
        let mut h = TelemetryHash::default();
        for (topic, t_ns, sample) in samples {
            h.update(topic, *t_ns, sample);
        }
        h.hex()
    }

    #[test]
    fn sees_channel_time_order_and_every_bit_of_every_field() {
        let base = hash(&[("/a", 1, foot(1.0, 3)), ("/b", 2, foot(2.0, 0))]);
        assert_eq!(
            base,
            hash(&[("/a", 1, foot(1.0, 3)), ("/b", 2, foot(2.0, 0))])
        );
        for other in [
            hash(&[("/c", 1, foot(1.0, 3)), ("/b", 2, foot(2.0, 0))]),
            hash(&[("/a", 3, foot(1.0, 3)), ("/b", 2, foot(2.0, 0))]),
            hash(&[
                ("/a", 1, foot(1.0_f64.next_up(), 3)),
                ("/b", 2, foot(2.0, 0)),
            ]),
            hash(&[("/a", 1, foot(1.0, 2)), ("/b", 2, foot(2.0, 0))]),
            hash(&[("/b", 2, foot(2.0, 0)), ("/a", 1, foot(1.0, 3))]),
            hash(&[("/a", 1, foot(1.0, 3))]),
        ] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn layout_is_as_documented() {
        let mut bytes = vec![2];
        bytes.extend_from_slice(b"/e");
        bytes.extend_from_slice(&7_u64.to_le_bytes());
        for text in ["mode", "joint 3 holds"] {
            bytes.extend_from_slice(&(text.len() as u32).to_le_bytes());
            bytes.extend_from_slice(text.as_bytes());
        }
        let mut h = TelemetryHash::default();
        let sample = ProvenanceSample {
            kind: "mode".into(),
            text: "joint 3 holds".into(),
        };
        h.update("/e", 7, &sample);
        assert_eq!(h.hex(), blake3::hash(&bytes).to_hex().to_string());
    }

    #[test]
    fn batching_does_not_change_the_result() {
        let mut batched = TelemetryHash::default();
        let mut plain = blake3::Hasher::new();
        for t in 0..5000_u64 {
            let sample = foot(t as f64, t as u8);
            batched.update("/x", t, &sample);
            let mut bytes = vec![2];
            bytes.extend_from_slice(b"/x");
            bytes.extend_from_slice(&t.to_le_bytes());
            sample.bytes(&mut bytes);
            plain.update(&bytes);
        }
        assert_eq!(batched.hex(), plain.finalize().to_hex().to_string());
    }
}
