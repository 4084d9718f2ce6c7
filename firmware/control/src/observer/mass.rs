//! Mass estimator: the moving mass, from the impulse of one move.
//!
//! While the piston slides one way, friction and load are constant but for the
//! viscous part, and the impulse of the known forces is
//!
//! ```text
//! J(i) = Σ (F − d v) = m (v(i) − v₀)/T + c i          i: periods since the piston slides; T: period, s
//! m    = T (J − J line) / (v − v line)                at the fastest; line: from the first to the last instant
//! ```
//!
//! F: pressure force, mN; d: viscous friction, mN s/mm; v: speed, mm/s; m: mass, kg (× 2^16); c: Coulomb friction less
//! load, mN; J in mN · periods. Three instants of the move tell m from c: where it begins to slide, where it is
//! fastest, and where it ends. What lies on the straight line from the first to the last is due to c; what the fastest
//! has above that line is due to m, in J as in v. Source: Newton's second law, integrated; the derivation is this
//! project's.
//!
//! **A move** begins when |v| is above 20 mm/s. It ends when |v| is not any more, when v has changed its sign, or after
//! 1 s; a piston that is then still as fast begins another. Moves count whoever drives. It tells a mass if it took at least 80 ms, was 200 mm/s fast, and 100 mm/s above the line; otherwise nothing
//! changes.
//!
//! Where the bounds of the pressures are far apart in such a move (in the mean by more than a quarter of the largest
//! extending force), as after a power-up with air that nobody knows, the force is wrong by more than the mass needs: there the
//! mass comes with the pressures from [`super::identification`].
//!
//! **Doubt.** The peak above the line is a small difference of large impulses, and in a long move at nearly one speed a
//! viscous friction or a pressure that is a little off passes for a mass of a quarter of the true one. A mass below the
//! least that can be (0.6 of that specified: rod and carriage stay) is therefore ignored, with the pressures found
//! beside it, until the next move that tells a mass tells it, too; then that bound is taken. Believed at once, it makes
//! the next move overshoot. The most that is taken is 12 times that specified.
//!
//! **Cushion and end stop** are not known here, other than in [`super::motion`]. A move that ends in one has been
//! braked by an impulse that J lacks: so J line at the fastest is too high by a share of it, and the mass comes out too
//! small. The same bound and doubt are all that holds against it.
//!
//! Assumes: the load does not come or go in the move; axes for which it does switch it off
//! ([`crate::axis::AxisData::learns_mass`]). Viscous friction and supply as specified, within what doubt makes up for.
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
    /// Periods since the first.
    periods: u16,
    /// Raw mm/s.
    speed: i32,
    /// Impulse since the first, 16 mN × periods.
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
    /// The last move that told a mass told less than can be.
    doubted: bool,
}

impl MassEstimator {
    /// One period that ends at `speed` (raw mm/s), with the pressure force `force` in it and with the `widths` of the
    /// bounds of both pressures as forces, mN. Gives what a move that has ended with it tells, if it does.
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
            // Forces below 2^24 mN (100 mm of bore at 2.1 MPa) in 16 mN, of up to 2^8 periods.
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
        // Less than can be: that is doubted until the next move tells it, too.
        self.doubted = found.mass < least && !ended.doubted;
        if self.doubted {
            return None;
        }
        Some(Identified {
            mass: found.mass.max(least).min(most),
            ..found
        })
    }

    /// The mass by three instants, if it can be told.
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

    /// A mass under a known force, with friction and a load: up to speed, and down again.
    fn moved(model: &AxisModel, mass_kg: f64, sign: f64, load: f64) -> Option<f64> {
        moved_again(&mut MassEstimator::default(), model, mass_kg, sign, load)
    }

    /// The same, after moves before it.
    fn moved_again(
        estimator: &mut MassEstimator,
        model: &AxisModel,
        mass_kg: f64,
        sign: f64,
        load: f64,
    ) -> Option<f64> {
        let mut speed = 0.0_f64;
        for period in 0..75 {
            // mm/s a period.
            let acceleration = if period < 30 { 12.0 } else { -10.4 };
            // The force of the period that ends at the speed.
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

    /// One that believes whatever the next move tells: the last one told too little.
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

    /// With bounds that are a quarter of the largest force apart in the mean the air is identified, too; with less the three
    /// instants tell the mass, and the pressures are left.
    #[test]
    fn a_move_with_unknown_air_tells_its_mass_and_the_air() {
        let model = model();
        let found = |share: f64| {
            let mut estimator = doubting();
            let width = (share * f64::from(model.force_out)) as i32;
            let mut speed = 0.0_f64;
            (0..75).find_map(|period| {
                speed = f64::max(speed + if period < 30 { 12.0 } else { -10.4 }, 0.0);
                // The estimate of A is too low by half a width that closes.
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

    /// A mass of a fifteenth of that specified is ignored in the first move that tells it, and bounded in the second; with
    /// one between that can be, doubt begins anew. A move too short to tell a mass changes nothing.
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

    /// The peak that is just fast enough, and long enough, tells a mass; one below does not.
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
        // Begun at speed, it has less above the line from its begin to its end: 100 mm/s are enough.
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

    /// One that still slides a second after its begin is taken as far as it went.
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
        // The first only begins it: 250 periods of 4 ms after that.
        assert_eq!(period, Some(250));
    }

    /// What lies between 19 and 21 mm/s is the end of a slide.
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
