//! The predictive law: position of one axis with four on/off valves and one potentiometer.
//!
//! *Predictive*: it acts by the state that is predicted for the end of the dead time. Nothing is optimised over a
//! horizon, and there is no cost.
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
//! | [`reference_generator`] | second-order reference with a lead-limiting governor; runs ahead of the law, each tick |
//! | `dead_time_predictor` | motion at the end of the dead time, where a pulse begun now acts |
//! | `switching_curve` | proximate time-optimal: parabola of braking, straight line at the target |
//! | `inverse_dynamics` | force for the speed that is wanted, with friction fed forward and the break-away ramp |
//! | `allocation` | from a force to two chamber pressures about their mean; the pressure swap |
//! | `pulse_planner` | from a pressure to the on-times of the next period |
//! | `standstill` | when the valves stay shut: a state machine |
//! | `inching` | coarse valves: steps towards the target, with the valves shut between them |
//! | `seat` | a force instead of a position at an end stop |
//! | `preload` | the edge of slipping ahead of an announced move |
//! | `handover` | which part of the firmware commands the valves |
//!
//! Valves that take milliseconds need no new decision in every one: observer and law work once in a period of
//! [`PERIOD_TICKS`] (4) ticks, whole in its last tick, and plan the pulses of the next period to the microsecond. The
//! steps, in the order of the code:
//!
//! 1. [`Predictive::drive`] is called in every tick. In the last one of a period it does 2 to 10, in the others 10 alone.
//! 2. `observe_period` (`handover`): the observer takes what was sent, and the mean of the last two strokes
//!    ([`crate::observer`] has its steps). A mass that it has learnt gives new gains (`switching_curve`).
//! 3. `plan_period`: another target? Then patience begins anew (`standstill`), and the ramp is forgotten.
//! 4. `preload`: does the piston rest (or stand at a stop), and is a move announced? Then its force, or no pulse where that stands already.
//! 5. `seat`, if 4 has nothing to say: is the target an end stop, and the piston there? Then its force, or rest.
//! 6. `standstill`, if 4 has nothing to say: its state follows from 5, or else from how the piston comes to the target.
//! 7. `allocation`: the pressure swap begins with a preload, or where the piston stands at an end stop.
//! 8. F\*: that of 4 or 5. No pulse, where 4 says so, or the state of 6 is PAUSE, CATCH or REST. Where the valves are
//!    coarse and the piston near, the pulses of a step, or none (`inching`), and 9 is left out. Otherwise that of the
//!    position servo: `dead_time_predictor`, break-away ramp, then `inverse_dynamics` with `switching_curve` in it.
//! 9. F\*, limited to what the supply can give, becomes two pressures (`allocation`) and these pulses
//!    (`pulse_planner`).
//! 10. The on-times of the next tick are cut out of the plan (`due`).
//!
//! Gains and thresholds stand in [`crate::tuning`], all of them, each with its unit, its reason, and file and name of
//! the test that guards it; what follows from them and from the axis data, in [`AxisModel`]. Formats are those of
//! [`crate::observer`]; beside them k and D 1/s × 2^8, a_b whole mm/s², the ramp mN × 2^8, on-times whole µs.
//!
//! The files have times as: T_t tick, T period, T_d dead time from the moment of the observer, T_r dead time from the
//! tick that works; and the deceleration towards the target as a_b.
//!
//! Assumes: a stroke that is true; delays of the valves that are as specified ([`crate::observer::valve_delay`] says
//! how they are found); ticks of the length for which the [`AxisModel`] was made, none left out. What else each part
//! assumes is in its file. Where that does not hold:
//!
//! | what happens | what follows |
//! |---|---|
//! | an invalid sample | the node, not the law, sees it (`firmware/node/src/sensor.rs`): it hands over the last good stroke; two in a row are a fault, and the node shuts the valves. With the first good sample after that it makes a new law: no history is left, the mass is that of the data, the air counts as unknown |
//! | a frozen potentiometer | the node misses the motion (`no_motion_detector.rs` there) |
//! | no new reference | the node lets the last one run on at its speed for one bus cycle, then stand; when it gives the master up it shuts the valves. The law comes to rest at what it is given |
//! | somebody else drives the valves | `handover`: the observer counts what they send; when the law acts again, its standstill, ramp and preload begin anew (if the other part had the last tick of a period), all else goes on |
//! | the supply is lower than specified | nobody notices it. The estimate of a filled chamber is too high and pulses do less than planned; while the piston slides the load takes the difference, so the speed is kept after some 20 ms, up to the force that is left. A piston at rest stays at rest. The mass learnt in such a move is off ([`crate::observer::mass`] says how far that is believed) |
//! | an end stop | `seat` with a precharge; without one the position servo and `standstill`. The observer holds the piston there and learns no load ([`crate::observer::motion`]) |
//! | friction that is not as specified | shows as load; what is fed forward beyond it makes a relay near the target: it is faded out there (`standstill`) |
//!
//! Tests stand at the end of each file, or in `tests.rs` in the folder of its name; those of `handover`, `seat` and
//! `preload` are in `tests.rs` here and in `tests/preload.rs`. What all of it is worth in the closed loop:
//! `tests/system/control_bars.rs`.
//!
//! Three frictions are used on purpose: the observer and the predictor count 0.92 of Coulomb friction, because counting
//! more than there is would hide speed; `inverse_dynamics` feeds all of it forward; `standstill` counts on 0.85 of it where friction
//! has to stop the piston.

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
use crate::tuning::{REFERENCE_RESTS, STILL_SPEED};
use allocation::PressureSwap;
use dead_time_predictor::PredictedState;
use inching::{Inch, Inching};
use inverse_dynamics::{BreakawayRamp, ForceDemand};
use preload::{Awaited, Preload};
use seat::Seat;
use standstill::{Approach, Standstill};
use switching_curve::SpeedGains;
use wheeleg_units::{Duty, VelocityMmS};

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

