//! From potentiometer code to stroke, with range and rate check.
//!
//! stroke = (code − zero) · full scale / 2^16. An open or shorted potentiometer pulls the converter input to a rail,
//! outside the valid codes; a loose wiper causes jumps that no piston can make. A rejected reading is replaced by the
//! last good one for as long as the sensor is faulty. Two consecutive rejections are a fault, so a dead sensor is acted
//! upon in its second tick. A wiper that loses contact every other tick is a fault at its third rejection (a leaky
//! count: +2 bad, −1 good, fault at 4). After a fault the wiper may have come back anywhere: the first good reading is
//! not compared with anything, and whatever keeps a history of strokes must restart there. A sensor that is stuck
//! inside its range is not detected here, but by the following error.

use crate::hardware::SensorError;
use core::hash::{Hash, Hasher};
use wheeleg_units::{AdcCode, PositionMm};

/// Added to the leaky count by a rejected reading; a good one takes 1 off.
const REJECTED_WEIGHT: u8 = 2;

/// Leaky count that is a fault.
const FAULT_LEVEL: u8 = 4;

/// Consecutive good readings that pass the self-test after reset.
pub const SELF_TEST_READINGS: u16 = 10;

/// Calibration and limits of a position sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SensorConfig {
    /// Code at zero stroke (U0F16 of converter full scale).
    pub zero: AdcCode,
    /// Travel over the whole converter range, mm.
    pub full_scale: PositionMm,
    /// Smallest valid code; below it the sensor is open or shorted.
    pub code_min: AdcCode,
    /// Largest valid code.
    pub code_max: AdcCode,
    /// Smallest stroke of the allowed travel, mm.
    pub travel_min: PositionMm,
    /// Largest stroke of the allowed travel, mm.
    pub travel_max: PositionMm,
    /// Largest credible change between two ticks, mm.
    pub step_max: PositionMm,
}

/// Why a reading was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// The converter gave no reading.
    Missing,
    /// Code outside the valid range: open or short circuit.
    Range,
    /// A valid code, but outside the allowed travel.
    Travel,
    /// Change faster than a piston can move.
    Rate,
}

/// One tick's reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Stroke; the last good one when this tick's reading was rejected.
    pub position: PositionMm,
    /// Why this tick's reading was rejected.
    pub rejected: Option<Rejection>,
    /// Set while the sensor is faulty: the reason of the newest rejection.
    pub fault: Option<Rejection>,
    /// The first good reading, or the first one after a fault: no earlier stroke belongs to the same motion.
    pub is_first: bool,
}

/// Checks and converts the readings of one position sensor. The order of the fields makes it two whole words, which are
/// sealed as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct SensorMonitor {
    /// The last good position; zero without one.
    last: PositionMm,
    rejected: u8,
    /// The next reading may be compared with the last good one.
    has_last: bool,
    good_in_row: u16,
}

impl Hash for SensorMonitor {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here; the small ones share a word.
        let Self {
            last,
            rejected,
            good_in_row,
            has_last,
        } = self;
        let small = u32::from(*rejected)
            | u32::from(*has_last).wrapping_shl(8)
            | u32::from(*good_in_row).wrapping_shl(16);
        state.write_u32(small);
        state.write_i32(last.raw());
    }
}

impl SensorMonitor {
    /// No reading yet.
    pub const fn new() -> Self {
        Self {
            last: PositionMm::ZERO,
            rejected: 0,
            good_in_row: 0,
            has_last: false,
        }
    }

    /// Takes the reading of this tick.
    pub fn sample(
        &mut self,
        reading: Result<AdcCode, SensorError>,
        config: &SensorConfig,
    ) -> Reading {
        match self.check(reading, config) {
            Ok(position) => {
                let is_first = !self.has_last;
                self.last = position;
                self.has_last = true;
                self.rejected = self.rejected.saturating_sub(1);
                self.good_in_row = self.good_in_row.saturating_add(1);
                Reading {
                    position,
                    rejected: None,
                    fault: None,
                    is_first,
                }
            }
            Err(rejection) => {
                self.good_in_row = 0;
                let level = self.rejected.saturating_add(REJECTED_WEIGHT);
                self.rejected = level.min(FAULT_LEVEL);
                let fault = (level >= FAULT_LEVEL).then_some(rejection);
                if fault.is_some() {
                    // Nothing to compare with any more: the wiper may come back anywhere. Its last good position is
                    // still the best guess.
                    self.has_last = false;
                }
                Reading {
                    position: self.last,
                    rejected: Some(rejection),
                    fault,
                    is_first: false,
                }
            }
        }
    }

