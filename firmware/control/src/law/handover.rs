//! Which part of the firmware commands the valves: the law or another one.
//!
//! The estimates depend on what was sent. When another part drives (exhaust, precharge, hold) and reports it through
//! [`Predictive::external_on_times`], the observer counts that at once, and the law waits until it has been counted. A
//! plan that is cut short counts as far as it was sent.
//!
//! | | what is kept when another part drives | why |
//! |---|---|---|
//! | continues | pressures with their bounds, tracks of the valves, motion, load, mass in use with its gains, doubt and the move under way, friction in use, clock and period, a pressure swap | they follow what was sent, whoever sent it |
//! | starts afresh at the end of each period whose last tick the other part has | standstill, with the present stroke as its target; break-away ramp; preload; inching; the means of the friction | they belong to a rest, to forces that the law has not made, and to sliding that somebody may have pushed |
//! | is dropped at once | the part of the plan that was not sent: a coil that is on counts as off from the end of the tick | it does not happen |
//!
//! A part that drives for less than a period, and not in its last tick, leaves rest, ramp and preload as they were. An
//! axis that the node holds, or has shut off because of a fault, is one that another part drives.
//!
//! The law starts to plan again at the end of the first period in which it is called ([`Predictive::drive`]); until
//! then all valves are shut. Only the board makes a new law without any of this, by `JointController::reset`: after a
//! sensor fault, damaged memory or a change of axis data.
//!
//! Assumes: that whoever drives reports it in every tick, and that what is reported reaches the chamber. Without
//! supply, the air that is counted never came; what is not reported is air that the observer does not know of. In both
//! cases the bounds of the pressures no longer hold.

use super::Predictive;
use super::inching::Inching;
use super::inverse_dynamics::BreakawayRamp;
use super::preload::Preload;
use super::standstill::Standstill;
use super::switching_curve::SpeedGains;
use crate::axis::{AxisModel, PERIOD_TICKS};
use crate::observer::by_chamber;
use crate::pwm::OnTimes;
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

impl Predictive {
    /// A tick after which somebody else drives. Tracks chambers and piston, and forgets that the piston is at rest.
    pub fn observe(&mut self, model: &AxisModel, measured: PositionMm) -> VelocityMmS {
        if self.drives {
            self.release_valves(model);
        }
        if self.ends_period(measured) {
            self.observe_period(model, measured);
            self.ramp = BreakawayRamp::default();
            self.preload = Preload::default();
            self.inching = Inching::default();
            self.standstill = Standstill::at(self.observer.motion.stroke);
            self.observer.forget_sliding();
        }
        self.next_tick(measured);
        VelocityMmS::from_raw(self.observer.motion.speed)
    }

    /// What somebody else has sent for the next tick: how long each valve counts as open in it, without its switching
    /// delays, µs. It counts at once, without waiting for the delays.
    pub fn external_on_times(&mut self, open: &OnTimes) {
        if self.drives {
            return;
        }
        for (open, more) in self.external.iter_mut().zip(open) {
            *open = open.saturating_add(*more);
        }
    }

    /// Nothing of the plan was sent for the tick to come, nor will be.
    pub fn stopped(&mut self, model: &AxisModel) {
        let sent = (model.times.tick as u16).wrapping_mul(u16::from(self.tick_of_period));
        self.plan = self.plan.map(|on| on.min(sent));
    }

    /// Whether the tick that begins is the last of its period. The first measured stroke is taken as the piston's
    /// position.
    pub(super) fn ends_period(&mut self, measured: PositionMm) -> bool {
        if !self.primed {
            self.primed = true;
            self.measured = measured.raw();
            self.observer.start_at(self.measured);
            self.standstill = Standstill::at(self.measured);
        }
        self.plans()
    }

    /// Advances to the next tick.
    pub(super) const fn next_tick(&mut self, measured: PositionMm) {
        self.measured = measured.raw();
        self.tick_of_period = self.tick_of_period.wrapping_add(1) % PERIOD_TICKS;
    }

    /// Ends a period: observes it and begins the next.
    pub(super) fn observe_period(&mut self, model: &AxisModel, measured: PositionMm) {
        let period = self.period(model);
        let stroke = self.measured.saturating_add(measured.raw()) >> 1;
        let learnt = self
            .observer
            .update(model, &period, self.plan, self.external, stroke);
        if let Some(mass) = learnt {
            self.gains = SpeedGains::new(model, mass);
        }
        self.carry(model);
        self.begin = period.next;
        self.plan = [0; 4];
        self.external = [0; 4];
    }

    /// Somebody else drives from the end of this tick on: what was planned after it does not happen.
    #[cold]
    fn release_valves(&mut self, model: &AxisModel) {
        let ticks = i32::from(self.tick_of_period).wrapping_add(1);
        let end = self
            .begin
            .wrapping_add(model.times.tick.wrapping_mul(ticks) as u32);
        let [plan_a, plan_b] = by_chamber(self.plan);
        self.observer.a.release(model, self.begin, end, plan_a);
        self.observer.b.release(model, self.begin, end, plan_b);
        self.drives = false;
        self.plan = [0; 4];
        self.duty = Duty::ZERO;
        self.limited = false;
    }
}
