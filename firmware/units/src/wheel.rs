//! Wheel encoder counts.

/// Wheel position: 24-bit two's complement encoder counts that wrap around.
///
/// As in the HCTL-1100: −8 388 608…8 388 607 quadrature counts. With an encoder of 500 lines before a
/// reduction of 260:1 that is only ±16 wheel revolutions, with 100 lines ±80, so positions are compared only
/// by [`WheelCount::wrapping_difference`], and there is no ordering on this type. Positive is forward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct WheelCount(i32);

impl WheelCount {
    /// Zero.
    pub const ZERO: Self = Self(0);
    /// −2^23.
    pub const MIN: Self = Self(-8_388_608);
    /// 2^23 − 1.
    pub const MAX: Self = Self(8_388_607);

    /// From any integer, keeping the low 24 bits.
    #[must_use]
    pub const fn wrapping_new(count: i32) -> Self {
        Self(count.wrapping_shl(8).wrapping_shr(8))
    }

    /// From an integer that must fit 24 bits.
    #[must_use]
    pub const fn checked_new(count: i32) -> Option<Self> {
        let wrapped = Self::wrapping_new(count);
        if wrapped.0 == count {
            Some(wrapped)
        } else {
            None
        }
    }

    /// The count, sign-extended: −8 388 608…8 388 607.
    #[must_use]
    pub const fn get(self) -> i32 {
        self.0
    }

    /// Sum with a number of counts, modulo 2^24.
    #[must_use]
    pub const fn wrapping_add(self, counts: i32) -> Self {
        Self::wrapping_new(self.0.wrapping_add(counts))
    }

    /// The shorter way from `origin` to `self`: `self − origin` modulo 2^24, as
    /// −2^23…2^23−1 counts. Right as long as the true distance is below 2^23.
    #[must_use]
    pub const fn wrapping_difference(self, origin: Self) -> i32 {
        Self::wrapping_new(self.0.wrapping_sub(origin.0)).0
    }
}

#[cfg(test)]
mod tests {
    use super::WheelCount;
    use proptest::prelude::*;

    #[test]
    fn wraps_at_both_ends() {
        assert_eq!(WheelCount::MAX.wrapping_add(1), WheelCount::MIN);
        assert_eq!(WheelCount::MIN.wrapping_add(-1), WheelCount::MAX);
        assert_eq!(WheelCount::MIN.wrapping_difference(WheelCount::MAX), 1);
        assert_eq!(WheelCount::MAX.wrapping_difference(WheelCount::MIN), -1);
        assert_eq!(WheelCount::wrapping_new(1 << 24), WheelCount::ZERO);
        assert_eq!(WheelCount::checked_new(8_388_608), None);
        assert_eq!(WheelCount::checked_new(-8_388_608), Some(WheelCount::MIN));
        assert_eq!(WheelCount::checked_new(-8_388_609), None);
    }

    proptest! {
        #[test]
        fn difference_undoes_addition(start in any::<i32>(), step in -8_388_608..=8_388_607_i32) {
            let origin = WheelCount::wrapping_new(start);
            prop_assert_eq!(origin.wrapping_add(step).wrapping_difference(origin), step);
        }
    }
}
