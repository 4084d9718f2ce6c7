//! Durations. Time is always an argument; nothing here reads a clock.

/// Duration in whole microseconds, `u32`: up to 71 minutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Micros(pub u32);

impl Micros {
    /// No time.
    pub const ZERO: Self = Self(0);
    /// Longest representable duration.
    pub const MAX: Self = Self(u32::MAX);

    /// From whole milliseconds, saturating.
    #[must_use]
    pub const fn from_millis(millis: u32) -> Self {
        Self(millis.saturating_mul(1000))
    }

    /// The number of microseconds.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }

    /// Sum, saturating.
    #[must_use]
    pub const fn saturating_add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// Difference, zero when `other` is longer.
    #[must_use]
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// Whole ticks of length `tick` that cover this duration, rounded up:
    /// a time-out never ends early. A `tick` of zero counts as one microsecond.
    #[must_use]
    pub const fn to_ticks_ceil(self, tick: Self) -> Ticks {
        let length = if tick.0 == 0 { 1 } else { tick.0 };
        Ticks(self.0.div_ceil(length))
    }
}

/// Number of control ticks, `u32`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Ticks(pub u32);

impl Ticks {
    /// No ticks.
    pub const ZERO: Self = Self(0);

    /// The number of ticks.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }

    /// One more, saturating.
    #[must_use]
    pub const fn next(self) -> Self {
        Self(self.0.saturating_add(1))
    }

    /// One fewer, zero at zero.
    #[must_use]
    pub const fn previous(self) -> Self {
        Self(self.0.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::{Micros, Ticks};

    #[test]
    fn ticks_cover_the_duration() {
        let tick = Micros(1000);
        for (micros, ticks) in [
            (0, 0),
            (1, 1),
            (999, 1),
            (1000, 1),
            (1001, 2),
            (u32::MAX, 4_294_968),
        ] {
            assert_eq!(Micros(micros).to_ticks_ceil(tick), Ticks(ticks), "{micros}");
        }
        assert_eq!(Micros(5).to_ticks_ceil(Micros::ZERO), Ticks(5));
    }

    #[test]
    fn limits_saturate() {
        assert_eq!(Micros::MAX.saturating_add(Micros(1)), Micros::MAX);
        assert_eq!(Micros::ZERO.saturating_sub(Micros(1)), Micros::ZERO);
        assert_eq!(Micros::from_millis(u32::MAX), Micros::MAX);
        assert_eq!(Ticks(u32::MAX).next(), Ticks(u32::MAX));
        assert_eq!(Ticks::ZERO.previous(), Ticks::ZERO);
    }
}
