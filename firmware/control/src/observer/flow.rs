//! Flow through a valve by ISO 6358.
//!
//! ```text
//! q = C ρ0 p₁                          p₂ ≤ b p₁: choked
//! q = C ρ0 p₁ √(1 − ((p₂/p₁ − b)/(1 − b))²)   otherwise
//! ```

use crate::math::{mul_shr, square_root};

/// Subsonic flow of ISO 6358: constants of one critical ratio b.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FlowCurve {
    /// 1/(1 − b), × 2^19.
    pub stretch: i32,
    /// b/(1 − b), × 2^19.
    pub choked: i32,
}

impl FlowCurve {
    /// p₁ ψ(p₂/p₁) from 1 to 2, both in 1/256 Pa; negative when the gas runs back.
    ///
    /// With y = (p₂ − b p₁)/(1 − b), the root of p₁² − y²: no division.
    #[inline]
    #[must_use]
    pub fn drive(&self, from: i32, to: i32) -> i32 {
        let forward = from >= to;
        let (high, low) = if forward { (from, to) } else { (to, from) };
        // In 32 Pa: 17 bits.
        let y = mul_shr(low, self.stretch, 32).wrapping_sub(mul_shr(high, self.choked, 32));
        let drive = if y <= 0 {
            high
        } else {
            let p1 = high.max(0).wrapping_shr(13);
            // Rounded, y may be more than p₁ by one.
            let square = p1.wrapping_sub(y).max(0).wrapping_mul(p1.wrapping_add(y));
            square_root(square.cast_unsigned()).wrapping_shl(13) as i32
        };
        if forward { drive } else { drive.wrapping_neg() }
    }

    /// The same as a power, for an open valve's `flow` as a speed of the piston.
    #[inline(never)]
    pub(crate) fn power(&self, from: i32, to: i32, flow: i32) -> i32 {
        power(self.drive(from, to), flow)
    }
}

/// Power of `pressure` (1/256 Pa) at `speed` (raw mm/s): 2^-24 Pa mm/s to 2^8.
/// Below 2^28.
#[inline]
pub(crate) const fn power(pressure: i32, speed: i32) -> i32 {
    mul_shr(pressure, speed, 32)
}
