//! Errors of the bus line: flipped, lost and inserted bytes, late transmissions.

use rand::{Rng, RngExt};
use wheeleg_protocol::frame::{MAX_PAYLOAD, VERSION, encode, encoded_len};
use wheeleg_protocol::{Address, Header, MAX_ENCODED, NODES};

/// Message type of no message.
const RECORD: u8 = 0x7F;

/// Rates of the errors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct LineErrors {
    /// Probability that a bit is wrong.
    pub(crate) bit: f64,
    /// Probability that a byte is lost.
    pub(crate) lost: f64,
    /// Probability that a random byte follows a byte.
    pub(crate) inserted: f64,
    /// Longest delay of a transmission, ns; uniform from 0.
    pub(crate) delay_ns: u64,
}

impl LineErrors {
    /// Whether the line is sound.
    pub(crate) fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The bytes that reach the receivers of `bytes`.
    pub(crate) fn corrupt(&self, bytes: &[u8], rng: &mut impl Rng) -> Vec<u8> {
        let mut out = Vec::with_capacity(bytes.len());
        for &byte in bytes {
            let mut mask = 0;
            if self.bit > 0.0 {
                for bit in 0..8 {
                    mask |= u8::from(rng.random_bool(self.bit)) << bit;
                }
            }
            if !(self.lost > 0.0 && rng.random_bool(self.lost)) {
                out.push(byte ^ mask);
            }
            if self.inserted > 0.0 && rng.random_bool(self.inserted) {
                out.push(rng.random());
            }
        }
        out
    }

    /// How late this transmission is, ns.
    pub(crate) fn delay_ns(&self, rng: &mut impl Rng) -> u64 {
        if self.delay_ns == 0 {
            0
        } else {
            rng.random_range(0..=self.delay_ns)
        }
    }
}

/// Bytes without meaning.
pub(super) fn rubbish(bytes: usize, rng: &mut impl Rng) -> Vec<u8> {
    (0..bytes).map(|_| rng.random()).collect()
}

/// A sound frame of an unknown type, from the last board to the master, as long as fits into `room` bytes;
/// `None` if none does.
pub(super) fn record(room: usize) -> Option<Vec<u8>> {
    let payload = room.checked_sub(encoded_len(0))?.min(MAX_PAYLOAD);
    let header = Header {
        version: VERSION,
        message_type: RECORD,
        source: Address::new(NODES as u8)?,
        destination: Address::MASTER,
        sequence: 0,
    };
    let mut buffer = [0; MAX_ENCODED];
    Some(
        encode(&header, &[0x55; MAX_PAYLOAD][..payload], &mut buffer)
            .ok()?
            .to_vec(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    fn rng() -> Pcg64Mcg {
        Pcg64Mcg::seed_from_u64(1)
    }

    #[test]
    fn a_sound_line_changes_nothing() {
        let bytes: Vec<u8> = (0..=255).collect();
        let line = LineErrors::default();
        assert!(line.is_none());
        assert_eq!(line.corrupt(&bytes, &mut rng()), bytes);
        assert_eq!(line.delay_ns(&mut rng()), 0);
    }

    /// Each rate within five standard deviations of what was asked for.
    #[test]
    fn errors_come_at_their_rates() {
        let zeros = vec![0_u8; 200_000];
        let bits = zeros.len() as f64 * 8.0;
        let mut rng = rng();
        let flips = LineErrors {
            bit: 1e-3,
            ..LineErrors::default()
        };
        let ones: u32 = flips
            .corrupt(&zeros, &mut rng)
            .iter()
            .map(|b| b.count_ones())
            .sum();
        assert!((f64::from(ones) - bits * 1e-3).abs() < 5.0 * (bits * 1e-3).sqrt());
        let lost = LineErrors {
            lost: 0.01,
            ..LineErrors::default()
        };
        let n = zeros.len() - lost.corrupt(&zeros, &mut rng).len();
        assert!((n as f64 - 2000.0).abs() < 5.0 * 2000_f64.sqrt());
        let inserted = LineErrors {
            inserted: 0.01,
            ..LineErrors::default()
        };
        let n = inserted.corrupt(&zeros, &mut rng).len() - zeros.len();
        assert!((n as f64 - 2000.0).abs() < 5.0 * 2000_f64.sqrt());
    }

    #[test]
    fn delays_fill_their_range() {
        let late = LineErrors {
            delay_ns: 1000,
            ..LineErrors::default()
        };
        let mut rng = rng();
        let delays: Vec<u64> = (0..1000).map(|_| late.delay_ns(&mut rng)).collect();
        assert!(delays.iter().all(|d| *d <= 1000));
        assert!(delays.iter().any(|d| *d < 50) && delays.iter().any(|d| *d > 950));
    }

    #[test]
    fn a_record_is_a_sound_frame_of_the_room_there_is() {
        for room in [15, 16, 40, 199, 200, 1000] {
            let bytes = record(room).expect("fits");
            assert_eq!(bytes.len(), room.min(MAX_ENCODED));
            let mut decoder = wheeleg_protocol::Decoder::new();
            let sound = bytes
                .iter()
                .filter(|b| matches!(decoder.push(**b), Some(Ok(_))));
            assert_eq!(sound.count(), 1);
        }
        assert_eq!(record(14), None);
    }
}
