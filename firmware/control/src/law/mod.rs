//! The predictive law: position control of one axis with four on/off valves and one potentiometer.
//!
//! *Predictive* means that it acts on the state predicted for the end of the dead time. Nothing is optimised over a
//! horizon, and there is no cost function.
//!
//! ```text
//!    x, v, load; p also at T_d
//! observer ──► dead-time predictor ──► switching curve ──► inverse dynamics ──► allocation ──► pulse planner
//!    │              x, v at T_d           v*(e), dv*/de           F*               pA*, pB*     µs of each valve
//!    └──► standstill (seat, preload): instead of F* all valves shut, or a force of its own
//! ```
//!
//! | file | concept |
//! |---|---|
//! | [`reference_generator`] | second-order reference with a lead-limiting governor; runs ahead of the law in every tick |
//! | `dead_time_predictor` | motion at the end of the dead time, when a pulse begun now takes effect |
//! | `switching_curve` | proximate time-optimal: a braking parabola with a straight line at the target |
//! | `inverse_dynamics` | force for the wanted speed, with friction feed-forward and the break-away ramp |
//! | `allocation` | from a force to two chamber pressures about their mean; the pressure swap |
//! | `pulse_planner` | from a pressure to the on-times of the next period |
//! | `standstill` | when the valves stay shut: a state machine |
//! | `inching` | coarse valves: steps towards the target, with the valves shut in between |
//! | `seat` | force control instead of position control at an end stop |
//! | `preload` | brings the force to the edge of slipping ahead of an announced move |
//! | `handover` | which part of the firmware commands the valves |
//!
//! Valves that take milliseconds to switch do not need a new decision every millisecond. Observer and law work once per
//! period of [`PERIOD_TICKS`] (4) ticks, entirely in its last tick, and plan the pulses of the next period to the
//! microsecond. The steps, in the order of the code:
//!
//! 1. [`Predictive::drive`] is called in every tick. In the last tick of a period it does 2 to 10, otherwise only 10.
//! 2. `observe_period` (`handover`): the observer takes what was sent and the mean of the last two strokes (its steps
//!    are in [`crate::observer`]). If it has learnt a new mass, the gains are recomputed (`switching_curve`). Friction,
//!    wherever the law uses it, is that of the axis data times the share that the observer has learnt.
//!    Where no mass is learnt, the mass in use is that of the axis data, or the standing mass while the foot at the rod
//!    stands.
//! 3. `plan_period`: if the target is new, patience starts afresh, a landing is allowed (`standstill`), and the ramp is
//!    forgotten.
//! 4. `preload`: if the piston rests (or stands at a stop) and a move is announced, this gives a force, or no pulse if
//!    that force is already there.
//! 5. `seat`, unless 4 has decided: if the target is an end stop and the piston is there, this gives a force, or rest.
//! 6. `standstill`, unless 4 has decided: its state follows from 5, or otherwise from how the piston approaches the
//!    target.
//! 7. `allocation`: the pressure swap starts with a preload, or when the piston stands at an end stop.
//! 8. F\* is that of 4 or 5, if one of them gave a force. There is no pulse if 4 says so, or if the state of 6 is
//!    PAUSE, CATCH or REST. If the valves are coarse and the piston is near, `inching` gives the pulses of a step, or
//!    none, and 9 is skipped. Otherwise F\* is that of the position servo: `dead_time_predictor`, break-away ramp, then
//!    `inverse_dynamics`, which uses `switching_curve`.
//! 9. F\*, limited to what the supply can deliver, is turned into two pressures (`allocation`) and their pulses
//!    (`pulse_planner`).
//!    A piston that is held under full force gets targets out of reach instead.
//! 10. The on-times of the next tick are cut out of the plan (`due`).
//!
//! All gains and thresholds are in [`crate::tuning`], each with its unit, its reason, and the file and name of the test
//! that guards it. What follows from them and from the axis data is in [`AxisModel`]. Formats are those of
//! [`crate::observer`]; in addition k and D are in 1/s × 2^8, a_b in whole mm/s², the ramp in mN × 2^8, on-times in
//! whole µs.
//!
//! Symbols used in these files: T_t tick, T period, T_d dead time from the observer's moment, T_r dead time from the
//! tick that does the work, a_b deceleration towards the target.
//!
//! Assumes: a true stroke; valve delays as specified ([`crate::observer::valve_delay`] says how to find them); ticks of
//! the length for which the [`AxisModel`] was made, with none left out. Each part states its further assumptions in its
//! own file. Where they do not hold:
//!
//! | what happens | what follows |
//! |---|---|
//! | an invalid sample | the node, not the law, sees it (`firmware/node/src/sensor.rs`) and passes on the last good stroke. Two in a row are a fault, and the node shuts the valves. With the first good sample after that it makes a new law: no history is left, mass and friction are those of the axis data, and the pressures start from the assumption of a power-up, with bounds from atmosphere to supply |
//! | a frozen potentiometer | the node notices the missing motion (`no_motion_detector.rs` there) |
//! | no new reference | the node lets the last one continue at its speed for one bus cycle and then stand; when it gives up on the master it shuts the valves. The law comes to rest at whatever reference it is given |
//! | somebody else drives the valves | `handover`: the observer counts what they send. When the law acts again, its standstill, ramp and preload start afresh (if the other part had the last tick of a period); everything else continues |
//! | the supply is lower than specified | nobody notices. The estimated pressure of a filled chamber is too high, and pulses do less than planned. While the piston slides, the load estimate absorbs the difference, so the speed recovers with a time constant of about 20 ms, up to the force that is left. A piston at rest stays at rest. The mass learnt in such a move is wrong ([`crate::observer::mass`] says how far it is trusted) |
//! | a full chamber that counts as vented | the piston stands. Once all the force is demanded, but not before 0.2 s of standing, the valves stay open until it slides (`allocation`) |
//! | an end stop | `seat` with a precharge; without one the position servo and `standstill`. The observer holds the piston there and learns no load ([`crate::observer::motion`]) |
//! | friction that is not as specified | it appears as load, until the piston has slid to and fro at one target; then it is learnt, within half and twice (`observer/friction.rs`). Feeding forward more than the real friction makes a relay near the target, so the feed-forward is faded out there (`standstill`) |
//!
//! Tests are at the end of each file, or in `tests.rs` in the folder of its name; those of `handover`, `seat` and
//! `preload` are in `tests.rs` here and in `tests/preload.rs`. `tests/system/control_bars.rs` shows what all of it is
//! worth in the closed loop.
//!
//! Four shares of Coulomb friction are used for sliding and stopping, on purpose. The observer and the predictor use
//! 0.92 of it, because more than the real friction would hide speed. `inverse_dynamics` feeds all of it forward.
//! `standstill` relies on 0.85 where friction has to stop the piston within the band, and the landing of
//! `switching_curve` on 0.6, because the true friction may be less. `preload`, `seat` and `inching` have factors of
//! their own.

