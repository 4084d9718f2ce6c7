//! Chamber pressures for a force.

use crate::axis::gas::Pressures;
use crate::axis::model::AxisModel;
use crate::axis::{part, scaled};

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
    scaled(a, model.area_ratio, 24).saturating_sub(part(
        force.saturating_add(model.force_rod),
        model.pressure_b,
        12,
    ))
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
