//! Standstill: when the valves stay shut, a state machine.
//!
//! ```text
//!           in the band and slow, or friction stops it there   for more than 6 periods
//!  SERVO ───────────────────────────────────────────────► CATCH ─────────────────► REST
//!   │ ▲ ▲                                                   │                        │
//!   │ │ └───────────── no longer so ────────────────────────┘                        │
//!   │ └─────────────── released ─────────────────────────────────────────────────────┘
//!   └─► PAUSE   patience is over and the piston enters the band: valves shut, for one oscillation at most
//!  PRESS: at an end stop a force is controlled (`seat`): REST once the piston is pressed, otherwise as from SERVO when
//!         the seat ends
//! ```
//!
//! Worked out once a period, unless a preload or a seat decides. In the band: |e| < band. Slow: |v| < 4 mm/s. The
//! valves are shut in CATCH, PAUSE and REST. All but REST and PRESS follow from the period alone: CATCH, if the piston
//! is caught; if not, PAUSE, if one is under way; otherwise SERVO.
//!
//! * **Stopping distance.** With shut valves friction alone stops the piston in the band if F_s (|e| − band) < m v²/2 <
//!   F_s (|e| + band), F_s = 0.85 Fc − (F + load) sgn v; counted on within 12 bands of the target and while F_s is at
//!   least Fc/4.
//! * **Patience** counts the periods within 24 bands of a target that rests, and down again otherwise; not in REST. It
//!   is over after 100 (0.4 s). Then a heavy piston is asked for half the acceleration (`inverse_dynamics`); the
//!   friction that is fed forward fades, between 132 and 260 periods; and from 220 on band and slow speed grow, up to
//!   2.4 times at 400, the band to 0.4 mm at most. Each target more than one band from the last one begins with all of
//!   its patience.
//! * **Pause.** Where patience is over, the law waits with the valves shut each time the piston enters the band at 40
//!   mm/s at most, for one oscillation of the mass on the air, T_o = 2π √(m / k_air), k_air = n p (AA²/VA + AB²/VB), 25
//!   to 250 periods: no limit cycle lasts. The pause ends before that when the piston is faster than 40 mm/s, or more
//!   than 2 mm off, with a new target, or when the reference moves; a period counts for eight while the piston stands
//!   (|v| < 3 mm/s) beside the band. It goes on counting in CATCH. REST and PRESS do not count: what is left of it goes on
//!   after them, but not after a seat that was reached, which clears pause and patience.
//! * **Release.** REST ends
//!   - at once, when the reference moves (faster than 1 mm/s), with the patience of the third case;
//!   - at once, when it has gone more than one band from the target of this rest, if the stroke measured is also out of
//!     the band of release there. A new target so near that it is not, ends no rest: it becomes the target of it;
//!   - without a new target, in the fifth period in a row out of the band of release. Then patience goes on from 100
//!     periods at least.
//!
//!   The band of release is the present band and one of the axis data more, but at most 0.45 mm or, where that is more,
//!   the present band and half of that of the axis data. If the axis data's release is more, it counts, but not for a
//!   new target.
//! * A reference that moves faster than 1 mm/s is never rested at: SERVO.
//!
//! e: error of the estimated stroke, mm; v: speed, mm/s; F, load, Fc: pressure force, load and Coulomb friction, mN; m:
//! mass in use, kg; n = 1.2; p: mean of supply and atmosphere, Pa; VA, VB: volume of each chamber at mid stroke, m³;
//! AA, AB: areas, m²; k_air: N/m; T_o: s. "The band", also in the stopping distance, is the present one,
//! which patience widens; the 24 bands, and the one band of a new target, are those of the axis data (0.12 mm on the
//! bench). Times are in periods of four ticks: 4 ms with ticks of 1 ms.
//!
//! Assumes: friction of at least 0.85 of the specified one, where it is counted on; that shut valves hold the air, so
//! that a piston at rest stays there; noise of the measured stroke below a third of the band. If the supply falls, a
//! piston at rest stays there: nothing of it asks for air. One on its way may lack the force to arrive: it stays in
//! SERVO, its band widens no further than 2.4 times, and supervision sees the error. REST learns nothing about the
//! force: a load that grows beyond friction moves the piston out of the band of release, and SERVO acts again, with the
//! ramp as it was.
//!
//! Source: hysteresis of a friction-locked actuator (Hodgson et al. 2012 shut all valves in a band, too); patience and
//! pause are our own, found by search against limit cycles (`docs/decisions/0038-control-as-observer-and-law.md`).
//!
//! Config [`AxisModel`], state [`Standstill`], update [`Standstill::update`].

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat, square_root};
use crate::observer::motion::Motion;
use crate::tuning::{
    BAND_WIDEST, CATCH_SPEED, FADES_AFTER, FRICTION_STOPS, GENTLE_SPEED, NEAR_BANDS, NEAR_PERIODS,
    OSCILLATION_PERIODS_MAX, OSCILLATION_PERIODS_MIN, PATIENCE, PATIENCE_MOST, PAUSE_ENDS_BEYOND,
    PAUSE_SPENT, REFERENCE_RESTS, RELEASE_BEYOND_SIXTEENTHS, RELEASE_PERIODS, RELEASE_SIXTEENTHS,
    RELEASE_WIDEST, REST_PERIODS, STILL_SPEED, STOP_LEAST_SHIFT, STOP_ZONE_BANDS, WIDENS_AFTER,
    WIDENS_SHIFT,
};

