//! The last stroke: rest or target pressures, and the pulses of the next period.

use super::pressures::{made_up, targets};
use super::rest::{Approach, REFERENCE_RESTS};
use super::seat::Seat;
use super::{MakesUp, NOTHING, Predictive, STILL};
use crate::axis::gas::Pressures;
use crate::axis::model::AxisModel;
use crate::joint::{Announced, JointInput};
use wheeleg_units::Duty;

impl Predictive {
    /// The pulses of the next period. Those towards a reference that came in this very tick
    /// begin with the force of the last one.
    #[inline]
    pub(super) fn choose(&mut self, model: &AxisModel, input: &JointInput) {
        let reference = input.reference.raw();
        self.rest.aim(model, reference);
        let stands = self.rest.is_settled() || self.motion.speed.wrapping_abs() < STILL;
        let mut to = reference;
        let mut awaited = None;
        // Against a stop with the target behind it, or where patience is over, it need not rest.
        let leans = || {
            stands
                && !self.rest.is_settled()
                && input.reference_velocity.raw().wrapping_abs() <= REFERENCE_RESTS
                && self.motion.leans(model, reference, self.rest.lingers())
        };
        match input.announced {
            // A move is awaited where the last one ended, not in the midst of that.
            Some(Announced {
                reference: next, ..
            }) if self.rest.holds() || leans() => {
                awaited = self.preload(model, next.raw());
                if awaited.is_some() {
                    to = next.raw();
                }
            }
            _ => self.awaits = NOTHING,
        }
        let seat = match awaited {
            Some(_) => None,
            None => self.seat(model, input),
        };
        if seat == Some(Seat::Seated) {
            self.quiet = true;
            self.rest.settle();
        } else if seat.is_some() {
            self.quiet = false;
        } else if awaited.is_none() {
            self.quiet = self.rest.quiet(
                model,
                &Approach {
                    reference,
                    reference_speed: input.reference_velocity.raw(),
                    measured: input.measured.raw(),
                    motion: &self.motion,
                    force: self.force,
                    mass: self.inertia.mass,
                },
            );
        }
        if awaited.is_some() || (stands && self.motion.at_stop(model)) {
            self.makes_up = if to > self.motion.stroke {
                MakesUp::Extends
            } else {
                MakesUp::Retracts
            };
        }
        let force = match (awaited, seat) {
            (Some(force), _) | (None, Some(Seat::Press(force))) => force,
            (None, _) if self.quiet => {
                let ([fill_a, vent_a], [fill_b, vent_b]) = (self.a.shut(model), self.b.shut(model));
                self.plan = [fill_a, vent_a, fill_b, vent_b];
                self.turn.limited = false;
                self.duty = Duty::ZERO;
                self.rest_check = self.sum_of_rest();
                return;
            }
            (None, _) => self.wanted,
        };
        let possible = force
            .max(model.force_in.wrapping_neg())
            .min(model.force_out);
        let target = self.target(model, possible);
        let [fill_a, vent_a] = self.a.pulses(model, model.flow_a, target.a);
        let [fill_b, vent_b] = self.b.pulses(model, model.flow_b, target.b);
        self.plan = [fill_a, vent_a, fill_b, vent_b];
        if awaited.is_none()
            && self.rest.is_near()
            && fill_a | vent_a != 0
            && self.a.idle()
            && self.b.idle()
        {
            // Near the target a pulse of one chamber alone: two may be too much of valves that
            // cannot open for less.
            if fill_a.max(vent_a) > fill_b.max(vent_b) {
                self.plan = [fill_a, vent_a, 0, 0];
            } else if fill_b | vent_b != 0 {
                self.plan = [0, 0, fill_b, vent_b];
            }
        }
        self.turn.limited = possible != force;
        self.duty = model.duty(possible);
        self.rest_check = self.sum_of_rest();
    }

    /// The force with which an announced move to `next` is awaited; `None` if
    /// the piston has begun to move, or the move is none.
    pub(super) fn preload(&mut self, model: &AxisModel, next: i32) -> Option<i32> {
        let stroke = self.motion.stroke;
        if self.awaits == NOTHING {
            self.awaits = stroke;
        }
        let place = self.awaits;
        let distance = next.saturating_sub(place);
        let gone = stroke.saturating_sub(place).saturating_abs();
        let band = model.band;
        if distance.saturating_abs() <= band || gone > band.wrapping_shl(1) {
            return None;
        }
        let edge = model.coulomb.wrapping_shr(1);
        let edge = if distance > 0 {
            edge
        } else {
            edge.wrapping_neg()
        };
        Some(edge.saturating_sub(self.motion.load))
    }

    /// Chamber pressures for a force that the supply can give.
    #[inline]
    pub(super) fn target(&mut self, model: &AxisModel, force: i32) -> Pressures {
        let target = targets(model, force);
        let extends = match self.makes_up {
            MakesUp::No => return target,
            MakesUp::Extends => true,
            MakesUp::Retracts => false,
        };
        let expected = Pressures {
            a: self.a.expected,
            b: self.b.expected,
        };
        made_up(model, force, target, expected, extends).unwrap_or_else(|| {
            self.makes_up = MakesUp::No;
            target
        })
    }
}
