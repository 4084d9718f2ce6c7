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
//! * **Seat.** Position control against an end stop never rests: cushion and load hold the piston
//!   beside its target. At a target within [`seat::TARGET`] of a stop a force is controlled
//!   instead, until the piston is pressed against it.
//! * **Announced moves.** With a move announced, and the piston at rest at the present target or
//!   against a stop, the force is brought to the edge
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
mod handover;
mod plan;
mod pressures;
mod rest;
mod seals;
mod seat;

use super::air::{Chamber, Clock, Piston};
use super::gas::Pressures;
use super::learn::Learner;
use super::model::AxisModel;
use super::motion::{Inertia, Motion};
use crate::joint::JointInput;
use crate::pwm::OnTimes;
use force::{Ahead, Course, Push, Wish};
use pressures::targets;
use rest::Rest;
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

/// Slower than this, raw mm/s, the piston stands (3 mm/s).
const STILL: i32 = 3 << 16;

/// No move is awaited.
const NOTHING: i32 = i32::MIN;

/// The drive chamber makes up for what the counter chamber still has too much.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum MakesUp {
    /// It does not.
    No,
    /// In a move that extends.
    Extends,
    /// In one that retracts.
    Retracts,
}

/// What the law gives in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drive {
    /// On-times of the next tick, µs.
    pub on: OnTimes,
    /// Estimated speed.
    pub velocity: VelocityMmS,
    /// Force asked for as a share of what the supply can give, in steps of 2^-14.
    pub duty: Duty,
    /// At rest at the reference.
    pub settled: bool,
    /// The force asked for is beyond what the supply can give.
    pub limited: bool,
}

/// The quarters of the law, by the tick of its period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
enum Stroke {
    /// Chamber A: what it sees of the pulses, its pressure at the moment and ahead; the mass is
    /// learnt.
    #[default]
    A = 1,
    /// Chamber B.
    B,
    /// Motion, and the force that is wanted.
    Motion,
    /// Rest, target pressures, pulses of the next period.
    Pulses,
}

impl Stroke {
    /// Ticks of the period before it.
    #[inline]
    const fn turn(self) -> u16 {
        (self as u16).wrapping_sub(1)
    }

    #[inline]
    const fn next(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::Motion,
            Self::Motion => Self::Pulses,
            Self::Pulses => Self::A,
        }
    }
}

/// Small ones that every tick uses, in an order in which they are a whole word, which is sealed
/// as it is. It is never zero.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(4))]
struct Turn {
    /// The stroke to come.
    stroke: Stroke,
    primed: bool,
    /// The law decides about the coils, not somebody else.
    drives: bool,
    /// For the record: the force asked for was beyond what is possible.
    limited: bool,
}

impl Turn {
    #[inline]
    const fn word(self) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            stroke,
            primed,
            drives,
            limited,
        } = self;
        u32::from_le_bytes([stroke as u8, primed as u8, drives as u8, limited as u8])
    }
}

/// State of the law. It keeps no coefficients: every call is given those of the
/// axis, which must be the same from call to call.
#[derive(Clone, Debug)]
pub struct Predictive {
    a: Chamber,
    b: Chamber,

    /// Where the chambers are followed to.
    course: Course,
    course_check: u32,

    motion: Motion,
    /// Pressure force at the moment, mN.
    force: i32,
    /// The force that is wanted at the end of the dead time, mN.
    wanted: i32,
    motion_check: u32,

    inertia: Inertia,
    push: Push,
    push_check: u32,

    learner: Learner,

    rest: Rest,
    /// Where the piston stood when the next move was announced; [`NOTHING`] without one.
    awaits: i32,
    /// The drive chamber makes up for what the counter chamber still has too much.
    makes_up: MakesUp,
    /// The valves stay shut.
    quiet: bool,
    rest_check: u32,

    // What every tick uses, in the `Hash`.
    turn: Turn,
    /// Begin of the next period, µs; wraps.
    next: u32,
    /// Stroke of the last tick, raw mm.
    measured: i32,
    /// On-times of the present period from its begin, µs; in its last tick, of the next one. Where
    /// somebody else decides: for how long the valves were sent open since their chambers were followed.
    plan: OnTimes,

    // For the record.
    /// Share of the force that was asked for, as far as it is possible.
    duty: Duty,
}

impl Predictive {
    /// At rest. Chambers that a precharge fills before the law drives count as half full and in balance
    /// from power-up on: the middle is wrong by the least. Others count as vented.
    #[must_use]
    pub fn new(model: &AxisModel) -> Self {
        Self::with(model, Inertia::new(model, model.mass))
    }

    #[inline]
    fn with(model: &AxisModel, inertia: Inertia) -> Self {
        let pressures = if model.precharged {
            targets(model, 0)
        } else {
            Pressures {
                a: model.ambient,
                b: model.ambient,
            }
        };
        let mut law = Self {
            a: Chamber::new(pressures.a),
            b: Chamber::new(pressures.b),
            course: Course::default(),
            course_check: 0,
            motion: Motion::default(),
            force: model.pressure_force(pressures),
            wanted: 0,
            motion_check: 0,
            inertia,
            push: Push::default(),
            push_check: 0,
            learner: Learner::new(),
            rest: Rest::default(),
            awaits: NOTHING,
            makes_up: MakesUp::No,
            quiet: true,
            rest_check: 0,
            turn: Turn::default(),
            next: 0,
            measured: 0,
            plan: [0; 4],
            duty: Duty::ZERO,
        };
        law.seal();
        law
    }

