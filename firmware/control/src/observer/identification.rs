//! Identification from a move: the mass, and where within their bounds the pressures were, by least squares.
//!
//! While the piston slides in one direction, the impulse of the estimated force is linear in what the model does not
//! know:
//!
//! ```text
//! J(i) = Σ (F − d v) = m (v(i) − v₀)/T + c i − uA Σ wA + uB Σ wB        i: periods since the piston slides
//!   wA = AA (pA⁺ − pA⁻)      width of the bounds, as a force        u: error of the pressure as a share of it
//! ```
//!
//! J in mN · periods, w in mN, u within ±1, the rest as in [`super::mass`]: c is Coulomb friction less load. The
//! pressure error fades as a chamber is filled, is vented or grows, in the same way as the width of its bounds; that
//! distinguishes it from mass and load. The normal equations of the four unknowns are summed in every move, with a
//! ridge that keeps the shares at zero where the move reveals little.
//!
//! They are solved once, when a move has ended that determines a mass ([`super::mass`]) and in which the bounds were
//! far apart. The resulting mass replaces the one from three instants. The pressures are corrected by u times the width
//! of their bounds, within these, and remain uncertain by an eighth of the width on either side
//! ([`super::pressure::Chamber::correct`]). If the equations cannot separate the unknowns, the mass from three instants
//! and the pressures stay.
//!
//! Source: Ljung, System Identification, ch. 7; ridge: Hoerl and Kennard 1970.
//!
//! Assumes: load and friction constant over the move, so not a move that ends in a cushion; bounds that contain the
//! true pressures. If the supply has fallen, they may not ([`super::pressure`]), and the result is limited to them. At
//! standstill nothing is learnt: there a pressure cannot be distinguished from a load (Pandian et al. 2002).
//!
//! Config [`AxisModel`], state [`Regression`], updates [`Regression::add`] and [`Regression::solve`].

use crate::axis::AxisModel;
use crate::math::mul_shr_sat;
use crate::tuning::{AIR_RESIDUAL, AIR_SHARE_SHIFT};

/// Mass, constant force, errors of both pressures; the impulse is the right-hand side.
const UNKNOWNS: usize = 4;
/// Bits of a normalised equation.
const BITS: i32 = 28;
/// Fraction bits of a solution.
const FRACTION: u32 = 20;

type Rows = [[i64; UNKNOWNS + 1]; UNKNOWNS];

/// The sums of one move; only the upper triangle is used. Forces are shares of the largest, × 2^12.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Regression {
    impulse: i32,
    widths: [i32; 2],
    sums: Rows,
}

/// What a move reveals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identified {
    /// kg × 2^16.
    pub(crate) mass: i32,
    /// Errors of the pressures of A and B, shares of the widths of their bounds × 2^16, within ±1.
    pub(crate) shares: [i32; 2],
}

/// `value × 2^shift` for a shift of either sign.
fn shifted(value: i64, shift: i32) -> i64 {
    if shift < 0 {
        value.wrapping_shr(shift.unsigned_abs().min(63))
    } else {
        value.saturating_mul(1_i64.wrapping_shl(shift.unsigned_abs().min(62)))
    }
}

/// Bits of the absolute value.
const fn bits(value: i64) -> i32 {
    64_i32.wrapping_sub(value.unsigned_abs().leading_zeros() as i32)
}

/// Share of the largest extending force, × 2^12.
fn share(model: &AxisModel, force: i32) -> i32 {
    mul_shr_sat(force, model.share_out, 28)
}