/// Periods in which the band widens by one.
const WIDENS_STEP: i32 = 1 << WIDENS_SHIFT;

/// What the standstill logic has decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum State {
    /// The position servo acts.
    #[default]
    Servo,
    /// Valves shut for what is left of an oscillation.
    Pause,
    /// Valves shut: friction stops the piston.
    Catch,
    /// At rest, valves shut.
    Rest,
    /// Pressed against an end stop.
    Press,
}

/// Rest at a target, and how long it has been tried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Standstill {
    state: State,
    /// Raw mm.
    target: i32,
    /// The target has changed, and the piston has not come to rest at the new one.
    aimed: bool,
    /// Periods near the target without coming to rest: patience is over beyond [`PATIENCE`].
    near: u16,
    /// In the band in the last period.
    inside: bool,
    /// Periods in [`State::Catch`].
    caught: u16,
    /// What is left of the pause under way, periods; 0 without one.
    pause: u16,
    /// Periods outside the band of release.
    outside: u16,
}

impl Standstill {
    /// As somebody else drives: the next target is one only beside `stroke`, raw mm.
    pub(super) fn at(stroke: i32) -> Self {
        Self {
            target: stroke,
            ..Self::default()
        }
    }

    /// At rest.
    pub(super) const fn is_at_rest(&self) -> bool {
        matches!(self.state, State::Rest)
    }

    /// Whether the valves are to stay shut.
    pub(super) const fn valves_closed(&self) -> bool {
        matches!(self.state, State::Pause | State::Catch | State::Rest)
    }

    /// Whether it rests at the present target.
    pub(super) const fn holds(&self) -> bool {
        self.is_at_rest() && !self.aimed
    }

    /// Whether it has been near its target without coming to rest for longer than patience allows.
    pub(super) const fn patience_is_over(&self) -> bool {
        self.near > PATIENCE
    }

    /// Whether the piston has been near its target for some time.
    pub(super) const fn is_near(&self) -> bool {
        self.near > NEAR_PERIODS
    }

    /// Takes over the reference; gives whether it is another target: more than one band from the last one.
    pub(super) const fn aim(&mut self, model: &AxisModel, reference: i32) -> bool {
        let other = reference.saturating_sub(self.target).saturating_abs() > model.band;
        if other {
            self.target = reference;
            self.near = 0;
            self.pause = 0;
            self.aimed = true;
        }
        other
    }

