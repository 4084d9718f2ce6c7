//! The air of a cylinder: what was sent to the valves, followed into the chambers.

use super::gas::{ChamberFlows, Pressures, Wanted, power};
use super::model::AxisModel;
use super::valves::ValveTrack;
use crate::pwm::OnTimes;
use core::hash::{Hash, Hasher};

/// Highest pressure that is followed, 1/256 Pa (2.1 MPa).
const MOST: i32 = (1 << 29) - 1;

/// Pulses under way and pressures; valves in the order of [`OnTimes`].
#[derive(Clone, Debug)]
pub struct Air {
    valves: [ValveTrack; 4],
    /// Open times of the tick that begins now, µs.
    opening: [i32; 4],
    pressures: Pressures,
    /// End of the ticks taken so far, µs; wraps.
    now: u32,
    /// Flows of A and B at these pressures, as far as they are known.
    flows: [ChamberFlows; 2],
    /// Stiffness of A and B where they were last followed or looked ahead to.
    stiffness: [i32; 2],
}

impl Hash for Air {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here. Openings are
        // narrower than a word: two share one.
        let Self {
            valves: [fill_a, vent_a, fill_b, vent_b],
            opening: [first, second, third, fourth],
            pressures,
            now,
            // Worked out anew in every tick.
            flows: _,
            stiffness: _,
        } = self;
        (fill_a, vent_a, fill_b, vent_b).hash(state);
        state.write_i32(first ^ second.rotate_left(16));
        state.write_i32(third ^ fourth.rotate_left(16));
        pressures.hash(state);
        state.write_u32(*now);
    }
}

impl Air {
    /// Valves shut, chambers at `pressure` (1/256 Pa absolute).
    #[must_use]
    pub fn new(pressure: i32) -> Self {
        Self {
            valves: [ValveTrack::new(); 4],
            opening: [0; 4],
            pressures: Pressures {
                a: pressure,
                b: pressure,
            },
            now: 0,
            flows: [ChamberFlows::default(); 2],
            stiffness: [0; 2],
        }
    }

    /// Estimated pressures.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        self.pressures
    }

    /// One tick in which `sent` were the on-times last given out, with the piston at
    /// `stroke` (raw mm) and `speed` (raw mm/s).
    #[inline]
    pub fn follow(&mut self, model: &AxisModel, stroke: i32, speed: i32, sent: &OnTimes) {
        self.flows = [ChamberFlows::default(); 2];
        let passed = self.after(model, self.opening, stroke, speed, model.times.tick);
        // Never below half the atmosphere: a vacuum needs a motion of its own.
        let least = model.ambient.wrapping_shr(1);
        self.pressures = Pressures {
            a: passed.a.max(least).min(MOST),
            b: passed.b.max(least).min(MOST),
        };
        for ((opening, valve), &on) in self.opening.iter_mut().zip(&mut self.valves).zip(sent) {
            *opening = valve.advance(self.now, i32::from(on), &model.times);
        }
        self.now = self.now.wrapping_add(model.times.tick as u32);
    }

    /// Pressures at the end of the dead time, with what has been committed to by
    /// then; the piston is at `stroke` then, and moves at `speed` until then.
    #[inline]
    pub fn ahead(&mut self, model: &AxisModel, stroke: i32, speed: i32) -> Pressures {
        let mut open = self.opening;
        for (open, valve) in open.iter_mut().zip(&self.valves) {
            *open = open.wrapping_add(valve.committed(self.now, &model.times));
        }
        self.after(model, open, stroke, speed, model.horizon_us)
    }

    /// Pressures after the valves were `open` and the piston moved at `speed` for
    /// `span` µs. Flows are those at the present pressures.
    // One copy, compiled for speed: inlined, it would be where it is called.
    #[inline(never)]
    fn after(
        &mut self,
        model: &AxisModel,
        open: [i32; 4],
        stroke: i32,
        speed: i32,
        span: i32,
    ) -> Pressures {
        let [fill_a, vent_a, fill_b, vent_b] = open;
        let Pressures { a, b } = self.pressures;
        let [flows_a, flows_b] = &mut self.flows;
        flows_a.want(model, model.flow_a, a, wanted(fill_a, vent_a));
        flows_b.want(model, model.flow_b, b, wanted(fill_b, vent_b));
        let squeeze_a = power(a, speed.saturating_neg());
        let squeeze_b = power(b, speed);
        let (stiff_a, stiff_b) = (model.stiffness_a(stroke), model.stiffness_b(stroke));
        let change_a = flows_a.change([fill_a, vent_a], squeeze_a, span, stiff_a);
        let change_b = flows_b.change([fill_b, vent_b], squeeze_b, span, stiff_b);
        self.stiffness = [stiff_a, stiff_b];
        Pressures {
            a: a.saturating_add(change_a),
            b: b.saturating_add(change_b),
        }
    }

    /// On-times of the next tick that bring the chambers from `expected`, where they were
    /// last looked [`Air::ahead`] to, to `target`.
    #[inline]
    pub fn pulses(&mut self, model: &AxisModel, expected: Pressures, target: Pressures) -> OnTimes {
        let [fill_a, vent_a, fill_b, vent_b] = &self.valves;
        let [flows_a, flows_b] = &mut self.flows;
        let [stiff_a, stiff_b] = self.stiffness;
        let change = target.a.saturating_sub(expected.a);
        flows_a.want(
            model,
            model.flow_a,
            self.pressures.a,
            wanted(change, change.saturating_neg()),
        );
        let needs = flows_a.needs(change, stiff_a);
        let [first, second] = pair(model, self.now, needs, fill_a, vent_a);
        let change = target.b.saturating_sub(expected.b);
        flows_b.want(
            model,
            model.flow_b,
            self.pressures.b,
            wanted(change, change.saturating_neg()),
        );
        let needs = flows_b.needs(change, stiff_b);
        let [third, fourth] = pair(model, self.now, needs, fill_b, vent_b);
        [first, second, third, fourth]
    }

    /// Everything shut as soon as the pulses under way allow.
    #[inline]
    #[must_use]
    pub fn shut(&self, model: &AxisModel) -> OnTimes {
        let mut on = [0; 4];
        for (on, valve) in on.iter_mut().zip(&self.valves) {
            *on = microseconds(valve.on_time(self.now, 0, true, &model.times));
        }
        on
    }
}

#[inline]
const fn wanted(fill: i32, vent: i32) -> Wanted {
    Wanted {
        fill: fill > 0,
        vent: vent > 0,
    }
}

/// On-times of a chamber's two valves for the openings that they need, µs.
#[inline]
fn pair(
    model: &AxisModel,
    now: u32,
    needs: [i32; 2],
    fill: &ValveTrack,
    vent: &ValveTrack,
) -> [u16; 2] {
    let [fill_need, vent_need] = needs;
    [
        microseconds(fill.on_time(now, fill_need, vent.coil(), &model.times)),
        microseconds(vent.on_time(now, vent_need, fill.coil(), &model.times)),
    ]
}

/// An on-time, 0…tick (at most 2000).
#[inline]
const fn microseconds(on: i32) -> u16 {
    on as u16
}
