//! Standstill: a state machine that decides when the valves stay shut.
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
//! Updated once per period, unless a preload or a seat decides. In the band: |e| < band. Slow: |v| < 4 mm/s. The valves
//! are shut in CATCH, PAUSE and REST. All states but REST and PRESS are decided anew in each period: CATCH if the
//! piston is caught; otherwise PAUSE if one is under way; otherwise SERVO.
//!
//! * **Stopping distance.** With shut valves friction alone stops the piston in the band if F_s (e' − band) < m v²/2 <
//!   F_s (e' + band), e' = e sgn v, F_s = 0.85 Fc − (F + load) sgn v. This is used within 12 bands of the target and
//!   while F_s is at least Fc/4.
//! * **Landing.** On its first approach to a resting target the piston comes in as fast as friction can stop it
//!   (`switching_curve`). The approach is over once the piston rests, or stands (slower than 3 mm/s towards the target)
//!   or moves away within 24 bands of it. Each target more than one band from the last one allows another landing.
//! * **Start.** A piston that has rested counts as standing there until it has moved by two bands, however fast it
//!   yields on the spring of its friction (`inverse_dynamics`).
//! * **Patience** counts up in each period within 24 bands of a resting target, and down in every other; it does not
//!   count in REST. It is over after 100 periods (0.4 s). Then a heavy piston is given half the acceleration
//!   (`inverse_dynamics`); between 132 and 260 periods the friction feed-forward fades; and from 220 on the band and
//!   the slow speed grow, up to 2.4 times at 400, the band to 0.4 mm at most. Each target more than one band from the
//!   last one starts with full patience.
//! * **Pause.** Once patience is over, each time the piston enters the band at no more than 40 mm/s the law waits with
//!   the valves shut, for one oscillation of the mass on the air, T_o = 2π √(m / k_air), k_air = n p (AA²/VA + AB²/VB),
//!   25 to 250 periods: no limit cycle lasts. The pause ends early when the piston is faster than 40 mm/s or more than
//!   2 mm off, with a new target, or when the reference moves. A period counts as eight while the piston stands (|v| <
//!   3 mm/s) beside the band. The pause continues to count in CATCH, but not in REST and PRESS: what is left of it
//!   resumes after them, except after a seat that was reached, which clears pause and patience.
//! * **Release.** REST ends
//!   - at once, when the reference moves (faster than 1 mm/s). Patience then continues from about 100 periods, or
//!     afresh once the reference has moved by more than one band;
//!   - at once, when the reference has moved more than one band from the target of this rest, if the measured stroke is
//!     also outside the band of release of the new target. If it is not outside, the new target does not end the rest
//!     but becomes its target;
//!   - without a new target, in the fifth consecutive period outside the band of release. Patience then continues from
//!     at least 100 periods.
//!
//!   The band of release is the present band plus one band of the axis data, but at most 0.45 mm or, where that is
//!   more, the present band plus half a band of the axis data. If the axis data's own release is larger, it applies
//!   instead, but not for a new target.
//! * A reference that moves faster than 1 mm/s always means SERVO, never rest.
//!
//! e: error of the estimated stroke, mm; v: speed, mm/s; F, load, Fc: pressure force, load and Coulomb friction, mN; m:
//! mass in use, kg; n = 1.2; p: mean of supply and atmosphere, Pa; VA, VB: volume of each chamber at mid stroke, m³;
//! AA, AB: areas, m²; k_air: N/m; T_o: s. "The band", also in the stopping distance, is the present one, which patience
//! widens; the 24 bands, and the one band of a new target, are those of the axis data (0.12 mm on the bench). Times are
//! in periods of four ticks: 4 ms with ticks of 1 ms.
//!
//! Assumes: where friction is relied on, at least 0.85 of the friction in use; that shut valves hold the air, so that a
//! piston at rest stays there; noise of the measured stroke below a third of the band. If the supply falls, a piston at
//! rest stays there, because rest needs no air. A piston on its way may lack the force to arrive: it stays in SERVO,
//! its band widens by no more than 2.4 times, and supervision sees the error. REST learns nothing about the force: a
//! load that grows beyond friction moves the piston out of the band of release, and SERVO acts again, with the ramp as
//! it was.
//!
//! Source: hysteresis of a friction-locked actuator (Hodgson et al. 2012 also shut all valves in a band); patience and
//! pause are our own, found by search against limit cycles (`docs/decisions/0038-control-as-observer-and-law.md`).
//!
//! Config [`AxisModel`], state [`Standstill`], update [`Standstill::update`].

