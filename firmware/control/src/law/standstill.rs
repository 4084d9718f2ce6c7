//! Standstill: when the valves stay shut, a state machine.
//!
//! ```text
//!           in the band and slow, or friction stops it there      for REST_PERIODS
//!  SERVO ───────────────────────────────────────────────► CATCH ─────────────────► REST
//!    ▲ │ ▲                                                  │                        │
//!    │ │ └──────────────────────────────────────────────────┘                        │
//!    │ └─► PAUSE   patience is over and it entered the band: one swing with the valves shut
//!    └──────────────────────────────────────────────────── out of the release band ──┘
//!  PRESS: at an end stop a force is controlled (`seat`); it ends in REST
//! ```
//!
//! * **Stopping way.** Friction alone stops the piston in the band if m v²/2 lies between the work of what friction
//!   has left beside the forces that act, over the ways to both edges of the band.
//! * **Patience.** What does not come to rest near its target for long may do so in a wider band, up to 2.4 times
//!   and 0.4 mm, and the friction that is fed forward fades. Each time it enters that band the law waits with the
//!   valves shut for a swing of the mass on the air, 2π √(m / k), k = n p (AA²/VA + AB²/VB): no limit
//!   cycle lasts.
//! * **Release.** At rest nothing switches until the error has left the band of release for some periods; at once with
//!   a new target.
//!
//! The hysteresis of a friction-locked actuator (Hodgson et al. 2012 shut all valves in a band, too); patience and
//! pause are ours, found by search against limit cycles (`docs/decisions/0038-control-as-observer-and-law.md`).
//!
//! Config [`AxisModel`], state [`Standstill`], update [`Standstill::update`].

use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat, square_root};
use crate::observer::motion::Motion;
use crate::tuning::{
    BAND_WIDEST, CATCH_SPEED, FLED, FRICTION_STOPS, GENTLE_SPEED, NEAR_BANDS, NEAR_PERIODS,
    PATIENCE, PAUSE_SPENT, REFERENCE_RESTS, RELEASE_PERIODS, RELEASE_SIXTEENTHS, RELEASE_WIDEST,
    REST_PERIODS, START_PERIODS, STILL_SPEED, STOP_LEAST_SHIFT, STOP_ZONE_BANDS, SWING_PERIODS_MAX,
    SWING_PERIODS_MIN, WIDENS_AFTER, WIDENS_SHIFT,
};

/// Periods in which the band widens by one.
const WIDENS_STEP: i32 = 1 << WIDENS_SHIFT;

/// What the standstill logic has decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum State {
    /// The position servo acts.
    #[default]
    Servo,
    /// Valves shut for what is left of a swing.
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
    /// The target has changed since the piston came to rest.
    aimed: bool,
    /// Periods near the target without coming to rest.
    near: u16,
    /// In the band in the last period.
    inside: bool,
    /// Periods in [`State::Catch`].
    caught: u16,
    /// What is left of the pause under way, periods.
    pause: u16,
    /// Periods outside the band of release.
    outside: u16,
}

impl Standstill {
    /// Shut valves from power-up on, with the piston at `stroke`, raw mm.
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
    pub(super) const fn lingers(&self) -> bool {
        self.near > PATIENCE
    }

    /// Whether the piston has been near its target for some time.
    pub(super) const fn is_near(&self) -> bool {
        self.near > NEAR_PERIODS
    }

