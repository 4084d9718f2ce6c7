//! What strokes leave to each other, and who decides about the valves.

use super::*;
use crate::axis::AxisData;
use crate::joint::Announced;
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
const KEPT: [Flip; 24] = [
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

/// What was seen is mended while somebody else drives, so that a cleared fault stays cleared.
#[test]
fn damage_that_was_seen_is_mended_while_somebody_else_drives() {
    let model = model();
    let flips = KEPT.into_iter().chain([
        (|law: &mut Predictive, bit: u32| law.inertia.mass ^= 1 << bit) as Flip,
        |law, _| law.learner = flipped_learner(&law.learner),
    ]);
    for flip in flips {
        for ticks in 200..204 {
            let mut law = moving(&model, ticks);
            flip(&mut law, 7);
            for _ in 0..8 {
                law.observe(&model, PositionMm::from_int(70));
            }
            for tick in 0..8 {
                assert!(law.kept_is_sound(), "{ticks} {tick}: {law:?}");
                law.observe(&model, PositionMm::from_int(70));
            }
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

/// A law that takes over at its target begins no pulse, whatever others had on.
#[test]
fn taking_over_in_the_middle_of_pulses_begins_none() {
    for valve_on in [3500, 10_000, 40_000] {
        let data = AxisData {
            valve_on: Micros(valve_on),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        for observed in 400..404 {
            let mut law = Predictive::new(&model);
            for _ in 0..observed {
                law.observe(&model, PositionMm::from_int(90));
            }
            for _ in 0..2 {
                law.observe(&model, PositionMm::from_int(90));
                law.sent(&[1000, 0, 1000, 0]);
            }
            // The coil is on in the tick that begins, and off from then on.
            let mut before = [1000, 0, 1000, 0];
            for tick in 0..16 {
                let sent = law.drive(&model, &input(90, 90)).on;
                for (on, before) in sent.iter().zip(before) {
                    let rises = *on > 0 && before == 0;
                    assert!(!rises || tick > 6, "{valve_on} {observed} {tick}: {sent:?}");
                }
                before = sent;
            }
        }
    }
}

/// A valve is seen open for as long as somebody else had it open, whatever the stroke in which
/// that began and ended, and the law begins when it is counted.
#[test]
fn what_somebody_else_sends_is_counted_once() {
    let model = model();
    let mut ends = [0; 4];
    for (observed, end) in (400..404).zip(&mut ends) {
        let mut law = Predictive::new(&model);
        for tick in 0..observed + 20 {
            law.observe(&model, PositionMm::from_int(90));
            let on = if tick < observed - 390 { 600 } else { 0 };
            law.sent(&[on, 0, 0, 0]);
        }
        let last = if observed == 400 {
            10.0
        } else {
            f64::from(observed - 390)
        };
        // Choked: of C ρ0 R T p_s a share of the volume, n times as much in pressure.
        let length = f64::from(model.length_a(90 << 16)) / 65_536.0;
        let flow = f64::from(model.flow_a) / 65_536.0;
        let rise = 1.2 * f64::from(model.supply) * flow * last * 600e-6 / length;
        let risen = f64::from(law.pressures().a - model.ambient);
        assert!(
            (risen / rise - 1.0).abs() < 0.03,
            "{observed}: {risen} {rise}"
        );
        *end = law.pressures().a;
        for tick in 0..8 {
            law.drive(&model, &input(90, 90));
            assert!(law.turn.drives || tick < 4, "{observed} {tick}");
        }
        assert!((law.pressures().a - *end).abs() < 1 << 16);
    }
}

/// Whoever decides, the account of the valves is that of what was sent.
#[test]
fn a_plan_that_is_cut_counts_as_far_as_it_was_sent() {
    let model = model();
    for ticks in 200..208 {
        let mut cut = moving(&model, ticks);
        // The tick that begins still has what the law gave out last; then all is shut.
        for _ in 0..40 {
            cut.observe(&model, PositionMm::from_int(70));
            cut.sent(&[0; 4]);
        }
        let pressures = cut.pressures();
        assert!(
            (model.ambient..=model.supply).contains(&pressures.a),
            "{ticks}: {pressures:?}"
        );
        // Nothing is under way any more: another period changes nothing.
        let before = cut.pressures();
        for _ in 0..4 {
            cut.observe(&model, PositionMm::from_int(70));
        }
        assert_eq!(cut.pressures(), before, "{ticks}");
    }
}

/// A law that takes over in the last tick of a period plans nothing there.
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
