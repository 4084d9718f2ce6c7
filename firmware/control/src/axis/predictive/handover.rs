//! Who decides about the valves: the law, or somebody else.

use super::force::{Course, Push};
use super::{NOTHING, Predictive, Stroke};
use crate::axis::model::AxisModel;
use crate::axis::motion::Inertia;
use crate::pwm::OnTimes;
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

impl Predictive {
    /// A tick after which somebody else drives, who tells [`Predictive::sent`] how. Follows
    /// chambers and piston, and forgets that the piston rests.
    pub fn observe(&mut self, model: &AxisModel, measured: PositionMm) -> VelocityMmS {
        if !self.turn.primed {
            self.prime(measured);
            if self.inertia.is_to_be_made() {
                return VelocityMmS::ZERO;
            }
        }
        if self.turn.drives {
            self.yield_to_others(model);
            // That is enough for a tick: the period is one longer. What has opened or shut in
            // it is seen a tick later; a valve that is open throughout counts for one less.
            self.next = self.next.wrapping_add(model.times.tick as u32);
            self.measured = measured.raw();
            return VelocityMmS::from_raw(self.motion.speed);
        }
        match self.turn.stroke {
            Stroke::A => self.follow(model, true),
            Stroke::B => self.follow(model, false),
            Stroke::Motion => {
                self.learn(model);
                self.moves(model, measured);
                self.wanted = 0;
                self.push = Push::default();
                self.push_check = self.push.sum();
                self.motion_check = self.sum_of_motion();
            }
            Stroke::Pulses => {
                if self.inertia.is_to_be_made() {
                    self.inertia = Inertia::new(model, model.mass);
                }
                self.release();
            }
        }
        self.next_stroke(measured);
        VelocityMmS::from_raw(self.motion.speed)
    }

    /// What somebody else has sent for the next tick: for how much of it each valve counts as open
    /// without its switching delays, µs. It counts at once: the delays are not waited for.
    #[inline]
    pub fn sent(&mut self, open: &OnTimes) {
        if self.turn.drives {
            return;
        }
        for (open, more) in self.plan.iter_mut().zip(open) {
            *open = open.saturating_add(*more);
        }
    }

    /// What is kept is damaged ([`Predictive::kept_is_sound`]): all of it begins anew, as after
    /// power-up. What follows from the mass takes long to be made; that waits for a stroke that has
    /// the time, the first one after the next stroke that is measured.
    #[cold]
    #[inline(never)]
    pub fn forget(&mut self, model: &AxisModel) {
        *self = Self::with(model, Inertia::TO_BE_MADE);
        self.turn.stroke = Stroke::Pulses;
    }

    /// Nothing of the plan has been sent in the tick to come, nor will be.
    #[inline]
    pub fn stopped(&mut self) {
        self.plan = [0; 4];
    }

    /// The first stroke that is measured is where the piston stands.
    #[cold]
    #[inline(never)]
    pub(super) fn prime(&mut self, measured: PositionMm) {
        self.turn.primed = true;
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

    /// Whether the law decides from this period on. If not, it has only looked on.
    #[cold]
    #[inline(never)]
    pub(super) fn begins(&mut self, model: &AxisModel, measured: PositionMm) -> bool {
        if !self.turn.primed || self.turn.stroke != Stroke::A || self.plan != [0; 4] {
            self.observe(model, measured);
            return false;
        }
        self.turn.drives = true;
        true
    }

    /// Begin of the tick.
    const fn edge(&self, model: &AxisModel) -> u32 {
        let turn = self.turn.stroke.turn() as i32;
        if turn == 0 {
            return self.next;
        }
        let left = model
            .times
            .period
            .wrapping_sub(model.times.tick.wrapping_mul(turn));
        self.next.wrapping_sub(left as u32)
    }

    /// Somebody else drives from now on: what is planned for after the tick that begins does not
    /// happen.
    #[cold]
    #[inline(never)]
    fn yield_to_others(&mut self, model: &AxisModel) {
        let times = &model.times;
        let now = self.edge(model);
        let [fill_a, vent_a, fill_b, vent_b] = self.due(model, self.turn.stroke.turn());
        let [_, _, fill, vent] = self.plan;
        // The period has begun for a chamber with its stroke.
        let (begun_a, begun_b) = match self.turn.stroke {
            Stroke::A => (Some((now, [fill_a, vent_a])), Some((now, [fill_b, vent_b]))),
            Stroke::B => (None, Some((self.clock(model).now, [fill, vent]))),
            Stroke::Motion | Stroke::Pulses => (None, None),
        };
        self.a.end(now, [fill_a, vent_a], begun_a, times);
        self.b.end(now, [fill_b, vent_b], begun_b, times);
        self.turn.drives = false;
        self.plan = [0; 4];
        self.duty = Duty::ZERO;
        self.turn.limited = false;
    }
}
