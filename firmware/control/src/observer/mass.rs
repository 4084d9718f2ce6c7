//! Mass estimator: the moving mass, from the impulse of one move.
//!
//! While the piston slides in one direction, friction and load are constant but for the viscous part, and the impulse
//! of the known forces is
//!
//! ```text
//! J(i) = Σ (F − d v) = m (v(i) − v₀)/T + c i          i: periods since the piston slides; T: period, s
//! m    = T (J − J line) / (v − v line)                at the fastest; line: from the first to the last instant
//! ```
//!
//! F: pressure force, mN; d: viscous friction, mN s/mm; v: speed, mm/s; m: mass, kg (× 2^16); c: Coulomb friction less
//! load, mN; J in mN · periods. Three instants of the move separate m from c: where it begins to slide, where it is
//! fastest, and where it ends. What lies on the straight line from the first to the last is due to c; what the fastest
//! has above that line is due to m, in J as in v. Source: Newton's second law, integrated; the derivation is this
//! project's.
//!
//! **A move** begins when |v| rises above 20 mm/s. It ends when |v| no longer exceeds that, when v has changed its
//! sign, or after 1 s; a piston that is then still as fast begins another. Moves count whoever drives. A move
//! determines a mass if it took at least 80 ms, reached 200 mm/s, and was 100 mm/s above the line; otherwise nothing
//! changes.
//!
//! If the bounds of the pressures are far apart in such a move (both widths, as forces, together on average by more
//! than a quarter of the largest extending force), as after a power-up with unknown air, the force is not accurate
//! enough for the mass. Then the mass comes, together with the pressures, from [`super::identification`].
//!
//! **Doubt.** The peak above the line is a small difference of large impulses. In a long move at nearly constant speed
//! a small error of viscous friction or pressure can make the mass appear as a quarter of the true one. A mass below
//! the plausible minimum (0.6 of the specified one: rod and carriage always remain) is therefore ignored, with the
//! pressures found beside it, until the next move that determines a mass confirms it; then the minimum is used.
//! Believed at once, it would make the next move overshoot. The maximum is 12 times the specified mass.
//!
//! **Cushion and end stop** are not known here, other than in [`super::motion`]. A move that ends in one has been
//! braked by an impulse that J lacks: J line at the fastest is too high by a share of it, and the mass comes out too
//! small. Only the same bound and doubt guard against this.
//!
//! Assumes: the load does not change during the move; axes for which it does switch learning off
//! ([`crate::axis::AxisData::learns_mass`]). Viscous friction in use and supply as specified, within what doubt covers.
//! If the supply falls, F is too high while a chamber is filled, and the mass is wrong by the share of that in J − J
//! line: no more than the two bounds let through.
//!
//! Config [`AxisModel`], state [`MassEstimator`], update [`MassEstimator::update`].

use super::identification::{Identified, Regression};
use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat, quotient};
use crate::tuning::{
    AIR_UNKNOWN, LEARN_PEAK_ABOVE, LEARN_PEAK_SPEED, LEARN_PERIODS_MAX, LEARN_PERIODS_MIN,
    LEARN_SLIDES, MASS_LEARNT_LEAST, MASS_LEARNT_MOST,
};

/// An instant of a move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct Instant {
    /// Periods since the first instant.
    periods: u16,
    /// Raw mm/s.
    speed: i32,
    /// Impulse since the first instant, 16 mN × periods.
    impulse: i32,
}

/// The move under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MassEstimator {
    /// Speed at the first instant, raw mm/s; 0 before it.
    first: i32,
    fastest: Instant,
    last: Instant,
    regression: Regression,
    /// The last move that determined a mass gave less than the plausible minimum.
    doubted: bool,
}

impl MassEstimator {
    /// One period that ends at `speed` (raw mm/s), with the mean pressure force `force` and with the `widths` of the
    /// bounds of both pressures as forces, mN. If a move has ended with it, returns what that move reveals, if
    /// anything.
    pub(crate) fn update(
        &mut self,
        model: &AxisModel,
        speed: i32,
        force: i32,
        widths: [i32; 2],
    ) -> Option<Identified> {
        let sliding = speed.wrapping_abs() > LEARN_SLIDES;
        if self.first == 0 {
            if sliding {
                self.first = speed;
            }
            return None;
        }
        let used = force.saturating_sub(mul_shr(speed, model.viscous, 24));
        self.last = Instant {
            periods: self.last.periods.wrapping_add(1),
            speed,
            // Forces below 2^24 mN (100 mm bore at 2.1 MPa), in 16 mN, over up to 2^8 periods.
            impulse: self.last.impulse.wrapping_add(used.wrapping_shr(4)),
        };
        let gained = speed.saturating_sub(self.first);
        self.regression
            .add(model, gained, self.last.periods, used, widths);
        if speed.wrapping_abs() > self.fastest.speed.wrapping_abs() {
            self.fastest = self.last;
        }
        let turned = (speed ^ self.first) < 0;
        if sliding && !turned && self.last.periods < LEARN_PERIODS_MAX {
            return None;
        }
        let ended = core::mem::take(self);
        self.doubted = ended.doubted;
        let by_instants = ended.mass(model)?;
        let is_unknown = ended.regression.width(ended.last.periods) > AIR_UNKNOWN
            && !is_without(Part::AirIdentification);
        let identified = is_unknown.then(|| ended.regression.solve(model)).flatten();
        let found = identified.unwrap_or(Identified {
            mass: by_instants,
            shares: [0; 2],
        });
        let told = model.mass;
        let least = mul_shr_sat(told, MASS_LEARNT_LEAST, 16);
        let most = told.saturating_mul(MASS_LEARNT_MOST);
        // Below the minimum: doubted until the next move confirms it.
        self.doubted = found.mass < least && !ended.doubted;
        if self.doubted {
            return None;
        }
        Some(Identified {
            mass: found.mass.max(least).min(most),
            ..found
        })
    }

