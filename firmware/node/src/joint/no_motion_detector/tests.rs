//! Tests of the watch for missing motion.

use super::*;
use crate::checksum::Checksum;
use wheeleg_control::axis::AxisData;

/// A tick under control that sends `on`.
fn sample(watch: &mut MotionWatch, on: &OnTimes, driven: &Driven, model: &MotionModel) -> bool {
    let overdue = watch.judge(driven, model);
    watch.follow(on, driven.position, model);
    overdue
}

const PUSH: OnTimes = [1000, 0, 0, 1000];
const PULL: OnTimes = [0, 1000, 1000, 0];
const SHUT: OnTimes = [0; 4];

fn model(margin: i16) -> MotionModel {
    let gains = JointGains {
        axis: AxisData::default(),
        ..JointGains::default()
    };
    MotionModel::new(&gains, PositionMm::from_int(margin)).unwrap()
}

const fn driven(reference: i16, position: i16) -> Driven {
    Driven {
        reference: PositionMm::from_int(reference),
        position: PositionMm::from_int(position),
        velocity: VelocityMmS::ZERO,
    }
}

/// A watch that knows both chambers and has learnt a load of `learnt` mN.
fn knowing(learnt: i32, position: i16, model: &MotionModel) -> MotionWatch {
    let mut watch = MotionWatch::new(model, PositionMm::from_int(position));
    for on in [PUSH, PULL, [0, 1000, 0, 1000]] {
        for _ in 0..1500 {
            watch
                .air
                .follow(&on, PositionMm::from_int(position), &model.air, false);
        }
    }
    assert!(watch.air.is_comparable(&model.air));
    (watch.slid, watch.learnt) = (MEMORY, learnt);
    watch
}

/// Tick of the fault, and the force on the piston, N, 27 ticks before it (ten rounds including both ends).
fn fault(
    mut watch: MotionWatch,
    on: OnTimes,
    driven: Driven,
    model: &MotionModel,
) -> Option<(u32, f64)> {
    let mut forces = [0; 5000];
    (1..5000).find_map(|tick| {
        let found = sample(&mut watch, &on, &driven, model);
        forces[tick] = watch.air.force(&model.air);
        found.then(|| (tick as u32, f64::from(forces[tick - 27]) / 1e3))
    })
}

#[test]
fn a_piston_that_should_move_for_all_that_was_learnt_is_at_fault() {
    // The margin as specified, or half of 158 N; plus break-away friction of 15 N.
    for (margin, bound) in [(50, 65.0), (0, 94.0)] {
        let model = model(margin);
        for load in [-30_000, 0, 30_000] {
            let watch = knowing(load, 90, &model);
            let (_, at) = fault(watch, PUSH, driven(120, 90), &model).unwrap();
            let over = at - f64::from(load) / 1e3 - bound;
            assert!((0.0..2.0).contains(&over), "{margin} {load} {over}");
            let (_, at) = fault(watch, PULL, driven(60, 90), &model).unwrap();
            let over = -at + f64::from(load) / 1e3 - bound;
            assert!((0.0..2.0).contains(&over), "{margin} {load} {over}");
        }
    }
}

#[test]
fn nothing_is_expected_near_the_reference_away_from_it_or_against_an_end() {
    let model = model(50);
    for (on, reference, position) in [
        (PUSH, 93, 90),
        (PULL, 120, 90),
        (PUSH, 60, 90),
        (PUSH, 200, 178),
        (PULL, -20, 2),
    ] {
        let watch = knowing(0, position, &model);
        let found = fault(watch, on, driven(reference, position), &model);
        assert_eq!(found, None, "{reference} {position}");
    }
    let watch = knowing(0, 2, &model);
    assert!(fault(watch, PUSH, driven(60, 2), &model).is_some());
}

