//! Sensors: linear potentiometer, 12-bit ADC with noise and oversampling, faults.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::hash::StateHasher;
use crate::noise::{Normal, unit_interval};

/// Linear potentiometer on a cylinder, ratiometric to the ADC's reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PotentiometerParams {
    /// Electrical stroke: wiper travel for 0..1 of the reference \[m\], 0.001..2.
    pub electrical_stroke_m: f64,
    /// Wiper position at stroke 0, from the electrical start \[m\], −0.1..0.1.
    pub offset_m: f64,
    /// Gain error \[-\], 0.8..1.2; 1 is ideal.
    pub gain: f64,
    /// Independent linearity: amplitude of a full sine over the electrical
    /// stroke, as a share of it \[-\], 0..0.05.
    pub nonlinearity: f64,
}

impl PotentiometerParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check(
            "potentiometer.electrical_stroke_m",
            self.electrical_stroke_m,
            0.001,
            2.0,
        )?;
        check("potentiometer.offset_m", self.offset_m, -0.1, 0.1)?;
        check("potentiometer.gain", self.gain, 0.8, 1.2)?;
        check("potentiometer.nonlinearity", self.nonlinearity, 0.0, 0.05)
    }

    /// Wiper voltage as a share of the reference, 0..=1.
    #[must_use]
    pub fn ratio(&self, stroke_m: f64) -> f64 {
        let u = (self.offset_m + self.gain * stroke_m) / self.electrical_stroke_m;
        let bow = if self.nonlinearity > 0.0 {
            self.nonlinearity * libm::sin(std::f64::consts::TAU * u)
        } else {
            0.0
        };
        (u + bow).clamp(0.0, 1.0)
    }
}

/// Shape of the conversion noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum AdcNoise {
    /// None.
    None,
    /// Gaussian.
    Gaussian {
        /// Standard deviation \[LSB of one conversion\], 0..100.
        sigma_lsb: f64,
    },
    /// Uniform in ±half width.
    Uniform {
        /// Half width \[LSB of one conversion\], 0..100.
        half_width_lsb: f64,
    },
}

/// One ADC channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AdcParams {
    /// Resolution of one conversion \[bit\], 8..=16.
    pub bits: u32,
    /// Conversions averaged in one reading, 1..=256.
    pub oversampling: u32,
    /// Noise of each conversion.
    pub noise: AdcNoise,
}

impl AdcParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("adc.bits", f64::from(self.bits), 8.0, 16.0)?;
        check("adc.oversampling", f64::from(self.oversampling), 1.0, 256.0)?;
        match self.noise {
            AdcNoise::None => Ok(()),
            AdcNoise::Gaussian { sigma_lsb } => check("adc.noise.sigma_lsb", sigma_lsb, 0.0, 100.0),
            AdcNoise::Uniform { half_width_lsb } => {
                check("adc.noise.half_width_lsb", half_width_lsb, 0.0, 100.0)
            }
        }
    }
}

/// An electrical fault of an analogue sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SensorFault {
    /// Healthy.
    #[default]
    None,
    /// Wiper open: the input floats up to the reference.
    Open,
    /// Wiper shorted to ground.
    Short,
    /// Wiper stuck at a share of the reference, 0..=1.
    Stuck {
        /// Share of the reference.
        ratio: f64,
    },
}

/// State of one ADC channel: its own random stream and its fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AdcState {
    rng: Pcg64Mcg,
    /// Injected fault.
    pub fault: SensorFault,
}

/// Random stream of one signal: a function of the run's seed and the signal's name
/// only, so that adding a signal leaves every other one unchanged.
#[must_use]
pub fn signal_rng(seed: u64, signal: &str) -> Pcg64Mcg {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&seed.to_le_bytes());
    hasher.update(signal.as_bytes());
    let digest = hasher.finalize();
    let mut key = [0u8; 16];
    key.copy_from_slice(&digest.as_bytes()[..16]);
    Pcg64Mcg::from_seed(key)
}

impl AdcState {
    /// Channel of the signal `signal` in a run with `seed`.
    #[must_use]
    pub fn new(seed: u64, signal: &str) -> Self {
        Self {
            rng: signal_rng(seed, signal),
            fault: SensorFault::None,
        }
    }

    /// One reading of an input that is a share of the reference: the mean of
    /// the conversions, left-aligned in 16 bits (full scale 65 520 for 12 bits).
    ///
    /// All conversions see the input as it is at the sampling instant; motion
    /// within a reading (0.4 µm per µs at full speed) is far below one LSB.
    #[must_use]
    pub fn read(&mut self, params: &AdcParams, ratio: f64) -> u16 {
        let ratio = match self.fault {
            SensorFault::None => ratio,
            SensorFault::Open => 1.0,
            SensorFault::Short => 0.0,
            SensorFault::Stuck { ratio } => ratio,
        };
        let top = f64::from((1u32 << params.bits) - 1);
        let ideal = ratio * f64::from(1u32 << params.bits);
        let mut sum = 0u64;
        let mut normal = Normal::default();
        for _ in 0..params.oversampling {
            let noise = match params.noise {
                AdcNoise::None => 0.0,
                AdcNoise::Gaussian { sigma_lsb } => sigma_lsb * normal.sample(&mut self.rng),
                AdcNoise::Uniform { half_width_lsb } => {
                    half_width_lsb * (2.0 * unit_interval(&mut self.rng) - 1.0)
                }
            };
            sum += (ideal + noise).floor().clamp(0.0, top) as u64;
        }
        let n = u64::from(params.oversampling);
        let scaled = sum << (16 - params.bits);
        ((scaled + n / 2) / n) as u16
    }

