//! When a step begins, which valves it opens, and for how long.

use super::*;
use crate::axis::AxisData;
use crate::law::allocation;
use crate::observer::pressure::Pressures;
use crate::tuning::OPENING_LONGEST;
use wheeleg_units::Micros;

/// Valves so wide that their finest pulse makes more than break-away friction.
fn model() -> AxisModel {
    let data = AxisData {
        conductance: "0.4".parse().expect("a number"),
        ..AxisData::default()
    };
    AxisModel::new(&data, Micros(1000)).expect("in range")
}

/// At rest at 90 mm with these pressures, 1/256 Pa.
fn at(model: &AxisModel, pressures: Pressures) -> Observer {
    let mut observer = Observer::new(model, pressures);
    observer.start_at(90 << 16);
    observer
}

/// In balance, about the middle.
fn balanced(model: &AxisModel) -> Observer {
    at(model, allocation::targets(model, 0))
}

/// A target this many bands from a piston at 90 mm.
fn bands_off(model: &AxisModel, bands: i32) -> i32 {
    (90 << 16) + bands * model.band
}

/// Change of force that these openings make, mN, to first order.
fn made(model: &AxisModel, observer: &Observer, openings: [i32; 4]) -> f64 {
    let share = |valve: usize| {
        let valves = pulse_planner::valves(model, observer);
        f64::from(openings[valve]) / f64::from(model.times.shortest_opening())
            * f64::from(valves[valve].finest())
    };
    share(0) - share(1) - share(2) + share(3)
}

#[test]
fn valves_are_coarse_if_a_pulse_is_more_than_friction_holds_and_the_mass_is_small() {
    let fine = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
    let coarse = AxisModel {
        breakaway: 2000,
        ..model()
    };
    assert!(!is_coarse(&fine, false), "{}", fine.pulse_force);
    assert!(is_coarse(&coarse, false), "{}", coarse.pulse_force);
    assert!(!is_coarse(&coarse, true));
    for (percent, found) in [(129, false), (131, true)] {
        let limit = AxisModel {
            breakaway: coarse.pulse_force * 100 / percent,
            ..coarse
        };
        assert_eq!(is_coarse(&limit, false), found, "{percent}");
    }
}

/// Steps begin within 20 bands and below 120 mm/s; they end beyond 80 bands.
#[test]
fn steps_begin_near_the_target_and_slow() {
    let model = model();
    let begins = |bands: i32, speed: i32| {
        let mut observer = balanced(&model);
        observer.motion.speed = speed << 16;
        Inching::default()
            .update(&model, &observer, bands_off(&model, bands), 1 << 20)
            .is_some()
    };
    assert!(begins(19, 119) && begins(-19, -119));
    assert!(!begins(21, 119) && !begins(-21, 0) && !begins(19, 121) && !begins(19, -121));
    let goes_on = |bands: i32| {
        let mut inching = Inching {
            state: State::Wait { still: 0 },
        };
        let observer = balanced(&model);
        let told = inching.update(&model, &observer, bands_off(&model, bands), 1 << 20);
        assert_eq!(told.is_none(), matches!(inching.state, State::Away));
        told.is_some()
    };
    assert!(goes_on(79) && goes_on(-79) && !goes_on(81) && !goes_on(-81));
}

/// A step starts in the second period at rest; its pulses are then sent to their end whatever the piston does, unless a
/// standstill intervenes.
#[test]
fn a_step_waits_for_the_piston_and_is_sent_whole() {
    let model = model();
    let mut observer = balanced(&model);
    let target = bands_off(&model, 10);
    let mut inching = Inching {
        state: State::Wait { still: 1 },
    };
    let next = |inching: &mut Inching, observer: &Observer| {
        inching.update(&model, observer, target, 1 << 20)
    };
    // It waits while the piston moves, and while a pulse is still to change the pressure.
    observer.motion.speed = 4 << 16;
    assert_eq!(next(&mut inching, &observer), Some(Inch::Wait));
    observer.motion.speed = 0;
    observer.a.expected += 2_100 << 8;
    inching.state = State::Wait { still: 1 };
    assert_eq!(next(&mut inching, &observer), Some(Inch::Wait));
    observer.a.expected -= 200 << 8;
    assert_eq!(next(&mut inching, &observer), Some(Inch::Wait), "the first");
    let planned = on_times(&model, openings(&model, &observer, target - (90 << 16)));
    let mut sent = [0; 4];
    for _ in 0..20 {
        let Some(Inch::Pulses(on)) = next(&mut inching, &observer) else {
            break;
        };
        sent = core::array::from_fn(|valve| sent[valve] + i32::from(on[valve]));
        observer.motion.speed = 90 << 16;
    }
    assert_eq!(sent, planned);
    assert!(
        planned.iter().any(|on| *on > model.times.period),
        "{planned:?}"
    );
    inching.state = State::Pulses { left: planned };
    inching.interrupt();
    assert_eq!(inching.state, State::Wait { still: 0 });
    let mut away = Inching::default();
    away.interrupt();
    assert_eq!(away, Inching::default());
}

