//! The right leg is the left one mirrored in Y.
//!
//! A vector (position, force, velocity of a point) changes the sign of its Y component, an axial
//! vector (angular velocity, moment, angular momentum) those of X and Z.

use nalgebra::{Matrix3, Vector3};

use crate::both::Both;

/// +1 for the left leg, −1 for the right one.
pub(super) fn sign(leg: usize) -> f64 {
    if leg == 0 { 1.0 } else { -1.0 }
}

pub(super) fn vector(sign: f64, v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, sign * v.y, v.z)
}

pub(super) fn axial(sign: f64, v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(sign * v.x, v.y, sign * v.z)
}

/// [`vector`] for both legs.
#[inline]
pub(super) fn both(v: &Vector3<f64>) -> Vector3<Both> {
    Vector3::new(Both::splat(v.x), Both::new([v.y, -v.y]), Both::splat(v.z))
}

/// [`axial`] for both legs.
#[inline]
pub(super) fn both_axial(v: &Vector3<f64>) -> Vector3<Both> {
    Vector3::new(
        Both::new([v.x, -v.x]),
        Both::splat(v.y),
        Both::new([v.z, -v.z]),
    )
}

/// The reflection itself.
pub(super) fn matrix(sign: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, sign, 1.0))
}