    /// Adds the state to a hash.
    pub fn feed(&self, hasher: &mut StateHasher) {
        hasher.bytes(&self.rng.state().to_le_bytes());
        match self.fault {
            SensorFault::None => hasher.u64(0),
            SensorFault::Open => hasher.u64(1),
            SensorFault::Short => hasher.u64(2),
            SensorFault::Stuck { ratio } => {
                hasher.u64(3);
                hasher.f64(ratio);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{adc, potentiometer};

    #[test]
    fn noise_has_the_mean_and_spread_asked_for() {
        let mut params = adc();
        params.oversampling = 1;
        params.noise = AdcNoise::Gaussian { sigma_lsb: 1.0 };
        let mut state = AdcState::new(1, "test");
        let n = 100_000;
        let input = 1234.5;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let code = f64::from(state.read(&params, input / 4096.0)) / 16.0;
            sum += code;
            squares += code * code;
        }
        let mean = sum / f64::from(n);
        let variance = squares / f64::from(n) - mean * mean;
        // Floor takes half an LSB off the mean and adds 1/12 to the variance.
        assert!((mean - (input - 0.5)).abs() < 0.02, "{mean}");
        assert!((variance - (1.0 + 1.0 / 12.0)).abs() < 0.03, "{variance}");
    }

    #[test]
    fn oversampling_narrows_the_spread_by_its_root() {
        let spread = |oversampling| {
            let params = AdcParams {
                oversampling,
                noise: AdcNoise::Uniform {
                    half_width_lsb: 1.0,
                },
                ..adc()
            };
            let mut state = AdcState::new(7, "spread");
            let n = 20_000;
            let codes: Vec<f64> = (0..n)
                .map(|_| f64::from(state.read(&params, 0.3)) / 16.0)
                .collect();
            let mean = codes.iter().sum::<f64>() / f64::from(n);
            (codes.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / f64::from(n)).sqrt()
        };
        let ratio = spread(1) / spread(16);
        assert!((ratio - 4.0).abs() < 0.2, "{ratio}");
    }

    #[test]
    fn ideal_codes_are_left_aligned_and_clamped() {
        let params = AdcParams {
            noise: AdcNoise::None,
            ..adc()
        };
        let mut s = AdcState::new(0, "x");
        assert_eq!(s.read(&params, 0.0), 0);
        assert_eq!(s.read(&params, 0.5), 2048 << 4);
        assert_eq!(s.read(&params, 1.0), 4095 << 4);
        s.fault = SensorFault::Open;
        assert_eq!(s.read(&params, 0.2), 4095 << 4);
        s.fault = SensorFault::Short;
        assert_eq!(s.read(&params, 0.2), 0);
        s.fault = SensorFault::Stuck { ratio: 0.25 };
        assert_eq!(s.read(&params, 0.9), 1024 << 4);
    }

    #[test]
    fn streams_depend_on_seed_and_name_only() {
        let params = AdcParams {
            noise: AdcNoise::Gaussian { sigma_lsb: 3.0 },
            ..adc()
        };
        let run = |seed, name| {
            let mut s = AdcState::new(seed, name);
            (0..50).map(|_| s.read(&params, 0.4)).collect::<Vec<_>>()
        };
        assert_eq!(run(1, "pot.1"), run(1, "pot.1"));
        assert_ne!(run(1, "pot.1"), run(1, "pot.2"));
        assert_ne!(run(1, "pot.1"), run(2, "pot.1"));
    }

    #[test]
    fn potentiometer_spans_its_electrical_stroke() {
        let mut p = potentiometer();
        p.nonlinearity = 0.0;
        let per_metre = (p.ratio(0.18) - p.ratio(0.0)) / 0.18;
        assert!((per_metre - p.gain / p.electrical_stroke_m).abs() < 1e-12);
        assert!(
            p.ratio(0.0) > 0.0 && p.ratio(0.18) < 1.0,
            "open and short stay visible"
        );
        p.nonlinearity = 0.001;
        let worst = (0..=1000)
            .map(|i| {
                let x = 0.18 * f64::from(i) / 1000.0;
                (p.ratio(x) - (p.offset_m + p.gain * x) / p.electrical_stroke_m).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst > 0.0009 && worst < 0.00101, "{worst}");
    }
}
