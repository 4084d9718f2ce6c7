//! Force-to-pressure allocation: two chamber pressures that make one force.
//!
//! ```text
//! pA = p_m + F / (2 AA)          p_m: mean of supply and atmosphere
//! pB = (pA AA − pa (AA − AB) − F) / AB          each limited to what valves can make; the other makes up for it
//! ```
//!
//! F, N; p, Pa absolute; AA, AB: areas of bore and annulus, m². The valves can make 1.03 p_a to 0.985 p_s, and F is
//! limited beforehand to what these pressures make. Within the limits each chamber makes half of a change of F:
//! AA dpA = dF/2, AB dpB = −dF/2.
//!
//! Two actuators make one force, so the split is a choice. Symmetric about a mean is the usual one (e.g. Shen and
//! Goldfarb 2007). About the mean of supply and atmosphere, A can rise as far as it can fall, and B nearly so behind a
//! thin rod. This is neither the stiffest level, which is the highest, nor the one at which filling and venting are
//! equally fast.
//!
//! **Pressure swap.** A chamber vents no faster than its valve lets it. In a move after a preload, and in one from an
//! end stop, the drive chamber compensates for the excess pressure that is still in the counter chamber, and falls back
//! as that vents: the force is there as soon as either chamber can make it. The swap ends once the expected excess of
//! the counter chamber is at most 10 kPa. Source: this project (decision 38).
//!
//! **Out of reach.** A piston that stands until the break-away ramp has grown by one break-away force (0.2 s), and then
//! under all the force that can be demanded, is held by air that the observer does not know of: mostly by a full
//! counter chamber that counts as vented, for which no pulse would be planned. Then both targets lie beyond what valves
//! can make, and the valves stay open until the piston slides: whatever was assumed, filling ends at the supply and
//! venting at the atmosphere.
//!
//! Assumes: areas, supply and atmosphere as specified. If the supply is lower, the drive chamber does not reach its
//! pressure, and the force is less than demanded. For the swap: that the counter chamber's pressure is estimated to
//! within 10 kPa.
//!
//! Config [`AxisModel`], state [`PressureSwap`], update [`PressureSwap::targets`].

use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::observer::pressure::Pressures;
use crate::tuning::{PRESSURE_MAX, SWAP_LAG};
use wheeleg_units::{Duty, saturate_i32};

/// Limits a pressure to what the valves can make.
#[inline]
fn possible(model: &AxisModel, pressure: i32) -> i32 {
    pressure.max(model.low).min(model.high)
}

/// Pressure of B that makes `force` with `a` in A: (pA AA − rod − F) / AB.
#[inline]
fn b_of(model: &AxisModel, force: i32, a: i32) -> i32 {
    let times = |a: i32, b: i32| i64::from(a).wrapping_mul(i64::from(b));
    // Over the annulus of a thick rod each of the two exceeds 32 bits (8.4 MPa); their difference is a pressure again.
    let of_a = times(a, model.area_ratio).wrapping_shr(24);
    let of_force = times(force.saturating_add(model.force_rod), model.pressure_b).wrapping_shr(12);
    saturate_i32(of_a.wrapping_sub(of_force))
}

/// Pressure of A that makes `force` with `b` in B.
#[inline]
fn a_of(model: &AxisModel, force: i32, b: i32) -> i32 {
    let sum = force
        .saturating_add(model.force_rod)
        .saturating_add(mul_shr(b, model.force_b, 32));
    mul_shr_sat(sum, model.pressure_a, 12)
}

/// Limits a force to what the supply can deliver, mN.
pub(super) fn possible_force(model: &AxisModel, force: i32) -> i32 {
    force
        .max(model.force_in.wrapping_neg())
        .min(model.force_out)
}

/// Pressures about the mean that make `force`, which must be one that the supply can deliver so that products with it
/// fit.
#[inline]
pub(super) fn targets(model: &AxisModel, force: i32) -> Pressures {
    let a = possible(
        model,
        model
            .mean
            .saturating_add(mul_shr(force, model.half_pressure_a, 12)),
    );
    let b = b_of(model, force, a);
    let bounded = possible(model, b);
    if bounded == b {
        return Pressures { a, b };
    }
    let a = possible(model, a_of(model, force, bounded));
    Pressures { a, b: bounded }
}

/// Whether the drive chamber compensates for the excess pressure of the counter chamber.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PressureSwap {
    /// No.
    No,
    /// Yes, in a move that extends.
    Extends,
    /// Yes, in a move that retracts.
    Retracts,
}

impl PressureSwap {
    /// For a move from `stroke` to `target`, raw mm.
    pub(super) const fn towards(target: i32, stroke: i32) -> Self {
        if target > stroke {
            Self::Extends
        } else {
            Self::Retracts
        }
    }

    /// Excess pressure of the counter chamber, 1/256 Pa.
    const fn lag(self, target: Pressures, expected: Pressures) -> i32 {
        match self {
            Self::No => 0,
            Self::Extends => expected.b.saturating_sub(target.b),
            Self::Retracts => expected.a.saturating_sub(target.a),
        }
    }