#[test]
fn a_piston_that_moves_is_not_and_one_that_shakes_is() {
    let model = model(50);
    let run = |position: &dyn Fn(u32) -> i32, speed: i16| {
        let mut watch = knowing(0, 90, &model);
        (0..3000).any(|tick| {
            let driven = Driven {
                position: PositionMm::from_raw((90 << 16) + position(tick)),
                velocity: VelocityMmS::from_int(speed),
                ..driven(120, 90)
            };
            sample(&mut watch, &PUSH, &driven, &model)
        })
    };
    // 0.55 mm in 30 ms, and half as much.
    assert!(!run(&|tick| (tick / 30 * 36_000) as i32 % (20 << 16), 0));
    assert!(run(&|tick| (tick / 60 * 30_000) as i32 % (20 << 16), 0));
    assert!(run(&|tick| (tick % 2 * 30_000) as i32, 0));
    // A piston that reverses has a speed.
    assert!(!run(&|_| 0, 12));
}

#[test]
fn without_knowledge_it_takes_the_largest_force_for_200_ms() {
    let model = model(50);
    let watch = MotionWatch::new(&model, PositionMm::from_int(90));
    // B is known to be empty after 1.17 s.
    let (tick, _) = fault(watch, PUSH, driven(120, 90), &model).unwrap();
    assert!((1360..1400).contains(&tick), "{tick}");
    // If only one of two valves is open, the other chamber remains unknown.
    let one = fault(watch, [1000, 0, 0, 0], driven(120, 90), &model);
    assert_eq!(one, None);
    // Being disarmed, or a minute at rest, means forgetting.
    for minute in [false, true] {
        let mut watch = knowing(0, 90, &model);
        if minute {
            for _ in 0..=u16::MAX {
                sample(&mut watch, &SHUT, &driven(90, 90), &model);
            }
        } else {
            watch.rest(&SHUT, PositionMm::from_int(90), &model);
        }
        let (tick, _) = fault(watch, PUSH, driven(120, 90), &model).unwrap();
        assert!((1360..1400).contains(&tick), "{minute} {tick}");
    }
}

#[test]
fn a_chamber_that_should_hold_more_than_any_supply_has_lost_its_air() {
    let model = model(0);
    let mut watch = knowing(0, 20, &model);
    for _ in 0..2000 {
        sample(&mut watch, &[0, 0, 1000, 0], &driven(20, 20), &model);
    }
    // B at supply pressure; 130 mm further in it would have 27 bar.
    let mut found = None;
    for tick in 0..2000_i32 {
        let moved = (tick * 13_107).min(130 << 16);
        let driven = Driven {
            position: PositionMm::from_raw((20 << 16) + moved),
            velocity: if moved < 130 << 16 {
                VelocityMmS::from_int(200)
            } else {
                VelocityMmS::ZERO
            },
            ..driven(150, 20)
        };
        if sample(&mut watch, &SHUT, &driven, &model) {
            found = Some(tick);
            break;
        }
    }
    // While the piston moves it may be an impact; 28 ticks after it has come to rest it is not.
    assert!(
        found.is_some_and(|tick| (674..684).contains(&tick)),
        "{found:?}"
    );
}

#[test]
fn the_load_is_the_force_of_a_sliding_piston_less_its_friction() {
    let model = model(0);
    let mut watch = knowing(0, 90, &model);
    (watch.slid, watch.learnt) = (0, 0);
    let force = watch.air.force(&model.air);
    for (ticks, speed, friction) in [(400, 100, 14_000), (4000, -100, -14_000)] {
        slide(&mut watch, ticks, speed, &model);
        // 10 N of Coulomb and 4 N of viscous friction.
        assert!(
            (watch.learnt - (force - friction)).abs() < 500,
            "{}",
            watch.learnt
        );
    }
    // Standing teaches nothing, nor do the cushions, 6 mm before either end.
    let before = watch.learnt;
    for (at, speed, teaches) in [
        (90, 0, false),
        (5, 100, false),
        (6, 100, false),
        (174, 100, false),
        (5, -100, false),
        (175, 100, false),
        (175, -100, false),
        (7, 100, true),
        (173, 100, true),
    ] {
        let mut watch = watch;
        for _ in 0..3 {
            let driven = Driven {
                velocity: VelocityMmS::from_int(speed),
                ..driven(at, at)
            };
            sample(&mut watch, &SHUT, &driven, &model);
        }
        assert_eq!(watch.learnt != before, teaches, "{at} {speed}");
    }
}

