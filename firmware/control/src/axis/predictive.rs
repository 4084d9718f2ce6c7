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
//! * **Dead time.** A pulse begun now acts t_on and the wave's way later.
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
//!
//! Valves that take milliseconds need no new decision in every one: the law is worked out once
//! in a period of four ticks, a quarter of it in each ([`Stroke`]), and plans the pulses of the
//! next period to the microsecond. What a stroke leaves to the next is sealed by it, and looked
//! at before the next uses it ([`Predictive::kept_is_sound`]).

mod force;
mod pressures;
mod rest;

use super::air::Air;
use super::gas::Pressures;
use super::learn::Learner;
use super::model::AxisModel;
use super::motion::{Inertia, Motion};
use super::{mix, within};
use crate::joint::{Announced, JointInput};
use crate::pwm::OnTimes;
use core::hash::{Hash, Hasher};
use force::{Ahead, Push, Wish};
use pressures::{made_up, targets};
use rest::{Approach, Rest};
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

/// Slower than this, raw mm/s, the piston stands (3 mm/s).
const STILL: i32 = 3 << 16;

/// What the law gives in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drive {
    /// On-times of the next tick, µs.
    pub on: OnTimes,
    /// Speed, raw mm/s.
    pub velocity: VelocityMmS,
    /// Force asked for as a share of what the supply can give, in steps of 2^-14.
    pub duty: Duty,
    /// At rest at the reference.
    pub settled: bool,
    /// The force asked for is beyond what the supply can give.
    pub limited: bool,
}

/// The quarters of the law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
enum Stroke {
    /// The planned pulses begin: what the chambers see of them, and the flows.
    #[default]
    Valves,
    /// Pressures and motion up to the moment, pressures at the end of the dead time.
    Air,
    /// The motion is corrected by the strokes of this and the last tick; rest.
    Motion,
    /// Force, target pressures, pulses of the next period.
    Pulses,
}

/// State of the law. It keeps no coefficients: every call is given those of the
/// axis, which must be the same from call to call.
#[derive(Clone, Debug)]
pub struct Predictive {
    inertia: Inertia,
    air: Air,
    motion: Motion,
    /// Pressure force at the moment, mN.
    force: i32,
    /// Pressures at the end of the dead time.
    expected: Pressures,
    learner: Learner,
    push: Push,
    rest: Rest,
    /// Where the piston stood when the next move was announced.
    awaits: Option<i32>,
    /// The drive chamber makes up for what the counter chamber still has too much,
    /// in a move that extends (true) or retracts.
    makes_up: Option<bool>,
    /// The force with which an announced move is awaited.
    awaited: Option<i32>,
    /// The valves are to stay shut.
    quiet: bool,
    /// Sum of what strokes leave to each other: air, motion, and what decides.
    air_check: u32,
    motion_check: u32,
    decision_check: u32,

    // What every tick uses, in the `Hash`.
    /// The stroke to come.
    stroke: Stroke,
    /// Stroke of the last tick, raw mm.
    measured: i32,
    /// What is left of the plan, µs.
    left: OnTimes,
    duty: Duty,
    limited: bool,
    primed: bool,
    /// The pulses under way are the law's plan; otherwise somebody else's.
    planned: bool,
}

impl Hash for Predictive {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here. Flags share a
        // word, each in its own bits.
        let Self {
            // Sealed apart: see `kept_is_sound`.
            inertia: _,
            air: _,
            motion: _,
            force: _,
            expected: _,
            learner: _,
            push: _,
            rest: _,
            awaits: _,
            makes_up: _,
            awaited: _,
            quiet: _,
            air_check: _,
            motion_check: _,
            decision_check: _,
            stroke,
            measured,
            left: [fill_a, vent_a, fill_b, vent_b],
            duty,
            limited,
            primed,
            planned,
        } = self;
        let flags = u32::from(*stroke as u8)
            | u32::from(*limited).wrapping_shl(8)
            | u32::from(*primed).wrapping_shl(9)
            | u32::from(*planned).wrapping_shl(10);
        state.write_u32(flags);
        state.write_i32(*measured);
        state.write_i32(duty.raw());
        state.write_u32(u32::from(*fill_a) | u32::from(*vent_a).wrapping_shl(16));
        state.write_u32(u32::from(*fill_b) | u32::from(*vent_b).wrapping_shl(16));
    }
}

