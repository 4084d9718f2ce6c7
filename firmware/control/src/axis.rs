//! A pneumatic axis as its controller knows it: data, gas, motion, valves.
//!
//! There is no pressure sensor. What is in the chambers follows from what the
//! valves have let in and out: every on-time that is sent is also followed
//! through the switching delays ([`valves`]), the flow of ISO 6358 through each
//! opening and the piston's motion give the two pressures ([`gas`]), and the
//! measured stroke corrects speed and load ([`motion`]). Errors of the pressures
//! die out by themselves, because a filling chamber ends at the supply and a
//! venting one at the atmosphere, whatever was assumed before.
//!
//! [`predictive`] is the law on top: it looks ahead over the valves' dead time,
//! and opens a valve for just as long as the force that is missing there needs.
//! [`learn`] takes the moving mass from one move.
//!
//! Numbers of a tick are integers: stroke and speed in raw I16F16 mm and mm/s,
//! pressures in 1/256 Pa absolute, forces in mN, accelerations in mm/s². Volumes
//! enter as lengths (volume over piston area), flows as speeds: a chamber of
//! length L with inflow q obeys `dp/dt = n (K p₁ ψ(p₂/p₁) − p v) / L` with
//! K = C ρ0 R T / area. Only [`AxisModel::new`], which runs when parameters
//! change, uses `f32`.

pub mod gas;
pub mod learn;
mod model;
pub mod motion;
pub mod predictive;
pub mod probe;
pub mod valves;

pub use model::{AxisData, AxisField, AxisModel};

use wheeleg_units::saturate_i32;

/// `a × b / 2^shift`, rounded down, saturating.
#[inline]
pub(crate) const fn scaled(a: i32, b: i32, shift: u32) -> i32 {
    saturate_i32((a as i64).wrapping_mul(b as i64).wrapping_shr(shift))
}

/// `value` limited to ±`bound`.
#[inline]
pub(crate) fn within(value: i32, bound: i32) -> i32 {
    value.max(bound.wrapping_neg()).min(bound)
}

/// Square root, rounded down to within one.
///
/// Newton's method from a power of two: three steps leave 2e-6 of it.
#[inline]
pub(crate) fn square_root(value: u32) -> u32 {
    if value == 0 {
        return 0;
    }
    let bits = 32_u32.wrapping_sub(value.leading_zeros());
    let mut root = 1_u32.wrapping_shl(bits.wrapping_add(1).wrapping_shr(1));
    for _ in 0..4 {
        root = root
            .wrapping_add(value.checked_div(root).unwrap_or(0))
            .wrapping_shr(1);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::square_root;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_root_is_exact_to_one(value in any::<u32>()) {
            let exact = f64::from(value).sqrt();
            prop_assert!((f64::from(square_root(value)) - exact).abs() <= 1.0 + exact * 1e-6);
        }
    }

    #[test]
    fn the_root_of_squares() {
        for root in [0_u32, 1, 2, 3, 255, 32_767, 46_340, 65_535] {
            assert!(square_root(root * root).abs_diff(root) <= 1, "{root}");
        }
    }
}
