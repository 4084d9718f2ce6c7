//! Lengths of the three cylinders of a leg.

use crate::Scalar;

/// Cylinder lengths of one leg (m). Rates and accelerations of the lengths are plain vectors in
/// the same order [b2, b5, b6].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegLengths<T> {
    /// Yaw cylinder.
    pub b2_m: T,
    /// Horizontal cylinder.
    pub b5_m: T,
    /// Vertical cylinder.
    pub b6_m: T,
}

impl<T: Scalar> LegLengths<T> {
    /// Lengths in metres.
    pub fn new(b2_m: T, b5_m: T, b6_m: T) -> Self {
        Self { b2_m, b5_m, b6_m }
    }

    /// [b2, b5, b6].
    pub fn to_array(&self) -> [T; 3] {
        [self.b2_m, self.b5_m, self.b6_m]
    }
}
