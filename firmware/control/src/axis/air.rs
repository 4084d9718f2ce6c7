//! The air of a cylinder: what was sent to the valves, followed into the chambers.

use super::gas::{ChamberFlows, power};
use super::mix;
use super::model::AxisModel;
use super::valves::{Ready, ValveTimes, ValveTrack};

/// Highest pressure that is followed, 1/256 Pa (2.1 MPa).
const MOST: i32 = (1 << 29) - 1;

/// A moment of the periods, µs; wraps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// Begin of the present period.
    pub(super) now: u32,
    /// Begin of the next one.
    pub(super) next: u32,
    /// The moment for which pressures are worked out: [`AxisModel::moment`] after the begin.
    pub(super) moment: u32,
}

/// What a chamber is told of its geometry and of the piston.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piston {
    /// Flow of an open valve as a speed of the piston, raw mm/s.
    pub(super) flow: i32,
    /// Length of the chamber in the middle of the period that ends at the moment, and where the
    /// dead time ends, raw mm.
    pub(super) lengths: [i32; 2],
    /// Speed at which the chamber shrinks, in that period and in the dead time, raw mm/s.
    pub(super) speeds: [i32; 2],
    /// Not 0: the stroke has time for the flows of valves that are shut.
    pub(super) all_flows: i32,
}

/// Pulses under way and pressure of one chamber.
#[derive(Clone, Debug)]
pub(super) struct Chamber {
    fill: ValveTrack,
    vent: ValveTrack,
    /// Sum of the pulses.
    pulses_check: u32,
    /// Pressure at the moment, 1/256 Pa.
    pub(super) pressure: i32,
    /// The same at the end of the dead time, with what has been committed to by then.
    pub(super) expected: i32,
    /// Sum of the pressures.
    pressures_check: u32,
    /// Flows at this pressure, as far as they are known.
    flows: ChamberFlows,
    /// Stiffness at the end of the dead time.
    stiffness: i32,
    /// What the valves can do in the next period.
    ready: [Ready; 2],
    /// Sum of these three.
    means_check: u32,
}

impl Chamber {
    /// Valves shut, at `pressure` (1/256 Pa absolute).
    pub(super) fn new(pressure: i32) -> Self {
        let mut chamber = Self {
            fill: ValveTrack::new(),
            vent: ValveTrack::new(),
            pulses_check: 0,
            pressure,
            expected: pressure,
            pressures_check: 0,
            flows: ChamberFlows::default(),
            stiffness: 0,
            ready: [Ready::default(); 2],
            means_check: 0,
        };
        chamber.pulses_check = chamber.sum_of_pulses();
        chamber.pressures_check = chamber.sum_of_pressures();
        chamber.means_check = chamber.sum_of_means();
        chamber
    }

    /// Flips a bit of one of the words that only this file sees, for tests of those who keep it.
    #[cfg(test)]
    pub(super) const fn damage(&mut self, word: u32, bit: u32) {
        let flip = 1 << bit;
        match word {
            0 => self.flows.fill ^= flip,
            1 => self.flows.vent ^= flip,
            2 => self.stiffness ^= flip,
            3 => self.means_check ^= flip.cast_unsigned(),
            4 => self.pressures_check ^= flip.cast_unsigned(),
            _ => self.pulses_check ^= flip.cast_unsigned(),
        }
    }

    /// Tracks of fill and vent, for tests of what is sent.
    #[cfg(test)]
    pub(super) const fn tracks(&self) -> [ValveTrack; 2] {
        [self.fill, self.vent]
    }

    #[inline]
    fn sum_of_pulses(&self) -> u32 {
        self.vent.sum(self.fill.sum(0))
    }

    #[inline]
    const fn sum_of_pressures(&self) -> u32 {
        mix(mix(0, self.pressure), self.expected)
    }

