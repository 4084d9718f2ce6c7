//! Noise of a measurement: what the file says of it, and what a fit leaves.

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::sensors::AdcNoise;

use super::point::ALL;

/// Noise of a pressure before it is known \[Pa\] (ASSUMED: a sensor of 10 bar with 0.2 %).
const PRESSURE_PA: f64 = 2e3;
/// Least noise, over that of the file: a model that is exact to less is one by chance.
const LEAST: f64 = 0.1;
/// Lags up to which correlations are summed, in correlation times (Sokal, Monte Carlo Methods in Statistical
/// Mechanics, 1996, section 3).
const WINDOW: f64 = 3.0;
/// Most lags: 10 s of samples 1 ms apart.
const LAGS: usize = 10_000;

/// Standard deviations of the measurements.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Of positions \[m\].
    pub position_m: f64,
    /// Of pressures \[Pa\].
    pub pressure_pa: f64,
}

/// Noise of the position by the axis file, and a guess for pressures.
#[must_use]
pub fn noise(axis: &AxisParams) -> Noise {
    let lsb_m = axis.potentiometer.electrical_stroke_m / f64::from(1_u32 << axis.adc.bits);
    let each = match axis.adc.noise {
        AdcNoise::None => 0.0,
        AdcNoise::Uniform { half_width_lsb } => half_width_lsb.powi(2) / 3.0,
        AdcNoise::Gaussian { sigma_lsb } => sigma_lsb.powi(2),
    };
    let mean = each / f64::from(axis.adc.oversampling.max(1));
    Noise {
        position_m: lsb_m * (mean + 1.0 / 12.0).sqrt(),
        pressure_pa: PRESSURE_PA,
    }
}

impl Noise {
    /// The noise that a fit leaves, from its residuals over this noise: `channels` of each sample in turn, the
    /// position first.
    pub(super) fn left(&self, residuals: &[f64], channels: usize) -> Self {
        let of = |channel: usize| {
            let each: Vec<f64> = residuals
                .iter()
                .copied()
                .skip(channel)
                .step_by(channels)
                .collect();
            effective_variance(&each, ALL / channels).sqrt().max(LEAST)
        };
        let pressure = (1..channels).map(of).fold(LEAST, f64::max);
        Self {
            position_m: self.position_m * of(0),
            pressure_pa: self.pressure_pa * if channels > 1 { pressure } else { 1.0 },
        }
    }
}

/// Variance of residuals that counts: that of independent ones which would say as much of a value that changes
/// slowly. Of n residuals with a correlation time of T samples, n / T are independent, and each fitted parameter
/// has taken one of them.
pub(super) fn effective_variance(residuals: &[f64], parameters: usize) -> f64 {
    let count = residuals.len().max(1) as f64;
    let square = residuals.iter().map(|r| r * r).sum::<f64>() / count;
    let time = correlation_time(residuals);
    let independent = count / time;
    let left = (independent - parameters as f64).max(1.0);
    square * time * (independent / left).max(1.0)
}

/// Integrated correlation time of a series about 0, in samples: 1 if it is white.
fn correlation_time(series: &[f64]) -> f64 {
    let square: f64 = series.iter().map(|x| x * x).sum();
    let mut time = 1.0;
    for lag in 1..series.len().min(LAGS) {
        let pairs = series.iter().zip(&series[lag..]);
        time += 2.0 * pairs.map(|(a, b)| a * b).sum::<f64>() / square.max(1e-300);
        if lag as f64 >= WINDOW * time {
            break;
        }
    }
    time.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_pcg::Pcg64Mcg;

    /// An autoregressive series has the correlation time (1 + r) / (1 - r) (Sokal, as above).
    #[test]
    fn the_correlation_time_of_a_known_series_is_found() {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        for r in [0.0, 0.5, 0.9, 0.98] {
            let mut value = 0.0;
            let series: Vec<f64> = (0..100_000)
                .map(|_| {
                    value = r * value + rng.random_range(-1.0..1.0_f64);
                    value
                })
                .collect();
            let expected = (1.0 + r) / (1.0 - r);
            let found = correlation_time(&series);
            assert!(
                (found / expected - 1.0).abs() < 0.2,
                "{found} of {expected}"
            );
        }
    }

    #[test]
    fn few_independent_residuals_count_as_one() {
        let same = [2.0; 100];
        assert!(effective_variance(&same, 16) >= 4.0 * 50.0);
        assert!((effective_variance(&[1.0, -1.0].repeat(5000), 16) - 1.0).abs() < 0.01);
    }
}
