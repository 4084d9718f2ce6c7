//! Products, quotients and roots of fixed-point numbers; each function states its precision and range. Products and
//! shifts round down.

/// `a × b / 2^shift`, rounded down, with a shift of 1…31; a result that does not fit becomes one of the 2^(32 − shift)
/// largest or smallest numbers. Only the upper word of the product is limited, in one instruction: limiting all of it
/// would take six.
#[inline]
pub(crate) fn mul_shr_sat(a: i32, b: i32, shift: u32) -> i32 {
    let product = i64::from(a).wrapping_mul(i64::from(b));
    let left = 32_u32.wrapping_sub(shift);
    let bound = i32::MAX.wrapping_shr(left);
    let high = (product.wrapping_shr(32) as i32).max(!bound).min(bound);
    let low = (product as u32).wrapping_shr(shift);
    high.wrapping_shl(left) | low as i32
}

/// `a × b / 2^shift`, rounded down, for a result that is known to fit. Host builds check this; images do not.
#[inline]
pub(crate) const fn mul_shr(a: i32, b: i32, shift: u32) -> i32 {
    let quotient = (a as i64).wrapping_mul(b as i64).wrapping_shr(shift);
    debug_assert!(
        quotient as i32 as i64 == quotient,
        "a product that does not fit"
    );
    quotient as i32
}

/// `a × 2^shift / b` to 16 significant bits of `b`, saturating; 0 if `b` is 0. It uses two 32-bit divisions instead of
/// one of 64 bits, which takes ten times as long.
#[inline(never)]
pub(crate) fn quotient(a: u64, b: u32, shift: u32) -> i32 {
    let bits = 32_u32.wrapping_sub(b.leading_zeros());
    let down = bits.saturating_sub(16);
    let divisor = b.wrapping_shr(down);
    let dividend = if down >= shift {
        a.wrapping_shr(down.wrapping_sub(shift))
    } else {
        a.wrapping_shl(shift.wrapping_sub(down))
    };
    // 48 bits by 16 bits, in two digits of 16 bits.
    let high = u32::try_from(dividend.wrapping_shr(16)).unwrap_or(u32::MAX);
    let first = high.checked_div(divisor).unwrap_or(0);
    if first >= 1 << 15 {
        return i32::MAX;
    }
    let rest = high.wrapping_sub(first.wrapping_mul(divisor));
    let low = rest.wrapping_shl(16) | (dividend & 0xFFFF) as u32;
    let second = low.checked_div(divisor).unwrap_or(0);
    first.wrapping_shl(16).wrapping_add(second) as i32
}

/// `value` limited to a signed number of `BITS` bits. This is one instruction of the processor, while limiting by
/// comparison takes four, and limiting a 64-bit product six.
#[inline]
pub(crate) fn clip<const BITS: u32>(value: i32) -> i32 {
    let bound = const { i32::MAX >> (32 - BITS) };
    value.max(!bound).min(bound)
}

/// `value` limited to ±`bound`.
#[inline]
pub(crate) fn within(value: i32, bound: i32) -> i32 {
    value.max(bound.wrapping_neg()).min(bound)
}

/// `value` along `direction`: its sign is reversed where `direction` is negative. So a size gets the sign of the
/// direction, and a signed value is positive in that direction.
#[inline]
pub(crate) const fn along(value: i32, direction: i32) -> i32 {
    if direction < 0 {
        value.saturating_neg()
    } else {
        value
    }
}

/// Square root, accurate to 1/2000 of it and to one.
///
/// A straight line approximates the root of a number that an even shift has brought into 1…4 × 2^30 to within 4.5 %;
/// one step of Newton's method squares that error.
#[inline]
pub(crate) fn square_root(value: u32) -> u32 {
    let zeros = value.leading_zeros() & !1;
    let near = value.wrapping_shl(zeros);
    // 0.328 x + 0.708.
    let line = near
        .wrapping_shr(17)
        .wrapping_add(near.wrapping_shr(19))
        .wrapping_add(near.wrapping_shr(21))
        .wrapping_add(23_200);
    let step = near.checked_div(line).unwrap_or(0);
    // The mean is never below the root: subtract half of the largest excess.
    let root = line.wrapping_add(step).wrapping_sub(32);
    // For zero this shifts by the whole width: twice the root is below 2^17.
    root.wrapping_shr(zeros.wrapping_shr(1).wrapping_add(1))
}

