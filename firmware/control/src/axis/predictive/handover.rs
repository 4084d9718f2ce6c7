//! Who decides about the valves: the law, or somebody else.

use super::force::{Course, Push};
use super::{Driver, NOTHING, Predictive, Stroke};
use crate::axis::learn::Learner;
use crate::axis::model::AxisModel;
use crate::axis::motion::Inertia;
use crate::pwm::OnTimes;
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

impl Predictive {
    /// A tick in which somebody else drives: `sent` are the on-times last given out. Follows
    /// valves, chambers and piston, and forgets that the piston rests. Damage that the caller was
    /// told of before this tick ([`Predictive::kept_is_sound`]) is mended by the stroke that it
    /// concerns: nothing of it is used here.
    pub fn observe(
        &mut self,
        model: &AxisModel,
        measured: PositionMm,
        sent: &OnTimes,
    ) -> VelocityMmS {
        if !self.primed {
            self.prime(measured);
        }
        if self.driver != Driver::Others {
            self.yield_to_others(model, sent);
        } else {
            self.energise(model, sent, model.times.tick, false);
        }
        match self.stroke {
            Stroke::A => self.follow(model, true),
            Stroke::B => {
                self.follow(model, false);
                if !self.learner.is_sound() {
                    self.learner = Learner::new();
                }
            }
            Stroke::Motion => {
                self.learn(model);
                if !self.inertia.is_sound() {
                    self.inertia = Inertia::new(model, model.mass);
                }
                self.moves(model, measured);
                self.wanted = 0;
                self.push = Push::default();
                self.push_check = self.push.sum();
                self.motion_check = self.sum_of_motion();
            }
            Stroke::Pulses => {
                self.release();
                self.rest_check = self.sum_of_rest();
            }
        }
        self.next_stroke(measured);
        VelocityMmS::from_raw(self.motion.speed)
    }

    /// The first stroke that is measured is where the piston stands.
    #[cold]
    #[inline(never)]
    pub(super) fn prime(&mut self, measured: PositionMm) {
        self.primed = true;
        let stroke = measured.raw();
        self.measured = stroke;
        self.motion.stroke = stroke;
        self.course = Course::at(stroke);
        self.rest.release(stroke);
        self.quiet = true;
        self.seal();
    }

    /// Forgets the rest state. What was damaged before keeps its broken seal.
    #[inline(never)]
    pub(super) fn release(&mut self) {
        let sound = self.rest_check == self.sum_of_rest();
        self.rest.release(self.motion.stroke);
        self.awaits = NOTHING;
        self.quiet = true;
        if sound {
            self.rest_check = self.sum_of_rest();
        }
    }

    /// Begin of the tick.
    pub(super) const fn edge(&self, model: &AxisModel) -> u32 {
        let turn = self.stroke as i32;
        if turn == 0 {
            return self.next;
        }
        let left = model
            .times
            .period
            .wrapping_sub(model.times.tick.wrapping_mul(turn));
        self.next.wrapping_sub(left as u32)
    }

    /// Coils that somebody else decides, for `span` µs from this tick on.
    #[inline(never)]
    pub(super) fn energise(&mut self, model: &AxisModel, sent: &OnTimes, span: i32, cut: bool) {
        let now = self.edge(model);
        let [fill_a, vent_a, fill_b, vent_b] = *sent;
        let times = &model.times;
        self.a.energise(now, [fill_a, vent_a], span, cut, times);
        self.b.energise(now, [fill_b, vent_b], span, cut, times);
    }

    /// The law drives from now on: what others have sent still acts in this tick, and nothing
    /// after it.
    #[cold]
    #[inline(never)]
    pub(super) fn take_over(&mut self, model: &AxisModel, sent: &OnTimes) {
        // So a coil that is on until the end of the tick falls there.
        self.energise(model, sent, model.times.tick.wrapping_add(1), false);
        self.driver = if self.stroke == Stroke::A {
            Driver::Law
        } else {
            Driver::Begins
        };
    }

    /// Somebody else drives from now on: what is planned for after this tick does not happen.
    #[cold]
    #[inline(never)]
    pub(super) fn yield_to_others(&mut self, model: &AxisModel, sent: &OnTimes) {
        let times = &model.times;
        if self.stroke == Stroke::B {
            let [_, _, fill, vent] = self.plan;
            let begun = self.clock(model).now;
            self.b
                .energise(begun, [fill, vent], times.period, false, times);
        }
        // Before the first stroke of its period the plan has not begun.
        let begun = self.stroke != Stroke::A;
        self.energise(
            model,
            sent,
            times.tick.wrapping_add(i32::from(begun)),
            begun,
        );
        self.driver = Driver::Others;
        self.plan = [0; 4];
        self.asked = 0;
        self.duty = Duty::ZERO;
        self.limited = false;
        self.release();
    }
}
