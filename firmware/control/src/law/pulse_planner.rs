//! Pulse planner: from the pressure that a chamber lacks to the on-times of the next period.
//!
//! ```text
//! opening = (p* − p expected) / ṗ         ṗ = n K p_s ψ(p/p_s) / L to fill, −n K p ψ(p_a/p) / L to vent
//! on-time = opening + t_on − t_off        at least t_on + margin; gaps at least t_off + margin
//! ```
//!
//! Times in s, pressures in Pa, ṗ in Pa/s: the inverse of [`crate::observer::pressure`], with its symbols, at the mean
//! of the present and the expected pressure. L: length of the chamber at the end of the dead time. Source: this
//! project, decision 7; flow by ISO 6358-1.
//!
//! Pulses are timed to the microsecond and may outlast a period. The rest of a pulse is decided again in the next
//! period, when it may be lengthened, but not cut to less than the shortest pulse. An opening below the shortest (the
//! shortest on-time − t_on + t_off) is rounded to that or to nothing, whichever is nearer.
//!
//! Each chamber is planned by itself, for its own pressure. The coils of its two valves are never on together: the
//! valve that would undo a change goes off as soon as its own pulse allows, and the other one waits for that. Near the
//! target (`standstill` has counted more than four periods within 24 bands), and with no coil on, only the longer of
//! the two chambers' pulses is sent: both may be too much with valves that cannot open for less. A preload sends both.
//! A valve still shutting does not keep the other one's coil off: their openings overlap where t_off is longer than
//! t_on.
//!
//! **Grain.** A chamber has half of a force to make (`allocation`), and is left alone if half of its shortest opening
//! would already be too much. So the least force that makes a pulse is about that of one shortest opening, F_1 of
//! `switching_curve`. A smaller demand is not stored: the next period demands again, and on a standing piston the
//! break-away ramp adds to it (`inverse_dynamics`) until it makes a pulse or `standstill` lets the piston rest. Pulses
//! of A and B with opposing forces occur where both pressures are to rise, or both to fall; only `inching` chooses them
//! deliberately, for the small difference of their forces.
//!
//! Assumes: a constant flow over the pulse; the effect of the piston's motion on the pressure only through the expected
//! pressure; valve delays as specified, within their margin; supply and atmosphere as specified. If the supply falls, a
//! fill valve passes less than planned while the observer counts what was planned. Only the observed motion corrects
//! this: through the load while the piston slides, through the ramp while it stands. Vent valves do what they should.
//!
//! Config [`AxisModel`]; no state: what a valve can do follows from its track. Update [`plan`].

use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::observer::Observer;
use crate::observer::pressure::{Chamber, Pressures};
use crate::observer::valve_delay::{ValveTimes, ValveTrack};
use crate::pwm::OnTimes;
use crate::tuning::{OPENING_LONGEST, PRESSURE_RATE_LEAST, PULSE_LENGTHENED_LEAST};

/// What a valve can do in the next period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ready {
    /// Its coil is on; this much is left of its shortest pulse, µs.
    On(i32),
    /// It has been shut for long enough to begin a pulse.
    Shut,
    /// It has been off for too short a time: it would not shut before a new pulse.
    Shuts,
}

impl Ready {
    /// State in the period that begins at `next`, up to which the coil has been decided.
    fn of(track: &ValveTrack, next: u32, times: &ValveTimes) -> Self {
        let elapsed = track.elapsed(next);
        if track.coil() {
            Self::On((times.shortest_pulse as u32).saturating_sub(elapsed) as i32)
        } else if elapsed < times.shortest_gap as u32 {
            Self::Shuts
        } else {
            Self::Shut
        }
    }

    /// On-time in the period if nothing is to open beyond what is [`ValveTrack::committed`].
    fn rest(self, times: &ValveTimes) -> u16 {
        match self {
            Self::On(left) => microseconds(left, times),
            Self::Shut | Self::Shuts => 0,
        }
    }

    /// On-time in the period for `need` µs of opening beyond what is [`ValveTrack::committed`]; `rival` is the
    /// chamber's other valve.
    fn on_time(self, need: i32, rival: Self, times: &ValveTimes) -> u16 {
        match self {
            Self::On(left) if need < PULSE_LENGTHENED_LEAST => microseconds(left, times),
            Self::On(left) => microseconds(left.saturating_add(need), times),
            Self::Shut if !matches!(rival, Self::On(_)) => {
                let shortest = times.shortest_opening();
                // Rounds to what can be made; the error is at most half of it.
                if need <= shortest >> 1 {
                    return 0;
                }
                microseconds(on_for(need.max(shortest), times), times)
            }
            Self::Shut | Self::Shuts => 0,
        }
    }
}

