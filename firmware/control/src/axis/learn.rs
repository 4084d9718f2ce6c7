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
use core::hash::{Hash, Hasher};

/// A move is looked at for so many ticks at most.
const TICKS_MAX: u16 = 1000;
/// Ticks without which there is no result.
const TICKS_MIN: u16 = 80;
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
    /// Ticks since the first.
    ticks: u16,
    /// Raw mm/s.
    speed: i32,
    /// Impulse since the first, 16 mN × ticks.
    impulse: i32,
}

/// The move under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Learner {
    /// Speed at the first moment, raw mm/s; 0 before it.
    first: i32,
    fastest: Moment,
    last: Moment,
    /// Mass of the last move, kg × 2^16, until it is taken; 0 if none.
    mass: i32,
}

impl Hash for Learner {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here. Without a first
        // moment nothing of it is read.
        let Self {
            first,
            fastest,
            last,
            mass,
        } = self;
        state.write_i32(*mass);
        state.write_i32(*first);
        if *first != 0 {
            state.write_u32(u32::from(fastest.ticks) | u32::from(last.ticks).wrapping_shl(16));
            state.write_i32(fastest.speed);
            state.write_i32(fastest.impulse);
            state.write_i32(last.speed);
            state.write_i32(last.impulse);
        }
    }
}

impl Learner {
    /// Nothing seen.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A mass that was learnt and not yet taken, kg × 2^16.
    #[inline]
    pub fn take(&mut self) -> Option<i32> {
        let mass = core::mem::take(&mut self.mass);
        (mass > 0).then_some(mass)
    }

    /// One tick at `speed` (raw mm/s) with pressure force `force`, mN.
    #[inline]
    pub fn sample(&mut self, model: &AxisModel, speed: i32, force: i32) {
        let sliding = speed.wrapping_abs() > SLIDES;
        if self.first == 0 {
            if sliding {
                *self = Self {
                    first: speed,
                    mass: self.mass,
                    ..Self::default()
                };
            }
            return;
        }
        let used = force.saturating_sub(part(speed, model.viscous, 24));
        // Forces below 2^24 mN (100 mm of bore at 2.1 MPa) in 16 mN, of up to 2^10 ticks.
        let impulse = self.last.impulse.wrapping_add(used.wrapping_shr(4));
        self.last = Moment {
            ticks: self.last.ticks.wrapping_add(1),
            speed,
            impulse,
        };
        if speed.wrapping_abs() > self.fastest.speed.wrapping_abs() {
            self.fastest = self.last;
        }
        if !sliding || (speed ^ self.first) < 0 || self.last.ticks >= TICKS_MAX {
            self.finish(model);
        }
    }

    /// The move has ended: solves for the mass.
    // Seldom: small rather than fast.
    #[cold]
    #[inline(never)]
    fn finish(&mut self, model: &AxisModel) {
        let Self {
            first,
            fastest,
            last,
            ..
        } = *self;
        self.first = 0;
        if last.ticks < TICKS_MIN || fastest.speed.wrapping_abs() < FAST {
            return;
        }
        // At least the least number of ticks: no division by nothing.
        let share = u32::from(fastest.ticks)
            .wrapping_shl(16)
            .checked_div(u32::from(last.ticks))
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
        if speed < ABOVE {
            return;
        }
        // 16 mN × s × 2^32 over mm/s × 2^16.
        let impulse = i64::from(impulse.max(0)).wrapping_mul(i64::from(model.tick));
        let impulse = impulse.wrapping_shr(8).cast_unsigned();
        let mass = quotient(impulse, speed.cast_unsigned(), 12);
        let told = model.mass;
        self.mass = mass
            .max(scaled(told, LEAST, 16))
            .min(told.saturating_mul(MOST));
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
        let mut learner = Learner::new();
        let mut speed = 0.0_f64;
        for tick in 0..300 {
            // mm/s a tick.
            let acceleration = if tick < 120 { 3.0 } else { -2.6 };
            let viscous = speed * f64::from(model.viscous) / 256e3;
            let force = acceleration * mass_kg + 10.0 + viscous;
            let force = (sign * force - load) * 1e3;
            assert_eq!(learner.mass, 0, "not before the end");
            learner.sample(model, (sign * speed * 65_536.0) as i32, force as i32);
            if tick > 120 && learner.first == 0 {
                break;
            }
            speed = f64::max(speed + acceleration, 0.0);
        }
        let learnt = learner.take().map(|mass| f64::from(mass) / 65_536.0);
        assert_eq!(learner.take(), None, "taken once");
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
        let steady = vec![300; 1100];
        let short = vec![100, 300, 500, 300, 0];
        let slow: Vec<_> = (0..=150).chain((0..150).rev()).collect();
        for speeds in [steady, short, slow] {
            let mut learner = Learner::new();
            for speed in speeds {
                learner.sample(&model, speed << 16, 20_000);
            }
            assert_eq!(learner.take(), None);
        }
    }

    #[test]
    fn a_mass_waits_through_the_next_short_slide() {
        let model = model();
        let mut learner = Learner {
            mass: 3 << 16,
            ..Learner::new()
        };
        for speed in [30, 40, 0] {
            learner.sample(&model, speed << 16, 0);
        }
        assert_eq!(learner.take(), Some(3 << 16));
    }
}
