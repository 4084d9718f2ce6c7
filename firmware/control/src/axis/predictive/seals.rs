//! What a stroke leaves to the next ones, sealed by it and looked at before it is used.

use super::{Predictive, Stroke};
use crate::axis::mix;
use core::hash::{Hash, Hasher};

impl Hash for Predictive {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            // Sealed apart: see `kept_is_sound`.
            a: _,
            b: _,
            course: _,
            course_check: _,
            motion: _,
            force: _,
            wanted: _,
            motion_check: _,
            inertia: _,
            push: _,
            push_check: _,
            learner: _,
            rest: _,
            awaits: _,
            makes_up: _,
            quiet: _,
            rest_check: _,
            turn,
            next,
            measured,
            plan: [fill_a, vent_a, fill_b, vent_b],
            // It shapes no output.
            duty: _,
        } = self;
        state.write_u32(turn.word());
        state.write_u32(*next);
        state.write_i32(*measured);
        state.write_u32(u32::from(*fill_a) | u32::from(*vent_a).wrapping_shl(16));
        state.write_u32(u32::from(*fill_b) | u32::from(*vent_b).wrapping_shl(16));
    }
}

impl Predictive {
    /// Seals what begins.
    #[cold]
    #[inline(never)]
    pub(super) fn seal(&mut self) {
        self.course_check = self.course.sum();
        self.motion_check = self.sum_of_motion();
        self.push_check = self.push.sum();
        self.rest_check = self.sum_of_rest();
    }

    #[inline]
    pub(super) fn sum_of_motion(&self) -> u32 {
        mix(mix(self.motion.sum(0), self.force), self.wanted)
    }

    #[inline]
    pub(super) fn sum_of_rest(&self) -> u32 {
        let Self {
            awaits,
            makes_up,
            quiet,
            ..
        } = *self;
        let flags = i32::from(quiet) | (makes_up as i32) << 8;
        mix(mix(self.rest.sum(0), awaits), flags)
    }

    /// Whether what the stroke to come works with, and the `Hash` leaves out, is as it was left.
    /// Speed and rest that every tick tells are those of the last look; the mass, by which the last
    /// stroke judges rest, is looked at by the stroke before it.
    #[inline]
    #[must_use]
    pub fn kept_is_sound(&self) -> bool {
        let Self { a, b, .. } = self;
        if matches!(self.turn.stroke, Stroke::A | Stroke::B) {
            let first = self.turn.stroke == Stroke::A;
            let chamber = if first { a } else { b };
            return chamber.pulses_are_sound()
                && chamber.pressures_are_sound()
                && self.course_check == self.course.sum()
                && (first || self.learner.is_sound());
        }
        let sound = a.pressures_are_sound()
            && b.pressures_are_sound()
            && self.motion_check == self.sum_of_motion()
            && self.rest_check == self.sum_of_rest();
        sound
            && if self.turn.stroke == Stroke::Motion {
                self.push_check == self.push.sum()
                    && self.inertia.is_sound()
                    && (!self.learner.has_news() || self.learner.is_sound())
            } else {
                a.means_are_sound() && b.means_are_sound()
            }
    }
}
