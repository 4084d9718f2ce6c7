//! Chamber pressures for a force.

use crate::axis::gas::Pressures;
use crate::axis::model::AxisModel;
use crate::axis::{part, scaled};
use wheeleg_units::saturate_i32;

/// A chamber lags whose pressure is so much above its target (10 kPa in 1/256 Pa).
const LAG: i32 = 10_000 << 8;

/// A pressure that valves can make.
#[inline]
fn possible(model: &AxisModel, pressure: i32) -> i32 {
    pressure.max(model.low).min(model.high)
}

/// Pressure of B that makes `force` with `a` in A: (pA AA − rod − F) / AB.
#[inline]
fn b_of(model: &AxisModel, force: i32, a: i32) -> i32 {
    let times = |a: i32, b: i32| i64::from(a).wrapping_mul(i64::from(b));
    // Over the annulus of a thick rod each of the two is more than 32 bits hold (8.4 MPa);
    // their difference is a pressure again.
    let of_a = times(a, model.area_ratio).wrapping_shr(24);
    let of_force = times(force.saturating_add(model.force_rod), model.pressure_b).wrapping_shr(12);
    saturate_i32(of_a.wrapping_sub(of_force))
}

/// Pressure of A that makes `force` with `b` in B.
#[inline]
fn a_of(model: &AxisModel, force: i32, b: i32) -> i32 {
    let sum = force
        .saturating_add(model.force_rod)
        .saturating_add(part(b, model.force_b, 32));
    scaled(sum, model.pressure_a, 12)
}

/// Pressures whose force is `force`, about the mean. The force must be one that the
/// supply can give, so that products with it fit.
#[inline]
pub(super) fn targets(model: &AxisModel, force: i32) -> Pressures {
    let a = possible(
        model,
        model
            .mean
            .saturating_add(part(force, model.half_pressure_a, 12)),
    );
    let b = b_of(model, force, a);
    let bounded = possible(model, b);
    if bounded == b {
        return Pressures { a, b };
    }
    let a = possible(model, a_of(model, force, bounded));
    Pressures { a, b: bounded }
}

/// Targets while the counter chamber still has too much: the drive chamber makes the
/// force with what that one has. `None` if it does not lag.
#[inline]
pub(super) fn made_up(
    model: &AxisModel,
    force: i32,
    target: Pressures,
    now: Pressures,
    extends: bool,
) -> Option<Pressures> {
    if extends {
        let a = possible(model, a_of(model, force, now.b)).max(target.a);
        (now.b.saturating_sub(target.b) > LAG).then_some(Pressures { a, ..target })
    } else {
        let b = possible(model, b_of(model, force, now.a)).max(target.b);
        (now.a.saturating_sub(target.a) > LAG).then_some(Pressures { b, ..target })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::{AxisData, AxisModel};
    use wheeleg_units::{Micros, PositionMm};

    /// Force of `pressures` with the areas themselves, mN.
    fn force(pressures: Pressures, data: &AxisData) -> f64 {
        let circle = |d: PositionMm| core::f64::consts::FRAC_PI_4 * d.to_f64() * d.to_f64();
        let (bore, rod) = (circle(data.bore), circle(data.rod));
        let [a, b] = [pressures.a, pressures.b].map(|p| f64::from(p) / 256.0);
        // Pa mm² are 1e-3 mN.
        (a * bore - b * (bore - rod) - 101_325.0 * rod) * 1e-3
    }

    /// Whatever bore, rod and supply: targets make the force that was asked for, up to the
    /// largest that the supply gives.
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
}
