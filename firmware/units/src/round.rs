//! Rounding and narrowing, written once.

/// `value / 2^bits`, rounded to nearest, ties away from zero.
///
/// Odd-symmetric: `f(-v) == -f(v)`. A plain arithmetic shift would round towards minus infinity and give a
/// controller a bias of half a step. `bits` of 63 or more gives zero. Never panics.
#[must_use]
#[inline]
pub const fn shift_right_round(value: i64, bits: u32) -> i64 {
    if bits == 0 {
        return value;
    }
    if bits > 62 {
        return 0;
    }
    // The smallest number rounds as the one after it.
    let value = if value == i64::MIN {
        value.wrapping_add(1)
    } else {
        value
    };
    shift_right_round_inner(value, bits)
}

/// [`shift_right_round`] of any number but `i64::MIN`, by 1 to 62 bits: a few
/// instructions. Outside of that the result is wrong. Never panics.
#[inline(always)]
#[must_use]
pub const fn shift_right_round_inner(value: i64, bits: u32) -> i64 {
    // Ties go up, and those of negative numbers, one less, down.
    let below = value.wrapping_add(value >> 63);
    let half = below.wrapping_shr(bits.wrapping_sub(1)) & 1;
    below.wrapping_shr(bits).wrapping_add(half)
}

/// [`shift_right_round`] of numbers of 32 bits, in a few instructions: `bits` of 1…30
/// and a magnitude of at most 2^31 − 2^29; beyond, the result wraps. Never panics.
#[inline]
#[must_use]
pub const fn shift_right_round_i32(value: i32, bits: u32) -> i32 {
    let half = 1_i32.wrapping_shl(bits.wrapping_sub(1));
    // Ties of negative numbers go down: one less before a shift that floors.
    let below = value >> 31;
    value
        .wrapping_add(half)
        .wrapping_add(below)
        .wrapping_shr(bits)
}

/// Narrows to `i32`, saturating at both ends. Never panics.
#[inline]
#[must_use]
pub const fn saturate_i32(value: i64) -> i32 {
    let low = value as i32;
    if low as i64 == value {
        low
    } else if value < 0 {
        i32::MIN
    } else {
        i32::MAX
    }
}

/// Narrows to `i16`, saturating at both ends. Never panics.
#[inline]
#[must_use]
pub const fn saturate_i16(value: i64) -> i16 {
    let narrow = saturate_i32(value);
    if narrow > i16::MAX as i32 {
        i16::MAX
    } else if narrow < i16::MIN as i32 {
        i16::MIN
    } else {
        narrow as i16
    }
}

#[cfg(test)]
mod tests {
    use super::{
        saturate_i16, saturate_i32, shift_right_round, shift_right_round_i32,
        shift_right_round_inner,
    };

    #[test]
    fn the_short_form_rounds_as_the_long_one() {
        for bits in [1, 4, 8, 10, 29] {
            for base in [0, 1 << bits, 3 << (bits - 1), 0x1234_5678, 0x5FFF_FFFF] {
                for value in (base - 3..=base + 3).flat_map(|v: i32| [v, -v]) {
                    if value.unsigned_abs() <= (1 << 31) - (1 << 29) {
                        let long = shift_right_round(i64::from(value), bits);
                        let short = shift_right_round_i32(value, bits);
                        assert_eq!(i64::from(short), long, "{value} {bits}");
                    }
                }
            }
        }
    }

    #[test]
    fn halves_round_away_from_zero_on_both_sides() {
        // value, bits, expected: written out by hand.
        for (value, bits, expected) in [
            (0, 4, 0),
            (7, 4, 0),
            (8, 4, 1),
            (-7, 4, 0),
            (-8, 4, -1),
            (-9, 4, -1),
            (23, 4, 1),
            (24, 4, 2),
            (-23, 4, -1),
            (-24, 4, -2),
            (-24, 0, -24),
            (1, 1, 1),
            (-1, 1, -1),
        ] {
            assert_eq!(
                shift_right_round(value, bits),
                expected,
                "{value} >> {bits}"
            );
            if bits > 0 {
                assert_eq!(shift_right_round_inner(value, bits), expected);
            }
        }
    }

    #[test]
    fn extremes_do_not_overflow() {
        assert_eq!(shift_right_round(i64::MAX, 1), 1 << 62);
        assert_eq!(shift_right_round(i64::MIN, 1), -(1 << 62));
        assert_eq!(shift_right_round(i64::MAX, 62), 2);
        assert_eq!(shift_right_round(i64::MIN, 62), -2);
        assert_eq!(shift_right_round(i64::MAX, 63), 0);
        assert_eq!(shift_right_round(i64::MIN, 200), 0);
    }

    #[test]
    fn narrowing_saturates_one_step_outside_and_not_inside() {
        assert_eq!(saturate_i32(i64::from(i32::MAX) + 1), i32::MAX);
        assert_eq!(saturate_i32(i64::from(i32::MIN) - 1), i32::MIN);
        assert_eq!(saturate_i32(i64::from(i32::MAX) - 1), i32::MAX - 1);
        assert_eq!(saturate_i32(i64::from(i32::MIN) + 1), i32::MIN + 1);
        for far in [1 << 32, 1 << 40, i64::MAX] {
            assert_eq!(
                (saturate_i32(far), saturate_i32(-far)),
                (i32::MAX, i32::MIN)
            );
            assert_eq!(
                (saturate_i16(far), saturate_i16(-far)),
                (i16::MAX, i16::MIN)
            );
        }
        assert_eq!(saturate_i16(32_768), i16::MAX);
        assert_eq!(saturate_i16(-32_769), i16::MIN);
        assert_eq!(saturate_i16(32_766), 32_766);
        assert_eq!(saturate_i16(-32_767), -32_767);
    }
}
