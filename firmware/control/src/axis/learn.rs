//! The moving mass, from one move.
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
//! is due to c; what the fastest has above that line is due to m, in J as in v.

use super::model::AxisModel;
use super::{part, quotient, scaled};

/// A move is looked at for so many periods at most.
const PERIODS_MAX: u16 = 250;
/// Periods without which there is no result.
const PERIODS_MIN: u16 = 20;
/// Sliding faster than this is looked at, raw mm/s (20 mm/s).
const SLIDES: i32 = 20 << 16;
/// A move must have been this fast at least, raw mm/s (200 mm/s), …
const FAST: i32 = 200 << 16;
/// … and this much faster than its line (100 mm/s).
const ABOVE: i32 = 100 << 16;
/// The mass may be this many times what was told: a payload adds to it …
const MOST: i32 = 12;
/// … and at least this share of it, × 2^16 (0.6): the rod and the carriage stay.
const LEAST: i32 = 39_322;

/// A moment of a move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Moment {
    /// Periods since the first.
    periods: u16,
    /// Raw mm/s.
    speed: i32,
    /// Impulse since the first, 16 mN × periods.
    impulse: i32,
}

/// The move under way. Its seal is kept up with each change: what was damaged before keeps a
/// broken one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Learner {
    /// Speed at the first moment, raw mm/s; 0 before it.
    first: i32,
    fastest: Moment,
    /// The last moment; its speed is noted when the move has ended.
    last: Moment,
    /// The move has ended: to be worked out, or to be forgotten.
    ended: bool,
    /// Mass of the last move, kg × 2^16, until it is taken; 0 if none.
    mass: i32,
    check: u32,
}

/// Weights in the seal, one for each word: odd, so that every flipped bit is seen, and small, so that
/// a change costs little.
const FIRST: u32 = 9;
const FASTEST_SPEED: u32 = 5;
const FASTEST_IMPULSE: u32 = 7;
const LAST_SPEED: u32 = 13;
const LAST_IMPULSE: u32 = 3;
const MASS: u32 = 11;
/// Places in the word of what is smaller than one: there the periods of the fastest moment are the
/// lowest bits, and the end is above all they count.
const LAST_PERIOD: u32 = 1 << 16;
const ENDED: u32 = 1 << 15;

/// `by` more of a word of this weight.
#[inline]
const fn more(weight: u32, by: i32) -> u32 {
    weight.wrapping_mul(by.cast_unsigned())
}

