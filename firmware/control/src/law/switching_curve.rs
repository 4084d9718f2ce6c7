//! Proximate time-optimal switching curve: the speed towards a target as a function of the remaining distance.
//!
//! ```text
//! e_l  = a_b / k²                            where straight line and parabola meet, with one slope
//! v*   = k e                                 |e| ≤ e_l
//!      = sgn(e) √(2 a_b (|e| − e_l/2))       beyond; both at most v_top, which begins at e_l/2 + v_top²/(2 a_b)
//! |v*| ≥ √(2 a_f |e|)                        landing: where band < |e| ≤ e_l, a_f = min(0.60 Fc / m, a_b / 2)
//!
//! k = 0.36 σ / T_d, at least 1/s      D = 0.95 σ / T_d      a_b = 0.50 (0.36 / T_d) v_c σ², below 2^18 mm/s²
//! σ = min(1, ∛(m_n / m))                     a heavy piston is given less of each
//! v_c = min(v_B, 1.5 v_A)                    v = C ρ0 R T0 / area of the chamber: its choked speed
//! v_top = 1.5 v_c                            stored air drives the piston beyond the choked speed
//! m_n   = 0.60 · ½ Ḟ / (a_b k)               with σ = 1; Ḟ: how fast both valves change the force at mid stroke
//!
//! half of the acceleration is enough:  m D k band > F_1
//! F_1   = n C ρ0 R T0 p_m AB/VB (t_off + margin)      the shortest opening of B's vent valve at mid stroke and mean pressure
//! ```
//!
//! e: error, mm; v: speed, mm/s; k: slope, D: gain of the speed error, 1/s; a_b: deceleration, mm/s²; T_d: dead time,
//! s; m: mass in use, m_n: nimble mass, kg; Fc: Coulomb friction, mN; Ḟ, mN/s; v_A, v_B: choked speed of each chamber
//! as an outlet, mm/s, as K in [`crate::observer::pressure`]. F_1: force of the finest pulse, mN, with n, C and ρ0 as
//! there, p_m as in `allocation`, area AB and volume VB of B, margin of the axis data; band: rest band, mm.
//! `inverse_dynamics` may lower a_b under a load.
//!
//! **Landing.** Near the target the straight line is slower than friction needs it to be: a piston that follows it is
//! pushed all the way, often stops a millimetre short, stands there and slips again. On its first approach to a resting
//! target (`standstill`) it comes in along the parabola of its friction, of which only a part is counted on, because
//! the true one may be less. The demanded deceleration still uses the slope k, not that of the landing. Beyond e_l the
//! landing is never the faster one, since a_f is at most a_b/2, and a piston with little friction for its mass stays on
//! the straight line nearly all the way.
//!
//! **Half is enough.** A piston that stands off its target by e is moved by the force m D k e (`inverse_dynamics`),
//! plus friction and ramp. Two halves meet on the way to the valves: `allocation` gives half of a force to each
//! chamber, and `pulse_planner` sends a pulse for more than half of what the shortest opening makes. So the least force
//! that makes a pulse is ½ F_1 / ½ = F_1, not ½ F_1 (in balance at mid stroke 0.9 to 1.25 F_1, depending on the other
//! valve and the rod). Where the condition holds, the full acceleration makes a pulse from one band on, and half of it
//! from two bands on; at two bands a piston at rest is also released, and the band in which it may rest grows to 2.4
//! bands (`standstill`). More than that only keeps a heavy piston moving, so `inverse_dynamics` takes half of it where
//! patience is over. Where the condition does not hold, as for light pistons, half of it would make no pulse within two
//! bands.
//!
//! Source: the parabola is the time-optimal curve of a mass that brakes with a_b; the straight line at its foot removes
//! the chatter of an ideal switch (Workman 1987, "proximate time-optimal servomechanism"). One curve serves 1 and 400
//! mm. Scaling by dead time, choked speed and mass is this project's (decision 38), and so is the landing (decision
//! 65); the factors are searched ([`crate::tuning`]). Within the limits of k and a_b, and unless a load lowers a_b, e_l
//! does not depend on the mass.
//!
//! Assumes: dead time, supply and conductance as specified; the mass in use; on the landing at least 0.6 of the
//! friction in use; and that a force can be built up within about a dead time, which the nimble mass represents. If the
//! supply falls, the curve stays as it is: the force that it demands comes later or not at all, and the piston falls
//! behind the curve or overshoots the target.
//!
//! Config [`AxisModel`] and [`SpeedGains`], which is recomputed with each new mass; no state; updates
//! [`SpeedGains::speed`] and [`SpeedGains::landing`].

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{along, cube_root, mul_shr, mul_shr_sat, quotient, square_root, within};
use crate::observer::motion::Inertia;
use crate::tuning::{LANDING_FRICTION, MASS_MIN, SLOPE_LEAST};

