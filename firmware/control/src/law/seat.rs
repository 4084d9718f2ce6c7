//! The seat at an end stop: where the target is a stop, force control replaces position control.
//!
//! ```text
//! seat: the target rests within 0.5 mm of the stop or behind it, the piston is within 3 mm of it and at most 60 mm/s fast
//! F*  = ±min(3 Fb, F_in)                 toward the stop; Fb: break-away friction, F_in: largest retracting force, mN
//! rest: within 1.5 mm of the target, |v| < 3 mm/s, and F expected > ¾ F* towards the stop
//! ```
//!
//! A cushion, a load or the compliance of the stop holds a piston some tenths of a millimetre from a target at the very
//! end of the stroke. That is outside every rest band of a position law, which then pulses for ever. Pressed against
//! its stop, the piston may rest. Its chambers then make three break-away forces beyond balance, by `allocation` as
//! everywhere: only where F_in limits them is one full or the other empty. The observer follows the air from the
//! pulses; it is not told that this is a stop. An axis without precharge has no seat: with its air a start
//! without notice would come 20 ms later (`docs/decisions/0042-robot-on-the-predictive-law.md`).
//!
//! A piston that rests here is pressed again only once it is 1.5 mm off its target; what has become of its force does
//! not matter. **The seat ends** as soon as its condition above no longer holds: a target 0.5 mm or more before the
//! stop, a reference faster than 1 mm/s, a piston 3 mm off or faster than 60 mm/s. A new target as near to the stop as
//! the old one ends nothing. A preload has priority over the seat. After PRESS the standstill logic continues as from
//! SERVO; after REST, by the rules of REST (`standstill`). A target more than 1.5 mm beyond the stop is pressed at for
//! ever.
//!
//! Source: force control against a stiff environment instead of position control (the switch of hybrid control, Raibert
//! and Craig 1981).
//!
//! Assumes: a specified stroke length that is right to 0.5 mm; supply as specified, break-away friction as in use;
//! chambers filled by a precharge, so that the expected force is right to a quarter. If the supply falls, the expected
//! force is overestimated, and the piston rests pressed by less than 3 Fb.
//!
//! Config [`AxisModel`]; no state of its own: PRESS and REST are those of `standstill`. Update [`Predictive::seat`].

use super::Predictive;
use crate::axis::AxisModel;
use crate::joint::JointInput;
use crate::tuning::{
    REFERENCE_RESTS, SEAT_FORCE_BREAKAWAYS, SEAT_PRESSED_SHIFT, SEAT_SPEED, SEAT_TARGET, SEAT_ZONE,
    SEATED_WITHIN, STILL_SPEED,
};

/// A piston at an end stop that is its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seat {
    /// It is to be pressed against the stop with this force, mN.
    Press(i32),
    /// It is pressed against the stop and may rest.
    Seated,
}

impl Predictive {
    /// The seat at the reference; `None` if the reference is no end stop, or the piston is not there yet.
    pub(super) fn seat(&self, model: &AxisModel, input: &JointInput) -> Option<Seat> {
        let reference = input.reference.raw();
        let motion = &self.observer.motion;
        let stroke = motion.stroke;
        let speed = motion.speed.wrapping_abs();
        let reference_rests = input.reference_velocity.raw().wrapping_abs() <= REFERENCE_RESTS;
        if !model.precharged || !reference_rests || speed > SEAT_SPEED {
            return None;
        }
        let far = model.stroke;
        let out =
            reference > far.saturating_sub(SEAT_TARGET) && stroke > far.saturating_sub(SEAT_ZONE);
        if !out && (reference >= SEAT_TARGET || stroke >= SEAT_ZONE) {
            return None;
        }
        let force = model
            .breakaway
            .saturating_mul(SEAT_FORCE_BREAKAWAYS)
            .min(model.force_in);
        let pressed = model.pressure_force(self.observer.expected());
        let (wanted, pressed) = if out {
            (force, pressed)
        } else {
            (force.saturating_neg(), pressed.saturating_neg())
        };
        let is_there = reference.saturating_sub(stroke).saturating_abs() < SEATED_WITHIN;
        let is_pressed = pressed > force.saturating_sub(force >> SEAT_PRESSED_SHIFT);
        let is_seated = is_there && (self.is_settled() || (speed < STILL_SPEED && is_pressed));
        Some(if is_seated {
            Seat::Seated
        } else {
            Seat::Press(wanted)
        })
    }
}
