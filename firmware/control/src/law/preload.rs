//! Preload: ahead of an announced move the force stands at the edge of slipping in its direction.
//!
//! ```text
//! F* = ½ Fc sgn(next − x₀) − load           the edge of slipping, in the direction of the move
//! acts  from |F* − F expected| > Fc/2 on, until it is ≤ Fc/8 and the counter chamber no longer lags
//! ```
//!
//! Fc: Coulomb friction, load: as in [`crate::observer::motion`], F expected: pressure force at the end of the dead
//! time, mN; x₀: stroke when the preload began, next: the announced one, mm. Source: this project (decision 38).
//!
//! The counter chamber vents and the drive chamber fills ahead of time, and the piston stands. This takes the
//! paper's 0.25 s of delay out of a known move (`docs/guide/delay.md`).
//!
//! **It begins** where a piston is in REST at its target and a move of more than one band is announced; also where one
//! stands within a millimetre of an end stop, with a target that rests more than a millimetre behind the stop or, if
//! patience is over, less than one before it. At first it does not act: more than Fc/2 must be missing, as later on.
//! With the net force N = F expected + load, |½ Fc sgn(next − x₀) − N| is missing. So where N is zero, or points along
//! the move and is not above Fc, no pulse is sent, and a full counter chamber stays full. An N that points the other
//! way is turned round.
//!
//! **It pauses** once the force is there, and the counter chamber no longer lags: the valves stay shut until the force
//! is more than half the friction off. A piston that rests is not kept at the edge by pulses. The force alone is not
//! enough: by the pressure swap two full chambers make it, too, and one of them would have to vent when the move
//! begins.
//!
//! **It ends** with the announcement, with a target more than one band from the old one (where that does not end REST,
//! a preload begins anew a period later), or with the rest; and while the piston is more than two bands from x₀. While it
//! lasts, `standstill` is not worked out: REST stays REST. Of an announcement that is not followed nothing is left but the
//! air.
//!
//! Assumes: at least half of the friction that is specified, so that the piston stands; that the observer's load and
//! pressures are right to the other half; the move as announced. If the supply falls, the drive chamber has less than
//! was estimated: the force is short of the edge, the piston stands, and the move begins later. The counter chamber
//! vents as before.
//!
//! Config [`AxisModel`], state [`Preload`], update [`Predictive::preload`].

use super::Predictive;
use super::allocation::{self, PressureSwap};
use crate::axis::AxisModel;
use crate::joint::JointInput;
use crate::tuning::{
    PRELOAD_AGAIN_SHIFT, PRELOAD_EDGE_SHIFT, PRELOAD_MOVED_BANDS, PRELOAD_THERE_SHIFT,
    REFERENCE_RESTS,
};

/// A move that is awaited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Preload {
    /// Where the piston stood when it was announced, raw mm; `None` without one.
    place: Option<i32>,
    /// Pulses are sent: more than half of the friction was missing, and the force is not there yet, or is made against a
    /// counter chamber that lags.
    pub(super) acts: bool,
}

/// What an announced move asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Awaited {
    /// A force, mN.
    Force(i32),
    /// No pulse: the force is there, or was near enough from the begin.
    Ready,
}

impl Predictive {
    /// What an announced move asks for, as it is awaited; `None` if there is none, or one of a band at most, and if the
    /// piston is on its way or has begun to move.
    pub(super) fn preload(
        &mut self,
        model: &AxisModel,
        input: &JointInput,
        stands: bool,
    ) -> Option<Awaited> {
        // A move is awaited where the last one ended, not in the midst of that; against a stop with the target
        // behind it, or where patience is over, the piston need not rest.
        let reference_rests = input.reference_velocity.raw().wrapping_abs() <= REFERENCE_RESTS;
        let motion = &self.observer.motion;
        let pressed = stands
            && !self.is_settled()
            && reference_rests
            && motion.at_end_stop(
                model,
                input.reference.raw(),
                self.standstill.patience_is_over(),
            );
        let next = input
            .announced
            .filter(|_| self.standstill.holds() || pressed);
        let Some(next) = next else {
            self.preload = Preload::default();
            return None;
        };
        let stroke = motion.stroke;
        let place = *self.preload.place.get_or_insert(stroke);
        let distance = next.reference.raw().saturating_sub(place);
        let gone = stroke.saturating_sub(place).saturating_abs();
        if distance.saturating_abs() <= model.band
            || gone > model.band.saturating_mul(PRELOAD_MOVED_BANDS)
        {
            return None;
        }
        let edge = model.coulomb.wrapping_shr(PRELOAD_EDGE_SHIFT);
        let edge = if distance > 0 {
            edge
        } else {
            edge.wrapping_neg()
        };
        let force = edge.saturating_sub(motion.load);
        let expected = self.observer.expected();
        let now = model.pressure_force(expected);
        let missing = force.saturating_sub(now).saturating_abs();
        self.preload.acts = if self.preload.acts {
            let possible = allocation::possible_force(model, force);
            let swap = PressureSwap::towards(next.reference.raw(), stroke);
            missing > model.coulomb >> PRELOAD_THERE_SHIFT || swap.lags(model, possible, expected)
        } else {
            missing > model.coulomb >> PRELOAD_AGAIN_SHIFT
        };
        Some(if self.preload.acts {
            Awaited::Force(force)
        } else {
            Awaited::Ready
        })
    }
}
