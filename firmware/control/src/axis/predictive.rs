//! The predictive law: paper's idea, positions made of forces made of air.
//!
//! ```text
//! stroke, speed, pressures ── dead time ahead ──► x, v, pA, pB there
//! e = reference − x            v* = v_r + min(slope e, √(2 brake (|e| − …)), top)
//! a* = dv*/dt + damping (v* − v)
//! F* = m a* + friction(v*) − load + what it takes to unstick
//! pA*, pB* : their force is F*, about the mean pressure
//! opening of each valve: the pressure it lacks / the rate at which it changes
//! ```
//!
//! * **Dead time.** A pulse begun now acts a tick, t_on and the wave's way later.
//!   Everything is decided for that moment: the motion is extrapolated, and air
//!   that pulses under way will still bring is counted in.
//! * **Braking** follows a parabola in e, so that one law serves 1 and 400 mm; the
//!   deceleration is what the force left beside the load allows.
//! * **Friction** is fed forward in the direction of v*; a piston that stands
//!   outside the band is pushed with a growing force until it slips.
//! * **Rest.** Inside the band and slow, all valves shut, and stay shut until the
//!   error has left three bands. A piston is also let to rest when friction alone
//!   will stop it in the band. What does not come to rest near its target for
//!   long may do so in a wider band, up to three times and 0.4 mm; and each time it
//!   enters that band the law waits with the valves shut, to see where it comes to
//!   rest, before it acts again: no limit cycle lasts.
//! * **Announced moves.** With a move announced, the force is brought to the edge
//!   of slipping in its direction: the counter chamber vents and the drive
//!   chamber fills ahead of time, and the piston stands.
//! * **Pressure swap.** A chamber vents no faster than its valve lets it. In an
//!   announced move, and in one from an end stop, the other chamber makes up for what
//!   it still has too much, and gives way as it falls: the force is there as soon as
//!   either chamber can make it.

mod force;
mod pressures;
mod rest;

use super::air::Air;
use super::gas::Pressures;
use super::learn::Learner;
use super::model::AxisModel;
use super::motion::{Inertia, Motion};
use super::within;
use crate::joint::JointInput;
use crate::pwm::OnTimes;
use core::hash::{Hash, Hasher};
use force::{Ahead, Push, Wish};
use pressures::{made_up, targets};
use rest::{Approach, Rest};
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

/// Slower than this, raw mm/s, the piston stands (3 mm/s).
const STILL: i32 = 3 << 16;

/// What the law gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drive {
    /// On-times of the next tick, µs.
    pub on: OnTimes,
    /// At rest at the reference.
    pub settled: bool,
    /// The force asked for is beyond what the supply can give.
    pub limited: bool,
    /// Force asked for, mN.
    pub force: i32,
}

/// State of the law. It keeps no coefficients: every call is given those of the
/// axis, which must be the same from call to call.
#[derive(Clone, Debug)]
pub struct Predictive {
    inertia: Inertia,
    air: Air,
    motion: Motion,
    learner: Learner,
    push: Push,
    rest: Rest,
    /// Where the piston stood when the next move was announced.
    awaits: Option<i32>,
    /// The drive chamber makes up for what the counter chamber still has too much,
    /// in a move that extends (true) or retracts.
    makes_up: Option<bool>,
    primed: bool,
}

impl Hash for Predictive {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here. Flags share a
        // word, each in its own bits.
        let Self {
            // Sealed apart: see `kept_is_sound`.
            inertia: _,
            air,
            motion,
            learner,
            push,
            rest,
            awaits,
            makes_up,
            primed,
        } = self;
        (air, motion, learner, push, rest).hash(state);
        let flags = u32::from(*primed)
            | u32::from(awaits.is_some()).wrapping_shl(1)
            | u32::from(makes_up.is_some()).wrapping_shl(2)
            | u32::from(*makes_up == Some(true)).wrapping_shl(3);
        state.write_u32(flags);
        state.write_i32(awaits.unwrap_or_default());
    }
}

impl Predictive {
    /// At rest, both chambers at the atmosphere.
    #[must_use]
    pub fn new(model: &AxisModel) -> Self {
        Self {
            inertia: Inertia::new(model, model.mass),
            air: Air::new(model.ambient),
            motion: Motion::default(),
            learner: Learner::new(),
            push: Push::default(),
            rest: Rest::default(),
            awaits: None,
            makes_up: None,
            primed: false,
        }
    }

    /// Whether what follows from the mass, which the `Hash` leaves out, is as it was
    /// worked out.
    #[inline]
    #[must_use]
    pub fn kept_is_sound(&self) -> bool {
        self.inertia.is_sound()
    }