impl Predictive {
    /// At rest, both chambers at the atmosphere.
    #[must_use]
    pub fn new(model: &AxisModel) -> Self {
        let mut law = Self {
            inertia: Inertia::new(model, model.mass),
            air: Air::new(model.ambient),
            motion: Motion::default(),
            force: 0,
            expected: Pressures::default(),
            learner: Learner::new(),
            push: Push::default(),
            rest: Rest::default(),
            awaits: None,
            makes_up: None,
            awaited: None,
            quiet: false,
            air_check: 0,
            motion_check: 0,
            decision_check: 0,
            stroke: Stroke::default(),
            measured: 0,
            left: [0; 4],
            duty: Duty::ZERO,
            limited: false,
            primed: false,
            planned: false,
        };
        law.force = model.pressure_force(law.air.pressures());
        law.seal_air();
        law.seal_motion();
        law.seal_decision();
        law
    }

    #[inline]
    fn sum_of_air(&self) -> u32 {
        let Pressures { a, b } = self.expected;
        mix(mix(self.air.sum(0), a), b)
    }

    #[inline]
    fn sum_of_motion(&self) -> u32 {
        mix(self.motion.sum(0), self.force)
    }

    #[inline]
    fn sum_of_decision(&self) -> u32 {
        let sum = self.learner.sum(0);
        let sum = self.rest.sum(self.push.sum(sum));
        let flags = u32::from(self.quiet)
            | u32::from(self.awaits.is_some()).wrapping_shl(1)
            | u32::from(self.makes_up.is_some()).wrapping_shl(2)
            | u32::from(self.makes_up == Some(true)).wrapping_shl(3)
            | u32::from(self.awaited.is_some()).wrapping_shl(4);
        let sum = mix(sum, flags.cast_signed());
        let sum = mix(sum, self.awaits.unwrap_or_default());
        mix(sum, self.awaited.unwrap_or_default())
    }

    #[inline]
    fn decision_is_sound(&self) -> bool {
        self.decision_check == self.sum_of_decision()
    }

    #[inline]
    fn seal_air(&mut self) {
        self.air_check = self.sum_of_air();
    }

    #[inline]
    fn seal_motion(&mut self) {
        self.motion_check = self.sum_of_motion();
    }

    #[inline]
    fn seal_decision(&mut self) {
        self.decision_check = self.sum_of_decision();
    }