mod allocation;
mod dead_time_predictor;
mod handover;
mod inching;
mod inverse_dynamics;
mod preload;
mod pulse_planner;
pub mod reference_generator;
mod seat;
mod standstill;
mod switching_curve;

use crate::axis::{AxisModel, PERIOD_TICKS};
use crate::joint::JointInput;
use crate::observer::Observer;
use crate::observer::motion::Motion;
use crate::observer::pressure::{Period, Pressures};
use crate::pwm::OnTimes;
use crate::tuning::{REFERENCE_RESTS, SLIDING_SPEED, STILL_SPEED};
use allocation::PressureSwap;
use dead_time_predictor::PredictedState;
use inching::{Inch, Inching};
use inverse_dynamics::{BreakawayRamp, ForceDemand};
use preload::{Awaited, Preload};
use seat::Seat;
use standstill::{Approach, Standstill};
use switching_curve::SpeedGains;
use wheeleg_units::{Duty, VelocityMmS};

/// Output of the law in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drive {
    /// On-times of the next tick, µs.
    pub on: OnTimes,
    /// Estimated speed.
    pub velocity: VelocityMmS,
    /// Demanded force as a share of what the supply can deliver, in steps of 2^-14.
    pub duty: Duty,
    /// At rest at the reference.
    pub settled: bool,
    /// The demanded force is more than the supply can deliver.
    pub limited: bool,
}