/// The part of the law that depends on the moving mass; recomputed when the mass changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SpeedGains {
    /// Slope of the straight line k, 1/s × 2^8.
    pub(super) slope: i32,
    /// Gain of the speed error, 1/s × 2^8.
    pub(super) damping: i32,
    /// Deceleration towards the target a_b, mm/s².
    pub(super) brake: i32,
    /// 1/(2 k²), s² × 2^32.
    linear: i32,
    /// Half of the acceleration is enough near the target: it still makes a pulse from two rest bands on.
    pub(super) half_is_enough: bool,
}

impl SpeedGains {
    /// For this mass, kg × 2^16.
    pub(super) fn new(model: &AxisModel, mass: i32) -> Self {
        let mass = mass.max(MASS_MIN);
        let share = if mass > model.nimble_mass {
            // Nimble mass over mass, × 2^30.
            let per_mass = quotient(1 << 40, mass.cast_unsigned(), 0);
            cube_root(mul_shr(model.nimble_mass, per_mass, 10).cast_unsigned())
        } else {
            1 << 16
        };
        let slope = mul_shr(model.slope, share, 16).max(SLOPE_LEAST);
        // 2^32 / (2 k²) with k × 2^8, below 2^16: 2^47 / k².
        let square = slope.cast_unsigned().wrapping_mul(slope.cast_unsigned());
        let damping = mul_shr(model.damping, share, 16);
        // Below 256/s and 680/s: 2^18/s². Times 200 kg and 12 it is below 2^30 mN/mm, and times a band of 5 mm below
        // 2^33 mN.
        let stiffness = mul_shr(slope, damping, 16);
        let stiffness = i64::from(mass)
            .wrapping_mul(stiffness.into())
            .wrapping_shr(16);
        let edge = stiffness
            .wrapping_mul(i64::from(model.band))
            .wrapping_shr(16);
        Self {
            slope,
            damping,
            half_is_enough: edge > i64::from(model.pulse_force),
            // Below 2^18 mm/s², 27 g: the curve uses it × 2^13.
            brake: mul_shr(model.brake, mul_shr(share, share, 16), 16).min((1 << 18) - 1),
            linear: quotient(1 << 47, square, 0),
        }
    }

    /// Speed towards the target, raw mm/s, and its slope over the error, 1/s × 2^8, for a deceleration of at most
    /// `brake` (mm/s²).
    pub(super) fn speed(&self, error: i32, brake: i32, top: i32) -> (i32, i32) {
        let line_ends = self.line_ends(brake);
        let size = error.saturating_abs();
        if size <= line_ends || is_without(Part::Parabola) {
            let line = mul_shr_sat(self.slope, error, 8);
            return (within(line, top), self.slope);
        }
        let speed = parabola(brake, size.saturating_sub(line_ends >> 1));
        if speed >= top {
            (along(top, error), 0)
        } else {
            (along(speed, error), parabola_slope(brake, speed))
        }
    }

    /// End of the straight line e_l = a_b / k², raw mm: twice `linear`, from mm/s² × s² × 2^32.
    fn line_ends(&self, brake: i32) -> i32 {
        mul_shr_sat(brake, self.linear, 15)
    }

    /// Speed towards the target on a first approach, raw mm/s: `curve`, that of [`Self::speed`] for the same error and
    /// `brake`, or the landing where that is faster.
    pub(super) fn landing(
        &self,
        model: &AxisModel,
        inertia: &Inertia,
        (error, brake): (i32, i32),
        curve: i32,
    ) -> i32 {
        let size = error.saturating_abs();
        if size <= model.band || size > self.line_ends(brake) || is_without(Part::Landing) {
            return curve;
        }
        let friction = inertia.acceleration(mul_shr(model.coulomb, LANDING_FRICTION, 16));
        let speed = parabola(friction.min(brake >> 1), size);
        along(
            speed.min(model.top_speed).max(curve.saturating_abs()),
            error,
        )
    }
}