    /// Whether what the stroke to come uses, and the `Hash` leaves out, is as it was left.
    #[inline]
    #[must_use]
    pub fn kept_is_sound(&self) -> bool {
        let air = || self.air_check == self.sum_of_air();
        let motion = || self.motion_check == self.sum_of_motion() && self.inertia.is_sound();
        match self.stroke {
            Stroke::Valves => self.air.pulses_are_sound() && air(),
            Stroke::Air => air() && motion(),
            Stroke::Motion => motion() && self.decision_is_sound(),
            Stroke::Pulses => {
                self.air.pulses_are_sound() && air() && motion() && self.decision_is_sound()
            }
        }
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

    /// A tick in which somebody else drives: `sent` are the on-times last given out. Follows
    /// valves, chambers and piston.
    pub fn observe(
        &mut self,
        model: &AxisModel,
        measured: PositionMm,
        sent: &OnTimes,
    ) -> VelocityMmS {
        let turn = self.stroke as i32;
        if self.planned && turn != 0 {
            self.air.cut(model, turn, sent);
        } else {
            self.air.energise(model, turn, sent);
        }
        self.planned = false;
        self.left = [0; 4];
        self.duty = Duty::ZERO;
        self.limited = false;
        // What was damaged before keeps its broken seal.
        let sound = self.decision_is_sound();
        self.follow(model, measured, sent);
        if self.stroke == Stroke::Motion {
            self.learner.sample(model, self.motion.speed, self.force);
        }
        self.rest.release(self.motion.stroke);
        self.push = Push::default();
        self.awaits = None;
        self.awaited = None;
        self.quiet = false;
        if sound {
            self.seal_decision();
        }
        self.next(measured);
        VelocityMmS::from_raw(self.motion.speed)
    }

    /// A tick of the law's own; on-times for the next tick. `sent` are those last given out.
    #[inline]
    pub fn drive(&mut self, model: &AxisModel, input: &JointInput, sent: &OnTimes) -> Drive {
        if !self.planned {
            self.air.energise(model, self.stroke as i32, sent);
        }
        self.follow(model, input.measured, sent);
        match self.stroke {
            Stroke::Valves | Stroke::Air => {}
            Stroke::Motion => self.decide(model, input),
            Stroke::Pulses => self.plan(model, input),
        }
        self.next(input.measured);
        Drive {
            on: self.due(model.times.tick as u16),
            velocity: VelocityMmS::from_raw(self.motion.speed),
            duty: self.duty,
            settled: self.rest.is_settled(),
            limited: self.limited,
        }
    }

    /// Valves, air and motion of this stroke.
    #[inline]
    fn follow(&mut self, model: &AxisModel, measured: PositionMm, sent: &OnTimes) {
        if !self.primed {
            self.primed = true;
            self.measured = measured.raw();
            self.motion.stroke = measured.raw();
            self.rest.release(measured.raw());
            self.seal_motion();
            self.seal_decision();
        }
        match self.stroke {
            Stroke::Valves => {
                if self.planned {
                    // Its first tick has been given out.
                    let mut plan = self.left;
                    for (plan, sent) in plan.iter_mut().zip(sent) {
                        *plan = plan.wrapping_add(*sent);
                    }
                    self.air.plan(model, &plan);
                }
                self.air.begin(model);
                self.seal_air();
            }
            Stroke::Air => {
                let before = self.force;
                self.air.follow(model, self.motion.stroke, self.motion.speed);
                self.force = model.pressure_force(self.air.pressures());
                let mean = before.saturating_add(self.force) >> 1;
                self.motion.predict(model, &self.inertia, mean);
                let ahead = Ahead::new(model, &self.motion);
                self.expected = self.air.ahead(model, ahead.stroke, ahead.mean);
                self.seal_air();
                self.seal_motion();
            }
            Stroke::Motion => {
                let mean = self.measured.saturating_add(measured.raw()) >> 1;
                self.motion.correct(model, &self.inertia, mean);
                self.seal_motion();
            }
            Stroke::Pulses => {}
        }
    }

    /// To the next stroke.
    #[inline]
    fn next(&mut self, measured: PositionMm) {
        self.measured = measured.raw();
        self.stroke = match self.stroke {
            Stroke::Valves => Stroke::Air,
            Stroke::Air => Stroke::Motion,
            Stroke::Motion => Stroke::Pulses,
            Stroke::Pulses => Stroke::Valves,
        };
    }

    /// Whether the piston may rest, what is awaited, and a mass that has been learnt.
    #[inline]
    fn decide(&mut self, model: &AxisModel, input: &JointInput) {
        let reference = input.reference.raw();
        if self.rest.aim(model, reference) {
            self.push = Push::default();
        }
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
        let still = self.motion.speed.wrapping_abs() < STILL;
        let stands = self.quiet || still;
        let mut to = reference;
        self.awaited = None;
        match input.announced {
            Some(Announced { reference: next, .. }) if stands => {
                self.awaited = self.preload(model, next.raw());
                if self.awaited.is_some() {
                    to = next.raw();
                }
            }
            Some(_) => {}
            None => self.awaits = None,
        }
        if self.awaited.is_some() || (stands && self.motion.at_stop(model)) {
            self.makes_up = Some(to > self.motion.stroke);
        }
        self.learner.sample(model, self.motion.speed, self.force);
        if still && let Some(mass) = self.learner.take() {
            self.inertia = Inertia::new(model, mass);
        }
        self.seal_decision();
    }

    /// The pulses of the next period.
    #[inline]
    fn plan(&mut self, model: &AxisModel, input: &JointInput) {
        self.planned = true;
        if self.awaited.is_none() && self.quiet {
            self.left = self.air.shut(model);
            self.limited = false;
            self.duty = Duty::ZERO;
            return;
        }
        let force = self.awaited.unwrap_or_else(|| {
            let mut ahead = Ahead::new(model, &self.motion);
            ahead.correct(model, &self.inertia, &self.motion, self.force, self.expected);
            let wish = Wish {
                reference: input.reference.raw(),
                reference_speed: input.reference_velocity.raw(),
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
        let expected = self.expected;
        let target = self.target(model, possible, expected);
        self.left = self.air.pulses(model, expected, target);
        self.limited = possible != force;
        self.duty = Self::duty(model, force);
        self.seal_decision();
    }

    /// On-times of the next tick by the plan.
    #[inline]
    fn due(&mut self, tick: u16) -> OnTimes {
        let mut on = [0; 4];
        for (on, left) in on.iter_mut().zip(&mut self.left) {
            *on = (*left).min(tick);
            *left = left.wrapping_sub(*on);
        }
        on
    }

    /// A force as a share of what the supply can give, in steps of 2^-14.
    #[inline]
    fn duty(model: &AxisModel, force: i32) -> Duty {
        let most = if force > 0 {
            model.force_out
        } else {
            model.force_in
        };
        let most = most.max(1 << 8);
        // Below 2^31: forces are below 2^25 mN.
        let share = within(force, most)
            .wrapping_shl(6)
            .checked_div(most.wrapping_shr(8))
            .unwrap_or(0);
        Duty::from_raw(within(share, 1 << 14).wrapping_shl(16))
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