    /// Takes over the reference; gives whether it is another target.
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
        let steps = now.reference_speed.wrapping_abs() <= REFERENCE_RESTS;
        if self.is_at_rest() {
            if self.stays(model, now, steps) {
                return;
            }
            self.caught = 0;
            self.near = self.near.max(PATIENCE);
        }
        if !steps {
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
            self.near.wrapping_add(1).min(PATIENCE * 4)
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
    fn stays(&mut self, model: &AxisModel, now: &Approach, steps: bool) -> bool {
        let band = self.band(model);
        let half = model.band >> 1;
        let release = model
            .band
            .wrapping_mul(RELEASE_SIXTEENTHS)
            .wrapping_shr(4)
            .wrapping_add(band)
            .min(RELEASE_WIDEST.max(band.wrapping_add(half)));
        // The ground pushes a standing joint to and fro. A target that has moved is another matter.
        let release = if self.aimed {
            release
        } else {
            release.max(model.release)
        };
        let away = now.reference.saturating_sub(now.measured).saturating_abs();
        if steps && away <= release {
            self.outside = 0;
            self.aimed = false;
            return true;
        }
        self.outside = self.outside.wrapping_add(1);
        let periods = if self.aimed {
            START_PERIODS
        } else {
            RELEASE_PERIODS
        };
        steps && self.outside < periods
    }

    /// Act and wait. Where acting alone has not brought the piston to rest for long,
    /// each gentle entry into the band is followed by a pause with the valves shut, about one
    /// swing on the air of the chambers: a piston that swings on it, or on the bristles of
    /// its friction, comes to rest by itself, and every pulse meant to help would keep it
    /// going. One that flees, because the forces on it are not in balance, is not waited for.
    fn wait(&mut self, model: &AxisModel, now: &Approach, speed: i32, error: i32, inside: bool) {
        let entered = inside && !self.inside;
        self.inside = inside;
        if speed > GENTLE_SPEED || (error > FLED && !inside) {
            self.pause = 0;
        } else if self.pause > 0 {
            let spent = if inside || speed >= STILL_SPEED {
                1
            } else {
                PAUSE_SPENT
            };
            self.pause = self.pause.saturating_sub(spent);
        } else if entered && self.beyond() > 0 {
            self.pause = swing(model, now.mass);
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
    pub(super) fn faded(&self, grip: i32) -> i32 {
        let left = (WIDENS_STEP + WIDENS_STEP / 4)
            .saturating_sub(self.beyond())
            .max(0);
        mul_shr(grip, left.min(WIDENS_STEP), WIDENS_SHIFT)
    }
}

/// Periods of a swing of a mass (kg × 2^16) on the air of both chambers, 25…250.
#[inline]
fn swing(model: &AxisModel, mass: i32) -> u16 {
    let square_8 = mul_shr_sat(mass, model.swing, 16);
    let periods = square_root(square_8.unsigned_abs()).wrapping_shr(4);
    periods.clamp(SWING_PERIODS_MIN, SWING_PERIODS_MAX) as u16
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
    /// the way is the kinetic energy over what friction has left beside the
    /// forces that act.
    #[inline]
    fn stops_within(&self, model: &AxisModel, band: i32) -> bool {
        let speed = self.motion.speed.wrapping_shr(8);
        let error = self.reference.saturating_sub(self.motion.stroke);
        if error.saturating_abs() > band.wrapping_mul(STOP_ZONE_BANDS) {
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
        let work = |way: i32| i64::from(stopping).wrapping_mul(i64::from(way));
        energy > work(ahead.saturating_sub(band)) && energy < work(ahead.saturating_add(band))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use crate::axis::AxisData;
    use std::vec::Vec;
    use wheeleg_units::{Micros, PositionMm};

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    /// Hundredths of a millimetre.
    fn hundredths(value: i32) -> i32 {
        (value << 16) / 100
    }

    /// A piston `off` (1/100 mm) from its target at `speed` mm/s, with 20 N on it.
    fn seen<R>(off: i32, speed: i32, look: impl FnOnce(&Approach) -> R) -> R {
        let stroke = (90 << 16) + hundredths(off);
        let motion = Motion {
            stroke,
            speed: speed << 16,
            ..Motion::default()
        };
        look(&Approach {
            reference: 90 << 16,
            reference_speed: 0,
            measured: stroke,
            motion: &motion,
            force: 20_000,
            mass: 3 << 15,
        })
    }

    /// The states that a piston takes there for so many periods.
    fn states(standstill: &mut Standstill, off: i32, speed: i32, periods: u32) -> Vec<State> {
        states_of(&model(), standstill, off, speed, periods)
    }

    fn states_of(
        model: &AxisModel,
        standstill: &mut Standstill,
        off: i32,
        speed: i32,
        periods: u32,
    ) -> Vec<State> {
        (0..periods)
            .map(|_| {
                seen(off, speed, |now| standstill.update(model, now));
                standstill.state
            })
            .collect()
    }

    fn aimed() -> Standstill {
        let mut standstill = Standstill::at(0);
        assert!(standstill.aim(&model(), 90 << 16));
        standstill
    }

    #[test]
    fn a_slow_piston_in_the_band_is_caught_and_rests_after_seven_periods() {
        // The band is 0.12 mm.
        for (off, speed, caught) in [
            (11, 3, true),
            (-11, -3, true),
            (13, 3, false),
            (11, 5, false),
        ] {
            let states = states(&mut aimed(), off, speed, 7);
            let expected = [State::Catch; 6].into_iter().chain([State::Rest]);
            assert_eq!(states.into_iter().eq(expected), caught, "{off} {speed}");
        }
    }

    #[test]
    fn rest_ends_after_five_periods_outside_twice_the_band_and_at_once_with_a_new_target() {
        let rested = || {
            let mut standstill = aimed();
            states(&mut standstill, 0, 0, 10);
            assert!(standstill.holds());
            standstill
        };
        assert_eq!(states(&mut rested(), 23, 0, 200).last(), Some(&State::Rest));
        let left = states(&mut rested(), 25, 0, 5);
        assert_eq!(
            left.iter().filter(|state| **state == State::Rest).count(),
            4
        );
        let mut moved = rested();
        assert!(moved.aim(&model(), 91 << 16) && !moved.holds());
        seen(25, 0, |now| {
            moved.update(
                &model(),
                &Approach {
                    reference: 91 << 16,
                    ..*now
                },
            );
        });
        assert_eq!(moved.state, State::Servo);
    }

    /// Hunting beside its target, a piston gets a wider band after 0.88 s, up to 2.4 bands; and each
    /// gentle entry into it is answered by a pause.
    #[test]
    fn patience_widens_the_band_and_waits_for_a_swing() {
        let rests_at = |off: i32, hunting: u32| {
            let mut standstill = aimed();
            states(&mut standstill, 60, 10, hunting);
            states(&mut standstill, off, 0, 9).last() == Some(&State::Rest)
        };
        assert!(!rests_at(15, 200) && rests_at(15, 300));
        assert!(rests_at(28, 500) && !rests_at(30, 500));
        let mut standstill = aimed();
        assert!(!states(&mut standstill, 60, 10, 99).contains(&State::Pause));
        states(&mut standstill, 60, 10, 10);
        // Entered at 10 mm/s: too fast to be caught.
        let waits = states(&mut standstill, 5, 10, 300);
        let swing = swing(&model(), 3 << 15);
        assert_eq!(
            waits.iter().filter(|s| **s == State::Pause).count(),
            usize::from(swing)
        );
        // One that is fast, or has fled, is not waited for.
        for (off, speed) in [(5, 41), (210, 10)] {
            let mut other = standstill;
            other.pause = 50;
            assert_eq!(
                states(&mut other, off, speed, 1),
                [State::Servo],
                "{off} {speed}"
            );
        }
    }

    #[test]
    fn friction_that_stops_the_piston_in_the_band_is_left_to_do_so() {
        // 1.5 kg; 10 N of friction, of which 0.85 count; no net force: 8.5 N over the way.
        let stops = |off: i32, speed: i32| {
            seen(off, speed, |now| {
                Approach { force: 0, ..*now }.stops_within(&model(), hundredths(12))
            })
        };
        // v²/2 × 1.5 kg = 8.5 N × 1 mm: 106 mm/s; ± 0.12 mm are ± 6 %.
        assert!(stops(-100, 106) && stops(100, -106) && stops(-100, 102) && stops(-100, 111));
        assert!(!stops(-100, 98) && !stops(-100, 115) && !stops(100, 106));
        assert!(!stops(-150, 130), "further than twelve bands away");
    }

    /// Near is within 24 bands of 0.12 mm, for more than four periods.
    #[test]
    fn patience_begins_within_24_bands() {
        let near = |off: i32, periods: u32| {
            let mut standstill = aimed();
            states(&mut standstill, off, 50, periods);
            standstill.is_near()
        };
        assert!(near(285, 5) && !near(285, 4) && !near(291, 50));
    }

    /// However wide the band of an axis, it widens to 0.4 mm at most; and one that has widened to 0.36 mm
    /// is left at 0.45 mm, not at twice that.
    #[test]
    fn a_wide_band_is_released_within_the_bar() {
        let banded = |hundredths: f64| {
            let data = AxisData {
                band: PositionMm::from_f64(hundredths / 100.0),
                ..AxisData::default()
            };
            AxisModel::new(&data, Micros(1000)).expect("in range")
        };
        let rested = |model: &AxisModel, off: i32| {
            let mut standstill = aimed();
            states_of(model, &mut standstill, 60, 10, 500);
            states_of(model, &mut standstill, off, 0, 9);
            standstill
        };
        let wide = banded(20.0);
        assert!(rested(&wide, 39).holds() && !rested(&wide, 41).holds());
        let narrow = banded(15.0);
        let leaves = |off: i32| {
            let mut standstill = rested(&narrow, 30);
            assert!(standstill.holds());
            // Rest forgets how long it took; kept near, the band is still wide.
            standstill.near = 400;
            states_of(&narrow, &mut standstill, off, 0, 5).last() != Some(&State::Rest)
        };
        assert!(!leaves(44) && leaves(46));
    }

    /// A force that leaves less than a quarter of the friction is not to be counted on.
    #[test]
    fn friction_that_a_force_takes_away_stops_nothing() {
        // Of 8.5 N there are 2.4 or 2.6 left.
        let stops = |force: i32| {
            seen(-100, 0, |now| {
                // What the friction that is left stops just at the target.
                let left = f64::from(8_500 - force) / 1e3;
                let speed = (2.0 * left / 1.5 / 1e3).sqrt() * 1e3;
                let motion = Motion {
                    speed: (speed * 65_536.0) as i32,
                    ..*now.motion
                };
                Approach {
                    force,
                    motion: &motion,
                    ..*now
                }
                .stops_within(&model(), hundredths(12))
            })
        };
        assert!(stops(5_900) && !stops(6_100));
    }

    /// Standing still beside the band, it does not wait for all of the swing.
    #[test]
    fn a_pause_beside_the_band_is_short() {
        let waits = |speed: i32| {
            let mut standstill = aimed();
            states(&mut standstill, 60, 10, 109);
            standstill.pause = 80;
            let states = states(&mut standstill, 60, speed, 200);
            states
                .iter()
                .filter(|state| **state == State::Pause)
                .count()
        };
        assert_eq!((waits(0), waits(5)), (9, 79));
    }

    /// The friction that is fed forward fades over 0.5 s once patience is over.
    #[test]
    fn friction_fades_where_the_piston_does_not_come_to_rest() {
        let faded = |periods: u32| {
            let mut standstill = aimed();
            states(&mut standstill, 60, 10, periods);
            standstill.faded(10_000)
        };
        assert_eq!((faded(100), faded(130), faded(400)), (10_000, 10_000, 0));
        assert!((4_000..6_000).contains(&faded(196)), "{}", faded(196));
    }

    #[test]
    fn a_seat_is_a_state_of_its_own() {
        let mut standstill = aimed();
        standstill.seat(false);
        assert!(!standstill.valves_closed() && !standstill.is_at_rest());
        standstill.seat(true);
        assert!(standstill.valves_closed() && standstill.holds());
    }

    /// Against the period of mass and air springs in SI units, on cylinders of this project.
    #[test]
    fn a_swing_is_that_of_the_mass_on_the_air() {
        // Bore, rod, stroke, mm; dead volumes, cm³; supply, kPa.
        for (bore, rod, stroke, dead, supply) in [
            (20, 8, 180, 3, 701),
            (12, 6, 50, 2, 701),
            (16, 6, 400, 4, 601),
            (40, 16, 250, 12, 701),
        ] {
            let data = AxisData {
                bore: PositionMm::from_int(bore),
                rod: PositionMm::from_int(rod),
                stroke: PositionMm::from_int(stroke),
                dead_a: PositionMm::from_int(dead),
                dead_b: PositionMm::from_int(dead),
                supply: PositionMm::from_int(supply),
                ..AxisData::default()
            };
            let circle = |d: PositionMm| core::f64::consts::FRAC_PI_4 * d.to_f64().powi(2) * 1e-6;
            let area_a = circle(data.bore);
            let area_b = area_a - circle(data.rod);
            let spring = |area: f64| {
                let volume = f64::from(dead) * 1e-6 + 0.5e-3 * data.stroke.to_f64() * area;
                area * area / volume
            };
            let mean_pa = 0.5 * (f64::from(supply) * 1e3 + 101_325.0);
            let stiffness = 1.2 * mean_pa * (spring(area_a) + spring(area_b));
            for tick_us in [1000, 500] {
                let model = AxisModel::new(&data, Micros(tick_us)).expect("in range");
                for mass_kg in [0.5, 1.5, 10.0, 60.0] {
                    let period_s = core::f64::consts::TAU * f64::sqrt(mass_kg / stiffness);
                    let exact = (period_s * 1e6 / f64::from(4 * tick_us)).clamp(25.0, 250.0);
                    let periods = f64::from(swing(&model, (mass_kg * 65_536.0) as i32));
                    let off = (periods - exact).abs();
                    assert!(
                        off < 1.0 + 0.1 * exact,
                        "{bore} {mass_kg}: {periods} {exact}"
                    );
                }
            }
        }
    }
}
