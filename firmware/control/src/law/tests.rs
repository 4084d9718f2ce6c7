//! Who commands the valves, what the law demands, and what it keeps.

use super::*;
extern crate std;
mod preload;
use crate::axis::AxisData;
use crate::joint::Announced;
use wheeleg_units::{Micros, PositionMm, Ticks};

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

/// A law in the middle of a move, after this many ticks.
fn moving(model: &AxisModel, ticks: u32) -> Predictive {
    let mut law = Predictive::new(model);
    for tick in 0..ticks {
        let way = (tick / 4).min(100) as i16;
        law.drive(model, &input(20 + way, 170));
    }
    law
}

/// With a standing foot the piston moves a share of the robot, and the law counts on it from the next period on; not
/// where the mass is learnt.
#[test]
fn a_standing_foot_gives_the_law_its_mass() {
    let kg_of = |data: &AxisData, stands: bool, drives: bool| {
        let model = AxisModel::new(data, Micros(1000)).expect("in range");
        let mut law = Predictive::new(&model);
        let mut told = [false, stands, false].map(|stands| {
            law.set_foot_stands(stands);
            for _ in 0..PERIOD_TICKS {
                if drives {
                    law.drive(&model, &input(90, 90));
                } else {
                    law.observe(&model, PositionMm::from_int(90));
                }
            }
            assert_eq!(law.gains, SpeedGains::new(&model, law.mass()));
            f64::from(law.mass()) / 65_536.0
        });
        told.iter_mut()
            .for_each(|kg| *kg = (*kg * 10.0).round() / 10.0);
        told
    };
    let told = AxisData {
        mass: PositionMm::from_f64(0.8),
        standing_mass: PositionMm::from_int(5),
        learns_mass: false,
        ..AxisData::default()
    };
    let kg = |data: &AxisData, stands: bool| {
        let driven = kg_of(data, stands, true);
        assert_eq!(driven, kg_of(data, stands, false), "whoever drives");
        driven
    };
    assert_eq!(kg(&told, true), [0.8, 5.0, 0.8]);
    assert_eq!(kg(&told, false), [0.8; 3]);
    let learns = AxisData {
        learns_mass: true,
        ..told
    };
    assert_eq!(kg(&learns, true), [0.8; 3]);
    let none = AxisData {
        standing_mass: PositionMm::ZERO,
        ..told
    };
    assert_eq!(kg(&none, true), [0.8; 3]);
}

/// Every bit of the law's state is in its `Hash`: flipping any of them changes the sum.
#[test]
fn the_hash_covers_what_is_kept() {
    use core::hash::{Hash, Hasher};
    struct Sum(u32);
    impl Hasher for Sum {
        fn write(&mut self, bytes: &[u8]) {
            for byte in bytes {
                self.0 = self
                    .0
                    .wrapping_mul(0x9E37_79B1)
                    .wrapping_add(u32::from(*byte));
            }
        }
        fn finish(&self) -> u64 {
            u64::from(self.0)
        }
    }
    let sum = |law: &Predictive| {
        let mut sum = Sum(0);
        law.hash(&mut sum);
        sum.finish()
    };
    let sound = moving(&model(), 202);
    let flips: [fn(&mut Predictive, u32); 13] = [
        |law, bit| law.observer.friction.flip(bit),
        |law, bit| law.observer.a.pressure ^= 1 << bit,
        |law, bit| law.observer.b.expected ^= 1 << bit,
        |law, bit| law.observer.a.bounds[1] ^= 1 << bit,
        |law, bit| law.observer.motion.speed ^= 1 << bit,
        |law, bit| law.observer.motion.load ^= 1 << bit,
        |law, bit| law.observer.inertia.mass ^= 1 << bit,
        |law, bit| law.observer.force ^= 1 << bit,
        |law, bit| law.gains.brake ^= 1 << bit,
        |law, bit| law.begin ^= 1 << bit,
        |law, bit| law.measured ^= 1 << bit,
        |law, bit| law.plan[0] ^= 1 << (bit % 16),
        |law, _| law.drives ^= true,
    ];
    for flip in flips {
        for bit in 0..32 {
            let mut flipped = sound.clone();
            flip(&mut flipped, bit);
            assert_ne!(sum(&flipped), sum(&sound), "{flipped:?}");
        }
    }
}

