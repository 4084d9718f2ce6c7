//! What strokes leave to each other, and who decides about the valves.

use super::*;
extern crate std;
use crate::axis::AxisData;
use crate::joint::Announced;
use std::vec::Vec;
use wheeleg_units::{Micros, Ticks};

fn model() -> AxisModel {
    AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
}

fn input(measured_mm: i16, reference_mm: i16) -> JointInput {
    JointInput {
        measured: PositionMm::from_int(measured_mm),
        reference: PositionMm::from_int(reference_mm),
        ..JointInput::default()
    }
}

/// A law in the middle of a move, after so many ticks.
fn moving(model: &AxisModel, ticks: u32) -> Predictive {
    let mut law = Predictive::new(model);
    for tick in 0..ticks {
        let way = (tick / 4).min(100) as i16;
        law.drive(model, &input(20 + way, 170));
    }
    law
}

type Flip = fn(&mut Predictive, u32);

/// Words of all blocks that the `Hash` leaves out and that have no test of their own.
const KEPT: [Flip; 32] = [
    |law, bit| law.a.damage(0, bit),
    |law, bit| law.b.damage(1, bit),
    |law, bit| law.a.damage(2, bit),
    |law, bit| law.b.damage(3, bit),
    |law, bit| law.a.damage(4, bit),
    |law, bit| law.b.damage(4, bit),
    |law, bit| law.a.damage(5, bit),
    |law, bit| law.b.damage(5, bit),
    |law, bit| law.a.pressure ^= 1 << bit,
    |law, bit| law.b.pressure ^= 1 << bit,
    |law, bit| law.a.expected ^= 1 << bit,
    |law, bit| law.b.expected ^= 1 << bit,
    |law, bit| law.course.middle ^= 1 << bit,
    |law, bit| law.course.speed ^= 1 << bit,
    |law, bit| law.course.end ^= 1 << bit,
    |law, bit| law.course.ahead ^= 1 << bit,
    |law, bit| law.course.now ^= 1 << bit,
    |law, bit| law.course.force ^= 1 << bit,
    |law, bit| law.course_check ^= 1 << bit,
    |law, bit| law.motion.stroke ^= 1 << bit,
    |law, bit| law.motion.speed ^= 1 << bit,
    |law, bit| law.motion.load ^= 1 << bit,
    |law, bit| law.motion.gained ^= 1 << bit,
    |law, _| law.motion.stuck ^= true,
    |law, bit| law.force ^= 1 << bit,
    |law, bit| law.wanted ^= 1 << bit,
    |law, bit| law.motion_check ^= 1 << bit,
    |law, bit| law.push_check ^= 1 << bit,
    |law, bit| law.awaits ^= 1 << bit,
    |law, _| law.quiet ^= true,
    |law, bit| law.rest_check ^= 1 << bit,
    |law, _| {
        law.makes_up = match law.makes_up {
            MakesUp::No => MakesUp::Extends,
            MakesUp::Extends | MakesUp::Retracts => MakesUp::No,
        };
    },
];

/// A flipped bit is seen before a stroke uses the word, and within a period, unless a stroke has
/// written the word anew before.
#[test]
fn every_flipped_bit_of_what_is_kept_is_seen_before_it_is_used() {
    let model = model();
    for ticks in 200..204 {
        let sound = moving(&model, ticks);
        for (number, flip) in KEPT.iter().enumerate() {
            for bit in 0..32 {
                let mut flipped = sound.clone();
                let mut twin = sound.clone();
                flip(&mut flipped, bit);
                let mut seen = false;
                for _ in 0..4 {
                    seen |= !flipped.kept_is_sound();
                    if seen {
                        break;
                    }
                    let given = flipped.drive(&model, &input(70, 170));
                    let right = twin.drive(&model, &input(70, 170));
                    assert_eq!(given.on, right.on, "{ticks} {number} {bit}");
                }
                // Not seen: it was written anew, and nothing of it is left.
                if !seen {
                    assert!(flipped.kept_is_sound() && twin.kept_is_sound());
                    assert_eq!(flipped.sum_of_motion(), twin.sum_of_motion());
                    assert_eq!(flipped.sum_of_rest(), twin.sum_of_rest());
                    assert_eq!(flipped.course.sum(), twin.course.sum());
                    assert_eq!(flipped.learner, twin.learner);
                }
            }
        }
    }
}

