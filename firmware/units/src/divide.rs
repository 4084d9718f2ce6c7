//! Division of 64-bit integers in few bytes of flash.
//!
//! A board divides wide numbers when it works out coefficients, hardly ever in a tick.
//! The compiler's routines take a kilobyte for it.

/// `dividend / divisor`, rounded down; 0 for a divisor of 0.
///
/// Fast for divisors below 2^16: four divisions of 32 bits. Others take a subtraction for
/// each bit of the quotient.
#[inline(never)]
#[must_use]
pub const fn divide(dividend: u64, divisor: u64) -> u64 {
    if dividend < divisor || divisor == 0 {
        return 0;
    }
    let mut quotient = 0_u64;
    let mut rest = dividend;
    if divisor < 1 << 16 {
        let mut above = 0_u32;
        let mut digits = 0_u32;
        while digits < 4 {
            // The rest above is less than the divisor: below 2^32 with the next digit.
            let part = above.wrapping_shl(16) | (rest >> 48) as u32;
            let digit = match part.checked_div(divisor as u32) {
                Some(digit) => digit,
                None => 0,
            };
            above = part.wrapping_sub(digit.wrapping_mul(divisor as u32));
            quotient = quotient.wrapping_shl(16) | digit as u64;
            rest = rest.wrapping_shl(16);
            digits = digits.wrapping_add(1);
        }
        return quotient;
    }
    // The divisor is not longer than the dividend: this does not wrap.
    let mut bits = divisor
        .leading_zeros()
        .wrapping_sub(dividend.leading_zeros())
        .wrapping_add(1);
    let mut part = divisor.wrapping_shl(bits.wrapping_sub(1));
    while bits > 0 {
        quotient = quotient.wrapping_shl(1);
        if rest >= part {
            rest = rest.wrapping_sub(part);
            quotient |= 1;
        }
        part = part.wrapping_shr(1);
        bits = bits.wrapping_sub(1);
    }
    quotient
}

/// `dividend / divisor`, rounded toward zero; 0 for a divisor of 0. The quotient of the
/// least number and −1, which does not fit, wraps.
#[inline(never)]
#[must_use]
pub const fn divide_signed(dividend: i64, divisor: i64) -> i64 {
    let quotient = divide(dividend.unsigned_abs(), divisor.unsigned_abs()).cast_signed();
    if (dividend ^ divisor) < 0 {
        quotient.wrapping_neg()
    } else {
        quotient
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn quotients_are_exact(a in any::<u64>(), b in any::<u64>(), x in 0_u32..64, y in 0_u32..64) {
            let (a, b) = (a >> x, b >> y);
            prop_assert_eq!(divide(a, b), a.checked_div(b).unwrap_or(0));
            let (a, b) = (a.cast_signed(), b.cast_signed());
            for (a, b) in [(a, b), (a.wrapping_neg(), b), (a, b.wrapping_neg())] {
                let exact = if b == 0 { 0 } else { a.wrapping_div(b) };
                prop_assert_eq!(divide_signed(a, b), exact);
            }
        }
    }

    #[test]
    fn ends_of_the_range() {
        for divisor in [0, 1, 2, 0xFFFF, 0x1_0000, 0x1_0001, 1 << 63, u64::MAX] {
            for dividend in [0, 1, 0xFFFF, 0x1_0000, 1 << 63, u64::MAX - 1, u64::MAX] {
                let exact = u64::checked_div(dividend, divisor).unwrap_or(0);
                assert_eq!(divide(dividend, divisor), exact, "{dividend} {divisor}");
            }
        }
        assert_eq!(divide_signed(i64::MIN, 1), i64::MIN);
        assert_eq!(divide_signed(i64::MIN, -1), i64::MIN);
        assert_eq!(divide_signed(i64::MIN, i64::MIN), 1);
    }
}