    /// After another calibration the sensor has to prove itself again. Until it does, the last good position is used.
    pub fn restart(&mut self) {
        *self = Self {
            last: self.last,
            ..Self::new()
        };
    }

    /// Whether enough consecutive good readings have been seen.
    pub const fn is_settled(&self) -> bool {
        self.good_in_row >= SELF_TEST_READINGS
    }

    fn check(
        &self,
        reading: Result<AdcCode, SensorError>,
        config: &SensorConfig,
    ) -> Result<PositionMm, Rejection> {
        let code = reading.map_err(|_| Rejection::Missing)?;
        if code < config.code_min || code > config.code_max {
            return Err(Rejection::Range);
        }
        let position = config.position(code);
        if position < config.travel_min || position > config.travel_max {
            return Err(Rejection::Travel);
        }
        let step = position.saturating_sub(self.last).saturating_abs();
        if self.has_last && step > config.step_max {
            return Err(Rejection::Rate);
        }
        Ok(position)
    }
}

impl SensorConfig {
    /// Stroke at a code: exact product, rounded toward −∞ at 2^-16 mm, saturating.
    pub fn position(&self, code: AdcCode) -> PositionMm {
        let difference = i64::from(code.get()).saturating_sub(i64::from(self.zero.get()));
        // 17 bits times 32 bits: never saturates.
        let product = difference.saturating_mul(i64::from(self.full_scale.raw()));
        let raw = product.wrapping_shr(16);
        PositionMm::from_raw(i32::try_from(raw).unwrap_or(if raw < 0 {
            i32::MIN
        } else {
            i32::MAX
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checksum::Checksum;

    /// 4096 code steps per 16 mm: 1 mm = 256 codes.
    const CONFIG: SensorConfig = SensorConfig {
        zero: AdcCode::new(8192),
        full_scale: PositionMm::from_int(256),
        code_min: AdcCode::new(4096),
        code_max: AdcCode::new(61_440),
        travel_min: PositionMm::from_int(-5),
        travel_max: PositionMm::from_int(185),
        step_max: PositionMm::from_int(2),
    };

    fn code(millimetres: u16) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(8192 + millimetres * 256))
    }

    #[test]
    fn conversion_is_linear_and_signed() {
        assert_eq!(CONFIG.position(AdcCode::new(8192)), PositionMm::ZERO);
        assert_eq!(
            CONFIG.position(AdcCode::new(8192 + 25_600)),
            PositionMm::from_int(100)
        );
        assert_eq!(
            CONFIG.position(AdcCode::new(8192 - 256)),
            PositionMm::from_int(-1)
        );
        assert_eq!(
            CONFIG.position(AdcCode::new(8193)).raw(),
            256,
            "one code is 1/256 mm"
        );
        let steep = SensorConfig {
            full_scale: PositionMm::MAX,
            zero: AdcCode::MIN,
            ..CONFIG
        };
        assert!(steep.position(AdcCode::MAX) < PositionMm::MAX);
    }

    #[test]
    fn open_short_and_missing_are_faults_in_the_second_tick() {
        let cases = [
            (Ok(AdcCode::MIN), Rejection::Range),
            (Ok(AdcCode::MAX), Rejection::Range),
            (Ok(AdcCode::new(4095)), Rejection::Range),
            (Ok(AdcCode::new(61_441)), Rejection::Range),
            (Err(SensorError::NotReady), Rejection::Missing),
            (Err(SensorError::Converter), Rejection::Missing),
            (code(90), Rejection::Rate),
            (code(186), Rejection::Travel),
            (Ok(AdcCode::new(8192 - 6 * 256)), Rejection::Travel),
        ];
        for (bad, reason) in cases {
            let mut monitor = SensorMonitor::new();
            monitor.sample(code(50), &CONFIG);
            let first = monitor.sample(bad, &CONFIG);
            assert_eq!((first.rejected, first.fault), (Some(reason), None));
            assert_eq!(first.position, PositionMm::from_int(50), "last good one");
            assert_eq!(monitor.sample(bad, &CONFIG).fault, Some(reason));
        }
    }

    /// A blind sensor says nothing about the stroke: neither that it is zero nor that it moves.
    #[test]
    fn the_last_good_position_stands_for_as_long_as_the_sensor_is_faulty() {
        let mut monitor = SensorMonitor::new();
        assert!(monitor.sample(code(100), &CONFIG).is_first);
        assert!(!monitor.sample(code(100), &CONFIG).is_first);
        for _ in 0..20 {
            let reading = monitor.sample(Ok(AdcCode::MIN), &CONFIG);
            assert_eq!(reading.position, PositionMm::from_int(100));
            assert!(!reading.is_first);
        }
        let back = monitor.sample(code(60), &CONFIG);
        assert_eq!(back.position, PositionMm::from_int(60));
        assert_eq!((back.rejected, back.is_first), (None, true));
        assert!(!monitor.sample(code(60), &CONFIG).is_first);
    }

    #[test]
    fn another_calibration_has_to_prove_itself_and_keeps_the_place_meanwhile() {
        let mut monitor = SensorMonitor::new();
        for _ in 0..SELF_TEST_READINGS {
            monitor.sample(code(100), &CONFIG);
        }
        monitor.restart();
        assert!(!monitor.is_settled());
        let rejected = monitor.sample(Ok(AdcCode::MIN), &CONFIG);
        assert_eq!(rejected.position, PositionMm::from_int(100));
        let reading = monitor.sample(code(60), &CONFIG);
        assert_eq!((reading.rejected, reading.is_first), (None, true));
    }

    #[test]
    fn one_glitch_is_bridged_and_forgotten() {
        let mut monitor = SensorMonitor::new();
        for _ in 0..10 {
            for tick in 0..4 {
                let bad = tick == 3;
                let reading = monitor.sample(if bad { code(99) } else { code(50) }, &CONFIG);
                assert_eq!(reading.rejected.is_some(), bad);
                assert_eq!(reading.fault, None);
                assert_eq!(reading.position, PositionMm::from_int(50));
            }
        }
    }

    #[test]
    fn loose_wiper_is_a_fault_in_its_third_rejection() {
        let mut monitor = SensorMonitor::new();
        let mut faults = 0;
        for tick in 0..6 {
            let reading = monitor.sample(if tick % 2 == 1 { code(99) } else { code(50) }, &CONFIG);
            faults += usize::from(reading.fault.is_some());
            assert_eq!(reading.fault.is_some(), tick == 5);
        }
        assert_eq!(faults, 1);
    }

    #[test]
    fn fastest_credible_move_passes() {
        let mut monitor = SensorMonitor::new();
        for millimetres in (0..180).step_by(2) {
            assert_eq!(monitor.sample(code(millimetres), &CONFIG).rejected, None);
        }
        assert!(monitor.is_settled());
    }

    #[test]
    fn every_flipped_bit_of_what_the_monitor_keeps_changes_its_seal() {
        for (rejected, good_in_row, has_last) in [(0, 0, false), (0x5A, 0xA5, true)] {
            let sound = SensorMonitor {
                last: PositionMm::from_int(90),
                rejected,
                good_in_row,
                has_last,
            };
            for bit in 0..32 {
                let mut damaged = [sound; 4];
                damaged[0].last = PositionMm::from_raw(sound.last.raw() ^ (1 << bit));
                damaged[1].rejected ^= 1 << (bit % 8);
                damaged[2].good_in_row ^= 1 << (bit % 16);
                damaged[3].has_last = !has_last;
                for (field, damaged) in damaged.iter().enumerate() {
                    assert_ne!(Checksum::of(damaged), Checksum::of(&sound), "{field} {bit}");
                }
            }
        }
    }
}
