//! A checksum over state that must not change between two ticks.
//!
//! The state is sealed when a tick has finished with it and checked when the next one begins. Any single flipped bit is
//! detected, because each step of the sum is a bijection of the running value and of the word. Two flips cancel in less
//! than one of 300 pairs (a test counts them): only flips of the same bit in two words can. The fault campaign counts
//! what is missed. The checksum guards memory, not against a faulty computation.

use core::hash::{Hash, Hasher};

/// Word-wise sum used as a [`Hasher`], so that a derived `Hash` defines what is covered. Mixing takes one instruction
/// per word: multiply and accumulate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WordSum(u32);

impl WordSum {
    #[inline(always)]
    fn checksum_step(&mut self, word: u32) {
        // Odd multiplier (Knuth, 2^32 / golden ratio): a bijection.
        self.0 = self.0.wrapping_mul(0x9E37_79B1).wrapping_add(word);
    }
}

impl Hasher for WordSum {
    #[inline(always)]
    fn write(&mut self, bytes: &[u8]) {
        // Arrays of integers arrive as their bytes: take a word at a time, and four words per loop iteration.
        let (words, rest) = bytes.as_chunks::<4>();
        let (fours, words) = words.as_chunks::<4>();
        for [a, b, c, d] in fours {
            self.checksum_step(u32::from_ne_bytes(*a));
            self.checksum_step(u32::from_ne_bytes(*b));
            self.checksum_step(u32::from_ne_bytes(*c));
            self.checksum_step(u32::from_ne_bytes(*d));
        }
        for word in words {
            self.checksum_step(u32::from_ne_bytes(*word));
        }
        for byte in rest {
            self.checksum_step(u32::from(*byte));
        }
    }

    #[inline(always)]
    fn write_u8(&mut self, word: u8) {
        self.checksum_step(u32::from(word));
    }

    #[inline(always)]
    fn write_u16(&mut self, word: u16) {
        self.checksum_step(u32::from(word));
    }

    #[inline(always)]
    fn write_u32(&mut self, word: u32) {
        self.checksum_step(word);
    }

    #[inline(always)]
    fn write_u64(&mut self, word: u64) {
        // Low and high halves, both in full.
        self.checksum_step((word & 0xFFFF_FFFF) as u32);
        self.checksum_step(word.wrapping_shr(32) as u32);
    }

    #[inline(always)]
    fn write_usize(&mut self, word: usize) {
        // Lengths and discriminants: equal on 32 and 64 bit machines.
        self.checksum_step((word & 0xFFFF_FFFF) as u32);
    }

    fn finish(&self) -> u64 {
        u64::from(self.0)
    }
}

/// The sum of sealed state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Checksum {
    sum: u32,
}

impl Checksum {
    /// Checksum of `state`.
    #[inline(always)]
    pub fn of<T: Hash + ?Sized>(state: &T) -> Self {
        Self::made(|sum| state.hash(sum))
    }

    /// Checksum of what `write` feeds into the sum.
    #[inline(always)]
    pub(crate) fn made(write: impl FnOnce(&mut WordSum)) -> Self {
        let mut sum = WordSum(0);
        write(&mut sum);
        Self { sum: sum.0 }
    }

    /// Whether `state` is as it was when sealed.
    #[inline(always)]
    pub fn holds(&self, state: &impl Hash) -> bool {
        *self == Self::of(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_single_bit_flip_is_detected() {
        let state = [0_i32, -1, 0x1234_5678, i32::MIN, 7];
        let seal = Checksum::of(&state);
        assert!(seal.holds(&state));
        for word in 0..state.len() {
            for bit in 0..32 {
                let mut flipped = state;
                flipped[word] ^= 1 << bit;
                assert!(!seal.holds(&flipped), "word {word} bit {bit}");
            }
        }
    }

    #[test]
    fn two_flips_cancel_in_less_than_one_of_three_hundred_pairs() {
        const WORDS: usize = 24;
        let state: [u32; WORDS] =
            core::array::from_fn(|i| (i as u32 + 1).wrapping_mul(0x85EB_CA6B) >> (i % 20));
        let seal = Checksum::of(&state);
        let (mut pairs, mut missed) = (0_u32, 0_u32);
        for first in 0..WORDS * 32 {
            for second in 0..first {
                let mut flipped = state;
                flipped[first / 32] ^= 1 << (first % 32);
                flipped[second / 32] ^= 1 << (second % 32);
                pairs += 1;
                if seal.holds(&flipped) {
                    missed += 1;
                    assert_eq!(first % 32, second % 32, "only equal bits can cancel");
                }
            }
        }
        assert!(missed > 0 && missed * 300 < pairs, "{missed} of {pairs}");
    }

    #[test]
    fn every_integer_is_taken_as_its_words() {
        let of = |words: &[u32]| {
            Checksum::made(|sum| words.iter().for_each(|word| sum.write_u32(*word)))
        };
        assert_eq!(Checksum::of(&(0x12_u8, 0x3456_u16)), of(&[0x12, 0x3456]));
        assert_eq!(
            Checksum::of(&0x1234_5678_9ABC_DEF0_u64),
            of(&[0x9ABC_DEF0, 0x1234_5678])
        );
        assert_eq!(Checksum::of(&0x1234_5678_usize), of(&[0x1234_5678]));
        let mut sum = WordSum(0);
        0x1234_u16.hash(&mut sum);
        assert_eq!(sum.finish(), 0x1234);
    }

    #[test]
    fn exchanged_words_are_detected() {
        assert!(!Checksum::of(&[1_u32, 2]).holds(&[2_u32, 1]));
        assert!(!Checksum::of(&(1_u64, 0_u8)).holds(&(1_u64 << 32, 0_u8)));
    }
}
