//! Inching: on coarse valves the piston approaches its target in steps, with the valves shut between them.
//!
//! ```text
//!          |e| < 20 bands, |v| < 120 mm/s            at rest for 2 periods
//!  AWAY ─────────────────────────────────► WAIT ◄────────────────────────► PULSES
//!    ▲                                       │          all are sent
//!    └──── |e| > 80 bands, another target ───┘
//!
//! coarse:  F_1 > 1.3 Fb, and half of the acceleration is not enough
//! ΔF    = 0.6 k_air |e| + Fc                             towards the target
//! F_i   = A_i |ṗ_i| (t_off + margin)                     the finest pulse of valve i, now
//! ```
//!
//! e: error, mm; v: speed, mm/s; F_1, and when half of the acceleration is enough: `switching_curve`; Fb, Fc:
//! break-away and Coulomb friction in use, mN; k_air: stiffness of the air in both shut chambers, mN/mm
//! ([`Observer::stiffness`]); A, ṗ: area of a chamber, and rate of pressure change through an open valve, as in
//! `pulse_planner`.
//!
//! The position servo demands a force in every period. Where the finest pulse makes more force than friction can hold
//! and the mass is small, the result is a limit cycle: each pulse is answered by one from another valve a dead time
//! later, and the piston drifts along, or stands because m a* + Fc is less than a pulse. Inching demands the force only
//! once, and from the distance: the change that moves the piston by e against its air spring and its friction. Without
//! damping half of the spring's force would be enough, with heavy damping all of it is needed (the share is searched).
//! The valves then stay shut until the piston has come to rest.
//!
//! **Which valves.** Fill the drive chamber or vent the counter chamber, if ΔF is at least 0.8 of the finest pulse of
//! that valve and its chamber has room. If both are possible, fill when the mean of the pressures is below the middle,
//! otherwise vent, so that the pressures stay about it. If neither is possible, use a *vernier* pair: both chambers are
//! filled, or both vented, starting together, and the difference of their forces acts. All openings are sent as
//! planned, unless `standstill` shuts the valves. A step waits until the air has come to rest and all valves are ready.
//!
//! `standstill` has priority: where it holds the valves shut (CATCH, PAUSE, REST), the rest of the pulses is dropped.
//! The state is AWAY while a preload or a seat decides, while the reference moves, and after a new target. The
//! break-away ramp and patience continue as they would without inching.
//!
//! Assumes: flows that stay constant over the pulse, friction as in use. Whether valves are coarse may change as
//! friction is learnt or a foot lands; a step under way is then dropped. The net force on a piston at rest can be anywhere within its
//! friction; it is taken as zero (estimates from the observer, or from the effect of the last step, did worse). If the
//! supply is lower, a filling pulse does less than planned, and another step follows.
//!
//! Source: stepwise positioning of a drive with stiction (impulse control: Armstrong-Hélouvry et al., Automatica 30,
//! 1994, section 4.5); the vernier pair: `docs/decisions/0064-inching-on-coarse-valves.md`.
//!
//! Config [`AxisModel`], state [`Inching`], update [`Inching::update`].

use super::pulse_planner::{self, Valve};
use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::observer::Observer;
use crate::pwm::OnTimes;
use crate::tuning::{
    INCH_AIR_RESTS, INCH_BANDS, INCH_COARSE, INCH_ENDS_BANDS, INCH_FITS, INCH_SPEED, INCH_SPRING,
    INCH_STILL_PERIODS, STILL_SPEED,
};

/// State of inching.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum State {
    /// The position servo acts.
    #[default]
    Away,
    /// Valves shut, until the piston has stood still for enough periods; `still` counts them.
    Wait { still: u16 },
    /// Pulses are under way; `left` is the rest of their on-times, µs.
    Pulses { left: [i32; 4] },
}

/// Steps towards a target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Inching {
    state: State,
}

/// What a step demands for the next period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inch {
    /// All valves shut.
    Wait,
    /// These on-times.
    Pulses(OnTimes),
}

/// Whether these valves are coarse for a piston, for which half of the acceleration may be enough or not.
pub(super) fn is_coarse(model: &AxisModel, half_is_enough: bool) -> bool {
    let much = mul_shr_sat(model.breakaway, INCH_COARSE, 16);
    model.pulse_force > much && !half_is_enough && !is_without(Part::Inching)
}

impl Inching {
    /// Something else holds the valves shut: ends a step under way.
    pub(super) fn interrupt(&mut self) {
        if !matches!(self.state, State::Away) {
            self.state = State::Wait { still: 0 };
        }
    }