    #[inline]
    const fn sum_of_means(&self) -> u32 {
        let ChamberFlows { fill, vent } = self.flows;
        let [first, second] = self.ready;
        let sum = mix(mix(mix(0, fill), vent), self.stiffness);
        mix(mix(sum, first.word()), second.word())
    }

    /// Whether the pulses under way are as they were left.
    #[inline]
    pub(super) fn pulses_are_sound(&self) -> bool {
        self.pulses_check == self.sum_of_pulses()
    }

    /// Whether the pressures are as they were left.
    #[inline]
    pub(super) const fn pressures_are_sound(&self) -> bool {
        self.pressures_check == self.sum_of_pressures()
    }

    /// Whether what the next pulses are made with is as it was left.
    #[inline]
    pub(super) const fn means_are_sound(&self) -> bool {
        self.means_check == self.sum_of_means()
    }

    /// Coils fall that are on, after these times from `now` on, fill and vent, µs, and nothing that
    /// was planned for later happens. `plan` is what the present period began with, and when,
    /// if it is not yet known here. What was damaged before keeps its broken seal.
    #[cold]
    #[inline(never)]
    pub(super) fn end(
        &mut self,
        now: u32,
        on: [u16; 2],
        plan: Option<(u32, [u16; 2])>,
        times: &ValveTimes,
    ) {
        let sound = self.pulses_are_sound();
        let [fill, vent] = on.map(i32::from);
        if let Some((begun, plan)) = plan {
            let [fill, vent] = plan.map(i32::from);
            self.fill.energise(begun, fill, times.period, times);
            self.vent.energise(begun, vent, times.period, times);
        }
        self.fill.end(now.wrapping_add(fill as u32), times);
        self.vent.end(now.wrapping_add(vent as u32), times);
        if sound {
            self.pulses_check = self.sum_of_pulses();
        }
    }

    /// Pressure at the moment, where somebody else than the law has had the valves open for these
    /// times, fill and vent, µs. They come on top of what is left of the law's own pulses. Nothing
    /// is foreseen.
    #[inline(never)]
    pub(super) fn observe(
        &mut self,
        model: &AxisModel,
        clock: &Clock,
        piston: &Piston,
        open: [u16; 2],
    ) {
        let Clock { next, moment, .. } = *clock;
        let from = moment.wrapping_sub(model.times.period as u32);
        let [fill_on, vent_on] = open.map(i32::from);
        if fill_on | vent_on != 0 {
            // The law waits until they have shut.
            self.fill.shuts(next);
            self.vent.shuts(next);
        }
        let fill = self
            .fill
            .passes(from, model.times.period)
            .wrapping_add(fill_on);
        let vent = self
            .vent
            .passes(from, model.times.period)
            .wrapping_add(vent_on);
        self.pulses_check = self.sum_of_pulses();

        let [length, _] = piston.lengths;
        let [speed, _] = piston.speeds;
        let p = self.pressure;
        let flows = ChamberFlows::of(model, piston.flow, p, fill > 0, vent > 0);
        let stiffness = model.stiffness(length);
        let change = flows.change([fill, vent], power(p, speed), model.times.period, stiffness);
        let (least, most) = bounds(model, fill, vent);
        self.pressure = p.saturating_add(change).max(least).min(most);
        self.expected = self.pressure;
        self.pressures_check = self.sum_of_pressures();
    }

