//! Two numbers side by side: of the left and the right leg, of chambers A and B, now and over the last step.
//!
//! Each is computed as it would be alone, bit for bit; both take the time of one.

use std::ops::Neg;

use nalgebra::{ClosedAddAssign, ClosedMulAssign, ClosedSubAssign, Scalar, Vector3};
use wide::f64x2;

/// Two numbers.
pub(crate) type Both = f64x2;

/// One number or two.
pub(crate) trait Number:
    Scalar + Copy + ClosedAddAssign + ClosedSubAssign + ClosedMulAssign + Neg<Output = Self>
{
    /// The number, or the same twice.
    fn of(value: f64) -> Self;
}

impl Number for f64 {
    #[inline]
    fn of(value: f64) -> Self {
        value
    }
}

impl Number for Both {
    #[inline]
    fn of(value: f64) -> Self {
        Self::splat(value)
    }
}

/// The vector, or the same twice.
#[inline]
pub(crate) fn same<T: Number>(v: &Vector3<f64>) -> Vector3<T> {
    Vector3::new(T::of(v.x), T::of(v.y), T::of(v.z))
}

/// Two vectors.
#[inline]
pub(crate) fn both(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<Both> {
    Vector3::new(
        Both::new([a.x, b.x]),
        Both::new([a.y, b.y]),
        Both::new([a.z, b.z]),
    )
}

/// The two vectors of a pair.
#[inline]
pub(crate) fn each(pair: &Vector3<Both>) -> [Vector3<f64>; 2] {
    let [x, y, z] = [pair.x, pair.y, pair.z].map(Both::to_array);
    [0, 1].map(|i| Vector3::new(x[i], y[i], z[i]))
}