/// A moving reference is followed; the piston does not rest at it.
#[test]
fn a_moving_reference_is_not_rested_at() {
    let model = model();
    for (speed, rests) in [(0, true), (60_000, true), (70_000, false), (-70_000, false)] {
        let mut law = Predictive::new(&model);
        for _ in 0..400 {
            let still = JointInput {
                reference_velocity: VelocityMmS::from_raw(speed),
                ..input(90, 90)
            };
            law.drive(&model, &still);
        }
        assert_eq!(law.is_settled(), rests, "{speed}");
    }
}

/// After a stop in the middle of a move nothing is left of its force.
#[test]
fn a_move_after_a_stop_does_not_begin_with_the_force_of_the_one_before() {
    // The test moves the piston itself, without a force, so neither mass nor friction can be learnt.
    let data = AxisData {
        learns_mass: false,
        ..AxisData::default()
    };
    let model = AxisModel::new(&data, Micros(1000)).expect("in range");
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

/// However slow the valves are to shut, the law begins no pulse of a chamber before those that somebody else sent have
/// had their time to shut.
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
                law.external_on_times(&[1000, 0, 0, 1000]);
            }
            // The coils are on in the tick that begins; what is returned is sent a tick later.
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

/// What somebody else sends is counted once, whatever the strokes at which it began and ended, and also if the law
/// takes over in the middle of it.
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
                law.external_on_times(&[600, 0, 0, 0]);
            }
            for tick in 0..12 {
                law.drive(&model, &input(90, 90));
                assert!(law.drives || tick < 4, "{before} {ticks}");
            }
            // Choked: pressure rises at n C ρ0 R T p_s over the volume.
            let length = f64::from(model.length_a(90 << 16)) / 65_536.0;
            let flow = f64::from(model.choked_speed_a) / 65_536.0;
            let open_s = f64::from(ticks) * 600e-6;
            let rise = 1.2 * f64::from(model.supply) * flow * open_s / length;
            let risen = f64::from(law.pressures().a - model.ambient);
            let off = (risen / rise - 1.0).abs();
            assert!(off < 0.03, "{before} {ticks}: {risen} {rise}");
        }
    }
}