use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{along, mul_shr, mul_shr_sat, square_root};
use crate::observer::motion::Motion;
use crate::tuning::{
    BAND_WIDEST, CATCH_SPEED, FADES_AFTER, FRICTION_STOPS, GENTLE_SPEED, NEAR_BANDS, NEAR_PERIODS,
    OSCILLATION_PERIODS_MAX, OSCILLATION_PERIODS_MIN, PATIENCE, PATIENCE_MOST, PAUSE_ENDS_BEYOND,
    PAUSE_SPENT, REFERENCE_RESTS, RELEASE_BEYOND_SIXTEENTHS, RELEASE_PERIODS, RELEASE_SIXTEENTHS,
    RELEASE_WIDEST, REST_PERIODS, START_BANDS, STILL_SPEED, STOP_LEAST_SHIFT, STOP_ZONE_BANDS,
    WIDENS_AFTER, WIDENS_SHIFT,
};

/// Periods in which the band widens by its own width.
const WIDENS_STEP: i32 = 1 << WIDENS_SHIFT;

/// What the standstill logic has decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum State {
    /// The position servo acts.
    #[default]
    Servo,
    /// Valves shut for the rest of an oscillation.
    Pause,
    /// Valves shut: friction stops the piston.
    Catch,
    /// At rest, valves shut.
    Rest,
    /// Pressed against an end stop.
    Press,
}

/// How far the approach to the present target has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Arrival {
    /// On the first approach, on which the piston may land by friction.
    #[default]
    First,
    /// The piston has stood or moved away near the target: its first approach is over.
    Over,
    /// The piston has come to rest at the target.
    Rested,
}

/// Rest at a target, and how long it has been attempted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Standstill {
    state: State,
    /// Raw mm.
    target: i32,
    /// Begins anew with each new target.
    arrival: Arrival,
    /// Periods near the target without coming to rest: patience is over beyond [`PATIENCE`].
    near: u16,
    /// The piston was in the band in the last period.
    inside: bool,
    /// Periods in [`State::Catch`].
    caught: u16,
    /// Periods left of the pause under way; 0 without one.
    pause: u16,
    /// Periods outside the band of release.
    outside: u16,
    /// Stroke at which the piston rested last, raw mm, until it has moved away from there.
    rested_at: Option<i32>,
}

impl Standstill {
    /// State while somebody else drives: only a target away from `stroke`, raw mm, is a new one.
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

    /// Whether the piston rests at the present target.
    pub(super) const fn holds(&self) -> bool {
        self.is_at_rest() && self.has_rested()
    }

    /// Whether the piston has come to rest at the present target, and may have left it since.
    const fn has_rested(&self) -> bool {
        matches!(self.arrival, Arrival::Rested)
    }

    /// Whether the piston has been near its target without coming to rest for longer than patience allows.
    pub(super) const fn patience_is_over(&self) -> bool {
        self.near > PATIENCE
    }

    /// Whether the piston has been near its target for some time.
    pub(super) const fn is_near(&self) -> bool {
        self.near > NEAR_PERIODS
    }

    /// Whether the piston is on its first approach to the target, on which it may land by friction.
    pub(super) const fn may_land(&self) -> bool {
        matches!(self.arrival, Arrival::First)
    }

    /// Whether the piston still stands where it rested last.
    pub(super) const fn has_not_left(&self) -> bool {
        self.rested_at.is_some()
    }