/// On-time, µs, that opens a shut valve for this many µs.
pub(super) fn on_for(opening: i32, times: &ValveTimes) -> i32 {
    opening.saturating_add(times.on).saturating_sub(times.off)
}

/// Limits an on-time to 0…period (at most 8000).
fn microseconds(on: i32, times: &ValveTimes) -> u16 {
    on.max(0).min(times.period) as u16
}

/// What both valves of a chamber can do.
fn ready(chamber: &Chamber, next: u32, times: &ValveTimes) -> [Ready; 2] {
    [&chamber.fill, &chamber.vent].map(|track| Ready::of(track, next, times))
}

/// Rate of pressure change through an open valve of this `power` in a chamber of `n_per_length`, 1/256 Pa per 16 µs.
fn rate(power: i32, n_per_length: i32) -> i32 {
    // 2^8 Pa mm/s × n/L.
    mul_shr(power, n_per_length, 22).max(PRESSURE_RATE_LEAST)
}

/// Opening, µs, in which an open valve of this `power` changes the pressure by `change` (1/256 Pa, not negative) in a
/// chamber of `n_per_length`.
fn opening(power: i32, change: i32, n_per_length: i32) -> i32 {
    // Limited to 5 bar: below 2^31, and more than a period can make.
    let size = change.min(500_000 << 8).wrapping_shl(4);
    size.checked_div(rate(power, n_per_length)).unwrap_or(0)
}

/// On-times of the next period, fill and vent, that bring a chamber of `length` (raw mm) from its expected pressure to
/// `target`.
fn pulses(
    model: &AxisModel,
    chamber: &Chamber,
    [choked_speed, length]: [i32; 2],
    target: i32,
    next: u32,
) -> [u16; 2] {
    let times = &model.times;
    let [fill, vent] = ready(chamber, next, times);
    let n_per_length = model.exponent_per_length(length);
    let change = target.saturating_sub(chamber.expected);
    // At the mean of the pressures now and at the end of the dead time.
    let mean = chamber.pressure.saturating_add(chamber.expected) >> 1;
    if change > 0 {
        let need = opening(model.fill_power(choked_speed, mean), change, n_per_length);
        [fill.on_time(need, vent, times), vent.rest(times)]
    } else {
        let need = opening(
            model.vent_power(choked_speed, mean),
            change.saturating_neg(),
            n_per_length,
        );
        [fill.rest(times), vent.on_time(need, fill, times)]
    }
}

/// On-times of the next period, which begins at `next`, for these pressures.
pub(super) fn plan(
    model: &AxisModel,
    observer: &Observer,
    target: Pressures,
    next: u32,
    near: bool,
) -> OnTimes {
    let Observer { a, b, .. } = observer;
    let end = observer.end_of_dead_time(model);
    let [fill_a, vent_a] = pulses(
        model,
        a,
        [model.choked_speed_a, model.length_a(end)],
        target.a,
        next,
    );
    let [fill_b, vent_b] = pulses(
        model,
        b,
        [model.choked_speed_b, model.length_b(end)],
        target.b,
        next,
    );
    let idle = |chamber: &Chamber| !chamber.fill.coil() && !chamber.vent.coil();
    if near && fill_a | vent_a != 0 && fill_b | vent_b != 0 && idle(a) && idle(b) {
        return if fill_a.max(vent_a) > fill_b.max(vent_b) {
            [fill_a, vent_a, 0, 0]
        } else {
            [0, 0, fill_b, vent_b]
        };
    }
    [fill_a, vent_a, fill_b, vent_b]
}

/// An open valve of a piston at rest, at the expected pressure of its chamber.
#[derive(Clone, Copy, Debug)]
pub(super) struct Valve {
    /// Power over area, as given by [`AxisModel::fill_power`].
    power: i32,
    /// [`AxisModel::exponent_per_length`] of the chamber.
    n_per_length: i32,
    /// mN per 1/256 Pa, × 2^32.
    force: i32,
    /// 1/256 Pa per mN, × 2^12.
    pressure: i32,
    /// Opening of the shortest pulse, µs.
    shortest: i32,
}

impl Valve {
    /// Change of force that the shortest opening makes, mN, not negative.
    pub(super) fn finest(&self) -> i32 {
        let rate = rate(self.power, self.n_per_length);
        mul_shr(mul_shr_sat(rate, self.shortest, 4), self.force, 32)
    }

    /// Pressure that makes this force, mN, in 1/256 Pa.
    pub(super) fn pressure(&self, force: i32) -> i32 {
        mul_shr_sat(force, self.pressure, 12)
    }

