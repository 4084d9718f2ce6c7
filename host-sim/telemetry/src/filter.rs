//! The low-pass used for force and acceleration plots.

use std::f64::consts::{PI, SQRT_2};

/// Second-order Butterworth low-pass, one causal pass, bilinear transform with
/// pre-warping. Used at 20 Hz for the comparison of forces and accelerations
/// with the paper (the 1 kHz samples hold stick-slip and valve impulses that a
/// 2003 recording at an unknown, slower rate cannot have shown). Its delay at
/// low frequency is `sqrt(2) / (2 pi f_c)` = 11.3 ms.
#[derive(Debug, Clone)]
pub struct LowPass2 {
    b0: f64,
    a1: f64,
    a2: f64,
    z1: f64,
    z2: f64,
    primed: bool,
}

impl LowPass2 {
    /// A filter with corner `cutoff_hz` for samples every `period_s`.
    /// The corner must lie below half the sample rate.
    #[must_use]
    pub fn new(cutoff_hz: f64, period_s: f64) -> Self {
        let k = libm::tan(PI * cutoff_hz * period_s);
        let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
        Self {
            b0: k * k * norm,
            a1: 2.0 * (k * k - 1.0) * norm,
            a2: (1.0 - SQRT_2 * k + k * k) * norm,
            z1: 0.0,
            z2: 0.0,
            primed: false,
        }
    }

    /// Filters one sample. The first sample sets the steady state, so that a
    /// record does not begin with a transient from zero.
    pub fn step(&mut self, x: f64) -> f64 {
        if !self.primed {
            self.primed = true;
            self.z2 = x * (self.b0 - self.a2);
            self.z1 = x * (2.0 * self.b0 - self.a1) + self.z2;
        }
        let y = self.b0 * x + self.z1;
        self.z1 = 2.0 * self.b0 * x - self.a1 * y + self.z2;
        self.z2 = self.b0 * x - self.a2 * y;
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain_at(frequency_hz: f64) -> f64 {
        let mut filter = LowPass2::new(20.0, 1e-3);
        let mut peak = 0.0_f64;
        for i in 0..4000 {
            let t = f64::from(i) * 1e-3;
            let y = filter.step((2.0 * PI * frequency_hz * t).sin());
            if i > 2000 {
                peak = peak.max(y.abs());
            }
        }
        peak
    }

    #[test]
    fn is_a_butterworth_of_second_order() {
        // |H| = 1/sqrt(1 + (f/fc)^4), up to bilinear warping.
        for (f, expected) in [(2.0, 0.99995), (20.0, 0.5_f64.sqrt()), (80.0, 0.0607)] {
            let gain = gain_at(f);
            assert!(
                (gain - expected).abs() < 0.01 * expected.max(0.1),
                "{f} Hz: {gain}"
            );
        }
    }

    #[test]
    fn a_constant_passes_from_the_first_sample() {
        let mut filter = LowPass2::new(20.0, 1e-3);
        for _ in 0..50 {
            assert!((filter.step(25.78) - 25.78).abs() < 1e-9);
        }
    }
}