/// By the documented formula, on either side and with one valve: 0.6 k_air |e| + Fc.
#[test]
fn a_step_makes_the_force_of_the_text() {
    let model = model();
    let observer = balanced(&model);
    let now = observer.expected();
    let air = |p: i32, area_mm2: f64, length: i32| {
        1.2 * f64::from(p) / 256.0 * area_mm2 * 1e-3 / (f64::from(length) / 65_536.0)
    };
    let stroke = 90 << 16;
    let exact =
        air(now.a, 314.16, model.length_a(stroke)) + air(now.b, 263.89, model.length_b(stroke));
    let found = f64::from(observer.stiffness(&model));
    assert!((found / exact / 1.05 - 1.0).abs() < 0.01, "{found} {exact}");
    for error_mm in [-20, -12, 12, 20] {
        let opened = openings(&model, &observer, error_mm << 16);
        let wanted =
            f64::from(error_mm) * 0.6 * found + f64::from(error_mm.signum() * model.coulomb);
        let off = made(&model, &observer, opened) / wanted - 1.0;
        assert!(off.abs() < 0.01, "{error_mm}: {opened:?} {off}");
        assert_eq!(opened.iter().filter(|open| **open > 0).count(), 1);
    }
}

/// The pair makes the demanded force to a hundredth of a finest pulse, each of its pulses can be made, and the chambers
/// are filled below the middle and vented above it.
#[test]
fn a_force_below_the_finest_pulses_is_made_by_a_pair() {
    let model = AxisModel {
        coulomb: 1000,
        ..model()
    };
    for (level, filled) in [(-(60_000 << 8), true), (60_000 << 8, false)] {
        let balance = allocation::targets(&model, 0);
        let observer = at(
            &model,
            Pressures {
                a: balance.a + level,
                b: balance.b + level,
            },
        );
        for error in [-(1 << 15), 1 << 15] {
            let opened = openings(&model, &observer, error);
            let shortest = model.times.shortest_opening();
            let pair = if filled { [0, 2] } else { [1, 3] };
            for (valve, open) in opened.iter().enumerate() {
                let sent = pair.contains(&valve);
                assert_eq!(*open >= shortest, sent, "{level} {error}: {opened:?}");
                assert!(sent || *open == 0);
            }
            let wanted = 0.5 * 0.6 * f64::from(observer.stiffness(&model)) + 1000.0;
            let off = made(&model, &observer, opened) - f64::from(error.signum()) * wanted;
            let grain = 0.02 * f64::from(model.pulse_force);
            assert!(off.abs() < grain, "{level} {error}: {off} of {wanted}");
        }
    }
    // From 0.8 of the finest pulse on, one pulse is used.
    let observer = balanced(&model);
    let [fill, vent, ..] = pulse_planner::valves(&model, &observer);
    let drive = (observer.expected().a, fill, vent);
    let [.., fill, vent] = pulse_planner::valves(&model, &observer);
    let counter = (observer.expected().b, fill, vent);
    let least = drive.1.finest().min(vent.finest());
    let sent = |share: i32| {
        let opened = step(&model, least / 100 * share, drive, counter);
        opened.iter().flatten().filter(|open| **open > 0).count()
    };
    assert_eq!((sent(79), sent(81)), (2, 1));
}

/// An opening is no shorter than the finest pulse, and no longer than 60 ms.
#[test]
fn an_opening_is_bounded_on_both_sides() {
    let model = model();
    for valve in pulse_planner::valves(&model, &balanced(&model)) {
        assert_eq!(valve.opening(0), model.times.shortest_opening());
        assert_eq!(valve.opening(1), model.times.shortest_opening());
    }
    let empty = Pressures {
        a: model.ambient,
        b: model.ambient,
    };
    let [_, vent, ..] = pulse_planner::valves(&model, &at(&model, empty));
    assert_eq!(vent.opening(400_000 << 8), OPENING_LONGEST);
    assert_eq!(OPENING_LONGEST, 60_000);
}

/// A chamber without room is left alone.
#[test]
fn a_full_drive_chamber_is_not_filled_and_an_empty_counter_chamber_not_vented() {
    let model = model();
    for (a, b, valve) in [(model.high, model.mean, 3), (model.mean, model.low, 0)] {
        let observer = at(&model, Pressures { a, b });
        let opened = openings(&model, &observer, 12 << 16);
        let opens = core::array::from_fn(|k| k == valve);
        assert_eq!(opened.map(|open| open > 0), opens, "{opened:?}");
    }
}
