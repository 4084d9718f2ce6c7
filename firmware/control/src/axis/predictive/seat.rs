//! The seat at an end stop: where the target is a stop, a force instead of a position.
//!
//! ```text
//! F* = ±3 F_breakaway                    toward the stop
//! rest: |v| small, within 1.5 mm of the target, and F̂ ≥ ¾ F*
//! ```
//!
//! A cushion, a load or the give of the stop holds a piston some tenths of a millimetre beside a
//! target at the very end of the stroke: beyond every rest band of a position law, which then
//! pulses for ever. Pressed against its stop it may rest; and of its chambers one is then known to be
//! full, or the other to be empty. An axis without precharge has no seat: the air of it would make a
//! start without notice 20 ms later (`tests/system/delay.rs`). It is awake again by a new target, or 1.5 mm off its place.

use super::{Predictive, STILL};
use crate::axis::gas::Pressures;
use crate::axis::model::AxisModel;
use crate::axis::predictive::rest::REFERENCE_RESTS;
use crate::joint::JointInput;

/// A target so near a stop is the stop, raw mm (0.5 mm).
const TARGET: i32 = 1 << 15;
/// A piston so near it is being seated, raw mm (3 mm) …
const ZONE: i32 = 3 << 16;
/// … if it is slower than this, raw mm/s (60 mm/s).
const GENTLE: i32 = 60 << 16;
/// A seated piston is no further from its target than this, raw mm (1.5 mm).
const SEATED: i32 = 3 << 15;
/// Force of the seat over the break-away friction.
const FORCE: i32 = 3;

/// A piston at the end stop that is its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seat {
    /// To be pressed against it, mN.
    Press(i32),
    /// Pressed against it: it may rest.
    Seated,
}

impl Predictive {
    /// The seat at the reference; `None` if that is no end stop, or the piston is not there yet.
    pub(super) fn seat(&self, model: &AxisModel, input: &JointInput) -> Option<Seat> {
        let reference = input.reference.raw();
        let stroke = self.motion.stroke;
        let speed = self.motion.speed.wrapping_abs();
        if !model.precharged {
            return None;
        }
        if input.reference_velocity.raw().wrapping_abs() > REFERENCE_RESTS || speed > GENTLE {
            return None;
        }
        let far = model.stroke;
        let force = model.breakaway.saturating_mul(FORCE).min(model.force_in);
        let out = reference > far.saturating_sub(TARGET) && stroke > far.saturating_sub(ZONE);
        if !out && (reference >= TARGET || stroke >= ZONE) {
            return None;
        }
        let pressed = model.pressure_force(Pressures {
            a: self.a.expected,
            b: self.b.expected,
        });
        let (wanted, pressed) = if out {
            (force, pressed)
        } else {
            (force.saturating_neg(), pressed.saturating_neg())
        };
        let is_there = reference.saturating_sub(stroke).saturating_abs() < SEATED;
        let is_pressed = pressed > force.saturating_sub(force >> 2);
        let is_seated = is_there && (self.rest.is_settled() || (speed < STILL && is_pressed));
        Some(if is_seated {
            Seat::Seated
        } else {
            Seat::Press(wanted)
        })
    }
}
