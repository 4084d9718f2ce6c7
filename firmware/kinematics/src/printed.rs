//! Equations as the paper prints them, wrong terms included. Diagnostics only: never in control.
//!
//! They show how far the printed forms are from the corrected ones, and let a reader check the
//! reconstruction of the paper.

use nalgebra::{Vector3, Vector6};

use crate::{Phi, Scalar, Theta3, lit};

/// Printed (13): foot twist of the R2P chain, rates [θ̇4, ḃ5, ḃ6]. Wrong sign of ωz, ẏ missing,
/// home pose only.
pub fn twist_13<T: Scalar>(rates: &Vector3<T>) -> Vector6<T> {
    let o = T::zero();
    Vector6::new(o, o, -rates.x, rates.y, o, -rates.z)
}

/// Printed (16): derivative of the foot twist. Home pose and b5 → 0 only.
pub fn twist_dot_16<T: Scalar>(rates: &Vector3<T>, accelerations: &Vector3<T>) -> Vector6<T> {
    let o = T::zero();
    Vector6::new(
        o,
        o,
        accelerations.x,
        accelerations.y,
        lit::<T>(2.0) * rates.x * rates.y,
        -accelerations.z,
    )
}

/// Printed (32): tip twist of the RPR chain, rates [θ̇1, ḃ2, θ̇3]. The terms of b2 are missing.
pub fn twist_32<T: Scalar>(crank_m: T, theta3: Theta3<T>, rates: &Vector3<T>) -> Vector6<T> {
    let (s3, c3) = theta3.rad().sin_cos();
    let w = rates.x + rates.z;
    let o = T::zero();
    Vector6::new(o, o, w, -crank_m * s3 * w, crank_m * c3 * w, o)
}

/// Printed (38): derivative of the tip twist. Coriolis factor, b2θ̈1 and b2θ̇1² missing, one sign
/// wrong.
pub fn twist_dot_38<T: Scalar>(
    crank_m: T,
    theta3: Theta3<T>,
    rates: &Vector3<T>,
    accelerations: &Vector3<T>,
) -> Vector6<T> {
    let (s3, c3) = theta3.rad().sin_cos();
    let w = rates.x + rates.z;
    let a = accelerations.x + accelerations.z;
    let o = T::zero();
    Vector6::new(
        o,
        o,
        a,
        -crank_m * s3 * a - (rates.x * rates.y + crank_m * c3 * w * w),
        accelerations.y + crank_m * c3 * a + crank_m * s3 * w * w,
        o,
    )
}

/// Printed (27): value of the quartic in γ = tan(θ1/2) (m). Its signs correspond to an elimination
/// with the wrong sign on the cos θ1 terms; the right equation is a quadratic.
pub fn quartic_27<T: Scalar>(crank_m: T, p4_m: [T; 2], theta3: Theta3<T>, gamma: T) -> T {
    let [xt, yt] = p4_m;
    let lc = crank_m * theta3.rad().cos();
    let two_y = lit::<T>(2.0) * yt;
    ((((lc - xt) * gamma - two_y) * gamma - lit::<T>(6.0) * lc) * gamma - two_y) * gamma + lc + xt
}

/// Printed (39), second row: Yp = b2 cot θ4 (m). The right one is −b5 cos θ4.
pub fn foot_y_39<T: Scalar>(b2_m: T, phi: Phi<T>) -> T {
    // cot(φ + π/2) = −tan φ.
    -b2_m * phi.rad().tan()
}
