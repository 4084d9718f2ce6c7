//! Preload: ahead of an announced move the force is brought to the edge of slipping in its direction.
//!
//! ```text
//! F* = ½ Fc sgn(next − x₀) − load           the edge of slipping, in the direction of the move
//! acts  from |F* − F expected| > Fc/2 on, until it is ≤ Fc/8 and the counter chamber no longer lags
//! ```
//!
//! Fc: Coulomb friction, load: as in [`crate::observer::motion`], F expected: pressure force at the end of the dead
//! time, mN; x₀: stroke when the preload began, next: the announced target, mm. Source: this project (decision 38).
//!
//! The counter chamber vents and the drive chamber fills ahead of time while the piston stands. This takes the paper's
//! 0.25 s of delay out of a known move (`docs/guide/delay.md`).
//!
//! **It begins** when the piston is in REST at its target and a move of more than one band is announced. It also begins
//! when the piston stands within 1 mm of an end stop and its resting target is more than 1 mm beyond the stop or, once
//! patience is over, beyond it or less than 1 mm before it. At first it does not act: as later on, more than Fc/2 must
//! be missing. With the net force N = F expected + load, |½ Fc sgn(next − x₀) − N| is missing. So where N is zero, or
//! points along the move and is not above Fc, no pulse is sent, and a full counter chamber stays full. An N that points
//! the other way is reversed.
//!
//! **It pauses** once the force is reached and the counter chamber no longer lags: the valves stay shut until the force
//! is off by more than half the friction. A resting piston is not kept at the edge by pulses. The force alone is not
//! enough: with the pressure swap two full chambers make it, too, and one of them would have to vent when the move
//! begins.
//!
//! **It ends** when the announcement or the rest ends, or with a target more than one band from the old one (where that
//! does not end REST, a preload begins again a period later). It is suspended while the piston is more than two bands
//! from x₀. While it lasts, `standstill` is not updated: REST stays REST. An announcement that is not followed leaves
//! nothing behind but the air.
//!
//! Assumes: at least half of the friction in use, so that the piston stands; that the errors of the observer's load
//! and pressures are covered by the other half; the move as announced. If the supply falls, the drive chamber has less
//! pressure than estimated: the force falls short of the edge, the piston stands, and the move begins later. The
//! counter chamber vents as before.
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

/// An awaited move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Preload {
    /// Stroke when the preload began, raw mm; `None` without one.
    place: Option<i32>,
    /// Pulses are sent: more than half of the friction was missing, and either the force is not yet reached, or the
    /// counter chamber still lags.
    pub(super) acts: bool,
}

/// What an announced move demands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Awaited {
    /// A force, mN.
    Force(i32),
    /// No pulse: the force is reached, or was near enough from the start.
    Ready,
}

impl Predictive {
    /// What an announced move demands while it is awaited. `None` without an announcement, for a move of at most one
    /// band, and if the piston is on its way or has begun to move.
    pub(super) fn preload(
        &mut self,
        model: &AxisModel,
        input: &JointInput,
        stands: bool,
    ) -> Option<Awaited> {
        // A move is awaited where the last one ended, not in the middle of it. The piston need not rest against a stop
        // with the target beyond it, or where patience is over.
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
