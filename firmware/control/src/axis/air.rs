//! The air of a cylinder: what was sent to the valves, followed into the chambers.

use super::gas::{ChamberFlows, Pressures, Wanted, power};
use super::model::AxisModel;
use super::valves::ValveTrack;
use super::{mix, part};
use crate::pwm::OnTimes;

/// Highest pressure that is followed, 1/256 Pa (2.1 MPa).
const MOST: i32 = (1 << 29) - 1;

/// Pulses under way and pressures; valves in the order of [`OnTimes`].
///
/// Pressures are those of a moment of each period, [`AxisModel::moment`] after it begins.
#[derive(Clone, Debug)]
pub struct Air {
    valves: [ValveTrack; 4],
    /// Begin of the next period, µs; wraps.
    next: u32,
    /// Sum of the pulses and of that begin.
    check: u32,
    pressures: Pressures,
    /// Open times in the period that ends at the moment, µs.
    open: [i32; 4],
    /// Open times committed to after the moment, µs.
    committed: [i32; 4],
    /// Flows of A and B at these pressures, as far as they are known.
    flows: [ChamberFlows; 2],
    /// Stiffness of A and B where they were last looked ahead to.
    stiffness: [i32; 2],
}

impl Air {
    /// Valves shut, chambers at `pressure` (1/256 Pa absolute).
    #[must_use]
    pub fn new(pressure: i32) -> Self {
        let mut air = Self {
            valves: [ValveTrack::new(); 4],
            next: 0,
            check: 0,
            pressures: Pressures {
                a: pressure,
                b: pressure,
            },
            open: [0; 4],
            committed: [0; 4],
            flows: [ChamberFlows::default(); 2],
            stiffness: [0; 2],
        };
        air.check = air.sum_of_pulses();
        air
    }

    /// Estimated pressures.
    #[must_use]
    pub const fn pressures(&self) -> Pressures {
        self.pressures
    }

    /// Sum of the pulses under way.
    #[inline]
    fn sum_of_pulses(&self) -> u32 {
        let [fill_a, vent_a, fill_b, vent_b] = &self.valves;
        let sum = mix(0, self.next.cast_signed());
        let sum = fill_a.sum(sum);
        let sum = vent_a.sum(sum);
        let sum = fill_b.sum(sum);
        vent_b.sum(sum)
    }

    /// Whether the pulses under way are as they were left.
    #[inline]
    #[must_use]
    pub fn pulses_are_sound(&self) -> bool {
        self.check == self.sum_of_pulses()
    }

