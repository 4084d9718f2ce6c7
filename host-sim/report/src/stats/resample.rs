//! Intervals by resampling the values themselves (Efron 1979), the same for the same seed.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

use super::quantile;

/// Number of samples drawn.
const TIMES: usize = 1000;

/// Interval of a statistic, 95 % two-sided, percentiles of its values on samples drawn with replacement;
/// `None` for fewer than two values.
#[must_use]
pub fn bootstrap(values: &[f64], seed: u64, statistic: impl Fn(&[f64]) -> f64) -> Option<[f64; 2]> {
    if values.len() < 2 {
        return None;
    }
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut drawn = vec![0.0; values.len()];
    let found: Vec<f64> = (0..TIMES)
        .map(|_| {
            for value in &mut drawn {
                *value = values[random.random_range(0..values.len())];
            }
            statistic(&drawn)
        })
        .collect();
    Some([quantile(&found, 0.025)?, quantile(&found, 0.975)?])
}

#[cfg(test)]
mod tests {
    use super::bootstrap;
    use crate::stats::mean;

    /// The mean of a uniform sample has a standard error of span / √(12 n).
    #[test]
    fn an_interval_of_a_mean_is_as_wide_as_its_standard_error_says() {
        let values: Vec<f64> = (0..400).map(|i| (f64::from(i) + 0.5) / 400.0).collect();
        let of_mean = |v: &[f64]| mean(v).unwrap_or(f64::NAN);
        let [low, high] = bootstrap(&values, 1, of_mean).expect("an interval");
        let half = 1.96 / (12.0 * 400.0_f64).sqrt();
        assert!(
            (0.5 * (low + high) - 0.5).abs() < 0.2 * half,
            "{low} {high}"
        );
        assert!(
            (0.9..1.1).contains(&(0.5 * (high - low) / half)),
            "{low} {high}"
        );
        assert_eq!(bootstrap(&values, 1, of_mean), Some([low, high]));
        assert_ne!(bootstrap(&values, 2, of_mean), Some([low, high]));
        assert_eq!(bootstrap(&[1.0], 1, of_mean), None);
    }
}