    /// One period in which the piston is to come to rest at `reference` (raw mm); the next period begins at `next`.
    /// `None`: the position servo acts.
    pub(super) fn update(
        &mut self,
        model: &AxisModel,
        observer: &Observer,
        reference: i32,
        next: u32,
    ) -> Option<Inch> {
        let error = reference.saturating_sub(observer.motion.stroke);
        let size = error.saturating_abs();
        let speed = observer.motion.speed.wrapping_abs();
        // A band is at most 5 mm, below 2^19; times up to 80 it fits.
        if size > model.band.wrapping_mul(INCH_ENDS_BANDS) {
            self.state = State::Away;
        } else if matches!(self.state, State::Away)
            && size < model.band.wrapping_mul(INCH_BANDS)
            && speed < INCH_SPEED
        {
            self.state = State::Wait { still: 0 };
        }
        let left = match self.state {
            State::Away => return None,
            State::Pulses { left } => left,
            State::Wait { still } => {
                let rests = speed < STILL_SPEED
                    && air_rests(observer)
                    && pulse_planner::all_ready(model, observer, next);
                let still = if rests { still.saturating_add(1) } else { 0 };
                if still < INCH_STILL_PERIODS {
                    self.state = State::Wait { still };
                    return Some(Inch::Wait);
                }
                on_times(model, openings(model, observer, error))
            }
        };
        let period = model.times.period;
        let later = left.map(|on| on.saturating_sub(period).max(0));
        self.state = if later == [0; 4] {
            State::Wait { still: 0 }
        } else {
            State::Pulses { left: later }
        };
        // At most a period, 8000 µs.
        Some(Inch::Pulses(left.map(|on| on.min(period) as u16)))
    }
}

/// Whether no pulse will change the pressures any more.
fn air_rests(observer: &Observer) -> bool {
    let (now, then) = (observer.pressures(), observer.expected());
    let rests = |now: i32, then: i32| then.saturating_sub(now).saturating_abs() <= INCH_AIR_RESTS;
    rests(now.a, then.a) && rests(now.b, then.b)
}

/// On-times of these openings, µs.
fn on_times(model: &AxisModel, openings: [i32; 4]) -> [i32; 4] {
    openings.map(|open| {
        if open > 0 {
            pulse_planner::on_for(open, &model.times)
        } else {
            0
        }
    })
}

/// Openings of the valves, µs, that move a resting piston by `error`, raw mm.
fn openings(model: &AxisModel, observer: &Observer, error: i32) -> [i32; 4] {
    let away = mul_shr_sat(observer.stiffness(model), error.saturating_abs(), 16);
    let wanted = mul_shr(away, INCH_SPRING, 16).saturating_add(model.coulomb);
    let now = observer.expected();
    let [fill_a, vent_a, fill_b, vent_b] = pulse_planner::valves(model, observer);
    let extends = error > 0;
    let (drive, counter) = if extends {
        ((now.a, fill_a, vent_a), (now.b, fill_b, vent_b))
    } else {
        ((now.b, fill_b, vent_b), (now.a, fill_a, vent_a))
    };
    let [drives, counters] = step(model, wanted, drive, counter);
    let ([fill_a, vent_a], [fill_b, vent_b]) = if extends {
        (drives, counters)
    } else {
        (counters, drives)
    };
    [fill_a, vent_a, fill_b, vent_b]
}

/// Openings of fill and vent valve, µs, of the drive and of the counter chamber, that change the force by `wanted` mN.
/// Each chamber is given as its pressure, its fill valve and its vent valve.
fn step(
    model: &AxisModel,
    wanted: i32,
    (drive, fill, drive_vent): (i32, Valve, Valve),
    (counter, counter_fill, vent): (i32, Valve, Valve),
) -> [[i32; 2]; 2] {
    let (fills_least, vents_least) = (fill.finest(), vent.finest());
    let by_fill = fill.pressure(wanted.max(fills_least));
    let by_vent = vent.pressure(wanted.max(vents_least));
    let can_fill = drive.saturating_add(by_fill) < model.high;
    let can_vent = counter.saturating_sub(by_vent) > model.low;
    let fits = |finest: i32| wanted > mul_shr(finest, INCH_FITS, 16);
    let (fills, vents) = (can_fill && fits(fills_least), can_vent && fits(vents_least));
    // This choice keeps the pressures about their middle.
    let high = drive.saturating_add(counter) > model.mean.saturating_mul(2);
    if fills && !(vents && high) {
        return [[fill.opening(by_fill), 0], [0, 0]];
    }
    if vents {
        return [[0, 0], [0, vent.opening(by_vent)]];
    }
    // Each of the two is at least a finest pulse.
    if high {
        let back = drive_vent.finest().max(vents_least.saturating_sub(wanted));
        let on = vent.pressure(back.saturating_add(wanted));
        [
            [0, drive_vent.opening(drive_vent.pressure(back))],
            [0, vent.opening(on)],
        ]
    } else {
        let back = counter_fill
            .finest()
            .max(fills_least.saturating_sub(wanted));
        let on = fill.pressure(back.saturating_add(wanted));
        [
            [fill.opening(on), 0],
            [counter_fill.opening(counter_fill.pressure(back)), 0],
        ]
    }
}

#[cfg(test)]
mod tests;
