//! The two chambers: pressures from what the valves let through.

use super::model::AxisModel;
use super::{scaled, square_root};
use wheeleg_units::saturate_i32;

/// Full scale of the flow function and of pressure ratios, 2^15.
const ONE: u32 = 1 << 15;

/// Subsonic flow of ISO 6358: constants of one critical ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FlowCurve {
    /// Critical ratio b, × 2^15.
    pub critical: u32,
    /// 1/(1 − b), × 2^15.
    pub stretch: u32,
}

impl FlowCurve {
    /// ψ(r), × 2^15, for a pressure ratio × 2^15: 1 when choked, 0 at r = 1.
    #[inline]
    #[must_use]
    pub fn psi(&self, ratio: u32) -> i32 {
        if ratio <= self.critical {
            return 1 << 15;
        }
        // At most 2^15 × 10 × 2^15.
        let y = ratio
            .wrapping_sub(self.critical)
            .wrapping_mul(self.stretch)
            .wrapping_shr(15)
            .min(ONE);
        let inside = ONE.wrapping_mul(ONE).wrapping_sub(y.wrapping_mul(y));
        // At most 2^15.
        square_root(inside) as i32
    }

    /// p₁ ψ(p₂/p₁) from 1 to 2, both in 1/256 Pa; negative when the gas runs back.
    #[inline]
    #[must_use]
    pub fn drive(&self, from: i32, to: i32) -> i32 {
        let forward = from >= to;
        let (high, low) = if forward { (from, to) } else { (to, from) };
        // Whole pascals of up to 2^21, so that the shifted number fits.
        let numerator = (low.max(0) as u32).wrapping_shr(8).wrapping_shl(11);
        let denominator = (high.max(1 << 12) as u32).wrapping_shr(12);
        let ratio = numerator.checked_div(denominator).unwrap_or(ONE).min(ONE);
        let drive = scaled(high, self.psi(ratio), 15);
        if forward { drive } else { drive.wrapping_neg() }
    }
}

/// Pressures of A and B in 1/256 Pa absolute.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Pressures {
    /// Bore side.
    pub a: i32,
    /// Rod side.
    pub b: i32,
}

/// Rates of one chamber with a valve open, or with the piston moving, in Pa/ms:
/// of filling, of venting, of compression.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChamberRates {
    /// Through the open fill valve.
    pub fill: i32,
    /// Through the open vent valve; positive lowers the pressure.
    pub vent: i32,
    /// By the piston's motion.
    pub squeeze: i32,
}

impl ChamberRates {
    /// Change of pressure in 1/256 Pa over `span` µs of motion, with the valves
    /// open for `fill` and `vent` µs of it.
    #[inline]
    #[must_use]
    pub fn change(&self, fill: i32, vent: i32, span: i32) -> i32 {
        // |rates| below 2^21 Pa/ms, times below 2^20 µs.
        let sum = i64::from(self.fill)
            .wrapping_mul(i64::from(fill))
            .wrapping_sub(i64::from(self.vent).wrapping_mul(i64::from(vent)))
            .wrapping_add(i64::from(self.squeeze).wrapping_mul(i64::from(span)));
        // 2^-6 Pa/ms × µs = 2^-6 / 1000 Pa; to 2^-8 Pa: × 4/1000 = × 67 109 / 2^24.
        saturate_i32(sum.wrapping_mul(67_109).wrapping_shr(24))
    }
}

/// Fractional bits of the rates: steps of 1/16 Pa/ms.
const RATE_BITS: u32 = 6;

/// Which rates of a chamber are wanted; what is not costs nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// Filling.
    pub fill: bool,
    /// Venting.
    pub vent: bool,
}

impl AxisModel {
    /// Rates of chamber A with the piston at `stroke` (raw mm) moving at `speed`.
    #[inline]
    #[must_use]
    pub fn rates_a(&self, p: i32, stroke: i32, speed: i32, wanted: Wanted) -> ChamberRates {
        let length = stroke.saturating_add(self.lead_a);
        self.rates(p, self.flow_a, length, speed.wrapping_neg(), wanted)
    }

    /// Rates of chamber B.
    #[inline]
    #[must_use]
    pub fn rates_b(&self, p: i32, stroke: i32, speed: i32, wanted: Wanted) -> ChamberRates {
        let length = self
            .stroke
            .saturating_sub(stroke)
            .saturating_add(self.lead_b);
        self.rates(p, self.flow_b, length, speed, wanted)
    }

    #[inline]
    fn rates(&self, p: i32, flow: i32, length: i32, closing: i32, wanted: Wanted) -> ChamberRates {
        // n / L in 2^22 per mm: L in 1/256 mm, at least 1 mm.
        let short = length.wrapping_shr(8).max(256);
        let stiffness = self.exponent.checked_div(short).unwrap_or(0);
        let rate = |pressure: i32, speed: i32| {
            // 1/256 Pa × 2^-16 mm/s = 2^-24 Pa mm/s; to 2^-6, then × 2^-22 /mm.
            let power = i64::from(pressure)
                .wrapping_mul(i64::from(speed))
                .wrapping_shr(18);
            let rate = power.wrapping_mul(i64::from(stiffness)).wrapping_shr(22);
            // Pa/s to Pa/ms: × 1/1000 = × 67 109 / 2^26. |rate| < 2^38.
            saturate_i32(rate.wrapping_mul(67_109).wrapping_shr(26))
        };
        ChamberRates {
            fill: if wanted.fill {
                rate(self.curve.drive(self.supply, p), flow)
            } else {
                0
            },
            vent: if wanted.vent {
                rate(self.curve.drive(p, self.ambient), flow)
            } else {
                0
            },
            squeeze: rate(p, closing),
        }
    }

    /// Opening in µs that changes a chamber by `change` (1/256 Pa, positive) at `rate`.
    #[inline]
    #[must_use]
    pub fn opening(&self, change: i32, rate: i32) -> i32 {
        // Pa × 1000 / (Pa/ms) = µs; the rate has RATE_BITS, the change 8 bits.
        let least = 50_i32.wrapping_shl(RATE_BITS);
        let numerator = change.wrapping_shr(8).min(500_000).wrapping_mul(4000);
        numerator
            .checked_div(rate.max(least).wrapping_shr(RATE_BITS.wrapping_sub(2)))
            .unwrap_or(0)
    }

    /// Force of the two pressures, mN, positive extending.
    #[inline]
    #[must_use]
    pub fn pressure_force(&self, p: Pressures) -> i32 {
        scaled(p.a, self.force_a, 32)
            .saturating_sub(scaled(p.b, self.force_b, 32))
            .saturating_sub(self.force_rod)
    }
}