/// A plan that is cut short counts as far as it was sent, tick by tick.
#[test]
fn a_plan_that_is_cut_counts_as_far_as_it_was_sent() {
    let model = model();
    let times = &model.times;
    let tracks = |law: &Predictive| {
        let Observer { a, b, .. } = &law.observer;
        [a.fill, a.vent, b.fill, b.vent]
    };
    let mut opened = 0;
    // Starts at the beginning of periods in which the law is busy.
    for period in 20..60 {
        // The last tick of the period before has already returned the first tick of this one.
        let mut begun = Predictive::new(&model);
        let mut first = [0; 4];
        for tick in 0..4 * period {
            let way = (tick / 4).min(100) as i16;
            first = begun.drive(&model, &input(20 + way, 170)).on;
        }
        assert_eq!(begun.tick_of_period, 0);
        let begin = begun.begin;
        for sent_ticks in 0..4 {
            let mut law = begun.clone();
            // The same valves, reported tick by tick.
            let mut told = tracks(&law);
            let mut given = first;
            for tick in 0..=sent_ticks {
                for (track, on) in told.iter_mut().zip(given) {
                    track.energise(begin + 1000 * tick, i32::from(on), 1000, times);
                }
                if tick < sent_ticks {
                    given = law.drive(&model, &input(70, 170)).on;
                }
            }
            let end = begin + 1000 * (sent_ticks + 1);
            for track in &mut told {
                track.energise(end, 0, 1000, times);
            }
            let start = begin.wrapping_add(model.moment as u32);
            let observed = sent_ticks == 3;
            law.observe(&model, PositionMm::from_int(70));
            for (valve, (mut told, mut cut)) in told.into_iter().zip(tracks(&law)).enumerate() {
                assert!(!cut.coil(), "{period} {sent_ticks} {valve}");
                let mut from = start.wrapping_sub(times.period as u32);
                if observed {
                    // The period is over.
                    told.passes(from, times.period);
                    from = start;
                }
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

/// A tick whose on-times were not sent does not count.
#[test]
fn what_was_planned_but_stopped_does_not_count() {
    let model = model();
    for ticks in 100..104 {
        let mut law = moving(&model, ticks);
        law.drive(&model, &input(70, 170));
        let sent = 1000 * u16::from(law.tick_of_period);
        law.stopped(&model);
        assert!(
            law.plan.iter().all(|on| *on <= sent),
            "{ticks}: {:?}",
            law.plan
        );
    }
}

/// A law that takes over plans nothing before it has demanded a force.
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
        // At most one period until it demands a force, and the rest of that period.
        assert!(first.is_some_and(|tick| tick <= 7), "{observed}: {first:?}");
    }
}

/// A precharged axis whose piston is at this stroke (1/10 mm) and speed, with this expected force (N).
fn at_a_stop(tenths: i32, speed_mm_s: i32, force_n: i32) -> (AxisModel, Predictive) {
    let data = AxisData {
        precharged: true,
        ..AxisData::default()
    };
    let model = AxisModel::new(&data, Micros(1000)).expect("in range");
    let mut law = Predictive::new(&model);
    law.observer.start_at((tenths << 16) / 10);
    law.observer.motion.speed = speed_mm_s << 16;
    let pressures = allocation::targets(&model, force_n * 1000);
    law.observer.a.expected = pressures.a;
    law.observer.b.expected = pressures.b;
    (model, law)
}

/// A slow piston near an end stop that is its target is seated once three times the break-away force presses it.
#[test]
fn a_seat_has_its_target_zone_speed_and_force() {
    let seat = |reference: i32, stroke: i32, speed: i32, force: i32| {
        let (model, law) = at_a_stop(stroke, speed, force);
        let asked = JointInput {
            reference: PositionMm::from_raw((reference << 16) / 10),
            ..JointInput::default()
        };
        law.seat(&model, &asked)
    };
    let press = Some(Seat::Press(45_000));
    assert_eq!(
        (seat(1796, 1790, 0, 0), seat(1794, 1790, 0, 0)),
        (press, None)
    );
    assert_eq!(
        (seat(4, 10, 0, 0), seat(6, 10, 0, 0)),
        (Some(Seat::Press(-45_000)), None)
    );
    assert_eq!(
        (seat(1800, 1771, 0, 0), seat(1800, 1769, 0, 0)),
        (press, None)
    );
    assert_eq!(
        (seat(1800, 1790, 59, 0), seat(1800, 1790, -61, 0)),
        (press, None)
    );
    // Three quarters of 45 N, within 1.5 mm, below 3 mm/s.
    let seated = Some(Seat::Seated);
    assert_eq!(
        (seat(1800, 1790, 0, 35), seat(1800, 1790, 0, 32)),
        (seated, press)
    );
    assert_eq!(
        (seat(1800, 1786, 0, 40), seat(1800, 1784, 0, 40)),
        (seated, press)
    );
    assert_eq!(
        (seat(1800, 1790, 2, 40), seat(1800, 1790, 4, 40)),
        (seated, press)
    );
}

/// A piston that stands in mid stroke with chambers at all the force that there should be, a ramp of this share of the
/// break-away friction, and a speed.
fn held(model: &AxisModel, share: f64, speed_mm_s: i32) -> Predictive {
    let mut law = Predictive::new(model);
    law.drive(model, &input(90, 90));
    let full = allocation::targets(model, model.force_out);
    (law.observer.a.pressure, law.observer.a.expected) = (full.a, full.a);
    (law.observer.b.pressure, law.observer.b.expected) = (full.b, full.b);
    law.ramp = BreakawayRamp::of((share * f64::from(model.breakaway)) as i32);
    law.observer.motion.speed = speed_mm_s << 16;
    law
}

/// A piston that stands under all the force that there should be is held by air that the observer does not know of: the
/// counter chamber, which counts as vented, is vented, and the drive chamber, which counts as full, is filled. Not
/// before the ramp has grown by a break-away force, not for a force that can be made, not for a piston that slides, and
/// not at an end stop.
#[test]
fn a_piston_that_is_held_under_full_force_gets_open_valves() {
    let model = model();
    let (shut, open) = ([0; 4], [4000, 0, 0, 4000]);
    for (share, speed_mm_s, forces, on) in [
        (1.02, 0, 2, open),
        (0.98, 0, 2, shut),
        (1.02, 0, 1, shut),
        (1.02, 9, 2, open),
        (1.02, 11, 2, shut),
    ] {
        let mut law = held(&model, share, speed_mm_s);
        let is_held = law.is_held(&model, 120 << 16);
        law.make_force(&model, forces * model.force_out, false, is_held);
        assert_eq!(law.plan, on, "{share} {speed_mm_s} mm/s {forces}");
    }
    let mut at_stop = held(&model, 1.02, 0);
    at_stop.observer.motion.stroke = model.stroke;
    assert!(!at_stop.is_held(&model, model.stroke + (2 << 16)));
    assert!(at_stop.is_held(&model, 90 << 16));
}

/// The same from power-up on: a piston that does not move. At first the chambers are filled and vented as far as is
/// known, and in the end the valves stay open. Preload and seat never ask for it.
#[test]
fn a_piston_that_does_not_move_gets_open_valves_in_the_end() {
    let model = model();
    for (measured, reference, drive) in [(60, 150, [0, 3]), (120, 30, [2, 1])] {
        let mut law = Predictive::new(&model);
        let mut open = 0;
        for tick in 0..3000 {
            let on = law.drive(&model, &input(measured, reference)).on;
            let both = drive.iter().all(|valve| on[*valve] == 1000);
            open += i32::from(both);
            assert!(both || tick < 2500, "{tick}: {on:?}");
        }
        assert!((500..2500).contains(&open), "{open} ticks");
    }
}

/// A piston that is moved to and fro by 8 mm at 50 mm/s, too slow to tell a mass, with air that is known.
fn hunting(model: &AxisModel, drives: bool) -> Predictive {
    let mut law = Predictive::new(model);
    for tick in 0..2000_i32 {
        let phase = tick % 640;
        let way_us = if phase < 320 { phase } else { 640 - phase } * 50 - 8000;
        let measured = PositionMm::from_f64(90.0 + f64::from(way_us) * 1e-3);
        for chamber in [&mut law.observer.a, &mut law.observer.b] {
            chamber.bounds = [chamber.pressure; 2];
        }
        if drives {
            let input = JointInput {
                measured,
                ..input(90, 90)
            };
            law.drive(model, &input);
        } else {
            law.observe(model, measured);
        }
    }
    law
}

/// The observer learns at the target of the law; not what somebody else pushes, and not where the axis learns nothing.
#[test]
fn friction_is_learnt_while_the_law_drives() {
    let told = model();
    let learns_nothing = AxisModel::new(
        &AxisData {
            learns_mass: false,
            ..AxisData::default()
        },
        Micros(1000),
    )
    .expect("in range");
    let one = 1 << 16;
    let law = hunting(&told, true);
    let share = law.observer.friction.share();
    assert_ne!(share, one);
    let inertia = crate::observer::motion::Inertia::new(&told.with_friction(share), law.mass());
    assert_eq!(law.observer.inertia, inertia);
    assert_eq!(hunting(&told, false).observer.friction.share(), one);
    assert_eq!(
        hunting(&learns_nothing, true).observer.friction.share(),
        one
    );
}

/// Friction is fed forward, and counted on, as learnt. A new target keeps it, and begins to learn anew.
#[test]
fn the_law_uses_the_friction_that_is_learnt() {
    use crate::observer::friction::FrictionEstimator;
    let model = model();
    let rested = |share: i32| {
        let mut law = Predictive::new(&model);
        for _ in 0..200 {
            law.drive(&model, &input(90, 90));
        }
        law.observer.friction = FrictionEstimator::of(share);
        law
    };
    let force = |share: i32| {
        let mut law = rested(share);
        let own = law.observer.learnt(&model);
        law.force_demand(&own, 90 << 16, 20 << 16)
    };
    // A start from rest at 20 mm/s: all of the break-away friction, and the viscous friction.
    let all = f64::from(model.breakaway) + 20.0 / 256.0 * f64::from(model.viscous);
    let less = f64::from(force(1 << 16) - force(1 << 15)) / all;
    assert!((less - 0.5).abs() < 0.02, "{less}");
    // In the closed loop, too: the duty of the same demand.
    let duty = |share: i32| {
        let mut law = rested(share);
        let starts = JointInput {
            reference_velocity: VelocityMmS::from_int(20),
            ..input(90, 90)
        };
        for _ in 0..4 {
            law.drive(&model, &starts);
        }
        law.duty.raw()
    };
    assert!(duty(1 << 15) < duty(1 << 16));
    // Another target.
    let mut law = rested(1 << 15);
    assert_eq!(law.observer.friction, FrictionEstimator::of(1 << 15));
    for _ in 0..4 {
        law.drive(&model, &input(90, 130));
    }
    let mut anew = FrictionEstimator::of(1 << 15);
    anew.forget();
    assert_eq!(law.observer.friction, anew);
}
