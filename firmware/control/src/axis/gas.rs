//! The two chambers: pressures from what the valves let through.

use super::model::AxisModel;
use super::{part, scaled, square_root};

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
        let drive = part(high, self.psi(ratio), 15);
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

/// What flows through the valves of one chamber while they are open, as powers:
/// pressure times a speed of the piston, in 2^8 Pa mm/s.
///
/// Neither the piston's place nor the time is in them, so that those of one tick
/// serve for that tick and for the dead time ahead.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChamberFlows {
    /// Through the open fill valve; 0 until asked for.
    pub fill: i32,
    /// Through the open vent valve, positive lowers the pressure; 0 until asked for.
    pub vent: i32,
}

/// Power of `pressure` (1/256 Pa) at `speed` (raw mm/s): 2^-24 Pa mm/s to 2^8.
/// Below 2^28.
#[inline]
pub(super) const fn power(pressure: i32, speed: i32) -> i32 {
    part(pressure, speed, 32)
}

impl ChamberFlows {
    /// Works out the flows that are `wanted` and not yet known, for an open valve's
    /// `flow` as a speed of the piston, raw mm/s.
    #[inline]
    pub fn want(&mut self, model: &AxisModel, flow: i32, pressure: i32, wanted: Wanted) {
        if wanted.fill && self.fill == 0 {
            self.fill = power(model.curve.drive(model.supply, pressure), flow);
        }
        if wanted.vent && self.vent == 0 {
            self.vent = power(model.curve.drive(pressure, model.ambient), flow);
        }
    }

    /// Change of pressure in 1/256 Pa with the valves open for `fill` and `vent` µs,
    /// and with the piston giving the power `squeeze` for `span` µs, in a chamber of
    /// `stiffness` ([`AxisModel::stiffness_a`]).
    #[inline]
    #[must_use]
    pub fn change(&self, open: [i32; 2], squeeze: i32, span: i32, stiffness: i32) -> i32 {
        let [fill, vent] = open;
        let product = |power: i32, us: i32| i64::from(power).wrapping_mul(i64::from(us));
        // Powers below 2^28, times below 2^17: 2^24 Pa mm/s µs below 2^31.
        let work = product(self.fill, fill)
            .wrapping_sub(product(self.vent, vent))
            .wrapping_add(product(squeeze, span))
            .wrapping_add(1 << 15)
            .wrapping_shr(16) as i32;
        // × n/L: see `stiffness_a`.
        scaled(work, stiffness, 10)
    }

    /// Openings of the fill and of the vent valve, µs, that change the pressure by
    /// `change` (1/256 Pa). The flow that does it must be known.
    #[inline]
    #[must_use]
    pub fn needs(&self, change: i32, stiffness: i32) -> [i32; 2] {
        let power = if change > 0 { self.fill } else { self.vent };
        // 2^8 Pa mm/s × n/L: 1/256 Pa per 16 µs.
        let rate = part(power, stiffness, 22).max(SLOWEST);
        // Below 2^31.
        let size = change.saturating_abs().min(500_000 << 8).wrapping_shl(4);
        let need = size.checked_div(rate).unwrap_or(0);
        if change > 0 { [need, 0] } else { [0, need] }
    }
}

/// Shortest length of a chamber, 1/256 mm (4 mm; a line alone is longer).
const SHORTEST: i32 = 4 << 8;
/// Slowest change of pressure that is counted on, 1/256 Pa per 16 µs (50 Pa/ms).
const SLOWEST: i32 = 205;

/// Which flows of a chamber are wanted; what is not costs nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// Filling.
    pub fill: bool,
    /// Venting.
    pub vent: bool,
}

impl AxisModel {
    /// n / L of chamber A with the piston at `stroke` (raw mm), × 1.048576 × 2^22 / mm:
    /// so that a work of 2^24 Pa mm/s µs, times it, is 2^-18 Pa.
    #[inline]
    #[must_use]
    pub fn stiffness_a(&self, stroke: i32) -> i32 {
        self.stiffness(stroke.saturating_add(self.lead_a))
    }

    /// n / L of chamber B.
    #[inline]
    #[must_use]
    pub fn stiffness_b(&self, stroke: i32) -> i32 {
        let length = self.stroke.saturating_sub(stroke);
        self.stiffness(length.saturating_add(self.lead_b))
    }

    #[inline]
    fn stiffness(&self, length: i32) -> i32 {
        let short = length.wrapping_shr(8).max(SHORTEST);
        self.exponent.checked_div(short).unwrap_or(0)
    }

    /// Force of the two pressures, mN, positive extending.
    #[inline]
    #[must_use]
    pub fn pressure_force(&self, p: Pressures) -> i32 {
        part(p.a, self.force_a, 32)
            .saturating_sub(part(p.b, self.force_b, 32))
            .saturating_sub(self.force_rod)
    }
}
