//! Position and velocity of a cylinder.

use crate::round::{saturate_i16, saturate_i32, shift_right_round};
use fixed::types::I16F16;
use fixed::types::extra::{U4, U6};
use fixed::{FixedI16, traits::ToFixed};

/// Position on the bus (next reference): I10F6 millimetres, ±512 mm, step 1/64 mm.
pub type WirePosition = FixedI16<U6>;

/// Velocity on the bus: I12F4 millimetres per second, ±2048 mm/s, step 1/16 mm/s.
pub type WireVelocity = FixedI16<U4>;

macro_rules! motion_quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal, $wire:ty, $wire_bits:literal, $wire_name:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(transparent)]
        pub struct $name(I16F16);

        impl $name {
            /// Zero.
            pub const ZERO: Self = Self(I16F16::ZERO);
            /// Most negative representable value, about −32 768.
            pub const MIN: Self = Self(I16F16::MIN);
            /// Largest representable value, about 32 768.
            pub const MAX: Self = Self(I16F16::MAX);
            /// One step of the format, 2^-16.
            pub const DELTA: Self = Self(I16F16::DELTA);

            #[doc = concat!("From a fixed-point number of ", $unit, ", exact.")]
            #[must_use]
            pub const fn new(value: I16F16) -> Self {
                Self(value)
            }

            #[doc = concat!("The fixed-point number of ", $unit, ".")]
            #[must_use]
            pub const fn get(self) -> I16F16 {
                self.0
            }

            #[doc = concat!("From the raw integer, in ", $unit, " × 2^16: what the wire and parameters carry.")]
            #[must_use]
            pub const fn from_raw(raw: i32) -> Self {
                Self(I16F16::from_bits(raw))
            }

            #[doc = concat!("The raw integer, in ", $unit, " × 2^16.")]
            #[must_use]
            pub const fn raw(self) -> i32 {
                self.0.to_bits()
            }

            #[doc = concat!("From a whole number of ", $unit, ", exact for every `i16`.")]
            #[must_use]
            pub const fn from_int(value: i16) -> Self {
                Self::from_raw((value as i32).wrapping_shl(16))
            }

            #[doc = concat!("From a float of ", $unit, ": nearest, saturating; `NaN` gives zero. For the host and for set-up code, never for a control tick.")]
            #[must_use]
            pub fn from_f64(value: f64) -> Self {
                if value.is_nan() {
                    return Self::ZERO;
                }
                Self(value.saturating_to_fixed())
            }

            #[doc = concat!("As a float of ", $unit, ", exact. For the host, never for a control tick.")]
            #[must_use]
            pub fn to_f64(self) -> f64 {
                self.0.to_num()
            }

            /// Sum, saturating at the range of the format.
            #[must_use]
            pub const fn saturating_add(self, other: Self) -> Self {
                Self(self.0.saturating_add(other.0))
            }

            /// Difference `self − other`, saturating at the range of the format.
            #[must_use]
            pub const fn saturating_sub(self, other: Self) -> Self {
                Self(self.0.saturating_sub(other.0))
            }

            /// Magnitude; that of [`Self::MIN`] saturates to [`Self::MAX`].
            #[must_use]
            pub const fn saturating_abs(self) -> Self {
                // The larger of the value and its negative: one saturating instruction.
                let (value, negative) = (self.raw(), 0_i32.saturating_sub(self.raw()));
                Self::from_raw(if value > negative { value } else { negative })
            }

            /// The value limited to `low..=high`; `low` wins when the two are swapped.
            #[must_use]
            pub const fn limit(self, low: Self, high: Self) -> Self {
                if self.raw() < low.raw() {
                    low
                } else if self.raw() > high.raw() {
                    if high.raw() < low.raw() { low } else { high }
                } else {
                    self
                }
            }

            #[doc = concat!("To the bus format ", $wire_name, ": nearest, ties away from zero, saturating.")]
            #[must_use]
            pub const fn to_wire(self) -> $wire {
                let scaled = shift_right_round(self.raw() as i64, 16 - $wire_bits);
                <$wire>::from_bits(saturate_i16(scaled))
            }

            #[doc = concat!("From the bus format ", $wire_name, ", exact: the bus format is a subset.")]
            #[must_use]
            pub const fn from_wire(wire: $wire) -> Self {
                let wide = (wire.to_bits() as i64).wrapping_shl(16 - $wire_bits);
                Self::from_raw(saturate_i32(wide))
            }
        }
    };
}

motion_quantity!(
    /// Position or position difference: millimetres in I16F16, ±32 768 mm, step 15.3 nm.
    ///
    /// Strokes are 0 at the retracted end. A difference is an error when it is `target − measured`, positive
    /// when the cylinder must extend.
    PositionMm,
    "millimetres",
    WirePosition,
    6,
    "I10F6"
);