    /// Opening, µs, that changes the pressure by `change` (1/256 Pa), at least the shortest.
    pub(super) fn opening(&self, change: i32) -> i32 {
        opening(self.power, change, self.n_per_length)
            .max(self.shortest)
            .min(OPENING_LONGEST)
    }
}

/// The four valves.
pub(super) fn valves(model: &AxisModel, observer: &Observer) -> [Valve; 4] {
    let stroke = observer.motion.stroke;
    let (a, b) = (observer.a.expected, observer.b.expected);
    let (speed_a, speed_b) = (model.choked_speed_a, model.choked_speed_b);
    let of = |[fill, vent]: [i32; 2], length: i32, force: i32, pressure: i32| {
        let n_per_length = model.exponent_per_length(length);
        [fill, vent].map(|power| Valve {
            power,
            n_per_length,
            force,
            pressure,
            shortest: model.times.shortest_opening(),
        })
    };
    let [fill_a, vent_a] = of(
        [model.fill_power(speed_a, a), model.vent_power(speed_a, a)],
        model.length_a(stroke),
        model.force_a,
        model.pressure_a,
    );
    let [fill_b, vent_b] = of(
        [model.fill_power(speed_b, b), model.vent_power(speed_b, b)],
        model.length_b(stroke),
        model.force_b,
        model.pressure_b,
    );
    [fill_a, vent_a, fill_b, vent_b]
}

/// Whether every valve can begin a pulse in the period that begins at `next`.
pub(super) fn all_ready(model: &AxisModel, observer: &Observer, next: u32) -> bool {
    [&observer.a, &observer.b].iter().all(|chamber| {
        ready(chamber, next, &model.times)
            .iter()
            .all(|valve| *valve == Ready::Shut)
    })
}

/// Shuts everything as soon as the pulses under way allow.
pub(super) fn shut(model: &AxisModel, observer: &Observer, next: u32) -> OnTimes {
    let times = &model.times;
    let rest = |chamber: &Chamber| ready(chamber, next, times).map(|valve| valve.rest(times));
    let ([fill_a, vent_a], [fill_b, vent_b]) = (rest(&observer.a), rest(&observer.b));
    [fill_a, vent_a, fill_b, vent_b]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use crate::law::allocation::targets;
    use wheeleg_units::Micros;

    const TIMES: ValveTimes = ValveTimes {
        tick: 1000,
        period: 4000,
        on: 3500,
        off: 2000,
        line: 900,
        shortest_pulse: 3850,
        shortest_gap: 2350,
    };

    /// A pulse is sent from half of the shortest opening upwards. It is never shorter than the shortest, nor longer
    /// than the period.
    #[test]
    fn a_pulse_is_worth_its_opening() {
        let on = |need| Ready::Shut.on_time(need, Ready::Shut, &TIMES);
        let shortest = TIMES.shortest_opening();
        assert_eq!(shortest, 2350);
        assert_eq!(
            (on(shortest / 2), on(shortest / 2 + 1), on(2350)),
            (0, 3850, 3850)
        );
        assert_eq!((on(2400), on(60_000)), (3900, 4000));
        assert_eq!(Ready::Shuts.on_time(2400, Ready::Shut, &TIMES), 0);
        assert_eq!(Ready::Shut.on_time(2400, Ready::On(0), &TIMES), 0);
    }

    /// Where nothing flows any more, the rate is taken as 50 Pa per millisecond.
    #[test]
    fn a_chamber_at_its_end_asks_for_a_pulse_that_ends() {
        let ms = opening(0, 1000 << 8, 1 << 20);
        assert!((ms - 20_000).abs() < 100, "{ms}");
    }

    /// For a piston in balance at mid stroke the least force that makes a pulse is that of the finest pulse: each
    /// chamber has half of it to make, and half of what its shortest opening makes is enough for a pulse.
    #[test]
    fn the_least_force_that_makes_a_pulse_is_that_of_the_finest() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let mut observer = Observer::new(&model, targets(&model, 0));
        observer.start_at(model.stroke / 2);
        for sign in [-1, 1] {
            let makes_a_pulse = |force: &i32| {
                let target = targets(&model, sign * force);
                plan(&model, &observer, target, 0, true) != [0; 4]
            };
            let least = (0..5_000).find(makes_a_pulse).expect("a pulse");
            let share = f64::from(least) / f64::from(model.pulse_force);
            assert!((0.9..1.25).contains(&share), "{sign}: {share}");
        }
    }

    #[test]
    fn a_pulse_under_way_is_lengthened_by_what_is_worth_it() {
        let on = |need| Ready::On(850).on_time(need, Ready::Shut, &TIMES);
        assert_eq!((on(19), on(20), on(9000)), (850, 870, 4000));
        assert_eq!(Ready::On(850).rest(&TIMES), 850);
    }
}
