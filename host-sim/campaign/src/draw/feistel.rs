//! A permutation of the numbers below n that needs no table: a Feistel network over the next even number of
//! bits, repeated until the number is below n again (cycle walking, Black and Rogaway 2002).

/// Number of rounds. Four turn a pseudorandom function into a pseudorandom permutation (Luby and Rackoff
/// 1988); two more are cheap.
const ROUNDS: u8 = 6;

/// A keyed permutation of 0 to n − 1.
pub(super) struct Permutation {
    key: [u8; 32],
    n: u64,
    /// Number of bits in one half.
    half: u32,
}

impl Permutation {
    pub(super) fn new(key: [u8; 32], n: u64) -> Self {
        let bits = u64::BITS - n.saturating_sub(1).leading_zeros();
        Self {
            key,
            n,
            half: bits.div_ceil(2).max(1),
        }
    }

    /// Image of a number.
    pub(super) fn of(&self, number: u64) -> u64 {
        debug_assert!(number < self.n);
        let mut image = self.network(number);
        // At worst a quarter of the numbers are below n, so this takes few steps.
        while image >= self.n {
            image = self.network(image);
        }
        image
    }

    fn network(&self, number: u64) -> u64 {
        let mask = (1_u64 << self.half) - 1;
        let (mut left, mut right) = (number >> self.half, number & mask);
        for round in 0..ROUNDS {
            let mut hasher = blake3::Hasher::new_keyed(&self.key);
            hasher.update(&[round]);
            hasher.update(&right.to_le_bytes());
            let mixed = super::first(*hasher.finalize().as_bytes()) & mask;
            (left, right) = (right, left ^ mixed);
        }
        left << self.half | right
    }
}

#[cfg(test)]
mod tests {
    use super::Permutation;

    #[test]
    fn every_number_comes_once() {
        for n in [1, 2, 3, 4, 5, 16, 17, 100, 1000] {
            let permutation = Permutation::new([7; 32], n);
            let mut images: Vec<u64> = (0..n).map(|i| permutation.of(i)).collect();
            if n >= 100 {
                assert_ne!(images, (0..n).collect::<Vec<_>>());
            }
            images.sort_unstable();
            assert_eq!(images, (0..n).collect::<Vec<_>>(), "{n}");
        }
    }

    #[test]
    fn another_key_is_another_permutation() {
        let of = |key| {
            let permutation = Permutation::new([key; 32], 1000);
            (0..1000).map(|i| permutation.of(i)).collect::<Vec<_>>()
        };
        let (one, other) = (of(1), of(2));
        let same = one.iter().zip(&other).filter(|(a, b)| a == b).count();
        // A random permutation of a thousand numbers has one fixed point on average.
        assert!(same < 10, "{same}");
    }
}