/// Cube root, × 2^16, of a share × 2^30 of at most one.
///
/// Newton's method on a share that shifts of three bits have brought into 1/8…1: there the chord is within a ninth of
/// the root, and each step squares that error.
pub(crate) fn cube_root(share: u32) -> i32 {
    if share >= 1 << 30 {
        return 1 << 16;
    }
    if share == 0 {
        return 0;
    }
    let third = share.leading_zeros().wrapping_sub(2) / 3;
    let near = share.wrapping_shl(third.wrapping_mul(3)).wrapping_shr(14);
    // The chord from 1/8 to 1.
    let mut root = near
        .wrapping_mul(9362)
        .wrapping_shr(14)
        .wrapping_add(28_087);
    for _ in 0..3 {
        let square = root.wrapping_mul(root.min((1 << 16) - 1)).wrapping_shr(16);
        let step = near.wrapping_shl(16).checked_div(square).unwrap_or(0);
        root = root.wrapping_mul(2).wrapping_add(step) / 3;
    }
    root.wrapping_shr(third) as i32
}

#[cfg(test)]
mod tests {
    use super::{along, cube_root, mul_shr_sat, quotient, square_root};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_root_is_good_to_a_two_thousandth(value in any::<u32>()) {
            let exact = f64::from(value).sqrt();
            prop_assert!((f64::from(square_root(value)) - exact).abs() <= 1.0 + exact * 5e-4);
        }
    }

    proptest! {
        #[test]
        fn quotients_are_good_to_sixteen_bits(
            a in 0_u64..1 << 46, b in 1..=u32::MAX, b_bits in 0_u32..32, shift in 0_u32..17,
        ) {
            let b = (b >> b_bits).max(1);
            let exact = a as f64 * f64::from(1 << shift) / f64::from(b);
            let limited = exact.min(f64::from(i32::MAX));
            let difference = (f64::from(quotient(a, b, shift)) - limited).abs();
            prop_assert!(difference <= 1.0 + exact.abs() * 4e-5, "{difference} {exact}");
        }
    }

    proptest! {
        #[test]
        fn scaled_products_are_exact_where_they_fit(
            a in any::<i32>(), b in any::<i32>(), b_bits in 0_u32..32, shift in 1_u32..32,
        ) {
            let b = b >> b_bits;
            let exact = (i64::from(a) * i64::from(b)) >> shift;
            let found = i64::from(mul_shr_sat(a, b, shift));
            let limited = exact.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
            let off = if exact == limited { 0 } else { (1_i64 << (32 - shift)) - 1 };
            prop_assert!((found - limited).abs() <= off, "{found} {exact}");
        }
    }

    #[test]
    fn a_value_along_a_direction_has_its_sign() {
        for (value, direction, expected) in [
            (5, 1, 5),
            (5, -1, -5),
            (-5, -1, 5),
            (-5, 1, -5),
            (5, 0, 5),
            (i32::MIN, -1, i32::MAX),
        ] {
            assert_eq!(along(value, direction), expected, "{value} {direction}");
        }
    }

    #[test]
    fn what_has_no_quotient_is_zero() {
        assert_eq!((quotient(5, 0, 3), quotient(0, 5, 3)), (0, 0));
    }

    #[test]
    fn the_root_of_squares() {
        for root in [0_u32, 1, 2, 3, 255, 32_767, 46_340, 65_535] {
            assert!(
                square_root(root * root).abs_diff(root) <= 1 + root / 2000,
                "{root}"
            );
        }
    }

    #[test]
    fn cube_roots() {
        assert_eq!(cube_root(0), 0);
        assert_eq!(cube_root(1 << 30), 1 << 16);
        for share in [
            1_u32,
            20_000,
            100 << 14,
            8192 << 14,
            30_000 << 14,
            65_000 << 14,
        ] {
            let exact = (f64::from(share) / f64::from(1 << 30)).cbrt() * 65_536.0;
            assert!((f64::from(cube_root(share)) - exact).abs() < 2.0, "{share}");
        }
    }
}