/// State of the law and of its observer. It holds no coefficients: every call is given those of the axis, which must be
/// the same from call to call.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Predictive {
    observer: Observer,
    gains: SpeedGains,
    ramp: BreakawayRamp,
    standstill: Standstill,
    preload: Preload,
    swap: PressureSwap,
    inching: Inching,

    /// The foot at the rod stands.
    foot_stands: bool,
    /// A stroke has been measured.
    primed: bool,
    /// The law commands the coils, and nobody else.
    drives: bool,
    /// Index in its period of the tick that comes next.
    tick_of_period: u8,
    /// Start of the present period, µs; wraps. In the last tick of a period, once that has been observed, start of the
    /// next.
    begin: u32,
    /// Stroke of the last tick, raw mm.
    measured: i32,
    /// On-times of the present period, counted from its start, µs.
    plan: OnTimes,
    /// How long somebody else had the valves open in the present period, without switching delays, µs.
    external: OnTimes,

    /// For the record: the deliverable part of the demanded force as a share, and whether the demand exceeded it.
    duty: Duty,
    limited: bool,
}

impl Predictive {
    /// At rest. If a precharge fills the chambers before the law drives, they count as half full and in balance from
    /// power-up on, since the middle is least wrong; otherwise as vented.
    #[must_use]
    pub fn new(model: &AxisModel) -> Self {
        let pressures = if model.precharged {
            allocation::targets(model, 0)
        } else {
            Pressures {
                a: model.ambient,
                b: model.ambient,
            }
        };
        Self {
            observer: Observer::new(model, pressures),
            gains: SpeedGains::new(model, model.mass),
            ramp: BreakawayRamp::default(),
            standstill: Standstill::default(),
            preload: Preload::default(),
            swap: PressureSwap::No,
            inching: Inching::default(),
            foot_stands: false,
            primed: false,
            drives: false,
            tick_of_period: 0,
            begin: 0,
            measured: 0,
            plan: [0; 4],
            external: [0; 4],
            duty: Duty::ZERO,
            limited: false,
        }
    }

    /// The estimates of chambers, motion and mass.
    #[must_use]
    pub const fn observer(&self) -> &Observer {
        &self.observer
    }