/// Slides for this many ticks with the chambers as they are.
fn slide(watch: &mut MotionWatch, ticks: u32, speed: i16, model: &MotionModel) {
    for _ in 0..ticks {
        let driven = Driven {
            velocity: VelocityMmS::from_int(speed),
            ..driven(90, 90)
        };
        sample(watch, &SHUT, &driven, model);
    }
}

#[test]
fn what_was_learnt_counts_after_100_ms_of_sliding() {
    let model = model(50);
    // Rounds of three ticks: 32 of them, and 33. Without knowledge rule 2 waits for nine tenths of 188 N, and 200 ms
    // more.
    for (ticks, least, most) in [(96, 142.0, 200.0), (99, 60.0, 70.0)] {
        let mut watch = knowing(0, 90, &model);
        (watch.slid, watch.learnt) = (0, 0);
        let forward = (ticks / 2) / 3 * 3;
        slide(&mut watch, forward, 100, &model);
        slide(&mut watch, ticks - forward, -100, &model);
        watch.learnt = 0;
        let (_, at) = fault(watch, PUSH, driven(120, 90), &model).unwrap();
        assert!((least..most).contains(&at), "{ticks} {at}");
    }
}

#[test]
fn the_mean_is_over_the_last_100_ms_of_sliding() {
    let model = model(0);
    let mut watch = knowing(0, 90, &model);
    slide(&mut watch, 3000, 100, &model);
    let old = f64::from(watch.learnt);
    // In the other direction friction has the other sign: a change of 28 N, of which 33 rounds leave (32/33)^33.
    slide(&mut watch, 99, -100, &model);
    let left = (old + 28_000.0 - f64::from(watch.learnt)) / 28_000.0;
    assert!((left - 0.362).abs() < 0.02, "{left}");
}

#[test]
fn every_flipped_bit_of_what_the_watch_keeps_changes_its_seal() {
    let model = model(0);
    let mut watch = knowing(0, 90, &model);
    // One word with many bits set and one with none: whatever combines two fields must preserve both.
    for (slid, doubt) in [(0, 0), (0x55AA, 0xA55A)] {
        (watch.slid, watch.doubt) = (slid, doubt);
        let sound = Checksum::of(&watch);
        for bit in 0..32 {
            let mut damaged = [watch; 5];
            damaged[0].from ^= 1 << bit;
            damaged[1].learnt ^= 1 << bit;
            damaged[2].slid ^= 1 << (bit % 16);
            damaged[3].doubt ^= 1 << (bit % 16);
            damaged[4].stands ^= 1 << (bit % 16);
            for (field, damaged) in damaged.iter().enumerate() {
                assert_ne!(Checksum::of(damaged), sound, "{field} {bit}");
            }
        }
    }
}

#[test]
fn a_precharge_holds_the_force_that_it_found() {
    let model = model(0);
    let at = PositionMm::from_int(90);
    let mut watch = knowing(0, 90, &model);
    let fill = |watch: &mut MotionWatch, on: OnTimes| {
        for _ in 0..60 {
            watch.rest(&on, at, &model);
        }
    };
    fill(&mut watch, [1000, 0, 0, 0]);
    let force = watch.air.force(&model.air);
    assert!(force > 20_000, "{force}");
    assert_eq!(watch.unbalanced(&model), force);
    watch.hold_force(&model);
    assert_eq!((watch.unbalanced(&model), watch.slid), (0, 0));
    // More pressure in B pushes back, by as much as it changes the force.
    fill(&mut watch, [0, 0, 1000, 0]);
    let change = watch.air.force(&model.air) - force;
    assert!(change < -20_000, "{change}");
    assert_eq!(watch.unbalanced(&model), change);
    let [a, b] = watch.air.pressures();
    assert_eq!(watch.least_pressure(), a.min(b));
}