    /// Estimated motion and load.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Estimated pressures.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        self.air.pressures()
    }

    /// Mass in use, kg × 2^16: as told, or learnt.
    #[must_use]
    pub const fn mass(&self) -> i32 {
        self.inertia.mass
    }

    /// At rest at its reference.
    #[must_use]
    pub const fn is_settled(&self) -> bool {
        self.rest.is_settled()
    }

    /// Follows valves, chambers and piston through a tick in which `sent` were the
    /// on-times last given out, whoever chose them. To be called once per
    /// tick, before [`Predictive::drive`] if that is called at all.
    #[inline]
    pub fn follow(
        &mut self,
        model: &AxisModel,
        measured: PositionMm,
        sent: &OnTimes,
    ) -> VelocityMmS {
        if !self.primed {
            self.primed = true;
            self.motion.stroke = measured.raw();
            self.rest.release(measured.raw());
        }
        let (stroke, speed) = (self.motion.stroke, self.motion.speed);
        self.air.follow(model, stroke, speed, sent);
        let force = model.pressure_force(self.air.pressures());
        self.motion
            .update(model, &self.inertia, force, measured.raw());
        self.learner.sample(model, self.motion.speed, force);
        VelocityMmS::from_raw(self.motion.speed)
    }

    /// The force asked for as a share of what the supply can give, in steps of 2^-14.
    #[inline]
    #[must_use]
    pub fn duty(model: &AxisModel, drive: &Drive) -> Duty {
        let most = if drive.force > 0 {
            model.force_out
        } else {
            model.force_in
        };
        let most = most.max(1 << 8);
        // Below 2^31: forces are below 2^25 mN.
        let share = within(drive.force, most)
            .wrapping_shl(6)
            .checked_div(most.wrapping_shr(8))
            .unwrap_or(0);
        Duty::from_raw(within(share, 1 << 14).wrapping_shl(16))
    }

    /// Forgets the rest state: the joint does not track.
    #[inline]
    pub fn release(&mut self) {
        self.rest.release(self.motion.stroke);
        self.push = Push::default();
    }

    /// On-times for the next tick.
    #[inline]
    pub fn drive(&mut self, model: &AxisModel, input: &JointInput) -> Drive {
        let reference = input.reference.raw();
        let reference_speed = input.reference_velocity.raw();
        if self.rest.aim(model, reference) {
            self.push = Push::default();
        }
        let quiet = self.rest.quiet(
            model,
            &Approach {
                reference,
                reference_speed,
                measured: input.measured.raw(),
                motion: &self.motion,
                force: model.pressure_force(self.air.pressures()),
                mass: self.inertia.mass,
            },
        );
        let stands = quiet || self.motion.speed.wrapping_abs() < STILL;
        let mut to = reference;
        let mut awaited = None;
        if let Some(announced) = input.announced {
            let next = announced.reference.raw();
            if stands {
                awaited = self.preload(model, next);
            }
            if awaited.is_some() {
                to = next;
            }
        } else {
            self.awaits = None;
        }
        if awaited.is_some() || (stands && self.motion.at_stop(model)) {
            self.makes_up = Some(to > self.motion.stroke);
        }
        if self.motion.speed.wrapping_abs() < STILL
            && let Some(mass) = self.learner.take()
        {
            self.inertia = Inertia::new(model, mass);
        }
        if awaited.is_none() && quiet {
            return Drive {
                on: self.air.shut(model),
                settled: self.rest.is_settled(),
                limited: false,
                force: 0,
            };
        }
        let mut ahead = Ahead::new(model, &self.motion);
        let expected = self.air.ahead(model, ahead.stroke, ahead.mean);
        ahead.correct(model, &self.inertia, &self.motion, expected);
        let force = awaited.unwrap_or_else(|| {
            let wish = Wish {
                reference,
                reference_speed,
                motion: &self.motion,
                ahead,
                inertia: &self.inertia,
            };
            let rest = &self.rest;
            wish.force(model, &mut self.push, |grip| rest.faded(grip))
        });
        let possible = force
            .max(model.force_in.wrapping_neg())
            .min(model.force_out);
        let target = self.target(model, possible, expected);
        Drive {
            on: self.air.pulses(model, expected, target),
            settled: false,
            limited: possible != force,
            force,
        }
    }

    /// The force with which an announced move to `next` is awaited; `None` if
    /// the piston has begun to move, or the move is none.
    fn preload(&mut self, model: &AxisModel, next: i32) -> Option<i32> {
        let stroke = self.motion.stroke;
        let place = *self.awaits.get_or_insert(stroke);
        let distance = next.saturating_sub(place);
        let gone = stroke.saturating_sub(place).saturating_abs();
        let band = model.band;
        if distance.saturating_abs() <= band || gone > band.saturating_mul(2) {
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

    /// Chamber pressures for a force that the supply can give, where `expected` will be.
    #[inline]
    fn target(&mut self, model: &AxisModel, force: i32, expected: Pressures) -> Pressures {
        let target = targets(model, force);
        let Some(extends) = self.makes_up else {
            return target;
        };
        made_up(model, force, target, expected, extends).unwrap_or_else(|| {
            self.makes_up = None;
            target
        })
    }
}
