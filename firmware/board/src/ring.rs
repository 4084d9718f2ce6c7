//! Arithmetic of the circular receive buffer.

use wheeleg_units::Micros;

/// Bytes of the receive buffer.
pub const RING: usize = 256;

/// Time of one byte on the line, µs: ten bits at 1 Mbit/s.
const BYTE_US: u32 = 10;

/// The bytes from `from` up to, but without, `to` as at most two stretches
/// (start, length), the second one beginning at index 0.
#[must_use]
pub fn stretches(from: u16, to: u16) -> [(usize, usize); 2] {
    let (from, to) = (usize::from(from) % RING, usize::from(to) % RING);
    if from <= to {
        [(from, to.saturating_sub(from)), (0, 0)]
    } else {
        [(from, RING.saturating_sub(from)), (0, to)]
    }
}

/// When the last byte of the first stretch ended, if the second one ended at `t_end`.
#[must_use]
pub fn end_of_first(t_end: Micros, second: usize) -> Micros {
    let later = (second as u32).wrapping_mul(BYTE_US);
    Micros(t_end.get().wrapping_sub(later))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_cover_what_arrived_once_and_in_order() {
        for from in 0..RING as u16 {
            for length in 0..RING as u16 {
                let to = (from + length) % RING as u16;
                let [first, second] = stretches(from, to);
                let covered: Vec<usize> = (first.0..first.0 + first.1)
                    .chain(second.0..second.0 + second.1)
                    .collect();
                let expected: Vec<usize> = (0..usize::from(length))
                    .map(|n| (usize::from(from) + n) % RING)
                    .collect();
                assert_eq!(covered, expected);
            }
        }
    }

    #[test]
    fn the_first_stretch_ends_a_byte_time_earlier_per_byte_of_the_second() {
        assert_eq!(end_of_first(Micros(1000), 0), Micros(1000));
        assert_eq!(end_of_first(Micros(1000), 3), Micros(970));
        assert_eq!(end_of_first(Micros(5), 1), Micros(u32::MAX - 4));
    }
}