    /// Whether the counter chamber still has too much pressure for a force that the supply can deliver.
    pub(super) fn lags(self, model: &AxisModel, force: i32, expected: Pressures) -> bool {
        self.lag(targets(model, force), expected) > SWAP_LAG
    }

    /// Chamber pressures for a force that the supply can deliver, while the chambers are `expected` to be at these. The
    /// swap ends when the counter chamber no longer lags.
    pub(super) fn targets(
        &mut self,
        model: &AxisModel,
        force: i32,
        expected: Pressures,
    ) -> Pressures {
        let target = targets(model, force);
        if self.lag(target, expected) <= SWAP_LAG {
            *self = Self::No;
        }
        match self {
            Self::No => target,
            Self::Extends => Pressures {
                a: possible(model, a_of(model, force, expected.b)).max(target.a),
                ..target
            },
            Self::Retracts => Pressures {
                b: possible(model, b_of(model, force, expected.a)).max(target.b),
                ..target
            },
        }
    }
}

/// Pressures that no valve reaches, for a force in the direction of `force`.
pub(super) const fn out_of_reach(force: i32) -> Pressures {
    let (a, b) = if force > 0 {
        (PRESSURE_MAX, 0)
    } else {
        (0, PRESSURE_MAX)
    };
    Pressures { a, b }
}

/// A force that the supply can deliver, as a share of its largest, in steps of 2^-14.
pub(super) fn duty(model: &AxisModel, force: i32) -> Duty {
    let share = if force > 0 {
        model.share_out
    } else {
        model.share_in
    };
    // Within ±2^14.
    Duty::from_raw(mul_shr(force, share, 26).wrapping_shl(16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::{Micros, PositionMm};

    /// Force of `pressures`, mN, from the areas themselves.
    fn force(pressures: Pressures, data: &AxisData) -> f64 {
        let circle = |d: PositionMm| core::f64::consts::FRAC_PI_4 * d.to_f64() * d.to_f64();
        let (bore, rod) = (circle(data.bore), circle(data.rod));
        let [a, b] = [pressures.a, pressures.b].map(|p| f64::from(p) / 256.0);
        // 1 Pa mm² is 1e-3 mN.
        (a * bore - b * (bore - rod) - 101_325.0 * rod) * 1e-3
    }

    /// For any bore, rod and supply the targets make the demanded force, up to the largest that the supply can deliver.
    #[test]
    fn targets_make_their_force_at_every_supply_and_rod() {
        for bore in [4, 20, 100] {
            for rod_tenths in [0, 4, 9] {
                for supply in [200, 701, 1600, 1640, 1700] {
                    let data = AxisData {
                        bore: PositionMm::from_int(bore),
                        rod: PositionMm::from_raw((i32::from(bore) << 16) / 10 * rod_tenths),
                        supply: PositionMm::from_int(supply),
                        ..AxisData::default()
                    };
                    let model = AxisModel::new(&data, Micros(1000)).unwrap();
                    let most = f64::from(model.force_out.max(model.force_in));
                    for share in -20_i64..=20 {
                        let side = if share < 0 {
                            model.force_in
                        } else {
                            model.force_out
                        };
                        let asked = (i64::from(side) * share / 20) as i32;
                        let target = targets(&model, asked);
                        let bounds = model.low..=model.high;
                        assert!(bounds.contains(&target.a) && bounds.contains(&target.b));
                        let off = force(target, &data) - f64::from(asked);
                        let what = format_args!("{bore} {rod_tenths} {supply} {share}: {off}");
                        assert!(off.abs() < most * 2e-3 + 2.0, "{what} of {asked}");
                    }
                }
            }
        }
    }

    /// B still has 2 bar too much: A compensates for it, and falls back once the excess is below 10 kPa.
    #[test]
    fn a_counter_chamber_that_lags_is_made_up_for() {
        let data = AxisData::default();
        let model = AxisModel::new(&data, Micros(1000)).unwrap();
        let target = targets(&model, 20_000);
        let swapped = |lag_pa: i32| {
            let mut swap = PressureSwap::towards(1, 0);
            let expected = Pressures {
                a: model.mean,
                b: target.b + (lag_pa << 8),
            };
            let found = swap.targets(&model, 20_000, expected);
            let made = Pressures {
                a: found.a,
                b: expected.b,
            };
            (swap, force(made, &data))
        };
        for lag_pa in [11_000, 100_000, 200_000] {
            let (swap, made) = swapped(lag_pa);
            assert_eq!(swap, PressureSwap::Extends);
            assert!((made - 20_000.0).abs() < 150.0, "{lag_pa}: {made}");
        }
        assert_eq!(swapped(9_000).0, PressureSwap::No);
        let mut other = PressureSwap::towards(0, 1);
        let expected = Pressures {
            a: target.a + (50_000 << 8),
            b: model.mean,
        };
        let found = other.targets(&model, 20_000, expected);
        assert!(found.b > target.b && found.a == target.a);
    }
}
