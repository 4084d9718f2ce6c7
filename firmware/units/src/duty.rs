//! Valve duty.

use crate::round::{saturate_i16, shift_right_round};
use fixed::types::extra::U14;
use fixed::{FixedI16, FixedI32, types::extra::U30};

/// Duty in telemetry: I2F14, −2…2, step 6.1e-5. Only −1…1 is ever sent.
pub type WireDuty = FixedI16<U14>;

/// Signed duty: I2F30, limited to −1…1, step 9.3e-10.
///
/// The fraction of the PWM period for which the driving valves should be open. Positive extends the cylinder
/// (fill A, vent B), negative retracts it (fill B, vent A), zero shuts all valves. Every constructor limits
/// to ±1, so a `Duty` outside it cannot exist.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Duty(FixedI32<U30>);

impl Duty {
    /// All valves shut.
    pub const ZERO: Self = Self(FixedI32::ZERO);
    /// Full extension, +1.
    pub const ONE: Self = Self(FixedI32::from_bits(1 << 30));
    /// Full retraction, −1.
    pub const MINUS_ONE: Self = Self(FixedI32::from_bits(-(1 << 30)));

    /// From a fixed-point fraction, limited to ±1.
    #[must_use]
    pub const fn new(value: FixedI32<U30>) -> Self {
        Self::from_raw(value.to_bits())
    }

    /// The fixed-point fraction, −1…1.
    #[must_use]
    pub const fn get(self) -> FixedI32<U30> {
        self.0
    }

    /// From the raw integer (fraction × 2^30), limited to ±2^30.
    #[must_use]
    pub const fn from_raw(raw: i32) -> Self {
        Self::from_raw_wide(raw as i64)
    }

    /// From a wide raw integer (fraction × 2^30), limited to ±2^30.
    #[must_use]
    pub const fn from_raw_wide(raw: i64) -> Self {
        if raw > Self::ONE.raw() as i64 {
            Self::ONE
        } else if raw < Self::MINUS_ONE.raw() as i64 {
            Self::MINUS_ONE
        } else {
            Self(FixedI32::from_bits(raw as i32))
        }
    }

    /// The raw integer, fraction × 2^30, in ±2^30.
    #[must_use]
    pub const fn raw(self) -> i32 {
        self.0.to_bits()
    }

    /// From per mille, limited to ±1000; nearest step.
    #[must_use]
    pub const fn from_per_mille(per_mille: i16) -> Self {
        // 2^30 / 1000 in 12 further bits, exact to 1e-12: products fit an i64.
        Self::from_raw_wide(shift_right_round(
            (per_mille as i64).wrapping_mul(4_398_046_511),
            12,
        ))
    }

    /// Magnitude, 0…1.
    #[must_use]
    pub const fn abs(self) -> Self {
        // In ±2^30: the magnitude is always representable.
        Self(self.0.saturating_abs())
    }

    /// The opposite direction, exact.
    #[must_use]
    pub const fn negated(self) -> Self {
        Self(self.0.saturating_neg())
    }

    /// To the telemetry format: nearest, ties away from zero. Always in range.
    #[must_use]
    pub const fn to_wire(self) -> WireDuty {
        WireDuty::from_bits(saturate_i16(shift_right_round(self.raw() as i64, 16)))
    }

    /// From the telemetry format, limited to ±1, exact inside.
    #[must_use]
    pub const fn from_wire(wire: WireDuty) -> Self {
        Self::from_raw_wide((wire.to_bits() as i64).wrapping_shl(16))
    }

    /// As a float, exact. For the host, never for a control tick.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        self.0.to_num()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn limits_are_exactly_one() {
        assert_eq!(Duty::ONE.to_f64(), 1.0);
        assert_eq!(Duty::MINUS_ONE.to_f64(), -1.0);
        assert_eq!(Duty::from_raw(i32::MAX), Duty::ONE);
        assert_eq!(Duty::from_raw(i32::MIN), Duty::MINUS_ONE);
        assert_eq!(Duty::from_raw((1 << 30) + 1), Duty::ONE);
        assert_eq!(Duty::from_raw((1 << 30) - 1).raw(), (1 << 30) - 1);
        assert_eq!(Duty::from_raw_wide(i64::MIN), Duty::MINUS_ONE);
    }

    #[test]
    fn per_mille_is_exact_to_a_step() {
        for per_mille in -1000..=1000_i16 {
            let exact = f64::from(per_mille) / 1000.0;
            let got = Duty::from_per_mille(per_mille).to_f64();
            assert!(
                (got - exact).abs() <= 1.0 / f64::from(1 << 30),
                "{per_mille}: {got}"
            );
        }
        assert_eq!(Duty::from_per_mille(1000), Duty::ONE);
        assert_eq!(Duty::from_per_mille(-1000), Duty::MINUS_ONE);
        assert_eq!(Duty::from_per_mille(i16::MIN), Duty::MINUS_ONE);
    }

    proptest! {
        #[test]
        fn wire_is_odd_and_near(raw in -(1_i32 << 30)..=(1 << 30)) {
            let duty = Duty::from_raw(raw);
            prop_assert_eq!(duty.negated().to_wire().to_bits(), -duty.to_wire().to_bits());
            prop_assert!((duty.to_wire().to_num::<f64>() - duty.to_f64()).abs() <= 0.5 / 16_384.0);
        }
    }
}