impl Regression {
    /// Adds a period in which the force less viscous friction was `used` and the bounds of the pressures were `widths`
    /// apart, mN. `gained` is the speed gained since the start, raw mm/s, and `periods` the number of periods since
    /// then.
    pub(crate) fn add(
        &mut self,
        model: &AxisModel,
        gained: i32,
        periods: u16,
        used: i32,
        widths: [i32; 2],
    ) {
        self.impulse = self.impulse.saturating_add(share(model, used));
        for (sum, width) in self.widths.iter_mut().zip(widths) {
            *sum = sum.saturating_add(share(model, width));
        }
        let [a, b] = self.widths;
        // Speeds in quarters of a mm/s. All are below 2^23 and products below 2^46, for at most 250 periods.
        let row = [
            i64::from(gained.wrapping_shr(14)),
            i64::from(periods),
            i64::from(a).wrapping_neg(),
            i64::from(b),
            i64::from(self.impulse),
        ];
        for ((sums, first), index) in self.sums.iter_mut().zip(row).zip(0_usize..) {
            for (sum, second) in sums.iter_mut().zip(row).skip(index) {
                *sum = sum.saturating_add(first.wrapping_mul(second));
            }
        }
    }

    /// Sum of both widths, averaged over `periods`, as a share of the largest force × 2^12.
    pub(crate) fn width(&self, periods: u16) -> i32 {
        let [a, b] = self.widths;
        a.saturating_add(b)
            .checked_div(i32::from(periods))
            .unwrap_or(0)
    }

    /// The unknowns; `None` if the equations cannot separate them.
    #[cold]
    pub(crate) fn solve(&self, model: &AxisModel) -> Option<Identified> {
        let (rows, scales, scale) = self.normalised()?;
        let [mass, _, a, b] = solution(rows)?;
        let [mass_scale, _, a_scale, b_scale] = scales;
        let mass = shifted(mass, scale.wrapping_sub(mass_scale));
        // From shares of the largest force × 2^12 over quarters of a mm/s, × 2^20, to kg × 2^16.
        let mass = mass
            .saturating_mul(i64::from(model.force_out))
            .wrapping_shr(12)
            .saturating_mul(i64::from(model.period))
            .wrapping_shr(34);
        let of = |x: i64, own: i32| {
            let x = shifted(x, scale.wrapping_sub(own)).wrapping_shr(FRACTION.wrapping_sub(16));
            x.clamp(-(1 << 16), 1 << 16) as i32
        };
        Some(Identified {
            mass: mass.max(0).min(i64::from(i32::MAX)) as i32,
            shares: [of(a, a_scale), of(b, b_scale)],
        })
    }

    /// The equations with the ridge, each unknown scaled by a power of two so that its own sum has 27 or 28 bits; also
    /// the exponents of these scales and that of the impulse.
    fn normalised(&self) -> Option<(Rows, [i32; UNKNOWNS], i32)> {
        let mut rows = self.sums;
        let ridge = AIR_RESIDUAL
            .wrapping_mul(AIR_RESIDUAL)
            .wrapping_shl(AIR_SHARE_SHIFT.wrapping_mul(2));
        let [_, _, [_, _, of_a, ..], [_, _, _, of_b, _]] = &mut rows;
        *of_a = of_a.saturating_add(ridge);
        *of_b = of_b.saturating_add(ridge);
        let [[m, ..], [_, c, ..], [_, _, a, ..], [_, _, _, b, _]] = rows;
        let scales = [m, c, a, b].map(|own| (bits(own).wrapping_sub(BITS).wrapping_add(1)) >> 1);
        let mut scale = 0;
        for (row, own) in rows.iter().zip(scales) {
            let [.., right] = *row;
            scale = scale.max(bits(right).wrapping_sub(own).wrapping_sub(BITS));
        }
        let others = [scales[0], scales[1], scales[2], scales[3], scale];
        for (row, own) in rows.iter_mut().zip(scales) {
            for (value, other) in row.iter_mut().zip(others) {
                *value = shifted(*value, own.wrapping_add(other).wrapping_neg());
            }
        }
        // The lower triangle mirrors the upper one.
        let upper = rows;
        for (index, row) in (0..).zip(rows.iter_mut()) {
            for (value, from) in row.iter_mut().zip(upper).take(index) {
                *value = from.get(index).copied()?;
            }
        }
        Some((rows, scales, scale))
    }
}