    /// The mass from three instants, if the move determines it.
    #[cold]
    fn mass(&self, model: &AxisModel) -> Option<i32> {
        let Self {
            first,
            fastest,
            last,
            ..
        } = *self;
        let share = u32::from(fastest.periods)
            .wrapping_shl(16)
            .checked_div(u32::from(last.periods))
            .unwrap_or(0) as i32;
        let line = |end: i32| mul_shr(end, share, 16);
        let speed = fastest
            .speed
            .wrapping_sub(first)
            .wrapping_sub(line(last.speed.wrapping_sub(first)));
        let impulse = fastest.impulse.wrapping_sub(line(last.impulse));
        let (speed, impulse) = if first < 0 {
            (speed.wrapping_neg(), impulse.wrapping_neg())
        } else {
            (speed, impulse)
        };
        if last.periods < LEARN_PERIODS_MIN
            || fastest.speed.wrapping_abs() < LEARN_PEAK_SPEED
            || speed < LEARN_PEAK_ABOVE
        {
            return None;
        }
        // 16 mN × s × 2^32 over mm/s × 2^16.
        let impulse = i64::from(impulse.max(0)).wrapping_mul(i64::from(model.period));
        let impulse = impulse.wrapping_shr(8).cast_unsigned();
        Some(quotient(impulse, speed.cast_unsigned(), 12))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    extern crate std;
    use std::vec;
    use std::vec::Vec;
    use wheeleg_units::Micros;

    /// A mass under a known force, with friction and a load: accelerates, then brakes.
    fn moved(model: &AxisModel, mass_kg: f64, sign: f64, load: f64) -> Option<f64> {
        moved_again(&mut MassEstimator::default(), model, mass_kg, sign, load)
    }

    /// The same, after other moves.
    fn moved_again(
        estimator: &mut MassEstimator,
        model: &AxisModel,
        mass_kg: f64,
        sign: f64,
        load: f64,
    ) -> Option<f64> {
        let mut speed = 0.0_f64;
        for period in 0..75 {
            // mm/s per period.
            let acceleration = if period < 30 { 12.0 } else { -10.4 };
            // The force of the period that ends at this speed.
            speed = f64::max(speed + acceleration, 0.0);
            let viscous = speed * f64::from(model.viscous) / 256e3;
            let force = acceleration * mass_kg / 4.0 + 10.0 + viscous;
            let force = (sign * force - load) * 1e3;
            let raw = (sign * speed * 65_536.0) as i32;
            if let Some(found) = estimator.update(model, raw, force as i32, [0; 2]) {
                assert!(speed < 20.0, "not before the end");
                return Some(f64::from(found.mass) / 65_536.0);
            }
        }
        None
    }

    /// An estimator that believes whatever the next move reveals, since the last one gave too little.
    fn doubting() -> MassEstimator {
        MassEstimator {
            doubted: true,
            ..MassEstimator::default()
        }
    }

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    #[test]
    fn a_mass_is_learnt_from_one_move_under_any_load() {
        let model = model();
        for mass_kg in [1.0, 1.5, 4.0, 9.0] {
            for (sign, load) in [(1.0, 0.0), (1.0, 60.0), (-1.0, 60.0), (-1.0, -90.0)] {
                let learnt = moved(&model, mass_kg, sign, load).expect("learnt");
                assert!((learnt / mass_kg - 1.0).abs() < 0.03, "{learnt} {mass_kg}");
            }
        }
    }

    /// With bounds a quarter of the largest force apart on average the air is identified, too. With less, the three
    /// instants determine the mass, and the pressures stay.
    #[test]
    fn a_move_with_unknown_air_tells_its_mass_and_the_air() {
        let model = model();
        let found = |share: f64| {
            let mut estimator = doubting();
            let width = (share * f64::from(model.force_out)) as i32;
            let mut speed = 0.0_f64;
            (0..75).find_map(|period| {
                speed = f64::max(speed + if period < 30 { 12.0 } else { -10.4 }, 0.0);
                // The estimate of A is too low by half of a width that closes.
                let left = (f64::from(width) * (1.0 - f64::from(period) / 75.0)) as i32 * 2;
                let force = if period < 30 { 4_500 } else { -3_900 } + 10_000 - left / 2;
                let raw = (speed * 65_536.0) as i32;
                estimator.update(&model, raw, force, [left, 0])
            })
        };
        let unknown = found(0.26).expect("told");
        assert!(unknown.shares[0] > 1 << 13, "{unknown:?}");
        assert_eq!(found(0.18).expect("told").shares, [0; 2]);
    }

    #[test]
    fn what_cannot_be_is_bounded() {
        let model = model();
        let told = f64::from(model.mass) / 65_536.0;
        let learnt = moved(&model, 90.0, 1.0, 0.0).expect("learnt");
        assert!((learnt / (12.0 * told) - 1.0).abs() < 1e-3, "{learnt}");
    }

    /// A mass of a fifteenth of the specified one is ignored in the first move that yields it, and bounded in the
    /// second. After a plausible mass in between, doubt starts again. A move too short to determine a mass changes
    /// nothing.
    #[test]
    fn a_mass_below_the_least_is_believed_when_it_is_told_again() {
        let model = model();
        let told = f64::from(model.mass) / 65_536.0;
        let mut estimator = MassEstimator::default();
        let mut next = |mass_kg: f64| moved_again(&mut estimator, &model, mass_kg, 1.0, 0.0);
        let is_least = |mass: Option<f64>| (mass.expect("told") / (0.6 * told) - 1.0).abs() < 1e-3;
        assert_eq!(next(0.1), None);
        assert!(is_least(next(0.1)), "told twice");
        assert_eq!(next(0.1), None, "a new doubt");
        assert!((next(told).expect("told") / told - 1.0).abs() < 0.03);
        assert_eq!(next(0.1), None, "after one that can be");
        for speed in [100, 300, 500, 300, 0] {
            assert!(
                estimator
                    .update(&model, speed << 16, 20_000, [0; 2])
                    .is_none()
            );
        }
        let again = moved_again(&mut estimator, &model, 0.1, 1.0, 0.0);
        assert!(is_least(again), "after one that told nothing");
    }

    /// A peak just fast and long enough determines a mass; one below does not.
    #[test]
    fn what_tells_nothing_is_left() {
        let model = model();
        let told = |speeds: &[i32]| {
            let mut estimator = doubting();
            let told = |speed: &i32| estimator.update(&model, *speed << 16, 20_000, [0; 2]);
            speeds.iter().filter_map(told).count()
        };
        let triangle = |peak: i32, periods: i32| -> Vec<i32> {
            let half = periods / 2;
            (0..=half)
                .chain((0..half).rev())
                .map(|k| peak * k / half)
                .collect()
        };
        assert_eq!(told(&vec![300; 300]), 0, "at one speed for ever");
        assert_eq!(told(&[100, 300, 500, 300, 0]), 0, "too short");
        assert_eq!((told(&triangle(190, 60)), told(&triangle(215, 60))), (0, 1));
        assert_eq!((told(&triangle(400, 18)), told(&triangle(400, 26))), (0, 1));
        // A move that begins at speed has less above the line from start to end: 100 mm/s are enough.
        let mut enough = [0; 2];
        for first in 21..290 {
            let rise: Vec<i32> = (first..300).step_by(4).collect();
            let peak = rise.len() as i32;
            let fall = (0..=300).rev().step_by(8).take_while(|speed| *speed > 12);
            let speeds: Vec<i32> = rise.into_iter().chain(fall).collect();
            let (last, periods) = (speeds[speeds.len() - 1], speeds.len() as i32 - 1);
            let above = 300 - first - (last - first) * peak / periods;
            if (above - 100).abs() > 3 {
                let is_enough = above > 100;
                assert_eq!(told(&speeds) == 1, is_enough, "{first}: {above}");
                enough[usize::from(is_enough)] += i32::from((above - 100).abs() < 20);
            }
        }
        assert!(
            enough.iter().all(|cases| *cases > 6),
            "on both sides: {enough:?}"
        );
    }

    /// A piston still sliding a second after the start is evaluated up to there.
    #[test]
    fn a_move_without_end_is_judged_after_a_second() {
        let model = model();
        let mut estimator = MassEstimator::default();
        let mut speeds = (21..=400).step_by(8).chain((100..400).rev());
        let period = speeds.position(|speed: i32| {
            estimator
                .update(&model, speed << 16, 20_000, [0; 2])
                .is_some()
        });
        // The first period only starts the move; 250 periods of 4 ms follow.
        assert_eq!(period, Some(250));
    }

    /// The limit between sliding and not sliding lies between 19 and 21 mm/s.
    #[test]
    fn a_move_begins_and_ends_with_sliding() {
        let model = model();
        let begun = |speed_mm_s: i32| {
            let mut estimator = MassEstimator::default();
            estimator.update(&model, speed_mm_s << 16, 0, [0; 2]);
            estimator != MassEstimator::default()
        };
        assert_eq!((begun(19), begun(21), begun(-21)), (false, true, true));
    }
}
