//! Sine and cosine together, inlined.
//!
//! The C library's pair is a call that the optimiser cannot look into, and it is not the same on
//! every system. This one is arithmetic only, so a chain gives the same bits wherever it is
//! compiled for the same target features.
//!
//! Reduction by π/2 in three parts (Cody and Waite), then the polynomials of fdlibm's `k_sin.c` and
//! `k_cos.c` on ±π/4 (Sun Microsystems 1993: "Permission to use, copy, modify, and distribute this
//! software is freely granted, provided that this notice is preserved"). Error below 1.5 units in
//! the last place of a result, plus 1e-17 absolute near the zeros.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4};

/// Beyond this angle (rad) the three parts are too short, and the crate `libm` is used.
const LIMIT_RAD: f64 = 1.0e5;

/// Adding this rounds to an integer and leaves it in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// π/2 as a sum; the first two have 33 bits, so their products with integers below 2^20 are exact.
const PIO2_1: f64 = f64::from_bits(0x3FF9_21FB_5440_0000);
const PIO2_2: f64 = f64::from_bits(0x3DD0_B461_1A60_0000);
const PIO2_3: f64 = f64::from_bits(0x3BA3_198A_2E03_7073);

const S1: f64 = f64::from_bits(0xBFC5_5555_5555_5549);
const S2: f64 = f64::from_bits(0x3F81_1111_1110_F8A6);
const S3: f64 = f64::from_bits(0xBF2A_01A0_19C1_61D5);
const S4: f64 = f64::from_bits(0x3EC7_1DE3_57B1_FE7D);
const S5: f64 = f64::from_bits(0xBE5A_E5E6_8A2B_9CEB);
const S6: f64 = f64::from_bits(0x3DE5_D93A_5ACF_D57C);

const C1: f64 = f64::from_bits(0x3FA5_5555_5555_554C);
const C2: f64 = f64::from_bits(0xBF56_C16C_16C1_5177);
const C3: f64 = f64::from_bits(0x3EFA_01A0_19CB_1590);
const C4: f64 = f64::from_bits(0xBE92_7E4F_809C_52AD);
const C5: f64 = f64::from_bits(0x3E21_EE9E_BDB4_B1C4);
const C6: f64 = f64::from_bits(0xBDA8_FAE9_BE88_38D4);

/// (sin x, cos x); NaN for an x that is not finite.
///
/// As in fdlibm, angles up to π/4 go straight to the polynomials; joints move smoothly, so the branch
/// is foreseen.
#[inline(always)]
pub(super) fn sin_cos(x: f64) -> (f64, f64) {
    if x.abs() <= FRAC_PI_4 {
        near(x)
    } else {
        turned(x)
    }
}

#[inline(never)]
fn turned(x: f64) -> (f64, f64) {
    if x.abs() < LIMIT_RAD {
        reduced(x)
    } else {
        libm::sincos(x)
    }
}

/// Polynomials on ±π/4.
#[inline(always)]
fn near(r: f64) -> (f64, f64) {
    let z = r * r;
    let zz = z * z;
    let sin = r + r * z * ((S1 + z * S2) + zz * ((S3 + z * S4) + zz * (S5 + z * S6)));
    let tail = zz * ((C1 + z * C2) + zz * ((C3 + z * C4) + zz * (C5 + z * C6)));
    let half = 0.5 * z;
    let high = 1.0 - half;
    // 1 - z/2 rounds; this adds the lost part back.
    let cos = high + (((1.0 - high) - half) + tail);
    (sin, cos)
}

/// Any angle within the limit.
fn reduced(x: f64) -> (f64, f64) {
    let shifted = x * FRAC_2_PI + ROUND;
    let turns = shifted - ROUND;
    let (sin, cos) = near(x - turns * PIO2_1 - turns * PIO2_2 - turns * PIO2_3);
    match shifted.to_bits() & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::{LIMIT_RAD, sin_cos};

    /// Distance in units in the last place, with an absolute floor near the zeros.
    fn ulps(a: f64, b: f64) -> f64 {
        let unit = f64::from_bits(b.abs().to_bits() + 1) - b.abs();
        (a - b).abs() / unit.max(1e-17)
    }

    #[test]
    fn agrees_with_the_c_library_to_two_units() {
        let mut worst: f64 = 0.0;
        let mut check = |x: f64| {
            let ((s, c), (rs, rc)) = (sin_cos(x), x.sin_cos());
            worst = worst.max(ulps(s, rs)).max(ulps(c, rc));
            assert!((s * s + c * c - 1.0).abs() < 4.0 * f64::EPSILON, "{x}");
        };
        for i in -400_000..=400_000 {
            check(f64::from(i) * 2.1e-5);
            check(f64::from(i) * 0.249_9);
        }
        for i in -64..=64 {
            // Multiples of π/4: ends of the polynomials' range and zeros of the results.
            let x = f64::from(i) * std::f64::consts::FRAC_PI_4;
            check(x);
            check(f64::from_bits(x.to_bits() + 1));
        }
        assert!(worst <= 2.0, "{worst}");
        assert!(worst >= 0.5, "{worst}: compared with itself?");
    }

    #[test]
    fn far_and_impossible_angles() {
        for x in [LIMIT_RAD, -LIMIT_RAD, 1e12, -3e20] {
            assert_eq!(sin_cos(x), libm::sincos(x));
        }
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (s, c) = sin_cos(x);
            assert!(s.is_nan() && c.is_nan());
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }
}
