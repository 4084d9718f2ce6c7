//! What an announced move demands.

use super::*;

/// A move to `reference` mm is announced, `after` ticks from now.
fn announced(reference: i16, after: u32, now: JointInput) -> JointInput {
    JointInput {
        announced: Some(Announced {
            reference: PositionMm::from_int(reference),
            after: Ticks(after),
        }),
        ..now
    }
}

/// A law that has seen its piston stand at `position` mm for this many ticks, with valves open for these times.
fn held(model: &AxisModel, ticks: u16, position: i16, on: [u16; 4]) -> Predictive {
    let mut law = Predictive::new(model);
    for _ in 0..ticks {
        law.observe(model, PositionMm::from_int(position));
        law.external_on_times(&on);
    }
    law
}

/// An announced move is awaited at the edge of slipping; the preload is forgotten when the announcement ends.
#[test]
fn an_announced_move_vents_the_counter_chamber() {
    let model = model();
    let mut law = held(&model, 400, 90, [1000, 0, 1000, 0]);
    let announced = announced(150, 200, input(90, 90));
    let mut vented = 0;
    for _ in 0..200 {
        vented += u32::from(law.drive(&model, &announced).on[3]);
    }
    assert!(vented > 5_000, "{vented}");
    for _ in 0..5 {
        law.drive(&model, &input(90, 90));
    }
    assert_eq!(law.preload, Preload::default());
}

/// Once the force of a preload is reached, a load estimate that drifts by less than half of the friction sends no
/// pulse; a larger drift does.
#[test]
fn a_preload_that_is_there_sends_no_pulse() {
    let model = model();
    let announced = announced(150, 200, input(90, 90));
    let pulses = |wander: i32| {
        let mut law = held(&model, 400, 90, [1000, 0, 1000, 0]);
        for _ in 0..1000 {
            law.drive(&model, &announced);
        }
        let reached = law.observer.force;
        assert!(
            (reached - 5_000 + law.motion().load).abs() < 2_000,
            "{reached}"
        );
        law.observer.motion.load -= wander;
        (0..400)
            .filter(|_| law.drive(&model, &announced).on != [0; 4])
            .count()
    };
    assert_eq!((pulses(0), pulses(3_500)), (0, 0));
    assert!(pulses(7_000) > 0);
}

/// A preload that has reached its force acts again once more than half of the 10 N of friction is missing.
#[test]
fn a_preload_acts_again_where_half_the_friction_is_missing() {
    let awaited = |missing: i32| {
        let (model, mut law) = at_a_stop(900, 0, 5);
        law.standstill.seat(true);
        let announced = announced(150, 200, input(90, 90));
        let made = model.pressure_force(law.observer.expected());
        law.observer.motion.load = 5_000 - missing - made;
        law.preload(&model, &announced, true)
    };
    for side in [-1, 1] {
        assert_eq!(awaited(side * 4_900), Some(Awaited::Ready));
        assert!(matches!(awaited(side * 5_100), Some(Awaited::Force(_))));
    }
}

/// At an end stop against which a full chamber has held the piston, a move is awaited with pressures about the mean,
/// under any load: the force alone would be reached as soon as the other chamber is as full.
#[test]
fn a_preload_is_there_once_the_counter_chamber_has_vented() {
    let model = model();
    let announced = announced(18, 800, input(180, 183));
    for load in [-30_000, -15_000, 0, 15_000, 30_000] {
        let mut law = held(&model, 800, 180, [1000, 0, 0, 1000]);
        law.observer.motion.load = load;
        for _ in 0..800 {
            law.drive(&model, &announced);
        }
        let wanted = -load - model.coulomb / 2;
        let target = allocation::targets(&model, wanted);
        let found = law.pressures();
        let [a, b] = [found.a - target.a, found.b - target.b].map(|p| f64::from(p) / 256e3);
        let force = model.pressure_force(found) - wanted;
        assert!(
            a.abs() < 12.0 && b.abs() < 20.0,
            "{load}: {a} {b} kPa, {force} mN"
        );
        assert!(force.abs() < model.coulomb / 4, "{load}: {force} mN");
    }
}

/// If an announced move finds the piston in balance, or pushed along, at most half of the friction is missing, and no
/// pulse is sent. However little it is pushed the other way, the force is reversed.
#[test]
fn a_preload_from_balance_sends_nothing() {
    let awaited = |net: i32| {
        let (model, mut law) = at_a_stop(900, 0, 5);
        law.standstill.seat(true);
        law.observer.motion.load = net - model.pressure_force(law.observer.expected());
        law.preload(&model, &announced(150, 200, input(90, 90)), true)
    };
    for net in [0, 5_000, 10_000] {
        assert_eq!(awaited(net), Some(Awaited::Ready), "{net}");
    }
    for net in [-1, -9_000, 10_001] {
        assert!(matches!(awaited(net), Some(Awaited::Force(_))), "{net}");
    }
}

/// A preload that acts continues while more than an eighth of the 10 N of friction is missing.
#[test]
fn a_preload_acts_until_an_eighth_of_the_friction_is_missing() {
    let awaited = |missing: i32| {
        let (model, mut law) = at_a_stop(900, 0, 5);
        law.standstill.seat(true);
        let announced = announced(150, 200, input(90, 90));
        let made = model.pressure_force(law.observer.expected());
        law.preload.acts = true;
        law.observer.motion.load = 5_000 - missing - made;
        law.preload(&model, &announced, true)
    };
    assert_eq!(awaited(1_200), Some(Awaited::Ready));
    assert!(matches!(awaited(1_300), Some(Awaited::Force(_))));
}

/// Half of the friction towards the target, less the load.
#[test]
fn the_force_of_a_preload_is_half_the_friction() {
    let awaited = |reference_mm: i16, load: i32| {
        let (model, mut law) = at_a_stop(900, 0, if reference_mm > 90 { -40 } else { 40 });
        law.standstill.seat(true);
        law.observer.motion.load = load;
        let announced = announced(reference_mm, 200, input(90, 90));
        law.preload(&model, &announced, true)
    };
    assert_eq!(awaited(150, 0), Some(Awaited::Force(5_000)));
    assert_eq!(awaited(30, 0), Some(Awaited::Force(-5_000)));
    assert_eq!(awaited(150, 12_000), Some(Awaited::Force(-7_000)));
}

/// Two bands from where it stood, the piston has begun to move.
#[test]
fn a_preload_ends_when_the_piston_has_moved_by_two_bands() {
    let model = model();
    let awaited = |moved_hundredths: i32| {
        let mut law = Predictive::new(&model);
        law.observer.start_at(90 << 16);
        law.standstill.seat(true);
        let announced = announced(150, 200, input(90, 90));
        assert!(law.preload(&model, &announced, true).is_some());
        law.observer.motion.stroke += (moved_hundredths << 16) / 100;
        law.preload(&model, &announced, true).is_some()
    };
    // The band is 0.12 mm.
    assert!(awaited(23) && awaited(-23) && !awaited(25));
}
