//! Mass estimator: the moving mass, from the impulse of one move.
//!
//! While the piston slides one way, friction and load are constant but for the
//! viscous part, and the impulse of the known forces is
//!
//! ```text
//! J(t) = ∫ (F − viscous) dt = m (v(t) − v₀) + c t
//! ```
//!
//! Three moments of the move tell m from c: where it begins to slide, where it is
//! fastest, and where it ends. What lies on the straight line from the first to the last
//! is due to c; what the fastest has above that line is due to m, in J as in v. (Newton's second law,
//! integrated; the derivation is ours.)
//!
//! Assumes: the load does not come or go in the move; axes for which it does switch it off
//! ([`crate::axis::AxisData::learns_mass`]).
//!
//! Config [`AxisModel`], state [`MassEstimator`], update [`MassEstimator::update`].

use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat, quotient};
use crate::tuning::{
    LEARN_PEAK_ABOVE, LEARN_PEAK_SPEED, LEARN_PERIODS_MAX, LEARN_PERIODS_MIN, LEARN_SLIDES,
    MASS_LEARNT_LEAST, MASS_LEARNT_MOST,
};

/// A moment of a move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct Moment {
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
    /// Speed at the first moment, raw mm/s; 0 before it.
    first: i32,
    fastest: Moment,
    last: Moment,
}

impl MassEstimator {
    /// One period that ends at `speed` (raw mm/s), with the pressure force `force` in it, mN. Gives
    /// the mass, kg × 2^16, of a move that has ended with it, if it tells one.
    pub fn update(&mut self, model: &AxisModel, speed: i32, force: i32) -> Option<i32> {
        let sliding = speed.wrapping_abs() > LEARN_SLIDES;
        if self.first == 0 {
            if sliding {
                self.first = speed;
            }
            return None;
        }
        let used = force.saturating_sub(mul_shr(speed, model.viscous, 24));
        self.last = Moment {
            periods: self.last.periods.wrapping_add(1),
            speed,
            // Forces below 2^24 mN (100 mm of bore at 2.1 MPa) in 16 mN, of up to 2^8 periods.
            impulse: self.last.impulse.wrapping_add(used.wrapping_shr(4)),
        };
        if speed.wrapping_abs() > self.fastest.speed.wrapping_abs() {
            self.fastest = self.last;
        }
        let turned = (speed ^ self.first) < 0;
        if sliding && !turned && self.last.periods < LEARN_PERIODS_MAX {
            return None;
        }
        core::mem::take(self).mass(model)
    }

    /// The mass, if it can be told.
    #[cold]
    fn mass(self, model: &AxisModel) -> Option<i32> {
        let Self {
            first,
            fastest,
            last,
        } = self;
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
        let mass = quotient(impulse, speed.cast_unsigned(), 12);
        let told = model.mass;
        Some(
            mass.max(mul_shr_sat(told, MASS_LEARNT_LEAST, 16))
                .min(told.saturating_mul(MASS_LEARNT_MOST)),
        )
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
        let mut estimator = MassEstimator::default();
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
            if let Some(mass) = estimator.update(model, raw, force as i32) {
                assert!(speed < 20.0, "not before the end");
                return Some(f64::from(mass) / 65_536.0);
            }
        }
        None
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

    #[test]
    fn what_cannot_be_is_bounded() {
        let model = model();
        let told = f64::from(model.mass) / 65_536.0;
        for (mass_kg, bound) in [(0.1, 0.6 * told), (90.0, 12.0 * told)] {
            let learnt = moved(&model, mass_kg, 1.0, 0.0).expect("learnt");
            assert!((learnt / bound - 1.0).abs() < 1e-3, "{learnt}");
        }
    }

    /// The peak that is just fast enough, and long enough, tells a mass; one below does not.
    #[test]
    fn what_tells_nothing_is_left() {
        let model = model();
        let told = |speeds: &[i32]| {
            let mut estimator = MassEstimator::default();
            let told = |speed: &i32| estimator.update(&model, *speed << 16, 20_000);
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
        // Begun in full speed, it has little above its line.
        let from = |first: i32| -> Vec<i32> {
            (first..=300)
                .step_by(4)
                .chain((0..=300).rev().step_by(8))
                .collect()
        };
        assert_eq!((told(&from(21)), told(&from(280))), (1, 0));
    }

    /// One that still slides a second after its begin is taken as far as it went.
    #[test]
    fn a_move_without_end_is_judged_after_a_second() {
        let model = model();
        let mut estimator = MassEstimator::default();
        let mut speeds = (21..=400).step_by(8).chain((100..400).rev());
        let period =
            speeds.position(|speed: i32| estimator.update(&model, speed << 16, 20_000).is_some());
        // The first only begins it: 250 periods of 4 ms after that.
        assert_eq!(period, Some(250));
    }

    /// What lies between 19 and 21 mm/s is the end of a slide.
    #[test]
    fn a_move_begins_and_ends_with_sliding() {
        let model = model();
        let begun = |speed_mm_s: i32| {
            let mut estimator = MassEstimator::default();
            estimator.update(&model, speed_mm_s << 16, 0);
            estimator != MassEstimator::default()
        };
        assert_eq!((begun(19), begun(21), begun(-21)), (false, true, true));
    }
}
