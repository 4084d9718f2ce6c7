//! States, bands and times of the standstill logic.

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

/// The states of a piston there over this many periods.
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

/// Two bands are 0.24 mm. A piston that has left its place and is back has not come to rest.
#[test]
fn a_start_lasts_until_the_piston_has_moved_by_two_bands() {
    let start = |strokes: &[i32]| {
        let mut standstill = aimed();
        assert!(!standstill.has_not_left());
        states(&mut standstill, 0, 0, 10);
        for off in strokes {
            seen(*off, 0, |now| {
                let now = Approach {
                    reference_speed: 5 << 16,
                    ..*now
                };
                standstill.update(&model(), &now);
            });
        }
        standstill.has_not_left()
    };
    for side in [-1, 1] {
        assert!(start(&[0, 23 * side]));
        assert!(!start(&[0, 25 * side]));
        assert!(!start(&[0, 25 * side, 0]));
    }
}

/// The first approach to a target ends where the piston stands or turns near it, on either side, and nowhere else; a
/// new target allows another landing.
#[test]
fn a_piston_lands_on_its_first_approach_only() {
    for side in [-1, 1] {
        let towards = -side;
        let mut standstill = aimed();
        // Standing far away, then coming in.
        states(&mut standstill, 300 * side, 0, 10);
        states(&mut standstill, 200 * side, 50 * towards, 10);
        states(&mut standstill, 20 * side, 4 * towards, 10);
        assert!(standstill.may_land());
        for (off, speed) in [(200 * side, 2 * towards), (20 * towards, 50 * towards)] {
            let mut arrived = standstill;
            states(&mut arrived, off, speed, 1);
            assert!(!arrived.may_land(), "{off} {speed}");
            assert!(arrived.aim(&model(), 91 << 16) && arrived.may_land());
        }
    }
}

/// A piston that hunts beside its target gets a wider band after 0.88 s, up to 2.4 bands, and each gentle entry into it
/// is answered by a pause.
#[test]
fn patience_widens_the_band_and_waits_for_an_oscillation() {
    let rests_at = |off: i32, hunting: u32| {
        let mut standstill = aimed();
        states(&mut standstill, 60, 10, hunting);
        states(&mut standstill, off, 0, 9).last() == Some(&State::Rest)
    };
    assert!(!rests_at(15, 200) && rests_at(15, 300));
    assert!(rests_at(28, 500) && !rests_at(30, 500));
    let mut standstill = aimed();
    // Entries at 10 mm/s, too fast to be caught, every second period, while patience lasts.
    for _ in 0..50 {
        assert_eq!(states(&mut standstill, 60, 10, 1), [State::Servo]);
        assert_eq!(states(&mut standstill, 5, 10, 1), [State::Servo]);
    }
    states(&mut standstill, 60, 10, 1);
    let waits = states(&mut standstill, 5, 10, 300);
    let expected = oscillation(&model(), 3 << 15);
    assert_eq!(
        waits.iter().filter(|s| **s == State::Pause).count(),
        usize::from(expected)
    );
    // A piston that is fast or far off is not waited for.
    for (off, speed, state) in [
        (5, 39, State::Pause),
        (5, 41, State::Servo),
        (190, 10, State::Pause),
        (210, 10, State::Servo),
    ] {
        let mut other = standstill;
        other.pause = 50;
        assert_eq!(states(&mut other, off, speed, 1), [state], "{off} {speed}");
    }
}

#[test]
fn friction_that_stops_the_piston_in_the_band_is_left_to_do_so() {
    // 1.5 kg; 10 N of friction, of which 0.85 is used; no net force: 8.5 N over the distance.
    let stops = |off: i32, speed: i32| {
        seen(off, speed, |now| {
            Approach { force: 0, ..*now }.stops_within(&model(), hundredths(12))
        })
    };
    // v²/2 × 1.5 kg = 8.5 N × 1 mm: 106 mm/s; ± 0.12 mm is ± 6 %.
    assert!(stops(-100, 106) && stops(100, -106) && stops(-100, 102) && stops(-100, 111));
    assert!(!stops(-100, 98) && !stops(-100, 115) && !stops(100, 106));
    assert!(!stops(-150, 130), "further than twelve bands away");
}

/// Near means within 24 bands of 0.12 mm for more than four periods.
#[test]
fn patience_begins_within_24_bands() {
    let near = |off: i32, periods: u32| {
        let mut standstill = aimed();
        states(&mut standstill, off, 50, periods);
        standstill.is_near()
    };
    assert!(near(285, 5) && !near(285, 4) && !near(291, 50));
}

/// A piston that has left its place has used up its patience; a new target is approached with a fresh one.
#[test]
fn a_new_target_has_a_patience_of_its_own() {
    let near = |target_mm: i32| {
        let mut standstill = aimed();
        states(&mut standstill, 0, 0, 10);
        assert!(standstill.holds());
        standstill.aim(&model(), target_mm << 16);
        for _ in 0..RELEASE_PERIODS {
            seen(200, 0, |now| {
                let now = Approach {
                    reference: target_mm << 16,
                    ..*now
                };
                standstill.update(&model(), &now);
            });
        }
        assert_eq!(standstill.state, State::Servo);
        standstill.near
    };
    assert_eq!(near(90), PATIENCE + 1, "2 mm off its place");
    assert_eq!(near(93), RELEASE_PERIODS, "1 mm from a new target");
    assert_eq!(near(190), 0, "98 mm from it");
}

/// However wide the band of an axis, it widens to 0.4 mm at most. A band that has widened to 0.36 mm is left at 0.45
/// mm, not at twice its width; one of 0.4 mm is left half a narrow band beyond it.
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
    let leaves = |model: &AxisModel, off: i32| {
        let mut standstill = rested(model, 30);
        assert!(standstill.holds());
        states_of(model, &mut standstill, off, 0, 5).last() != Some(&State::Rest)
    };
    let narrow = banded(15.0);
    assert!(!leaves(&narrow, 44) && leaves(&narrow, 46));
    assert!(!leaves(&wide, 49) && leaves(&wide, 51));
}

/// A force that leaves less than a quarter of the friction means that friction cannot be relied on.
#[test]
fn friction_that_a_force_takes_away_stops_nothing() {
    // Of the 8.5 N, 2.4 or 2.6 N are left.
    let stops = |force: i32| {
        seen(-100, 0, |now| {
            // The speed that the remaining friction stops just at the target.
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

/// A piston that stands still beside the band does not wait for the whole oscillation.
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

/// The friction feed-forward fades over 0.5 s once patience is over.
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

/// Compares with the period of mass and air springs in SI units, on cylinders of this project.
#[test]
fn an_oscillation_is_that_of_the_mass_on_the_air() {
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
                let periods = f64::from(oscillation(&model, (mass_kg * 65_536.0) as i32));
                let off = (periods - exact).abs();
                assert!(
                    off < 1.0 + 0.1 * exact,
                    "{bore} {mass_kg}: {periods} {exact}"
                );
            }
        }
    }
}
