//! Flow through a valve by ISO 6358.
//!
//! ```text
//! q = C ρ0 p₁ ψ(p₂/p₁)
//! ψ(r) = 1                             r ≤ b: choked
//!      = √(1 − ((r − b)/(1 − b))²)     otherwise
//! ```
//!
//! q: mass flow, kg/s; p₁, p₂: pressure upstream and downstream, Pa absolute; C: sonic conductance, m³/(s Pa); b:
//! critical pressure ratio, from the axis data, as is C; ρ0 = 1.185 kg/m³: density of the reference atmosphere of ISO
//! 8778 (20 °C, 1 bar, 65 %). Source: ISO 6358-1, with its factor √(T0/T1) taken as 1.
//!
//! Assumes: all air upstream at 293 K (20 K more make 3 % less flow); the same C and b for filling and venting; a valve
//! that is either open or shut. The supply is that of the axis data: if it falls, less flows than is counted.
//!
//! Config [`FlowCurve`]; no state; update [`FlowCurve::choked_equivalent`].

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
    /// p₁ ψ(p₂/p₁) from 1 to 2, both in 1/256 Pa: the upstream pressure that would give the same flow if choked;
    /// negative when the gas flows back.
    ///
    /// With y = (p₂ − b p₁)/(1 − b) it is the root of p₁² − y², which needs no division.
    #[inline]
    #[must_use]
    pub fn choked_equivalent(&self, from: i32, to: i32) -> i32 {
        let forward = from >= to;
        let (high, low) = if forward { (from, to) } else { (to, from) };
        // In units of 32 Pa: 17 bits.
        let y = mul_shr(low, self.stretch, 32).wrapping_sub(mul_shr(high, self.choked, 32));
        let equivalent = if y <= 0 {
            high
        } else {
            let p1 = high.max(0).wrapping_shr(13);
            // By rounding, y may exceed p₁ by one.
            let square = p1.wrapping_sub(y).max(0).wrapping_mul(p1.wrapping_add(y));
            square_root(square.cast_unsigned()).wrapping_shl(13) as i32
        };
        if forward {
            equivalent
        } else {
            equivalent.wrapping_neg()
        }
    }

    /// The same times a chamber's choked speed (raw mm/s): the power over area of an open valve.
    #[inline(never)]
    pub(crate) fn power(&self, from: i32, to: i32, choked_speed: i32) -> i32 {
        power(self.choked_equivalent(from, to), choked_speed)
    }
}

/// Power over area of `pressure` (1/256 Pa) at `speed` (raw mm/s): from 2^-24 Pa mm/s to 2^8 Pa mm/s. Below 2^28.
#[inline]
pub(crate) const fn power(pressure: i32, speed: i32) -> i32 {
    mul_shr(pressure, speed, 32)
}