/// Damage is not sealed by what happens while somebody else drives.
#[test]
fn damage_is_seen_while_somebody_else_drives() {
    let model = model();
    for ticks in 200..204 {
        for flip in KEPT {
            let mut law = moving(&model, ticks);
            let mut seen = false;
            flip(&mut law, 7);
            let before = law.clone();
            for _ in 0..4 {
                seen |= !law.kept_is_sound();
                law.observe(&model, PositionMm::from_int(70));
            }
            let mut twin = moving(&model, ticks);
            for _ in 0..4 {
                twin.observe(&model, PositionMm::from_int(70));
            }
            let same = law.sum_of_motion() == twin.sum_of_motion()
                && law.sum_of_rest() == twin.sum_of_rest();
            assert!(seen || same, "{ticks}: {before:?}");
        }
    }
}

/// What was seen is forgotten with all the rest: nothing of it is left, so that a cleared fault stays
/// cleared, and the law drives again.
#[test]
fn damage_that_was_seen_is_forgotten_with_all_the_rest() {
    let model = model();
    let flips = KEPT.into_iter().chain([
        (|law: &mut Predictive, bit: u32| law.inertia.mass ^= 1 << bit) as Flip,
        |law, _| law.learner = flipped_learner(&law.learner),
    ]);
    for (number, flip) in flips.enumerate() {
        for ticks in 200..204 {
            let mut law = moving(&model, ticks);
            flip(&mut law, 7);
            // As a board does, in hold and under control.
            let (mut tick, mut seen) = (0, false);
            while tick < 8 {
                if !law.kept_is_sound() {
                    seen = true;
                    law.forget(&model);
                    law.observe(&model, PositionMm::from_int(70));
                    break;
                }
                law.observe(&model, PositionMm::from_int(70));
                tick += 1;
            }
            if !seen {
                // Written anew before it was used.
                continue;
            }
            let mut fresh = Predictive::new(&model);
            fresh.observe(&model, PositionMm::from_int(70));
            for tick in 0..8 {
                assert!(law.kept_is_sound(), "{number} {ticks} {tick}: {law:?}");
                law.observe(&model, PositionMm::from_int(70));
                fresh.observe(&model, PositionMm::from_int(70));
            }
            assert_eq!(law.motion, fresh.motion, "{number} {ticks}");
            assert_eq!(law.pressures(), fresh.pressures(), "{number} {ticks}");
            assert_eq!(law.inertia, fresh.inertia, "{number} {ticks}");
            for _ in 0..12 {
                law.drive(&model, &input(70, 100));
            }
            assert!(law.turn.drives && law.kept_is_sound());
        }
    }
}

/// One of a move that nobody has sealed.
fn flipped_learner(learner: &Learner) -> Learner {
    let mut other = *learner;
    other.damage();
    other
}

/// After a stop in the middle of a move nothing of its force is left.
#[test]
fn a_move_after_a_stop_does_not_begin_with_the_force_of_the_one_before() {
    let model = model();
    for ticks in 200..204 {
        let mut law = moving(&model, ticks);
        for _ in 0..1000 {
            law.observe(&model, PositionMm::from_int(70));
        }
        for tick in 0..12 {
            let sent = law.drive(&model, &input(70, 20)).on;
            let [fill_a, _, _, vent_b] = sent;
            assert_eq!((fill_a, vent_b), (0, 0), "{ticks} {tick}: {sent:?}");
        }
    }
}

