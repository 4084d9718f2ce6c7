//! A number that may be known to be zero before the program runs.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A value with a flag that says whether it can differ from zero.
///
/// The flag depends on the chain's type alone, never on data. Everything in this folder is
/// inlined, so the optimiser sees every flag as a constant and drops the arithmetic on zeros, which
/// it may not do for plain floats (0 · x is not 0 for all x). Where it fails to, the result is the
/// same and slower.
#[derive(Debug, Clone, Copy)]
pub struct Num {
    value: f64,
    live: bool,
}

impl Num {
    /// Structural zero. All bits are zero, so that arrays of it are one `memset`.
    pub const ZERO: Self = Self {
        value: 0.0,
        live: false,
    };

    /// Any value.
    #[inline(always)]
    pub const fn any(value: f64) -> Self {
        Self { value, live: true }
    }

    /// Any value where `live` holds, a structural zero elsewhere.
    #[inline(always)]
    pub const fn where_live(live: bool, value: f64) -> Self {
        if live { Self::any(value) } else { Self::ZERO }
    }

    /// As a float.
    #[inline(always)]
    pub const fn get(self) -> f64 {
        if self.live { self.value } else { 0.0 }
    }

    /// 1/x; the caller has made sure that x is not a structural zero.
    #[inline(always)]
    pub fn recip(self) -> Self {
        Self::any(1.0 / self.get())
    }

    /// 2x, exactly.
    #[inline(always)]
    pub fn twice(self) -> Self {
        self + self
    }
}

impl Add for Num {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        match (self.live, other.live) {
            (true, true) => Self::any(self.value + other.value),
            (true, false) => self,
            (false, _) => other,
        }
    }
}

impl Neg for Num {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        if self.live {
            Self::any(-self.value)
        } else {
            self
        }
    }
}

impl Sub for Num {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        match (self.live, other.live) {
            (true, true) => Self::any(self.value - other.value),
            (true, false) => self,
            (false, true) => -other,
            (false, false) => Self::ZERO,
        }
    }
}

impl Mul for Num {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        if self.live && other.live {
            Self::any(self.value * other.value)
        } else {
            Self::ZERO
        }
    }
}

impl AddAssign for Num {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Num {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

#[cfg(test)]
mod tests {
    use super::Num;

    #[test]
    fn zeros_are_dropped_and_values_kept() {
        let (a, b, o) = (Num::any(3.0), Num::any(-0.5), Num::ZERO);
        assert_eq!((a + b).get(), 2.5);
        assert_eq!((a - b).get(), 3.5);
        assert_eq!((a * b).get(), -1.5);
        assert_eq!((a + o).get(), 3.0);
        assert_eq!((o + b).get(), -0.5);
        assert_eq!((o - a).get(), -3.0);
        assert_eq!((a - o).get(), 3.0);
        assert_eq!(b.recip().get(), -2.0);
        assert_eq!(a.twice().get(), 6.0);
        // A zero stays a zero with any other operand: plain floats may not do that.
        assert!(!(o * Num::any(f64::NAN)).live);
        assert!(!(o + o).live && !(o - o).live && !(-o).live);
        assert!((a * b).live && (a - o).live && (-a).live);
        assert_eq!(Num::where_live(false, 7.0).get(), 0.0);
        assert_eq!(Num::where_live(true, 7.0).get(), 7.0);
    }
}