#[test]
fn each_bound_of_the_rules_is_where_it_is_told() {
    let model = model(50);
    // Motion is expected from 4 mm off the reference and 3 mm before the ends.
    for (on, reference, position) in [
        (PUSH, 94, 90),
        (PULL, 86, 90),
        (PUSH, 200, 177),
        (PULL, -20, 3),
    ] {
        let watch = knowing(0, position, &model);
        let found = fault(watch, on, driven(reference, position), &model);
        assert!(found.is_some(), "{reference} {position}");
    }
    // The margin itself is allowed, a millinewton more is not.
    let mut watch = knowing(0, 90, &model);
    let force = watch.air.force(&model.air);
    let rule = |watch: &MotionWatch, reference: i16, model: &MotionModel| {
        let [reference, position] = [reference, 90].map(PositionMm::from_int);
        watch.rule(reference, position, model)
    };
    for (reference, sign) in [(120, 1), (60, -1)] {
        watch.learnt = force - sign * model.margin;
        assert_eq!(rule(&watch, reference, &model), Rule::None);
        watch.learnt -= sign;
        assert_eq!(rule(&watch, reference, &model), Rule::Pushed);
        // So are nine tenths of the largest force for a watch that has learnt nothing.
        let (slid, mut model) = (watch.slid, model);
        watch.slid = 0;
        let least = sign * force;
        model.nearly_all = (least, least);
        assert_eq!(rule(&watch, reference, &model), Rule::None);
        model.nearly_all = (least - 1, least - 1);
        assert_eq!(rule(&watch, reference, &model), Rule::Largest);
        watch.slid = slid;
    }
}

#[test]
fn of_short_pulses_only_those_of_a_piston_that_moves_count() {
    let model = model(50);
    // 6 ms every 20 ms: a valve specified to open in 3.5 ms may not open.
    let gain = |moves: bool| {
        let mut watch = knowing(0, 90, &model);
        let driven = Driven {
            velocity: VelocityMmS::from_int(if moves { 12 } else { 0 }),
            ..driven(90, 90)
        };
        for _ in 0..3 {
            sample(&mut watch, &SHUT, &driven, &model);
        }
        let before = watch.air.force(&model.air);
        for tick in 0..200 {
            let on = if tick % 20 < 6 { [1000, 0, 0, 0] } else { SHUT };
            sample(&mut watch, &on, &driven, &model);
        }
        watch.air.force(&model.air) - before
    };
    assert_eq!(gain(false), 0);
    assert!(gain(true) > 20_000, "{}", gain(true));
}

/// The first rounds of sliding have a weight of at most one sixth, so that a single reading is not taken for a load.
#[test]
fn the_first_round_of_sliding_is_a_sixth_of_the_mean() {
    let model = model(0);
    let mut watch = knowing(0, 90, &model);
    (watch.slid, watch.learnt) = (0, 0);
    let taken = watch.air.force(&model.air) - 14_000;
    slide(&mut watch, 3, 100, &model);
    assert!((watch.learnt - taken / 6).abs() < 100, "{}", watch.learnt);
}

#[test]
fn tools_are_told_what_the_watch_makes_of_the_axis() {
    let model = model(50);
    let mut watch = knowing(1234, 90, &model);
    let at = |mm: i16| PositionMm::from_int(mm);
    let begun = (0..1000).any(|_| {
        sample(&mut watch, &PUSH, &driven(120, 90), &model);
        watch.doubt >= 3 * STRONG
    });
    assert!(begun);
    // Each round of rule 1 takes 3 ms.
    let account = watch.account(at(120), at(90), &model);
    assert_eq!(account.rule, 1);
    let rounds = u32::from(watch.doubt / STRONG);
    assert!(rounds > 0);
    let off = i64::from(account.overdue.get()) - i64::from(rounds * 3000);
    assert!(off.abs() <= 12 * i64::from(rounds), "{account:?}");
    assert_eq!(account.force, watch.air.force(&model.air));
    assert_eq!((account.learnt, account.slid_ms), (1234, 99));
    assert_eq!(account.pressures, watch.air.pressures());
    assert_eq!(watch.account(at(91), at(90), &model).rule, 0);
}
