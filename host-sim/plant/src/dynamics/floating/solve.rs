//! The arrow-shaped mass matrix: chassis 6 × 6, a leg 3 × 3 each, a wheel 1 × 1 each, and nothing
//! between legs and wheels.
//!
//! Within a leg b6 couples with neither b2 nor b5, and the (b5, b5) and (b6, b6) entries are
//! constant masses, so a leg is eliminated by three rank-one updates of the chassis block.

use super::leg::LegTerms;
use super::state::{DOF, LEG, Velocity, WHEEL};
use crate::both::Both;
use crate::dynamics::error::DynamicsError;

/// Lower triangle of a symmetric 6 × 6, row by row.
pub(super) type Packed<T = f64> = [T; 21];

/// Index in [`Packed`]; row ≥ column.
#[inline]
pub(super) const fn at(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Sign of a chassis entry under the mirror: \[moment, force\].
pub(super) const MIRROR: [f64; 6] = [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0];

/// Chassis directions in which b6 has momentum: roll, pitch, up.
const LIFTED: [usize; 3] = [0, 1, 5];

/// The legs taken out of the equations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Eliminated {
    /// D⁻¹ of the columns.
    gain: [[Both; 6]; 3],
    /// D⁻¹ of a leg's right side.
    free: [Both; 3],
}

/// Takes the legs out: their shares of the chassis block and of the right side, both in a leg's
/// (mirrored) axes and to be subtracted. `right` is force less bias of b2, b5, b6.
#[inline]
pub(super) fn eliminate(
    t: &LegTerms,
    [m56, m6]: [f64; 2],
    right: [Both; 3],
) -> Result<(Eliminated, Packed<Both>, [Both; 6]), DynamicsError> {
    let [c2, c5, c6] = &t.columns;
    let ratio = t.d25 / m56;
    let d22 = t.d22 - ratio * t.d25;
    for pivot in d22.to_array() {
        if pivot.is_nan() || pivot <= 0.0 {
            return Err(DynamicsError::Singular { pivot });
        }
    }
    let one = Both::splat(1.0);
    let (inv2, inv5, inv6) = (one / d22, Both::splat(1.0 / m56), Both::splat(1.0 / m6));
    let rest: [Both; 6] = std::array::from_fn(|i| c2[i] - ratio * c5[i]);
    let mut gain = [
        rest.map(|c| c * inv2),
        c5.map(|c| c * inv5),
        c6.map(|c| c * inv6),
    ];
    let free2 = (right[0] - ratio * right[1]) * inv2;
    let (part5, free6) = (right[1] * inv5, right[2] * inv6);
    let mut block = [Both::splat(0.0); 21];
    let mut side = [Both::splat(0.0); 6];
    // b2 and b5 push nothing upwards; b6 only upwards, and turns nothing about the vertical.
    for i in 0..5 {
        for j in 0..=i {
            block[at(i, j)] -= gain[0][i] * rest[j] + gain[1][i] * c5[j];
        }
        side[i] -= rest[i] * free2 + c5[i] * part5;
    }
    for (n, &i) in LIFTED.iter().enumerate() {
        for &j in &LIFTED[..=n] {
            block[at(i, j)] -= gain[2][i] * c6[j];
        }
        side[i] -= c6[i] * free6;
    }
    // b5 follows b2.
    let [yaw, horizontal, _] = &mut gain;
    for (own, by_yaw) in horizontal.iter_mut().zip(yaw) {
        *own -= ratio * *by_yaw;
    }
    let free = [free2, part5 - ratio * free2, free6];
    Ok((Eliminated { gain, free }, block, side))
}

impl Eliminated {
    /// Accelerations of the legs for a chassis acceleration in each leg's axes.
    #[inline]
    pub(super) fn follow(&self, base: &[Both; 6]) -> [Both; 3] {
        std::array::from_fn(|k| {
            let [g0, g1, g2, g3, g4, g5] = self.gain[k];
            let [a0, a1, a2, a3, a4, a5] = *base;
            let taken = g0 * a0 + g1 * a1 + g2 * a2 + g3 * a3 + g4 * a4 + g5 * a5;
            self.free[k] - taken
        })
    }
}

/// Solves the symmetric positive definite 6 × 6 in place by L D Lᵀ.
#[inline]
pub(super) fn solve_block(block: &mut Packed, x: &mut [f64; 6]) -> Result<(), DynamicsError> {
    let inverse = [
        clear_column::<0>(block, x)?,
        clear_column::<1>(block, x)?,
        clear_column::<2>(block, x)?,
        clear_column::<3>(block, x)?,
        clear_column::<4>(block, x)?,
        clear_column::<5>(block, x)?,
    ];
    // block now holds L D below the diagonal.
    for j in (0..6).rev() {
        let mut value = x[j];
        for i in j + 1..6 {
            value -= block[at(i, j)] * x[i];
        }
        x[j] = value * inverse[j];
    }
    Ok(())
}

/// Eliminates one column below its pivot, and returns the pivot's inverse. A function for each
/// column: its loops are of known length then.
#[inline(always)]
fn clear_column<const J: usize>(
    block: &mut Packed,
    x: &mut [f64; 6],
) -> Result<f64, DynamicsError> {
    let pivot = block[at(J, J)];
    if pivot.is_nan() || pivot <= 0.0 {
        return Err(DynamicsError::Singular { pivot });
    }
    let inverse = 1.0 / pivot;
    for i in J + 1..6 {
        let factor = block[at(i, J)] * inverse;
        for k in J + 1..i + 1 {
            block[at(i, k)] -= factor * block[at(k, J)];
        }
        x[i] -= factor * x[J];
    }
    Ok(inverse)
}

/// Left plus right leg, in the axes of the chassis: a sign under the mirror for each entry.
#[inline]
pub(super) fn add_mirrored(block: &Packed<Both>) -> Packed {
    let mut total = [0.0; 21];
    for i in 0..6 {
        for j in 0..=i {
            let [left, right] = block[at(i, j)].to_array();
            total[at(i, j)] = left + MIRROR[i] * MIRROR[j] * right;
        }
    }
    total
}

/// Puts chassis, legs and wheels in the order of a velocity.
#[inline]
pub(super) fn assemble(base: &[f64; 6], legs: &[[f64; 3]; 2], wheels: [f64; 2]) -> Velocity {
    let mut v = [0.0; DOF];
    v[..6].copy_from_slice(base);
    v[LEG..LEG + 3].copy_from_slice(&legs[0]);
    v[LEG + 3..LEG + 6].copy_from_slice(&legs[1]);
    v[WHEEL..].copy_from_slice(&wheels);
    Velocity::from(v)
}