    /// At an end stop: pressed against it, or at rest there.
    pub(super) const fn seat(&mut self, seated: bool) {
        if seated {
            self.rest();
            self.near = 0;
            self.pause = 0;
        } else {
            self.state = State::Press;
            self.caught = 0;
        }
    }

    const fn rest(&mut self) {
        self.state = State::Rest;
        self.aimed = false;
        self.outside = 0;
    }

    /// One period.
    pub(super) fn update(&mut self, model: &AxisModel, now: &Approach) {
        let reference_rests = now.reference_speed.wrapping_abs() <= REFERENCE_RESTS;
        if self.is_at_rest() {
            if self.stays(model, now, reference_rests) {
                return;
            }
            self.caught = 0;
            // One that has left its place has had its patience; a new target is tried with a new one.
            if !self.aimed {
                self.near = self.near.max(PATIENCE);
            }
        }
        if !reference_rests {
            self.state = State::Servo;
            self.near = self.near.saturating_sub(1);
            self.caught = 0;
            self.pause = 0;
            self.inside = false;
            return;
        }
        let error = now
            .reference
            .saturating_sub(now.motion.stroke)
            .saturating_abs();
        // A band of at most 5 mm, below 2^19, times up to 24: all of it fits.
        self.near = if error < model.band.wrapping_mul(NEAR_BANDS) {
            self.near.wrapping_add(1).min(patience_most())
        } else {
            self.near.saturating_sub(1)
        };
        let band = self.band(model);
        let catch = CATCH_SPEED.wrapping_add(self.widened(CATCH_SPEED));
        let speed = now.motion.speed.wrapping_abs();
        let inside = error < band;
        self.wait(model, now, speed, error, inside);
        if (inside && speed < catch) || now.stops_within(model, band) {
            self.state = State::Catch;
            self.caught = self.caught.wrapping_add(1);
            if self.caught > REST_PERIODS {
                self.rest();
            }
        } else {
            self.caught = 0;
            self.state = if self.pause > 0 {
                State::Pause
            } else {
                State::Servo
            };
        }
    }

    /// Whether a piston at rest stays so.
    fn stays(&mut self, model: &AxisModel, now: &Approach, reference_rests: bool) -> bool {
        let band = self.band(model);
        let beyond = model.band.wrapping_mul(RELEASE_BEYOND_SIXTEENTHS) >> 4;
        let release = model
            .band
            .wrapping_mul(RELEASE_SIXTEENTHS)
            .wrapping_shr(4)
            .wrapping_add(band)
            .min(RELEASE_WIDEST.max(band.wrapping_add(beyond)));
        // The ground pushes a standing joint to and fro. A target that has moved is another matter.
        let release = if self.aimed {
            release
        } else {
            release.max(model.release)
        };
        let away = now.reference.saturating_sub(now.measured).saturating_abs();
        if reference_rests && away <= release {
            self.outside = 0;
            self.aimed = false;
            return true;
        }
        self.outside = self.outside.wrapping_add(1);
        // A new target is no noise.
        reference_rests && !self.aimed && self.outside < RELEASE_PERIODS
    }

    /// Act and wait. Where acting alone has not brought the piston to rest for long,
    /// each gentle entry into the band is followed by a pause with the valves shut, about one
    /// oscillation on the air of the chambers: a piston that oscillates on it, or on the bristles of
    /// its friction, comes to rest by itself, and every pulse meant to help would keep it
    /// going. One that leaves, because the forces on it are not in balance, is not waited for.
    fn wait(&mut self, model: &AxisModel, now: &Approach, speed: i32, error: i32, inside: bool) {
        let entered = inside && !self.inside;
        self.inside = inside;
        if speed > GENTLE_SPEED || (error > PAUSE_ENDS_BEYOND && !inside) {
            self.pause = 0;
        } else if self.pause > 0 {
            let spent = if inside || speed >= STILL_SPEED {
                1
            } else {
                PAUSE_SPENT
            };
            self.pause = self.pause.saturating_sub(spent);
        } else if entered && self.beyond() > 0 {
            self.pause = oscillation(model, now.mass);
        }
    }