    /// Estimated motion and load.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.observer.motion
    }

    /// Estimated pressures.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        self.observer.pressures()
    }

    /// Mass in use, kg × 2^16: as specified, that of a standing foot, or as learnt.
    #[must_use]
    pub const fn mass(&self) -> i32 {
        self.observer.inertia.mass
    }

    /// At rest at its reference.
    #[must_use]
    pub const fn is_settled(&self) -> bool {
        self.standstill.is_at_rest()
    }

    /// Whether the next tick ends a period: that tick does all the work.
    #[must_use]
    pub const fn plans(&self) -> bool {
        self.tick_of_period.saturating_add(1) >= PERIOD_TICKS
    }

    /// One tick in which the law drives; returns the on-times to send for the next tick. The law starts to decide at
    /// the end of a period, once everything that somebody else sent has been counted.
    pub fn drive(&mut self, model: &AxisModel, input: &JointInput) -> Drive {
        if self.ends_period(input.measured) {
            self.observe_period(model, input.measured);
            self.drives = true;
            self.plan_period(model, input);
        }
        let on = self.due(model);
        self.next_tick(input.measured);
        Drive {
            on,
            velocity: VelocityMmS::from_raw(self.observer.motion.speed),
            duty: self.duty,
            settled: self.is_settled(),
            limited: self.limited,
        }
    }

    /// Whether the foot at the rod stands, from the next period on.
    pub const fn set_foot_stands(&mut self, stands: bool) {
        self.foot_stands = stands;
    }

    /// Uses the mass that the piston moves, unless it is learnt: with a standing foot, a share of the robot.
    fn carry(&mut self, model: &AxisModel) {
        let mass = if self.foot_stands {
            model.standing_mass
        } else {
            model.mass
        };
        if !model.learns_mass && mass != self.observer.inertia.mass {
            self.observer.carry(model, mass);
            self.gains = SpeedGains::new(model, mass);
        }
    }

    /// The present period on the clock of the valves.
    const fn period(&self, model: &AxisModel) -> Period {
        Period {
            begin: self.begin,
            next: self.begin.wrapping_add(model.times.period as u32),
            moment: self.begin.wrapping_add(model.moment as u32),
        }
    }

    /// On-times of the next tick according to the plan.
    fn due(&self, model: &AxisModel) -> OnTimes {
        let tick = model.times.tick as u16;
        // After the last tick of a period comes the first of the next one, whose plan is new.
        let next = self.tick_of_period.wrapping_add(1) % PERIOD_TICKS;
        let gone = tick.wrapping_mul(u16::from(next));
        self.plan.map(|on| on.saturating_sub(gone).min(tick))
    }

    /// Plans the pulses of the next period.
    fn plan_period(&mut self, specified: &AxisModel, input: &JointInput) {
        let model = &self.observer.learnt(specified);
        let reference = input.reference.raw();
        let reference_speed = input.reference_velocity.raw();
        if self.standstill.aim(model, reference) {
            self.ramp = BreakawayRamp::default();
            self.inching = Inching::default();
            self.observer.forget_sliding();
        }
        let stands = self.is_settled() || self.observer.motion.speed.wrapping_abs() < STILL_SPEED;
        let preload = self.preload(model, input, stands);
        let seat = match preload {
            Some(_) => None,
            None => self.seat(model, input),
        };
        match (preload, seat) {
            (Some(_), _) => {}
            (None, Some(seat)) => self.standstill.seat(seat == Seat::Seated),
            (None, None) => self.standstill.update(
                model,
                &Approach {
                    reference,
                    reference_speed,
                    measured: input.measured.raw(),
                    motion: &self.observer.motion,
                    force: self.observer.force,
                    mass: self.observer.inertia.mass,
                },
            ),
        }
        if preload.is_some() || (stands && self.observer.motion.at_stop(model)) {
            let to = match (preload, input.announced) {
                (Some(_), Some(announced)) => announced.reference.raw(),
                _ => reference,
            };
            self.swap = PressureSwap::towards(to, self.observer.motion.stroke);
        }
        let decides = preload.is_some() || seat.is_some();
        match self.inch(model, input, decides) {
            Some(Inch::Wait) => return self.shut(model),
            Some(Inch::Pulses(plan)) => {
                self.plan = plan;
                self.limited = false;
                self.duty = Duty::ZERO;
                return;
            }
            None => {}
        }
        let force = match (preload, seat) {
            (Some(Awaited::Ready), _) => return self.shut(model),
            (Some(Awaited::Force(force)), _) | (None, Some(Seat::Press(force))) => force,
            (None, _) if self.standstill.valves_closed() => return self.shut(model),
            (None, _) => self.force_demand(model, reference, reference_speed),
        };
        let is_held = !decides && self.is_held(model, reference);
        self.make_force(
            model,
            force,
            preload.is_none() && self.standstill.is_near(),
            is_held,
        );
    }

    /// What a step on coarse valves demands for the next period; `None` if preload or seat decides.
    fn inch(&mut self, model: &AxisModel, input: &JointInput, decides: bool) -> Option<Inch> {
        let reference_rests = input.reference_velocity.raw().wrapping_abs() <= REFERENCE_RESTS;
        if decides || !reference_rests || !inching::is_coarse(model, self.gains.half_is_enough) {
            self.inching = Inching::default();
            return None;
        }
        if self.standstill.valves_closed() {
            self.inching.interrupt();
            return None;
        }
        self.inching
            .update(model, &self.observer, input.reference.raw(), self.begin)
    }

    /// F* of the position servo, mN.
    fn force_demand(&mut self, model: &AxisModel, reference: i32, reference_speed: i32) -> i32 {
        let demand = ForceDemand {
            reference,
            reference_speed,
            observer: &self.observer,
            ahead: PredictedState::new(model, &self.observer),
            gains: &self.gains,
        };
        demand.ramp(model, &mut self.ramp);
        demand.force(model, self.ramp, &self.standstill)
    }

    /// Shuts all valves as soon as the pulses under way allow.
    fn shut(&mut self, model: &AxisModel) {
        self.plan = pulse_planner::shut(model, &self.observer, self.begin);
        self.limited = false;
        self.duty = Duty::ZERO;
    }

    /// Whether something holds the piston back that is no end stop, and it does not slide yet.
    fn is_held(&self, model: &AxisModel, reference: i32) -> bool {
        let motion = &self.observer.motion;
        self.ramp.is_held(model)
            && motion.speed.wrapping_abs() <= SLIDING_SPEED
            && !motion.at_end_stop(model, reference, true)
    }

    /// Plans pulses that make a force, mN; near the target, pulses of one chamber only. If the piston is held and all
    /// of the force is demanded, the valves stay open.
    fn make_force(&mut self, model: &AxisModel, force: i32, near: bool, is_held: bool) {
        let possible = allocation::possible_force(model, force);
        self.limited = possible != force;
        let target = if self.limited && is_held {
            allocation::out_of_reach(force)
        } else {
            self.swap.targets(model, possible, self.observer.expected())
        };
        self.plan = pulse_planner::plan(model, &self.observer, target, self.begin, near);
        self.duty = allocation::duty(model, possible);
    }
}

#[cfg(test)]
mod tests;