    /// Sum of all that one stroke leaves to the next, but the pulses.
    #[inline]
    pub(super) fn sum(&self, sum: u32) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            valves: _,
            next: _,
            check: _,
            pressures: Pressures { a, b },
            open,
            committed,
            flows: [flows_a, flows_b],
            stiffness: [stiff_a, stiff_b],
        } = self;
        let mut sum = mix(mix(sum, *a), *b);
        for (open, committed) in open.iter().zip(committed) {
            sum = mix(mix(sum, *open), *committed);
        }
        let sum = mix(mix(sum, flows_a.fill), flows_a.vent);
        let sum = mix(mix(sum, flows_b.fill), flows_b.vent);
        mix(mix(sum, *stiff_a), *stiff_b)
    }

    /// Coils that somebody else decides: those of the tick that begins `turn` ticks after
    /// the period.
    pub fn energise(&mut self, model: &AxisModel, turn: i32, sent: &OnTimes) {
        let now = self.edge(model, turn);
        let times = &model.times;
        self.change_pulses(|valve, index| {
            let on = sent.get(index).map_or(0, |&on| i32::from(on));
            valve.energise(now, on, times.tick, times);
        });
    }

    /// Somebody else decides from the tick on that begins `turn` ticks after the period, in
    /// which `sent` still acts: what was planned for later does not happen.
    #[cold]
    pub fn cut(&mut self, model: &AxisModel, turn: i32, sent: &OnTimes) {
        let now = self.edge(model, turn);
        let times = &model.times;
        self.change_pulses(|valve, index| {
            let on = sent.get(index).map_or(0, |&on| i32::from(on));
            if valve.coil() {
                valve.energise(now, on, times.tick, times);
            } else {
                valve.cut(now.wrapping_add(on as u32), times);
            }
        });
    }

    /// A change between two strokes. What was damaged before keeps its broken seal.
    fn change_pulses(&mut self, change: impl Fn(&mut ValveTrack, usize)) {
        let sound = self.pulses_are_sound();
        for (index, valve) in self.valves.iter_mut().enumerate() {
            change(valve, index);
        }
        if sound {
            self.check = self.sum_of_pulses();
        }
    }

    /// The coils are on for these times of the period that begins, from its begin, µs.
    #[inline]
    pub fn plan(&mut self, model: &AxisModel, on: &OnTimes) {
        let times = &model.times;
        for (valve, &on) in self.valves.iter_mut().zip(on) {
            valve.energise(self.next, i32::from(on), times.period, times);
        }
    }

    /// Edge of a tick of the present period, or the first of the next.
    const fn edge(&self, model: &AxisModel, turn: i32) -> u32 {
        let since = model.times.tick.wrapping_mul(turn);
        let begin = if turn == 0 {
            self.next
        } else {
            self.next.wrapping_sub(model.times.period as u32)
        };
        begin.wrapping_add(since as u32)
    }

    /// A period begins: what the chambers see of the pulses until the moment, and after it.
    #[inline]
    pub fn begin(&mut self, model: &AxisModel) {
        let times = &model.times;
        let now = self.next;
        self.next = now.wrapping_add(times.period as u32);
        let moment = now.wrapping_add(model.moment as u32);
        let from = moment.wrapping_sub(times.period as u32);
        let pairs = self.open.iter_mut().zip(&mut self.committed);
        for (valve, (open, committed)) in self.valves.iter_mut().zip(pairs) {
            *open = valve.passes(from, times.period);
            *committed = valve.committed(moment, self.next, times);
        }
        self.check = self.sum_of_pulses();
        self.flows = [ChamberFlows::default(); 2];
        let [fill_a, vent_a, fill_b, vent_b] = self.open;
        let [more_fill_a, more_vent_a, more_fill_b, more_vent_b] = self.committed;
        let Pressures { a, b } = self.pressures;
        let [flows_a, flows_b] = &mut self.flows;
        let wanted_a = wanted(fill_a | more_fill_a, vent_a | more_vent_a);
        flows_a.want(model, model.flow_a, a, wanted_a);
        let wanted_b = wanted(fill_b | more_fill_b, vent_b | more_vent_b);
        flows_b.want(model, model.flow_b, b, wanted_b);
    }

    /// Follows the chambers to the moment, with the piston at `stroke` (raw mm) and
    /// `speed` (raw mm/s) one period before.
    #[inline]
    pub fn follow(&mut self, model: &AxisModel, stroke: i32, speed: i32) {
        let middle = stroke.saturating_add(part(speed, model.period >> 1, 32));
        let passed = self.after(model, self.open, middle, speed, model.times.period);
        // Never below half the atmosphere: a vacuum needs a motion of its own.
        let least = model.ambient.wrapping_shr(1);
        self.pressures = Pressures {
            a: passed.a.max(least).min(MOST),
            b: passed.b.max(least).min(MOST),
        };
    }

    /// Pressures at the end of the dead time, with what has been committed to by
    /// then; the piston is at `stroke` then, and moves at `speed` until then.
    #[inline]
    pub fn ahead(&mut self, model: &AxisModel, stroke: i32, speed: i32) -> Pressures {
        self.after(model, self.committed, stroke, speed, model.horizon_us)
    }

    /// Pressures after the valves were `open` and the piston moved at `speed` for
    /// `span` µs. Flows are those at the pressures of the last moment.
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
        let [flows_a, flows_b] = &self.flows;
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

    /// On-times of the next period that bring the chambers from `expected`, where they were
    /// last looked [`Air::ahead`] to, to `target`.
    #[inline]
    pub fn pulses(&self, model: &AxisModel, expected: Pressures, target: Pressures) -> OnTimes {
        let [fill_a, vent_a, fill_b, vent_b] = &self.valves;
        let [mut flows_a, mut flows_b] = self.flows;
        let [stiff_a, stiff_b] = self.stiffness;
        let change = target.a.saturating_sub(expected.a);
        flows_a.want(
            model,
            model.flow_a,
            self.pressures.a,
            wanted(change, change.saturating_neg()),
        );
        let needs = flows_a.needs(change, stiff_a);
        let [first, second] = pair(model, self.next, needs, fill_a, vent_a);
        let change = target.b.saturating_sub(expected.b);
        flows_b.want(
            model,
            model.flow_b,
            self.pressures.b,
            wanted(change, change.saturating_neg()),
        );
        let needs = flows_b.needs(change, stiff_b);
        let [third, fourth] = pair(model, self.next, needs, fill_b, vent_b);
        [first, second, third, fourth]
    }

    /// Everything shut as soon as the pulses under way allow.
    #[inline]
    #[must_use]
    pub fn shut(&self, model: &AxisModel) -> OnTimes {
        let mut on = [0; 4];
        for (on, valve) in on.iter_mut().zip(&self.valves) {
            *on = microseconds(valve.on_time(self.next, 0, true, &model.times));
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
    next: u32,
    needs: [i32; 2],
    fill: &ValveTrack,
    vent: &ValveTrack,
) -> [u16; 2] {
    let [fill_need, vent_need] = needs;
    [
        microseconds(fill.on_time(next, fill_need, vent.coil(), &model.times)),
        microseconds(vent.on_time(next, vent_need, fill.coil(), &model.times)),
    ]
}

/// An on-time, 0…period (at most 8000).
#[inline]
const fn microseconds(on: i32) -> u16 {
    on as u16
}