/// Gaussian elimination of a positive definite matrix; the solution × 2^20.
fn solution(mut rows: Rows) -> Option<[i64; UNKNOWNS]> {
    for index in 0..UNKNOWNS {
        let pivot = *rows.get(index)?;
        let own = *pivot.get(index)?;
        if own <= 0 {
            return None;
        }
        for row in rows.iter_mut().skip(index.wrapping_add(1)) {
            let first = *row.get(index)?;
            let factor = first.wrapping_shl(BITS as u32).checked_div(own)?;
            for (value, above) in row.iter_mut().zip(pivot).skip(index) {
                let part = factor.saturating_mul(above).wrapping_shr(BITS as u32);
                *value = value.saturating_sub(part);
            }
        }
    }
    let mut found = [0; UNKNOWNS];
    for index in (0..UNKNOWNS).rev() {
        let row = *rows.get(index)?;
        let [.., right] = row;
        let known = row.iter().zip(found).fold(0_i64, |sum, (value, x)| {
            sum.saturating_add(value.saturating_mul(x))
        });
        let rest = right.wrapping_shl(FRACTION).saturating_sub(known);
        *found.get_mut(index)? = rest.checked_div(*row.get(index)?)?;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::Micros;

    /// A move of 300 ms with this mass, with pressures that are wrong by these shares of bounds that close as the
    /// chambers are filled and vented, and with 12 N of load and friction.
    fn moved(model: &AxisModel, mass_kg: f64, shares: [f64; 2]) -> Identified {
        let mut regression = Regression::default();
        let (mut speed, mut a_n, mut b_n) = (20.0, 180.0, 150.0);
        for period in 1..=75_u16 {
            let gained = if period <= 40 { 12.0 } else { -13.0 };
            speed += gained;
            a_n *= 0.97;
            b_n *= if period <= 30 { 0.98 } else { 1.01 };
            let true_n = mass_kg * gained / 4.0 + 12.0;
            let estimated_n = true_n - shares[0] * a_n + shares[1] * b_n;
            let raw = ((speed - 20.0) * 65_536.0) as i32;
            let widths = [(a_n * 1e3) as i32, (b_n * 1e3) as i32];
            regression.add(model, raw, period, (estimated_n * 1e3) as i32, widths);
        }
        regression.solve(model).expect("told apart")
    }

    #[test]
    fn mass_and_air_are_told_apart() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        for mass_kg in [1.0, 3.0, 9.0] {
            for shares in [[0.0, 0.0], [0.6, 0.7], [0.2, -0.3], [0.9, 0.1]] {
                let found = moved(&model, mass_kg, shares);
                let learnt = f64::from(found.mass) / 65_536.0;
                let context = format_args!("{mass_kg} {shares:?}: {learnt} {:?}", found.shares);
                // The ridge takes part of the shares, and the mass takes some of that.
                assert!((learnt - mass_kg).abs() < 0.1 * mass_kg + 0.5, "{context}");
                for (share, told) in found.shares.into_iter().zip(shares) {
                    assert!(
                        (f64::from(share) / 65_536.0 - told).abs() < 0.25,
                        "{context}"
                    );
                }
            }
        }
    }

    /// The larger the expected residual, and the smaller the likely pressure errors, the less the pressures are
    /// corrected; here errors of 0.6 and 0.7 of the widths of the bounds.
    #[test]
    fn the_ridge_is_that_of_the_table() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let mut regression = Regression::default();
        regression.add(&model, 1 << 20, 1, 10_000, [50_000, 40_000]);
        let bare = regression.sums;
        let (rows, scales, _) = regression.normalised().expect("rows");
        let ridge = shifted(rows[2][2], 2 * scales[2]) - bare[2][2];
        // 0.37 of the largest force × 2^12, divided by one half, squared.
        let exact = (0.3662 * 4096.0 * 2.0_f64).powi(2);
        assert!((ridge as f64 / exact - 1.0).abs() < 0.01, "{ridge} {exact}");
    }

    /// No data, no result.
    #[test]
    fn equations_without_a_solution_tell_nothing() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        assert_eq!(Regression::default().solve(&model), None);
    }
}