motion_quantity!(
    /// Velocity: millimetres per second in I16F16, ±32 768 mm/s, step 15.3 nm/s.
    ///
    /// Positive extends the cylinder.
    VelocityMmS,
    "millimetres per second",
    WireVelocity,
    4,
    "I12F4"
);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn wire_position_saturates_and_rounds_symmetrically() {
        // 512 mm is one step outside I10F6.
        assert_eq!(PositionMm::from_int(512).to_wire().to_bits(), i16::MAX);
        assert_eq!(PositionMm::from_int(-512).to_wire().to_bits(), i16::MIN);
        assert_eq!(PositionMm::from_int(-513).to_wire().to_bits(), i16::MIN);
        assert_eq!(PositionMm::MAX.to_wire().to_bits(), i16::MAX);
        assert_eq!(PositionMm::MIN.to_wire().to_bits(), i16::MIN);
        // Half a wire step is 2^-7 mm = 512 raw.
        assert_eq!(PositionMm::from_raw(511).to_wire().to_bits(), 0);
        assert_eq!(PositionMm::from_raw(512).to_wire().to_bits(), 1);
        assert_eq!(PositionMm::from_raw(-511).to_wire().to_bits(), 0);
        assert_eq!(PositionMm::from_raw(-512).to_wire().to_bits(), -1);
        assert_eq!(PositionMm::from_raw(-1537).to_wire().to_bits(), -2);
    }

    #[test]
    fn wire_velocity_saturates_and_rounds_symmetrically() {
        assert_eq!(VelocityMmS::from_int(2048).to_wire().to_bits(), i16::MAX);
        assert_eq!(VelocityMmS::from_int(-2048).to_wire().to_bits(), i16::MIN);
        assert_eq!(VelocityMmS::from_int(400).to_wire().to_bits(), 6400);
        assert_eq!(VelocityMmS::from_int(-400).to_wire().to_bits(), -6400);
        // Half a wire step is 1/32 mm/s = 2048 raw.
        assert_eq!(VelocityMmS::from_raw(2047).to_wire().to_bits(), 0);
        assert_eq!(VelocityMmS::from_raw(2048).to_wire().to_bits(), 1);
        assert_eq!(VelocityMmS::from_raw(-2048).to_wire().to_bits(), -1);
    }

    #[test]
    fn full_scale_arithmetic_saturates() {
        assert_eq!(
            PositionMm::MAX.saturating_add(PositionMm::DELTA),
            PositionMm::MAX
        );
        assert_eq!(
            PositionMm::MIN.saturating_sub(PositionMm::DELTA),
            PositionMm::MIN
        );
        assert_eq!(PositionMm::MIN.saturating_abs(), PositionMm::MAX);
        assert_eq!(PositionMm::from_int(i16::MIN), PositionMm::MIN);
        assert_eq!(PositionMm::from_int(-7).raw(), -7 * 65_536);
    }

    #[test]
    fn floats_saturate_and_not_a_number_is_zero() {
        assert_eq!(PositionMm::from_f64(1e9), PositionMm::MAX);
        assert_eq!(PositionMm::from_f64(f64::NEG_INFINITY), PositionMm::MIN);
        assert_eq!(PositionMm::from_f64(f64::NAN), PositionMm::ZERO);
        assert_eq!(PositionMm::from_f64(-1.5).raw(), -98_304);
    }

    proptest! {
        #[test]
        fn wire_round_trip_is_within_half_a_step(raw in -33_554_000_i32..33_554_000) {
            let position = PositionMm::from_raw(raw);
            let back = PositionMm::from_wire(position.to_wire());
            prop_assert!(back.saturating_sub(position).raw().abs() <= 512);
            let negated = PositionMm::from_raw(-raw).to_wire();
            prop_assert_eq!(negated.to_bits(), -position.to_wire().to_bits());
        }

        #[test]
        fn wire_values_survive_exactly(bits in any::<i16>()) {
            let wire = WireVelocity::from_bits(bits);
            prop_assert_eq!(VelocityMmS::from_wire(wire).to_wire(), wire);
            let wire = WirePosition::from_bits(bits);
            prop_assert_eq!(PositionMm::from_wire(wire).to_wire(), wire);
        }

        #[test]
        fn float_round_trip_is_exact(raw in any::<i32>()) {
            let position = PositionMm::from_raw(raw);
            prop_assert_eq!(PositionMm::from_f64(position.to_f64()), position);
        }

        #[test]
        fn limit_stays_in_range(raw in any::<i32>(), a in any::<i32>(), b in any::<i32>()) {
            let (low, high) = (a.min(b), a.max(b));
            let limited = PositionMm::from_raw(raw).limit(PositionMm::from_raw(low), PositionMm::from_raw(high));
            prop_assert_eq!(limited.raw(), raw.clamp(low, high));
        }
    }
}