    /// Takes over the reference. Returns whether it is a new target: more than one band from the last one.
    pub(super) const fn aim(&mut self, model: &AxisModel, reference: i32) -> bool {
        let other = reference.saturating_sub(self.target).saturating_abs() > model.band;
        if other {
            self.target = reference;
            self.near = 0;
            self.pause = 0;
            self.arrival = Arrival::First;
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
        self.arrival = Arrival::Rested;
        self.outside = 0;
    }

    /// One period.
    pub(super) fn update(&mut self, model: &AxisModel, now: &Approach) {
        let reference_rests = now.reference_speed.wrapping_abs() <= REFERENCE_RESTS;
        self.note_rest(model, now.motion.stroke);
        if self.is_at_rest() {
            if self.stays(model, now, reference_rests) {
                return;
            }
            self.caught = 0;
            // A piston that has left its place has used up its patience; a new target gets a fresh one.
            if self.has_rested() {
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
        let ahead = now.reference.saturating_sub(now.motion.stroke);
        let error = ahead.saturating_abs();
        // A band is at most 5 mm, below 2^19; times up to 24 all of it fits.
        self.near = if error < model.band.wrapping_mul(NEAR_BANDS) {
            if self.may_land() && along(now.motion.speed, ahead) < STILL_SPEED {
                self.arrival = Arrival::Over;
            }
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

    /// Remembers where the piston rests, until it has moved by [`START_BANDS`].
    fn note_rest(&mut self, model: &AxisModel, stroke: i32) {
        // A band is at most 5 mm, below 2^19.
        let far = model.band.wrapping_mul(START_BANDS);
        let left = |from: i32| stroke.saturating_sub(from).saturating_abs() > far;
        if self.is_at_rest() {
            self.rested_at = Some(stroke);
        } else if self.rested_at.is_some_and(left) {
            self.rested_at = None;
        }
    }

    /// Whether a resting piston stays at rest.
    fn stays(&mut self, model: &AxisModel, now: &Approach, reference_rests: bool) -> bool {
        let band = self.band(model);
        let beyond = model.band.wrapping_mul(RELEASE_BEYOND_SIXTEENTHS) >> 4;
        let release = model
            .band
            .wrapping_mul(RELEASE_SIXTEENTHS)
            .wrapping_shr(4)
            .wrapping_add(band)
            .min(RELEASE_WIDEST.max(band.wrapping_add(beyond)));
        // The ground pushes a standing joint to and fro, so its release may be wide. A new target is a different
        // matter.
        let release = if self.has_rested() {
            release.max(model.release)
        } else {
            release
        };
        let away = now.reference.saturating_sub(now.measured).saturating_abs();
        if reference_rests && away <= release {
            self.outside = 0;
            self.arrival = Arrival::Rested;
            return true;
        }
        self.outside = self.outside.wrapping_add(1);
        // A new target is not noise.
        reference_rests && self.has_rested() && self.outside < RELEASE_PERIODS
    }

    /// Alternates between acting and waiting. Where acting alone has not brought the piston to rest for a long time,
    /// each gentle entry into the band is followed by a pause with the valves shut, of about one oscillation on the air
    /// of the chambers. A piston that oscillates on that air, or on the bristles of its friction, comes to rest by
    /// itself, and every pulse meant to help would keep it going. A piston that leaves because the forces on it are not
    /// in balance is not waited for.
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

    /// What is added to `base`, up to 1.4 times it, long after patience is over.
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

    /// Feeding forward more than the real friction makes a relay, so friction fades where the piston does not come to
    /// rest.
    pub(super) fn faded(&self, friction: i32) -> i32 {
        let left = (FADES_AFTER + WIDENS_STEP)
            .saturating_sub(self.beyond())
            .max(0);
        mul_shr(friction, left.min(WIDENS_STEP), WIDENS_SHIFT)
    }
}

/// Largest count of periods near a target.
fn patience_most() -> u16 {
    if is_without(Part::Patience) {
        PATIENCE
    } else {
        PATIENCE_MOST
    }
}

/// Periods of one oscillation of a mass (kg × 2^16) on the air of both chambers, 25…250.
#[inline]
fn oscillation(model: &AxisModel, mass: i32) -> u16 {
    let square_8 = mul_shr_sat(mass, model.oscillation, 16);
    let periods = square_root(square_8.unsigned_abs()).wrapping_shr(4);
    periods.clamp(OSCILLATION_PERIODS_MIN, OSCILLATION_PERIODS_MAX) as u16
}

/// How the piston approaches its target.
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
    /// Whether friction alone stops the piston within the band if the valves shut. The stopping distance is the kinetic
    /// energy divided by the friction that the acting forces leave.
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
        let stopping = mul_shr(model.coulomb, FRICTION_STOPS, 16).saturating_sub(along(net, speed));
        if stopping < model.coulomb >> STOP_LEAST_SHIFT {
            return false;
        }
        // kg × mm²/s² = µJ = mN × mm, all × 2^16.
        let energy = i64::from(self.mass)
            .wrapping_mul(i64::from(speed).wrapping_mul(i64::from(speed)))
            .wrapping_shr(17);
        let ahead = along(error, speed);
        let work = |distance: i32| i64::from(stopping).wrapping_mul(i64::from(distance));
        energy > work(ahead.saturating_sub(band)) && energy < work(ahead.saturating_add(band))
    }
}

#[cfg(test)]
mod tests;