    /// Periods near the target beyond what patience allows.
    fn beyond(&self) -> i32 {
        i32::from(self.near.saturating_sub(PATIENCE))
    }

    /// What is added to `base`, up to 1.4 times it, where patience is over for long.
    fn widened(&self, base: i32) -> i32 {
        let beyond = self.beyond().wrapping_sub(WIDENS_AFTER);
        let beyond = beyond.max(0);
        // Both below 2^19, times up to 2^8.
        base.wrapping_mul(beyond).wrapping_shr(WIDENS_SHIFT)
    }

    /// Rest band, raw mm.
    fn band(&self, model: &AxisModel) -> i32 {
        let narrow = model.band;
        narrow
            .wrapping_add(self.widened(narrow))
            .min(BAND_WIDEST.max(narrow))
    }

    /// What is fed forward for friction that is less than told makes a relay: where
    /// the piston does not come to rest, it fades.
    pub(super) fn faded(&self, friction: i32) -> i32 {
        let left = (FADES_AFTER + WIDENS_STEP)
            .saturating_sub(self.beyond())
            .max(0);
        mul_shr(friction, left.min(WIDENS_STEP), WIDENS_SHIFT)
    }
}

/// Periods near a target that are counted.
fn patience_most() -> u16 {
    if is_without(Part::Patience) {
        PATIENCE
    } else {
        PATIENCE_MOST
    }
}

/// Periods of an oscillation of a mass (kg × 2^16) on the air of both chambers, 25…250.
#[inline]
fn oscillation(model: &AxisModel, mass: i32) -> u16 {
    let square_8 = mul_shr_sat(mass, model.oscillation, 16);
    let periods = square_root(square_8.unsigned_abs()).wrapping_shr(4);
    periods.clamp(OSCILLATION_PERIODS_MIN, OSCILLATION_PERIODS_MAX) as u16
}

/// How the piston comes to its target.
pub(super) struct Approach<'a> {
    /// Raw mm.
    pub(super) reference: i32,
    /// Raw mm/s.
    pub(super) reference_speed: i32,
    /// As measured, raw mm.
    pub(super) measured: i32,
    /// As estimated.
    pub(super) motion: &'a Motion,
    /// Pressure force, mN.
    pub(super) force: i32,
    /// kg × 2^16.
    pub(super) mass: i32,
}

impl Approach<'_> {
    /// Whether friction alone stops the piston within the band, if the valves shut:
    /// the distance is the kinetic energy over what friction has left beside the
    /// forces that act.
    #[inline]
    fn stops_within(&self, model: &AxisModel, band: i32) -> bool {
        let speed = self.motion.speed.wrapping_shr(8);
        let error = self.reference.saturating_sub(self.motion.stroke);
        if error.saturating_abs() > band.wrapping_mul(STOP_ZONE_BANDS)
            || is_without(Part::StoppingDistance)
        {
            return false;
        }
        let net = self.force.saturating_add(self.motion.load);
        let along = if speed < 0 { net.saturating_neg() } else { net };
        let stopping = mul_shr(model.coulomb, FRICTION_STOPS, 16).saturating_sub(along);
        if stopping < model.coulomb >> STOP_LEAST_SHIFT {
            return false;
        }
        // kg × mm²/s² = µJ = mN × mm, all × 2^16.
        let energy = i64::from(self.mass)
            .wrapping_mul(i64::from(speed).wrapping_mul(i64::from(speed)))
            .wrapping_shr(17);
        let ahead = if speed < 0 {
            error.saturating_neg()
        } else {
            error
        };
        let work = |distance: i32| i64::from(stopping).wrapping_mul(i64::from(distance));
        energy > work(ahead.saturating_sub(band)) && energy < work(ahead.saturating_add(band))
    }
}

#[cfg(test)]
mod tests;