/// Speed, raw mm/s, from which this deceleration (mm/s²) stops the piston after `distance` (raw mm).
fn parabola(deceleration: i32, distance: i32) -> i32 {
    // (32 v)² = 2 a e × 2^10; with raw e: × 2^11 / 2^16.
    let square = i64::from(deceleration)
        .wrapping_mul(distance.into())
        .wrapping_shr(5);
    let square = u32::try_from(square).unwrap_or(u32::MAX);
    // At most 65 536 / 32 mm/s: fits raw mm/s.
    let root = square_root(square).max(1) as i32;
    root.wrapping_shl(11)
}

/// Slope of this parabola over the distance where its speed is `speed` (raw mm/s), a / v, 1/s × 2^8.
fn parabola_slope(deceleration: i32, speed: i32) -> i32 {
    // Times 2^24 in two halves: a deceleration below 2^18 times 2^13 fits, and a speed is a multiple of 2^11.
    deceleration
        .wrapping_shl(13)
        .checked_div(speed.wrapping_shr(11))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::{Micros, PositionMm};

    /// Compares with the documented formulas, from a tenth of a millimetre to the whole stroke; the line meets the
    /// parabola without a step in speed or slope.
    #[test]
    fn the_curve_is_a_line_and_a_parabola_that_meet_smoothly() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let gains = SpeedGains::new(&model, model.mass);
        let (k, b) = (f64::from(gains.slope) / 256.0, f64::from(gains.brake));
        let meet = b / (k * k);
        let top = f64::from(model.top_speed) / 65_536.0;
        for e in [0.1, 0.5 * meet, 0.99 * meet, 1.01 * meet, 2.0 * meet, 180.0] {
            let exact = if e <= meet {
                k * e
            } else {
                f64::min(top, (2.0 * b * (e - meet / 2.0)).sqrt())
            };
            for sign in [-1.0, 1.0] {
                let raw = (sign * e * 65_536.0) as i32;
                let (speed, _) = gains.speed(raw, gains.brake, model.top_speed);
                let off = f64::from(speed) / 65_536.0 - sign * exact;
                assert!(off.abs() < 0.1 + 3e-3 * exact, "{e}: {off} of {exact}");
            }
        }
        let slope = |e: f64| {
            gains
                .speed((e * 65_536.0) as i32, gains.brake, model.top_speed)
                .1
        };
        let ratio = f64::from(slope(1.01 * meet)) / f64::from(slope(0.99 * meet));
        assert!((0.97..=1.0).contains(&ratio), "{ratio}");
    }

    /// Compares with the documented formula: from one band on, until the line or the curve is faster. A light piston
    /// is bounded by half of the deceleration, the heavy ones land by their friction.
    #[test]
    fn a_landing_is_as_fast_as_friction_can_stop() {
        for (mass_kg, bounded) in [(1.5, true), (20.0, false), (60.0, false)] {
            let data = AxisData {
                mass: PositionMm::from_f64(mass_kg),
                ..AxisData::default()
            };
            let model = AxisModel::new(&data, Micros(1000)).expect("in range");
            let gains = SpeedGains::new(&model, model.mass);
            let inertia = Inertia::new(&model, model.mass);
            let (k, half) = (f64::from(gains.slope) / 256.0, 0.5 * f64::from(gains.brake));
            // mN/kg is mm/s².
            let friction = 0.6 * f64::from(model.coulomb) / mass_kg;
            assert_eq!(friction > half, bounded, "{mass_kg}: {friction} {half}");
            let band = f64::from(model.band) / 65_536.0;
            let mut lands_to = 0.0_f64;
            for step in 1..200 {
                let e = 0.05 * f64::from(step) + 0.01;
                let root = (2.0 * friction.min(half) * e).sqrt();
                for sign in [-1.0, 1.0] {
                    let raw = (sign * e * 65_536.0) as i32;
                    let (curve, _) = gains.speed(raw, gains.brake, model.top_speed);
                    let speed = gains.landing(&model, &inertia, (raw, gains.brake), curve);
                    let line = f64::from(curve.abs()) / 65_536.0;
                    let exact = if e > band { root.max(line) } else { line };
                    let speed = sign * f64::from(speed) / 65_536.0;
                    assert!((speed / exact - 1.0).abs() < 0.01, "{e}: {speed} {exact}");
                    if speed > 1.01 * line {
                        lands_to = lands_to.max(e);
                    }
                }
            }
            // Where the line is as fast.
            let meet = 2.0 * friction.min(half) / (k * k);
            assert!(
                (lands_to / meet - 1.0).abs() < 0.1,
                "{mass_kg}: {lands_to} {meet}"
            );
        }
    }

    #[test]
    fn gains_of_a_mass_are_good_to_two_thousandths() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        for mass_kg in [0.05, 0.3, 1.0, 1.5, 6.0, 40.0, 200.0] {
            let raw = (mass_kg * 65_536.0) as i32;
            let gains = SpeedGains::new(&model, raw);
            let share = (f64::from(model.nimble_mass) / f64::from(raw))
                .cbrt()
                .min(1.0);
            let slope = f64::from(model.slope) * share;
            for (value, exact) in [
                (gains.slope, slope),
                (gains.damping, f64::from(model.damping) * share),
                (gains.brake, f64::from(model.brake) * share * share),
                (gains.linear, 2_f64.powi(47) / (slope * slope)),
            ] {
                let difference = (f64::from(value) - exact).abs();
                assert!(
                    difference <= 2.0 + 2e-3 * exact,
                    "{mass_kg}: {value} {exact}"
                );
            }
        }
    }

    /// Half is enough from the mass at which an error of one band demands the finest pulse, by the documented formula.
    #[test]
    fn half_is_enough_where_an_error_of_the_band_asks_for_more_than_the_finest_pulse() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let band = f64::from(model.band) / 65_536.0;
        let mut enough = [0; 2];
        for mass_kg in (1..=200).map(f64::from) {
            let gains = SpeedGains::new(&model, (mass_kg * 65_536.0) as i32);
            let [slope, damping] = [gains.slope, gains.damping].map(|gain| f64::from(gain) / 256.0);
            let edge = mass_kg * damping * slope * band;
            let finest = f64::from(model.pulse_force);
            if (edge / finest - 1.0).abs() > 0.01 {
                assert_eq!(
                    gains.half_is_enough,
                    edge > finest,
                    "{mass_kg}: {edge} {finest}"
                );
                enough[usize::from(gains.half_is_enough)] += 1;
            }
        }
        assert!(enough.iter().all(|cases| *cases > 1), "{enough:?}");
    }

    /// At least 1/s, because half of 1/k² has to fit 2^-32 s².
    #[test]
    fn the_slope_of_the_heaviest_mass_fits_its_format() {
        let data = AxisData {
            valve_on: Micros(50_000),
            line_delay: Micros(20_000),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        let gains = SpeedGains::new(&model, i32::MAX);
        assert_eq!((gains.slope, gains.linear), (1 << 8, i32::MAX));
        let (speed, _) = gains.speed(1 << 10, gains.brake, model.top_speed);
        assert_eq!(speed, 1 << 10, "a millimetre a second for a millimetre");
    }

    /// A light piston behind large and fast valves: brake × 2^13 must fit 32 bits, or the curve would change its sign.
    #[test]
    fn the_brake_of_the_lightest_and_fastest_axis_fits_its_format() {
        let data = AxisData {
            bore: PositionMm::from_int(10),
            rod: PositionMm::from_int(4),
            stroke: PositionMm::from_int(100),
            dead_a: PositionMm::from_int(1),
            dead_b: PositionMm::from_int(1),
            conductance: "0.42".parse().expect("a number"),
            mass: PositionMm::from_f64(0.05),
            valve_on: Micros(1000),
            valve_off: Micros(1000),
            line_delay: Micros(100),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        assert!(model.brake > 1 << 18, "{}", model.brake);
        // The largest value that still fits when multiplied by 2^13.
        let gains = SpeedGains::new(&model, model.mass);
        assert_eq!(gains.brake, i32::MAX >> 13);
    }
}
