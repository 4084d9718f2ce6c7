//! The force demand, compared with the documented formulas.

use super::*;
use crate::axis::AxisData;
use crate::law::Predictive;
use crate::law::standstill::Approach;
use crate::tuning::PATIENCE;
use wheeleg_units::{Micros, PositionMm};

fn model() -> AxisModel {
    AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
}

/// Demand for a piston at 90 mm and a reference `error_mm` away, with a load and speeds, mm/s.
fn demanded(model: &AxisModel, error_mm: f64, load: i32, speed: i32, wanted: i32) -> i32 {
    demanded_after(model, 0, error_mm, load, [speed, wanted])
}

/// The same after this many periods of moving away at 10 mm/s, half a millimetre from the target.
fn demanded_after(
    model: &AxisModel,
    periods: u16,
    error_mm: f64,
    load: i32,
    [speed, wanted]: [i32; 2],
) -> i32 {
    let mut law = Predictive::new(model);
    law.observer.start_at(90 << 16);
    law.observer.motion.load = load;
    law.observer.motion.speed = 10 << 16;
    for _ in 0..periods {
        let now = Approach {
            reference: (90 << 16) - (1 << 15),
            reference_speed: 0,
            measured: 90 << 16,
            motion: &law.observer.motion,
            force: 0,
            mass: model.mass,
        };
        law.standstill.update(model, &now);
    }
    law.observer.motion.speed = speed << 16;
    let demand = ForceDemand {
        reference: (90 << 16) + (error_mm * 65_536.0) as i32,
        reference_speed: wanted << 16,
        observer: &law.observer,
        ahead: PredictedState {
            stroke: 90 << 16,
            speed: speed << 16,
        },
        gains: &law.gains,
    };
    demand.force(model, law.ramp, &law.standstill)
}

/// In balance, a piston at its target needs only the counterpart of the load. Friction is added with the wanted speed,
/// in proportion up to 10 mm/s.
#[test]
fn friction_is_fed_forward_in_proportion_up_to_ten_mm_s() {
    let model = AxisModel::new(
        &AxisData {
            viscous: PositionMm::ZERO,
            ..AxisData::default()
        },
        Micros(1000),
    )
    .expect("in range");
    assert_eq!(demanded(&model, 0.0, 20_000, 0, 0), -20_000);
    // At the wanted speed, where the reference will be after the dead time: friction alone.
    let at = |speed: i32| {
        let lead = f64::from(speed) * f64::from(model.dead_time_reference) / 2_f64.powi(32);
        demanded(&model, -lead, 0, speed, speed)
    };
    for (speed, expected) in [
        (5, 5_000),
        (9, 9_000),
        (10, 10_000),
        (40, 10_000),
        (-40, -10_000),
    ] {
        let found = at(speed);
        assert!((found - expected).abs() < 150, "{speed}: {found}");
    }
}

/// From rest, all of break-away friction is fed forward as soon as the reference moves at more than 3 mm/s, in its
/// direction; a piston that has not rested, or has left its place, gets it in proportion to the speed.
#[test]
fn a_start_from_rest_begins_with_all_of_the_break_away_friction() {
    let model = model();
    // The demand of a piston at 90 mm that stands, was moved by so much after its rest, if any, and is back.
    let demand = |rests: bool, moved_mm: i32, wanted: i32| {
        let mut law = Predictive::new(&model);
        law.observer.start_at(90 << 16);
        let see = |law: &mut Predictive, reference_speed: i32| {
            let now = Approach {
                reference: 90 << 16,
                reference_speed,
                measured: 90 << 16,
                motion: &law.observer.motion,
                force: 0,
                mass: model.mass,
            };
            law.standstill.update(&model, &now);
        };
        for _ in 0..if rests { 20 } else { 0 } {
            see(&mut law, 0);
        }
        assert_eq!(law.standstill.is_at_rest(), rests);
        for mm in [0, moved_mm, 0] {
            law.observer.motion.stroke = (90 + mm) << 16;
            see(&mut law, wanted << 16);
        }
        let demand = ForceDemand {
            reference: 90 << 16,
            reference_speed: wanted << 16,
            observer: &law.observer,
            ahead: PredictedState {
                stroke: 90 << 16,
                speed: 0,
            },
            gains: &law.gains,
        };
        demand.force(&model, law.ramp, &law.standstill)
    };
    for (rests, moved_mm, wanted, starts) in [
        (true, 0, 4, true),
        (true, 0, -4, true),
        (true, 0, 2, false),
        (false, 0, 4, false),
        (true, 1, 4, false),
    ] {
        let found = demand(rests, moved_mm, wanted) - demand(false, 0, wanted);
        // Break-away friction is 15 N; in proportion, a tenth of it for each mm/s.
        let lead = f64::from(wanted) * f64::from(model.dead_time_reference) / 2_f64.powi(32);
        let gains = SpeedGains::new(&model, model.mass);
        let speed = f64::from(wanted) + lead * f64::from(gains.slope) / 256.0;
        let more = f64::from(wanted.signum()) * 15e3 - 1.5e3 * speed;
        let expected = if starts { more } else { 0.0 };
        assert!(
            (f64::from(found) - expected).abs() < 100.0,
            "{rests} {moved_mm} {wanted}: {found} {expected}"
        );
    }
}