/// However slow the valves are to shut, the law begins no pulse of a chamber before those of
/// somebody else have had their time for it.
#[test]
fn a_law_that_takes_over_waits_until_the_valves_have_shut() {
    for valve_off in [2000, 6000, 20_000] {
        let data = AxisData {
            valve_off: Micros(valve_off),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        for observed in 400..404 {
            let mut law = Predictive::new(&model);
            for _ in 0..observed {
                law.observe(&model, PositionMm::from_int(90));
            }
            for _ in 0..6 {
                law.observe(&model, PositionMm::from_int(90));
                law.sent(&[1000, 0, 0, 1000]);
            }
            // The coils are on in the tick that begins; what is given is sent a tick later.
            let mut first = None;
            for tick in 1..80 {
                let [fill_a, _, _, vent_b] = law.drive(&model, &input(90, 170)).on;
                if first.is_none() && (fill_a > 0 || vent_b > 0) {
                    first = Some(tick);
                }
            }
            let gap_us = 1000 * (first.expect("it pulses") - 1);
            let least_us = model.times.shortest_gap;
            assert!(gap_us >= least_us, "{valve_off} {observed}: {gap_us}");
            assert!(
                gap_us < least_us + 16_000,
                "{valve_off} {observed}: {gap_us}"
            );
        }
    }
}

/// What somebody else sends is counted once, whatever the strokes in which that began and ended, also
/// where the law takes over in the midst of it.
#[test]
fn what_somebody_else_sends_is_counted_once() {
    let model = model();
    for before in 400..404 {
        for ticks in 1..9 {
            let mut law = Predictive::new(&model);
            for _ in 0..before {
                law.observe(&model, PositionMm::from_int(90));
            }
            for _ in 0..ticks {
                law.observe(&model, PositionMm::from_int(90));
                law.sent(&[600, 0, 0, 0]);
            }
            for tick in 0..12 {
                law.drive(&model, &input(90, 90));
                assert!(law.turn.drives || tick < 8, "{before} {ticks}");
            }
            // Choked: of C ρ0 R T p_s a share of the volume, n times as much in pressure.
            let length = f64::from(model.length_a(90 << 16)) / 65_536.0;
            let flow = f64::from(model.flow_a) / 65_536.0;
            let open_s = f64::from(ticks) * 600e-6;
            let rise = 1.2 * f64::from(model.supply) * flow * open_s / length;
            let risen = f64::from(law.pressures().a - model.ambient);
            let off = (risen / rise - 1.0).abs();
            assert!(off < 0.03, "{before} {ticks}: {risen} {rise}");
        }
    }
}

/// A plan that is cut counts as far as it was sent, tick by tick.
#[test]
fn a_plan_that_is_cut_counts_as_far_as_it_was_sent() {
    let model = model();
    let times = &model.times;
    let mut opened = 0;
    // From the begin of periods in which the law is busy.
    for period in 20..60 {
        let begun = moving(&model, 4 * period);
        assert_eq!(begun.turn.stroke, Stroke::A);
        let start = begun.next.wrapping_sub(times.period as u32) + model.moment as u32;
        for sent_ticks in 0..4 {
            let mut law = begun.clone();
            // The same valves, told tick by tick.
            let mut told: Vec<_> = [law.a.tracks(), law.b.tracks()].concat();
            let mut given = law.due(&model, 0);
            for tick in 0..=sent_ticks {
                for (track, on) in told.iter_mut().zip(given) {
                    track.energise(begun.next + 1000 * tick, i32::from(on), 1000, times);
                }
                if tick < sent_ticks {
                    given = law.drive(&model, &input(70, 170)).on;
                }
            }
            let end = begun.next + 1000 * (sent_ticks + 1);
            for track in &mut told {
                track.energise(end, 0, 1000, times);
            }
            let followed = [sent_ticks > 0, sent_ticks > 1];
            law.observe(&model, PositionMm::from_int(70));
            let cut = [law.a.tracks(), law.b.tracks()].concat();
            for (valve, (mut told, mut cut)) in told.into_iter().zip(cut).enumerate() {
                // Those whose chamber was followed have passed a period.
                let from = if followed[valve / 2] {
                    start.wrapping_add(times.period as u32)
                } else {
                    start
                };
                assert!(!cut.coil(), "{period} {sent_ticks} {valve}");
                // What was seen before that is the same: it was decided before.
                told.passes(start, from.wrapping_sub(start) as i32);
                let right = told.passes(from, 60_000);
                assert_eq!(
                    cut.passes(from, 60_000),
                    right,
                    "{period} {sent_ticks} {valve}"
                );
                opened += right;
            }
        }
    }
    assert!(opened > 100_000, "{opened}");
}

/// A law that takes over plans nothing before it has wanted a force.
#[test]
fn the_first_plan_follows_a_force_that_was_wanted() {
    let model = model();
    for observed in 1..9 {
        let mut law = Predictive::new(&model);
        for _ in 0..observed {
            law.observe(&model, PositionMm::from_int(20));
        }
        let mut first = None;
        for tick in 0..16 {
            let sent = law.drive(&model, &input(20, 170)).on;
            if first.is_none() && sent != [0; 4] {
                first = Some(tick);
            }
        }
        // A period at most until it wants, and the rest of that.
        assert!(first.is_some_and(|tick| tick <= 7), "{observed}: {first:?}");
    }
}

/// An announced move is awaited by the edge of slipping, and forgotten with its end.
#[test]
fn an_announced_move_vents_the_counter_chamber() {
    let model = model();
    let mut law = Predictive::new(&model);
    for _ in 0..400 {
        law.observe(&model, PositionMm::from_int(90));
        law.sent(&[1000, 0, 1000, 0]);
    }
    let announced = JointInput {
        announced: Some(Announced {
            reference: PositionMm::from_int(150),
            after: Ticks(200),
        }),
        ..input(90, 90)
    };
    let mut vented = 0;
    for _ in 0..200 {
        vented += u32::from(law.drive(&model, &announced).on[3]);
    }
    assert!(vented > 5_000, "{vented}");
    for _ in 0..5 {
        law.drive(&model, &input(90, 90));
    }
    assert_eq!(law.awaits, NOTHING);
}