impl Learner {
    /// Nothing seen.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sum of it.
    #[inline]
    fn sum(&self) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            first,
            fastest,
            last,
            ended,
            mass,
            check: _,
        } = *self;
        u32::from(fastest.periods)
            .wrapping_add(LAST_PERIOD.wrapping_mul(u32::from(last.periods)))
            .wrapping_add(ENDED.wrapping_mul(u32::from(ended)))
            .wrapping_add(more(FIRST, first))
            .wrapping_add(more(FASTEST_SPEED, fastest.speed))
            .wrapping_add(more(FASTEST_IMPULSE, fastest.impulse))
            .wrapping_add(more(LAST_SPEED, last.speed))
            .wrapping_add(more(LAST_IMPULSE, last.impulse))
            .wrapping_add(more(MASS, mass))
    }

    /// Flips a bit, for tests of those who keep it.
    #[cfg(test)]
    pub(super) const fn damage(&mut self) {
        self.first ^= 1 << 20;
    }

    /// Whether all of it is as it was left.
    #[inline]
    #[must_use]
    pub(super) fn is_sound(&self) -> bool {
        self.check == self.sum()
    }

    /// Whether a move has ended, or a mass was learnt: [`Learner::news`] is to
    /// be called.
    #[inline]
    #[must_use]
    pub const fn has_news(&self) -> bool {
        self.ended || self.mass > 0
    }

    /// One of two steps from a move that has ended to its mass, kg × 2^16: the first works it
    /// out.
    #[inline]
    pub fn news(&mut self, model: &AxisModel) -> Option<i32> {
        if self.ended {
            self.finish(model);
            return None;
        }
        let mass = core::mem::take(&mut self.mass);
        self.check = self.check.wrapping_sub(more(MASS, mass));
        Some(mass)
    }

    /// One period that ends at `speed` (raw mm/s), with the pressure force `force` in it, mN.
    #[inline]
    pub fn sample(&mut self, model: &AxisModel, speed: i32, force: i32) {
        if self.ended {
            return;
        }
        let sliding = speed.wrapping_abs() > SLIDES;
        if self.first == 0 {
            if sliding {
                // All else is zero.
                self.first = speed;
                self.check = self.check.wrapping_add(more(FIRST, speed));
            }
            return;
        }
        let used = force.saturating_sub(part(speed, model.viscous, 24));
        // Forces below 2^24 mN (100 mm of bore at 2.1 MPa) in 16 mN, of up to 2^8 periods.
        let used = used.wrapping_shr(4);
        let mut check = self.check.wrapping_add(more(LAST_IMPULSE, used));
        let impulse = self.last.impulse.wrapping_add(used);
        let periods = self.last.periods.wrapping_add(1);
        check = check.wrapping_add(LAST_PERIOD);
        self.last.impulse = impulse;
        self.last.periods = periods;
        let fastest = self.fastest;
        if speed.wrapping_abs() > fastest.speed.wrapping_abs() {
            self.fastest = Moment {
                periods,
                speed,
                impulse,
            };
            let later = periods.wrapping_sub(fastest.periods);
            check = check
                .wrapping_add(u32::from(later))
                .wrapping_add(more(FASTEST_SPEED, speed.wrapping_sub(fastest.speed)))
                .wrapping_add(more(FASTEST_IMPULSE, impulse.wrapping_sub(fastest.impulse)));
        }
        if !sliding || (speed ^ self.first) < 0 || periods >= PERIODS_MAX {
            let other = speed.wrapping_sub(self.last.speed);
            check = check
                .wrapping_add(ENDED)
                .wrapping_add(more(LAST_SPEED, other));
            self.ended = true;
            self.last.speed = speed;
        }
        self.check = check;
    }

    /// Solves for the mass of the move that has ended.
    // Seldom: small rather than fast.
    #[cold]
    #[inline(never)]
    fn finish(&mut self, model: &AxisModel) {
        let mass = self.solved(model).unwrap_or(self.mass);
        let damage = self.check.wrapping_sub(self.sum());
        *self = Self {
            mass,
            ..Self::default()
        };
        self.check = self.sum().wrapping_add(damage);
    }

    /// The mass, if it can be told.
    #[inline]
    fn solved(&self, model: &AxisModel) -> Option<i32> {
        let Self {
            first,
            fastest,
            last,
            ..
        } = *self;
        // At least the least number of periods: no division by nothing.
        let share = u32::from(fastest.periods)
            .wrapping_shl(16)
            .checked_div(u32::from(last.periods))
            .unwrap_or(0) as i32;
        let line = |end: i32| part(end, share, 16);
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
        if last.periods < PERIODS_MIN || fastest.speed.wrapping_abs() < FAST || speed < ABOVE {
            return None;
        }
        // 16 mN × s × 2^32 over mm/s × 2^16.
        let impulse = i64::from(impulse.max(0)).wrapping_mul(i64::from(model.period));
        let impulse = impulse.wrapping_shr(8).cast_unsigned();
        let mass = quotient(impulse, speed.cast_unsigned(), 12);
        let told = model.mass;
        Some(
            mass.max(scaled(told, LEAST, 16))
                .min(told.saturating_mul(MOST)),
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

    /// The mass, worked out and taken.
    fn taken(learner: &mut Learner, model: &AxisModel) -> Option<i32> {
        if learner.ended {
            assert_eq!(learner.news(model), None, "it is worked out first");
        }
        learner.has_news().then(|| learner.news(model))?
    }

    /// A mass under a known force, with friction and a load: up to speed, and down again.
    fn moved(model: &AxisModel, mass_kg: f64, sign: f64, load: f64) -> Option<f64> {
        let mut learner = Learner::new();
        let mut speed = 0.0_f64;
        for period in 0..75 {
            // mm/s a period.
            let acceleration = if period < 30 { 12.0 } else { -10.4 };
            // The force of the period that ends at the speed.
            speed = f64::max(speed + acceleration, 0.0);
            let viscous = speed * f64::from(model.viscous) / 256e3;
            let force = acceleration * mass_kg / 4.0 + 10.0 + viscous;
            let force = (sign * force - load) * 1e3;
            assert_eq!(learner.mass, 0, "not before the end");
            learner.sample(model, (sign * speed * 65_536.0) as i32, force as i32);
            if learner.ended {
                break;
            }
        }
        let learnt = taken(&mut learner, model).map(|mass| f64::from(mass) / 65_536.0);
        assert!(!learner.has_news(), "taken once");
        learnt
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

    #[test]
    fn what_tells_nothing_is_left() {
        let model = model();
        // At one speed for ever; too short; too slow.
        let steady = vec![300; 300];
        let short = vec![100, 300, 500, 300, 0];
        let slow: Vec<_> = (0..=38).chain((0..38).rev()).map(|v| 4 * v).collect();
        for speeds in [steady, short, slow] {
            let mut learner = Learner::new();
            for speed in speeds {
                learner.sample(&model, speed << 16, 20_000);
            }
            assert_eq!(taken(&mut learner, &model), None);
        }
    }

    #[test]
    fn a_move_that_has_ended_waits_until_it_is_worked_out() {
        let model = model();
        let mut learner = Learner::new();
        for speed in (0..40).chain((0..40).rev()).chain(40..60) {
            learner.sample(&model, (8 * speed) << 16, speed * 1000);
        }
        assert!(learner.ended);
        let waiting = learner;
        learner.sample(&model, 500 << 16, 0);
        assert_eq!(learner, waiting);
        assert!(taken(&mut learner, &model).is_some_and(|mass| mass > 0));
    }

    #[test]
    fn a_mass_waits_through_the_next_short_slide() {
        let model = model();
        let mut learner = Learner::new();
        learner.mass = 3 << 16;
        learner.check = learner.sum();
        for speed in [30, 40, 0] {
            learner.sample(&model, speed << 16, 0);
        }
        assert_eq!(taken(&mut learner, &model), Some(3 << 16));
        assert!(learner.is_sound());
    }

    /// A move under way, with all that can be in it.
    fn under_way(model: &AxisModel) -> Learner {
        let mut learner = Learner::new();
        learner.mass = 3 << 16;
        learner.check = learner.sum();
        for speed in (3..60).chain((40..60).rev()) {
            learner.sample(model, (8 * speed) << 16, speed * 1000);
            assert!(learner.is_sound(), "{learner:?}");
        }
        assert!(learner.fastest.periods < learner.last.periods);
        learner
    }

    #[test]
    fn a_flipped_bit_is_seen_whatever_is_sampled_after_it() {
        let model = model();
        let some = under_way(&model);
        let seen = |flip: &dyn Fn(&mut Learner)| {
            let mut flipped = some;
            flip(&mut flipped);
            assert!(!flipped.is_sound(), "{flipped:?}");
            // To the end of the move, and the next one.
            for speed in (0..40).rev().chain(0..30) {
                flipped.sample(&model, (8 * speed) << 16, speed * 1000);
                assert!(!flipped.is_sound(), "{flipped:?}");
            }
        };
        for bit in 0..32 {
            seen(&|own| own.mass ^= 1 << bit);
            seen(&|own| own.first ^= 1 << bit);
            seen(&|own| own.fastest.speed ^= 1 << bit);
            seen(&|own| own.fastest.impulse ^= 1 << bit);
            seen(&|own| own.last.speed ^= 1 << bit);
            seen(&|own| own.last.impulse ^= 1 << bit);
            seen(&|own| own.check ^= 1 << bit);
        }
        for bit in 0..16 {
            seen(&|own| own.fastest.periods ^= 1 << bit);
            seen(&|own| own.last.periods ^= 1 << bit);
        }
        seen(&|own| own.ended ^= true);
    }
}