/// The less force a load leaves for braking, the slower the approach, but it never stops; the acceleration is limited.
#[test]
fn what_a_load_leaves_for_braking_slows_the_approach() {
    let model = model();
    let gains = SpeedGains::new(&model, model.mass);
    let mass = f64::from(model.mass) / 65_536.0;
    // Far away and at rest: the limit of the acceleration, and break-away friction.
    let far = f64::from(demanded(&model, 80.0, 0, 0, 0));
    let top = f64::from(model.top_speed) / 65_536.0 * f64::from(model.viscous) / 256.0;
    let limit = 3.5 * f64::from(gains.brake) * mass + 15e3 + top;
    assert!((far / limit - 1.0).abs() < 0.02, "{far} {limit}");
    // The speed 20 mm before the target at which the demand is only friction and load.
    let speed_at = |load: i32| {
        (1..700)
            .find(|speed| {
                let friction = 10_000 + speed * model.viscous / 256;
                demanded(&model, 20.0, load, *speed, 0) + load - friction <= 0
            })
            .expect("it brakes")
    };
    let pushing = |share: f64| (share * f64::from(model.force_in)) as i32;
    let (free, half, most) = (speed_at(0), speed_at(pushing(0.99)), speed_at(pushing(1.2)));
    let left = 0.7 * 0.01 * f64::from(model.force_in) / mass;
    for (found, brake) in [(free, f64::from(gains.brake)), (half, left), (most, 200.0)] {
        let slope = f64::from(gains.slope) / 256.0;
        let expected = (2.0 * brake * (20.0 - 0.5 * brake / slope.powi(2))).sqrt();
        let expected = expected.min(f64::from(model.top_speed) / 65_536.0);
        let ratio = f64::from(found) / expected;
        assert!((0.9..1.1).contains(&ratio), "{found} {expected}");
    }
}

/// Near a target that rests the demand is that of a faster approach, until the piston has arrived; at a reference that
/// moves it is not.
#[test]
fn a_landing_ends_on_arrival_and_needs_a_target_that_rests() {
    let model = model();
    let after = |periods| demanded_after(&model, periods, 1.0, 0, [0, 0]);
    assert!(after(0) > after(1) + 500, "{} {}", after(0), after(1));
    assert_eq!(after(1), after(PATIENCE));
    // About the limit: 2 mm/s of reference instead of 1 take the landing away.
    let moving = |speed| demanded(&model, 1.0, 0, 0, speed);
    assert!(moving(1) > moving(2) + 500, "{} {}", moving(1), moving(2));
}

/// A millimetre off, at rest and in motion: beyond friction, the demand is halved from the period in which patience
/// ends, for the default axis with a piston of 40 kg, but not with one of 1.5 kg.
#[test]
fn half_the_acceleration_is_asked_for_where_patience_is_over_and_that_makes_a_pulse() {
    let of = |gain: i32| f64::from(gain) / 256.0;
    for (mass_kg, is_enough) in [(1.5, false), (40.0, true)] {
        let data = AxisData {
            mass: PositionMm::from_f64(mass_kg),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        let gains = SpeedGains::new(&model, model.mass);
        // Slow enough to stay within the limit of the acceleration.
        for speed in [0, 20, -20] {
            let after = |periods| f64::from(demanded_after(&model, periods, 1.0, 0, [speed, 0]));
            let pull = -of(gains.slope) * f64::from(speed);
            let damp = of(gains.damping) * (of(gains.slope) - f64::from(speed));
            let half = 0.5 * mass_kg * (pull + damp);
            assert_eq!(after(1), after(PATIENCE));
            let less = after(1) - after(PATIENCE + 1);
            if is_enough {
                assert!((less / half - 1.0).abs() < 0.02, "{speed}: {less} {half}");
            } else {
                assert_eq!(less, 0.0, "{speed}");
            }
        }
    }
}

/// Five break-away forces per second while the piston sticks; no change in between; four tenths less in each period of
/// sliding.
#[test]
fn the_ramp_grows_while_the_piston_sticks_and_falls_when_it_slides() {
    let model = model();
    let ramped = |speed: i32, reference_speed: i32, periods: u32| {
        let mut law = Predictive::new(&model);
        law.observer.motion.speed = speed << 16;
        let mut ramp = BreakawayRamp::default();
        for _ in 0..periods {
            let demand = ForceDemand {
                reference: 5 << 16,
                reference_speed: reference_speed << 16,
                observer: &law.observer,
                ahead: PredictedState {
                    stroke: 0,
                    speed: 0,
                },
                gains: &law.gains,
            };
            demand.ramp(&model, &mut ramp);
        }
        ramp
    };
    let newton = |ramp: BreakawayRamp| {
        let mut law = Predictive::new(&model);
        law.observer.start_at(90 << 16);
        let demand = ForceDemand {
            reference: 90 << 16,
            reference_speed: 0,
            observer: &law.observer,
            ahead: PredictedState {
                stroke: 90 << 16,
                speed: 0,
            },
            gains: &law.gains,
        };
        f64::from(demand.force(&model, ramp, &law.standstill)) / 1e3
    };
    let grown = newton(ramped(2, 0, 50));
    assert!((grown - 5.0 * 15.0 * 0.2).abs() < 0.2, "{grown}");
    for (speed, reference_speed) in [(4, 0), (9, 0), (0, 2)] {
        assert_eq!(newton(ramped(speed, reference_speed, 50)), 0.0, "{speed}");
    }
    // From 10 mm/s on, a period takes four tenths off it.
    let left_at = |speed: i32| {
        let mut ramp = ramped(0, 0, 50);
        let mut law = Predictive::new(&model);
        law.observer.motion.speed = speed << 16;
        let demand = ForceDemand {
            reference: 5 << 16,
            reference_speed: 0,
            observer: &law.observer,
            ahead: PredictedState {
                stroke: 0,
                speed: 0,
            },
            gains: &law.gains,
        };
        demand.ramp(&model, &mut ramp);
        newton(ramp) / grown
    };
    let left = left_at(11);
    assert!((0.57..0.61).contains(&left), "{left}");
    assert_eq!(left_at(9), 1.0);
}