    /// Pressures at the moment and at the end of the dead time, and what the next pulses are
    /// made with.
    // Called in one place.
    #[inline(always)]
    pub(super) fn follow(
        &mut self,
        model: &AxisModel,
        clock: &Clock,
        piston: &Piston,
        plan: [u16; 2],
    ) {
        let times = &model.times;
        let Clock { now, next, moment } = *clock;
        let from = moment.wrapping_sub(times.period as u32);
        let Self { fill, vent, .. } = self;
        let [fill_on, vent_on] = plan.map(i32::from);
        fill.energise(now, fill_on, times.period, times);
        vent.energise(now, vent_on, times.period, times);
        let open = [
            fill.passes(from, times.period),
            vent.passes(from, times.period),
        ];
        let committed = [
            fill.committed(moment, next, times),
            vent.committed(moment, next, times),
        ];
        self.ready = [fill.ready(next, times), vent.ready(next, times)];
        self.pulses_check = self.sum_of_pulses();

        let Piston {
            flow,
            lengths,
            speeds: [speed, speed_ahead],
            all_flows,
        } = *piston;
        let [length, length_ahead] = lengths;
        let stiffness = model.stiffness(length);
        let ahead = model.stiffness(length_ahead);
        let p = self.pressure;
        let [[fill, vent], [more_fill, more_vent]] = [open, committed];
        // At the mean pressure of the two steps: the end of the second was foreseen a period ago.
        let flows = ChamberFlows::of(
            model,
            flow,
            p.saturating_add(self.expected) >> 1,
            fill | more_fill | all_flows != 0,
            vent | more_vent | all_flows != 0,
        );
        let change = flows.change(open, power(p, speed), times.period, stiffness);
        // Those of the second step for both, which cost the tick too much apart: while a valve is
        // about to open, the piston does not squeeze beyond what it will let.
        let (least, most) = bounds(model, fill | more_fill, vent | more_vent);
        let p = p.saturating_add(change).max(least).min(most);
        let change = flows.change(committed, power(p, speed_ahead), model.horizon_us, ahead);
        self.flows = flows;
        self.stiffness = ahead;
        self.means_check = self.sum_of_means();
        self.pressure = p;
        self.expected = p.saturating_add(change).max(least).min(most);
        self.pressures_check = self.sum_of_pressures();
    }

    /// On-times of the next period that bring the chamber from what is expected to `target`,
    /// fill and vent, µs. The valve that would undo it shuts as soon as its pulse allows.
    #[inline]
    pub(super) fn pulses(&self, model: &AxisModel, flow: i32, target: i32) -> [u16; 2] {
        let change = target.saturating_sub(self.expected);
        let [ready_fill, ready_vent] = self.ready;
        let times = &model.times;
        if change > 0 {
            let power = match self.flows.fill {
                0 => model.curve.power(model.supply, self.pressure, flow),
                known => known,
            };
            let need = ChamberFlows::need(power, change, self.stiffness);
            [
                microseconds(ready_fill.on_time(need, ready_vent.coil(), times)),
                microseconds(ready_vent.rest(times)),
            ]
        } else {
            let power = match self.flows.vent {
                0 => model.curve.power(self.pressure, model.ambient, flow),
                known => known,
            };
            let need = ChamberFlows::need(power, change.saturating_neg(), self.stiffness);
            [
                microseconds(ready_fill.rest(times)),
                microseconds(ready_vent.on_time(need, ready_fill.coil(), times)),
            ]
        }
    }

    /// Whether both coils are off at the begin of the next period.
    #[inline]
    pub(super) const fn idle(&self) -> bool {
        let [fill, vent] = self.ready;
        !fill.coil() && !vent.coil()
    }

    /// Everything shut as soon as the pulses under way allow.
    #[inline]
    pub(super) fn shut(&self, model: &AxisModel) -> [u16; 2] {
        let times = &model.times;
        self.ready.map(|ready| microseconds(ready.rest(times)))
    }
}

/// Bounds of a pressure while valves are open, or are to be, for `fill` and `vent` µs. None fills beyond the supply or
/// vents below the atmosphere, however long a step is for a small chamber; and a vacuum of more than
/// half of that needs a motion of its own.
#[inline]
fn bounds(model: &AxisModel, fill: i32, vent: i32) -> (i32, i32) {
    (
        if vent > 0 {
            model.ambient
        } else {
            model.ambient.wrapping_shr(1)
        },
        if fill > 0 { model.supply } else { MOST },
    )
}

/// An on-time, 0…period (at most 8000).
#[inline]
const fn microseconds(on: i32) -> u16 {
    on as u16
}
