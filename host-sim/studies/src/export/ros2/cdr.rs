//! Common Data Representation, version 1, little-endian: the wire form of ROS 2 messages.
//!
//! Every number is aligned to a multiple of its size, counted after the four header bytes.

/// Bytes before the payload: little-endian CDR, no options.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// A message being written.
pub(super) struct Cdr(Vec<u8>);

impl Cdr {
    pub(super) fn new() -> Self {
        Self(HEAD.to_vec())
    }

    fn align(&mut self, size: usize) {
        let payload = self.0.len() - HEAD.len();
        self.0
            .resize(HEAD.len() + payload.next_multiple_of(size), 0);
    }

    fn u32(mut self, value: u32) -> Self {
        self.align(4);
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// The length of a sequence.
    pub(super) fn count(self, count: usize) -> Self {
        self.u32(u32::try_from(count).unwrap_or(u32::MAX))
    }

    /// Seconds (`int32`) and nanoseconds (`uint32`).
    pub(super) fn time(self, t_ns: u64) -> Self {
        let (sec, nsec) = (t_ns / 1_000_000_000, t_ns % 1_000_000_000);
        self.u32(u32::try_from(sec).unwrap_or(i32::MAX as u32))
            .u32(nsec as u32)
    }

    /// A string, with its length and a zero at its end.
    pub(super) fn text(self, text: &str) -> Self {
        let mut cdr = self.count(text.len() + 1);
        cdr.0.extend_from_slice(text.as_bytes());
        cdr.0.push(0);
        cdr
    }

    /// Numbers of eight bytes, without a length.
    pub(super) fn numbers(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        for value in values {
            self.align(8);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    pub(super) fn bytes(self) -> Vec<u8> {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_at_multiples_of_their_size() {
        let message = Cdr::new()
            .time(3_000_000_004)
            .text("ab")
            .count(1)
            .numbers([1.0]);
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([3, 0, 0, 0, 4, 0, 0, 0]);
        expected.extend([3, 0, 0, 0, b'a', b'b', 0, 0]);
        expected.extend([1, 0, 0, 0]);
        // 20 bytes of payload: four to the next multiple of eight.
        expected.extend([0, 0, 0, 0]);
        expected.extend(1.0_f64.to_le_bytes());
        assert_eq!(message.bytes(), expected);
    }
}