    /// Estimated motion and load.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Estimated pressures.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        Pressures {
            a: self.a.pressure,
            b: self.b.pressure,
        }
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

    /// A tick of the law's own; on-times for the next tick, which are sent.
    ///
    /// It begins to decide with a period, once all is counted that somebody else has sent.
    #[inline]
    pub fn drive(&mut self, model: &AxisModel, input: &JointInput) -> Drive {
        if !self.turn.drives && !self.begins(model, input.measured) {
            return self.gives([0; 4]);
        }
        let on = match self.turn.stroke {
            Stroke::A => {
                self.follow(model, true);
                self.due(model, 1)
            }
            Stroke::B => {
                self.follow(model, false);
                self.due(model, 2)
            }
            Stroke::Motion => {
                self.want(model, input);
                self.due(model, 3)
            }
            Stroke::Pulses => {
                self.choose(model, input);
                self.due(model, 0)
            }
        };
        self.next_stroke(input.measured);
        self.gives(on)
    }

    /// With these on-times.
    #[inline(always)]
    const fn gives(&self, on: OnTimes) -> Drive {
        Drive {
            on,
            velocity: VelocityMmS::from_raw(self.motion.speed),
            duty: self.duty,
            settled: self.rest.is_settled(),
            limited: self.turn.limited,
        }
    }

    /// The present period.
    #[inline]
    const fn clock(&self, model: &AxisModel) -> Clock {
        let now = self.next.wrapping_sub(model.times.period as u32);
        Clock {
            now,
            next: self.next,
            moment: now.wrapping_add(model.moment as u32),
        }
    }

    /// To the next stroke.
    #[inline]
    const fn next_stroke(&mut self, measured: PositionMm) {
        self.measured = measured.raw();
        self.turn.stroke = self.turn.stroke.next();
    }

    /// One of the chambers, A at the begin of a period.
    #[inline(never)]
    fn follow(&mut self, model: &AxisModel, first: bool) {
        if first {
            self.next = self.next.wrapping_add(model.times.period as u32);
        }
        let clock = self.clock(model);
        let Course {
            middle,
            speed,
            end,
            ahead,
            now,
            force,
        } = self.course;
        let [fill_a, vent_a, fill_b, vent_b] = self.plan;
        let (chamber, piston, plan) = if first {
            let piston = Piston {
                flow: model.flow_a,
                lengths: [model.length_a(middle), model.length_a(end)],
                speeds: [speed.wrapping_neg(), ahead.wrapping_neg()],
                all_flows: 0,
            };
            (&mut self.a, piston, [fill_a, vent_a])
        } else {
            let piston = Piston {
                flow: model.flow_b,
                lengths: [model.length_b(middle), model.length_b(end)],
                speeds: [speed, ahead],
                all_flows: 1,
            };
            (&mut self.b, piston, [fill_b, vent_b])
        };
        if self.turn.drives {
            chamber.follow(model, &clock, &piston, plan);
        } else {
            chamber.observe(model, &clock, &piston, plan);
            // Counted.
            self.plan = if first {
                [0, 0, fill_b, vent_b]
            } else {
                [fill_a, vent_a, 0, 0]
            };
        }
        if first && model.learns_mass {
            // Of the period before.
            self.learner.sample(model, now, force);
        }
    }

    /// The motion up to the moment, and where it will go.
    #[inline]
    fn moves(&mut self, model: &AxisModel, measured: PositionMm) {
        let before = self.force;
        self.force = model.pressure_force(self.pressures());
        let force = before.saturating_add(self.force) >> 1;
        self.motion.predict(model, &self.inertia, force);
        let mean = self.measured.saturating_add(measured.raw()) >> 1;
        self.motion.correct(model, &self.inertia, mean);
        self.course = Course::of(model, &self.motion, force);
        self.course_check = self.course.sum();
    }

    /// Motion, and the force that is wanted.
    #[inline]
    fn want(&mut self, model: &AxisModel, input: &JointInput) {
        self.moves(model, input.measured);
        let reference = input.reference.raw();
        // Also one that came between this stroke and the last of the period before.
        let other = self.rest.is_fresh() || self.rest.is_other(model, reference);
        if other {
            self.push = Push::default();
        }
        if !other && self.learner.has_news() {
            // Twice after a move: what was wanted a period ago will do.
            self.learn(model);
        } else {
            let expected = Pressures {
                a: self.a.expected,
                b: self.b.expected,
            };
            let ahead = Ahead::new(model, &self.inertia, &self.motion, self.force, expected);
            let wish = Wish {
                reference,
                reference_speed: input.reference_velocity.raw(),
                motion: &self.motion,
                ahead,
                inertia: &self.inertia,
            };
            if !self.quiet {
                wish.push(model, &mut self.push);
            }
            self.wanted = wish.force(model, self.push, &self.rest);
        }
        self.push_check = self.push.sum();
        self.motion_check = self.sum_of_motion();
    }

    /// Takes what a move has told of the mass, a step of it in a period.
    #[inline]
    fn learn(&mut self, model: &AxisModel) {
        if self.learner.has_news()
            && let Some(mass) = self.learner.news(model)
        {
            self.inertia = Inertia::new(model, mass);
        }
    }

    /// On-times of the next tick by the plan, of which so many ticks are gone by then.
    #[inline]
    fn due(&self, model: &AxisModel, ticks: u16) -> OnTimes {
        let tick = model.times.tick as u16;
        let gone = tick.wrapping_mul(ticks);
        self.plan.map(|on| on.saturating_sub(gone).min(tick))
    }
}

#[cfg(test)]
mod tests;
