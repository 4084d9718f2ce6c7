//! Random numbers whose bits depend only on the generator, not on the system's mathematics.

use rand::Rng;

/// A number in 0..1 (1 excluded) with 53 random bits.
#[must_use]
pub fn unit_interval(rng: &mut impl Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Standard normal distribution after Box and Muller (1958): two uniform numbers give a pair of
/// independent normal ones, of which the second is kept for the next call.
///
/// `rand_distr` would do the same faster, but takes `exp` and `ln` from the C library.
#[derive(Debug, Clone, Copy, Default)]
pub struct Normal {
    second: Option<f64>,
}

impl Normal {
    /// The next number: mean 0, variance 1.
    #[must_use]
    pub fn sample(&mut self, rng: &mut impl Rng) -> f64 {
        if let Some(second) = self.second.take() {
            return second;
        }
        // 1 - u lies in (0, 1], where the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - unit_interval(rng))).sqrt();
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * unit_interval(rng));
        self.second = Some(radius * sin);
        radius * cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::signal_rng;

    #[test]
    fn normal_numbers_have_the_moments_and_tails_of_the_distribution() {
        let (mut rng, mut normal) = (signal_rng(1, "normal"), Normal::default());
        let n = 1_000_000_u32;
        let (mut sums, mut beyond_two, mut pair) = ([0.0; 4], 0_u32, 0.0);
        let mut last = 0.0;
        for _ in 0..n {
            let x = normal.sample(&mut rng);
            for (power, sum) in (1..).zip(&mut sums) {
                *sum += x.powi(power);
            }
            beyond_two += u32::from(x.abs() > 2.0);
            pair += x * last;
            last = x;
        }
        let n = f64::from(n);
        // Five standard errors each: 1, sqrt(2), sqrt(15), sqrt(96) over sqrt(n).
        assert!((sums[0] / n).abs() < 5e-3, "{sums:?}");
        assert!((sums[1] / n - 1.0).abs() < 7.1e-3, "{sums:?}");
        assert!((sums[2] / n).abs() < 20e-3, "{sums:?}");
        assert!((sums[3] / n - 3.0).abs() < 49e-3, "{sums:?}");
        assert!(
            (f64::from(beyond_two) / n - 0.0455).abs() < 1.1e-3,
            "{beyond_two}"
        );
        assert!((pair / n).abs() < 5e-3, "{pair}");
    }

    #[test]
    fn the_first_numbers_of_a_stream_are_these_on_every_system() {
        let (mut rng, mut normal) = (signal_rng(7, "fixed"), Normal::default());
        let bits: [u64; 4] = std::array::from_fn(|_| normal.sample(&mut rng).to_bits());
        assert_eq!(
            bits,
            [
                13_832_096_430_855_038_519,
                4_601_883_296_202_459_073,
                13_825_656_386_310_286_478,
                4_608_951_083_993_982_317
            ]
        );
    }
}
