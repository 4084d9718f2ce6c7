//! The two chambers: pressures from what the valves let through.

use super::model::AxisModel;
use super::{part, scaled, square_root};
use wheeleg_units::Duty;

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
        let y = part(low, self.stretch, 32).wrapping_sub(part(high, self.choked, 32));
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
    pub(super) fn power(&self, from: i32, to: i32, flow: i32) -> i32 {
        power(self.drive(from, to), flow)
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
/// Neither the piston's place nor the time is in them, so that those of one period
/// serve for that period and for the dead time ahead.
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
    /// Those that are asked for, at `pressure`, for an open valve's `flow` as a speed of the
    /// piston, raw mm/s.
    #[inline]
    pub(super) fn of(model: &AxisModel, flow: i32, pressure: i32, fill: bool, vent: bool) -> Self {
        let curve = &model.curve;
        Self {
            fill: if fill {
                curve.power(model.supply, pressure, flow)
            } else {
                0
            },
            vent: if vent {
                curve.power(pressure, model.ambient, flow)
            } else {
                0
            },
        }
    }

    /// Change of pressure in 1/256 Pa with the valves open for `fill` and `vent` µs,
    /// and with the piston giving the power `squeeze` for `span` µs, in a chamber of
    /// `stiffness` ([`AxisModel::stiffness`]).
    #[inline]
    #[must_use]
    pub fn change(&self, open: [i32; 2], squeeze: i32, span: i32, stiffness: i32) -> i32 {
        let [fill, vent] = open;
        let product = |power: i32, us: i32| i64::from(power).wrapping_mul(i64::from(us));
        // Powers below 2^28, times below 2^18: 2^24 Pa mm/s µs below 2^31.
        let work = product(self.fill, fill)
            .wrapping_sub(product(self.vent, vent))
            .wrapping_add(product(squeeze, span))
            .wrapping_add(1 << 15)
            .wrapping_shr(16) as i32;
        // × n/L: see `AxisModel::stiffness`.
        scaled(work, stiffness, 10)
    }

    /// Opening, µs, in which an open valve's `power` changes the pressure by `change` (1/256 Pa,
    /// not negative).
    #[inline]
    #[must_use]
    pub fn need(power: i32, change: i32, stiffness: i32) -> i32 {
        // 2^8 Pa mm/s × n/L: 1/256 Pa per 16 µs.
        let rate = part(power, stiffness, 22).max(SLOWEST);
        // Below 2^31.
        let size = change.min(500_000 << 8).wrapping_shl(4);
        size.checked_div(rate).unwrap_or(0)
    }
}

/// Shortest length of a chamber, 1/256 mm (4 mm; a line alone is longer).
const SHORTEST: i32 = 4 << 8;
/// Slowest change of pressure that is counted on, 1/256 Pa per 16 µs (50 Pa/ms).
const SLOWEST: i32 = 205;

impl AxisModel {
    /// Length of chamber A with the piston at `stroke`, raw mm.
    #[inline]
    #[must_use]
    pub(super) const fn length_a(&self, stroke: i32) -> i32 {
        stroke.saturating_add(self.lead_a)
    }

    /// Length of chamber B.
    #[inline]
    #[must_use]
    pub(super) const fn length_b(&self, stroke: i32) -> i32 {
        self.stroke
            .saturating_sub(stroke)
            .saturating_add(self.lead_b)
    }

    /// n / L of a chamber of `length` (raw mm), × 1.048576 × 2^22 / mm:
    /// so that a work of 2^24 Pa mm/s µs, times it, is 2^-18 Pa.
    #[inline]
    #[must_use]
    pub(super) fn stiffness(&self, length: i32) -> i32 {
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

    /// A force that the supply can give as a share of its largest, in steps of 2^-14.
    #[inline]
    pub(super) fn duty(&self, force: i32) -> Duty {
        let share = if force > 0 {
            self.share_out
        } else {
            self.share_in
        };
        // Within ±2^14.
        Duty::from_raw(part(force, share, 26).wrapping_shl(16))
    }
}