/// State of the law and of its observer. It keeps no coefficients: every call is given those of the
/// axis, which must be the same from call to call.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Predictive {
    observer: Observer,
    gains: SpeedGains,
    ramp: BreakawayRamp,
    standstill: Standstill,
    preload: Preload,
    swap: PressureSwap,
    inching: Inching,

    /// A stroke has been measured.
    primed: bool,
    /// The law decides about the coils, not somebody else.
    drives: bool,
    /// Tick of the period that comes next.
    tick_of_period: u8,
    /// Begin of the present period, µs; wraps. In the last tick of a period, once that is observed, of the next.
    begin: u32,
    /// Stroke of the last tick, raw mm.
    measured: i32,
    /// On-times of the present period from its begin, µs.
    plan: OnTimes,
    /// For how long somebody else had the valves open in it, without their delays, µs.
    external: OnTimes,

    /// For the record: the share of the force that was asked for, as far as it is possible, and whether it
    /// is not.
    duty: Duty,
    limited: bool,
}

impl Predictive {
    /// At rest. Chambers that a precharge fills before the law drives count as half full and in balance
    /// from power-up on: the middle is wrong by the least. Others count as vented.
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

    /// Its observer.
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

    /// Mass in use, kg × 2^16: as specified, or learnt.
    #[must_use]
    pub const fn mass(&self) -> i32 {
        self.observer.inertia.mass
    }

    /// At rest at its reference.
    #[must_use]
    pub const fn is_settled(&self) -> bool {
        self.standstill.is_at_rest()
    }

    /// Whether the next tick ends a period: it is the one with all the work.
    #[must_use]
    pub const fn plans(&self) -> bool {
        self.tick_of_period.saturating_add(1) >= PERIOD_TICKS
    }

    /// A tick of the law's own; on-times for the next tick, which are sent. The law begins to decide at the
    /// end of a period, once all is counted that somebody else has sent.
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

    /// The present period on the clock of the valves.
    const fn period(&self, model: &AxisModel) -> Period {
        Period {
            begin: self.begin,
            next: self.begin.wrapping_add(model.times.period as u32),
            moment: self.begin.wrapping_add(model.moment as u32),
        }
    }

    /// On-times of the next tick by the plan.
    fn due(&self, model: &AxisModel) -> OnTimes {
        let tick = model.times.tick as u16;
        // The tick after the last of a period is the first of the next one, whose plan is new.
        let next = self.tick_of_period.wrapping_add(1) % PERIOD_TICKS;
        let gone = tick.wrapping_mul(u16::from(next));
        self.plan.map(|on| on.saturating_sub(gone).min(tick))
    }

    /// The pulses of the next period.
    fn plan_period(&mut self, model: &AxisModel, input: &JointInput) {
        let reference = input.reference.raw();
        let reference_speed = input.reference_velocity.raw();
        if self.standstill.aim(model, reference) {
            self.ramp = BreakawayRamp::default();
            self.inching = Inching::default();
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
        self.make_force(model, force, preload.is_none() && self.standstill.is_near());
    }

    /// What a step on coarse valves wants of the next period; preload or seat may decide instead.
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

    /// All valves shut as soon as the pulses under way allow.
    fn shut(&mut self, model: &AxisModel) {
        self.plan = pulse_planner::shut(model, &self.observer, self.begin);
        self.limited = false;
        self.duty = Duty::ZERO;
    }

    /// Pulses that make a force, mN; near the target, of one chamber alone.
    fn make_force(&mut self, model: &AxisModel, force: i32, near: bool) {
        let possible = allocation::possible_force(model, force);
        let target = self.swap.targets(model, possible, self.observer.expected());
        self.plan = pulse_planner::plan(model, &self.observer, target, self.begin, near);
        self.limited = possible != force;
        self.duty = allocation::duty(model, possible);
    }
}

#[cfg(test)]
mod tests;
