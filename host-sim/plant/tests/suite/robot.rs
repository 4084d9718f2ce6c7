//! Behaviour of the assembled robot.

use nalgebra::Vector3;
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Inputs, Plant, PlantError, PlantState};

const MS: u64 = 1_000_000;

fn robot() -> (Plant, PlantState) {
    let plant = Plant::new(&wheeleg_2003()).unwrap();
    let state = plant.initial_state(1).unwrap();
    (plant, state)
}

/// One tick of a lively program on all joints and both wheels.
fn lively(k: u16) -> Inputs {
    let mut inputs = Inputs::default();
    for (joint, on) in inputs.valve_on_us.iter_mut().enumerate() {
        let phase = (usize::from(k) + 37 * joint) % 20;
        let us = if phase < 7 {
            1000
        } else if phase == 7 {
            350
        } else {
            0
        };
        *on = if (k / 250).is_multiple_of(2) {
            [0, us, us, 0]
        } else {
            [us, 0, 0, us]
        };
    }
    inputs.bridge_duty = [0.2, 0.2];
    inputs.bridge_enabled = [k % 500 > 100; 2];
    inputs
}

#[test]
fn air_is_conserved_across_six_cylinders_and_the_supply() {
    let (plant, start) = robot();
    let mut state = start.clone();
    for k in 0..3000 {
        plant.tick(&mut state, &lively(k)).unwrap();
    }
    let before = plant.assembly.mass_balance_kg(&start.core);
    let after = plant.assembly.mass_balance_kg(&state.core);
    assert!(
        ((after - before) / before).abs() < 1e-12,
        "{before} {after}"
    );
    assert!(plant.outputs(&state).air_used_kg > 1e-3);
    let residual = plant.assembly.energy_residual_j(&start.core, &state.core);
    assert!(residual < 1e-9, "{residual}");
}

#[test]
fn cylinders_share_the_supply() {
    let mut params = wheeleg_2003();
    params.supply.reservoir_m3 = 2e-4;
    params.supply.source_pressure_pa = 101_325.0;
    let plant = Plant::new(&params).unwrap();
    let sag = |joints: usize| {
        let mut state = plant.initial_state(0).unwrap();
        let mut inputs = Inputs::default();
        for on in inputs.valve_on_us.iter_mut().take(joints) {
            *on = [0, 0, 1000, 0];
        }
        for _ in 0..100 {
            plant.tick(&mut state, &inputs).unwrap();
        }
        params.supply.initial_pressure_pa - plant.outputs(&state).supply_pressure_pa
    };
    let (none, one, two) = (sag(0), sag(1), sag(2));
    assert!(none.abs() < 1e-6, "{none}");
    assert!(one > 1e3 && two > 1.5 * one, "{one} {two}");
}

#[test]
fn tick_by_tick_equals_nothing_but_the_same_ticks() {
    let (plant, mut a) = robot();
    let mut b = a.clone();
    for k in 0..400 {
        plant.tick(&mut a, &lively(k)).unwrap();
        let t = u64::from(k) * MS;
        plant.advance(&mut b, t, t + MS, &lively(k)).unwrap();
        assert_eq!(
            plant.read_position(&mut a, 2),
            plant.read_position(&mut b, 2)
        );
    }
    assert_eq!(plant.state_hash(&a), plant.state_hash(&b));
    plant.tick(&mut b, &lively(400)).unwrap();
    assert_ne!(plant.state_hash(&a), plant.state_hash(&b));
}

#[test]
fn save_and_restore_goes_on_bit_for_bit() {
    let (plant, mut state) = robot();
    for k in 0..333 {
        plant.tick(&mut state, &lively(k)).unwrap();
    }
    let saved = serde_json::to_string(&state).unwrap();
    let mut restored: PlantState = serde_json::from_str(&saved).unwrap();
    assert_eq!(plant.state_hash(&state), plant.state_hash(&restored));
    for s in [&mut state, &mut restored] {
        for k in 333..777 {
            plant.tick(s, &lively(k)).unwrap();
            let _ = plant.read_position(s, 0);
        }
    }
    assert_eq!(plant.state_hash(&state), plant.state_hash(&restored));
}

#[test]
fn every_state_variable_is_in_the_hash() {
    let (plant, state) = robot();
    let base = plant.state_hash(&state);
    let changes: [fn(&mut PlantState); 12] = [
        |s| s.core.time_ns += 1,
        |s| s.core.motion.state.lengths_m[1][2] += 1e-15,
        |s| s.core.motion.state.velocity[0] = -1e-300,
        |s| s.core.motion.state.wheel_rad[1] += 1e-15,
        |s| s.core.motion.contacts.feet[1][4][0].stretch_m.z = 1e-300,
        |s| s.core.motion.contacts.switches[1][3] ^= true,
        |s| s.core.motion.motors[1].current_a = 1e-300,
        |s| s.core.cylinders[5].chamber_b.mass_kg *= 1.0 + f64::EPSILON,
        |s| s.core.cylinders[3].bristle_m = 1e-300,
        |s| s.core.cylinders[0].command_fall_ns[2] = 7,
        |s| s.core.supply.mass_kg *= 1.0 + f64::EPSILON,
        |s| s.adc[4] = wheeleg_plant::sensors::AdcState::new(2, "other"),
    ];
    for (i, change) in changes.iter().enumerate() {
        let mut other = state.clone();
        change(&mut other);
        assert_ne!(plant.state_hash(&other), base, "change {i}");
    }
}

#[test]
fn bad_inputs_are_refused_and_latch_nothing() {
    let (plant, mut state) = robot();
    let before = state.clone();
    let mut inputs = Inputs::default();
    inputs.valve_on_us[4][1] = 1001;
    let error = plant.apply(&mut state, &inputs).unwrap_err();
    assert!(
        matches!(error, PlantError::Input { index: 4, .. }),
        "{error}"
    );
    for duty in [1.001, f64::NAN, f64::INFINITY] {
        let inputs = Inputs {
            bridge_duty: [0.0, duty],
            ..Inputs::default()
        };
        let error = plant.apply(&mut state, &inputs).unwrap_err();
        assert!(
            matches!(error, PlantError::Input { index: 1, .. }),
            "{error}"
        );
    }
    let error = plant
        .advance(&mut state, 5, 10, &Inputs::default())
        .unwrap_err();
    assert!(
        matches!(
            error,
            PlantError::Time {
                state_ns: 0,
                from_ns: 5,
                ..
            }
        ),
        "{error}"
    );
    assert_eq!(state, before);
}

#[test]
fn dumping_empties_the_supply_and_opens_the_switch() {
    let (plant, mut state) = robot();
    assert!(plant.outputs(&state).pressure_switch);
    let dump = Inputs {
        dump: true,
        ..Inputs::default()
    };
    for _ in 0..1500 {
        plant.tick(&mut state, &dump).unwrap();
    }
    let o = plant.outputs(&state);
    assert!(o.dumping && !o.pressure_switch);
    assert!(o.supply_pressure_pa < 110_000.0, "{}", o.supply_pressure_pa);
    // The standing legs keep their gas.
    assert!(o.cylinders[2].pressure_pa[0] > 6e5);
}

#[test]
fn an_exploding_state_is_named() {
    let (plant, mut state) = robot();
    state.core.motion.state.velocity[8] = 1e9;
    let error = plant.tick(&mut state, &Inputs::default()).unwrap_err();
    let text = error.to_string();
    assert!(!matches!(error, PlantError::Input { .. }), "{text}");
    let (plant, mut state) = robot();
    state.core.cylinders[1].chamber_a.pv_j = f64::NAN;
    let error = plant.tick(&mut state, &Inputs::default()).unwrap_err();
    assert!(!matches!(error, PlantError::Input { .. }), "{error}");
}

fn run(plant: &Plant, state: &mut PlantState, inputs: &Inputs, ms: u32) {
    for _ in 0..ms {
        plant.tick(state, inputs).unwrap();
    }
}

#[test]
fn starts_in_equilibrium_and_stands() {
    let (plant, mut state) = robot();
    let start = plant.outputs(&state);
    let m6g = 0.8 * 9.81;
    for k in 0..500 {
        plant.tick(&mut state, &Inputs::default()).unwrap();
        let o = plant.outputs(&state);
        for leg in 0..2 {
            let f6 = o.cylinders[3 * leg + 2].forces.net_n();
            // F6 = N − m6 g at rest, and no jolt in the first milliseconds.
            assert!((f6 - (o.foot_normal_n[leg] - m6g)).abs() < 0.3, "{k}: {f6}");
            assert!((o.foot_normal_n[leg] - start.foot_normal_n[leg]).abs() < 0.5);
            assert_eq!(o.foot_switches[leg], [true; 4]);
        }
        assert!(o.velocity_m_s[0].abs() < 1e-3, "{k}: {:?}", o.velocity_m_s);
    }
    let end = plant.outputs(&state);
    for (a, b) in start.cylinders.iter().zip(&end.cylinders) {
        assert!((a.stroke_m - b.stroke_m).abs() < 2e-5);
    }
    assert!(end.position_m[0].abs() < 1e-4);
}

#[test]
fn feet_carry_what_the_moments_about_the_axle_say() {
    // Both legs at b5 = 0.01: moment of legs and chassis over the feet's lever.
    let (plant, state) = robot();
    let body = plant.assembly.mechanics.dynamics.clone();
    let down = Vector3::new(0.0, 0.0, -9.81);
    let kin = body.prepare(&state.core.motion.state, &down).unwrap();
    let weight = body.params().robot.total_mass_kg() * 9.81;
    let o = plant.outputs(&state);
    // The wheels' load acts directly below the axle, a sole's load at its spheres.
    let scene = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
    let sole = &scene.loads.contacts.feet[0];
    let axle = o.position_m[0];
    let lever = o.sole_m[0][0] - sole.moment_n_m.y / sole.force_n.z - axle;
    let expected = weight * (kin.com_m()[0] - axle) / lever;
    let carried: f64 = o.foot_normal_n.iter().sum();
    assert!(
        (carried - expected).abs() < 1e-6 * expected,
        "{carried} {expected}"
    );
    assert!(
        carried / weight < 0.16,
        "wheels carry most of it: {carried}"
    );
}

#[test]
fn lifting_one_leg_puts_its_load_on_the_other() {
    let (plant, mut state) = robot();
    let before: f64 = plant.outputs(&state).foot_normal_n.iter().sum();
    let mut inputs = Inputs::default();
    inputs.valve_on_us[2] = [0, 1000, 1000, 0];
    run(&plant, &mut state, &inputs, 2500);
    let o = plant.outputs(&state);
    assert_eq!(o.foot_switches, [[false; 4], [true; 4]]);
    assert_eq!(o.foot_normal_n[0], 0.0);
    assert!(
        (o.foot_normal_n[1] / before - 1.0).abs() < 0.03,
        "{:?}",
        o.foot_normal_n
    );
    assert!(o.cylinders[2].stroke_m < 1e-3);
    assert!((o.sole_m[0][2] - 0.178).abs() < 0.004, "{:?}", o.sole_m);
    // In the air the cylinder carries the foot's weight.
    assert!((o.cylinders[2].forces.net_n() + 0.8 * 9.81).abs() < 0.5);
    // And down again: it touches.
    inputs.valve_on_us[2] = [1000, 0, 0, 1000];
    run(&plant, &mut state, &inputs, 2500);
    let o = plant.outputs(&state);
    assert_eq!(o.foot_switches, [[true; 4]; 2]);
    assert!((o.foot_normal_n.iter().sum::<f64>() / before - 1.0).abs() < 0.02);
}

#[test]
fn drives_at_the_speed_the_motor_characteristic_gives() {
    // Both feet dragged along: friction at the feet and the chassis, the motor's line.
    let (plant, mut state) = robot();
    let inputs = Inputs {
        bridge_duty: [0.5; 2],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    run(&plant, &mut state, &inputs, 4000);
    let o = plant.outputs(&state);
    let p = plant.params();
    let m = &p.motors[0];
    let speed = o.velocity_m_s[0];
    assert!(speed > 0.1, "{speed}");
    // Steady: torque of both wheels over the radius balances soles, bearings and rolling.
    let load: f64 = o.wheel_normal_n.iter().sum();
    let rolling = p.contacts.wheel.rolling_resistance * load;
    let drag = -(o.foot_force_n[0][0] + o.foot_force_n[1][0]) + 4.0 * speed + rolling;
    let push = (o.wheel_torque_n_m[0] + o.wheel_torque_n_m[1]) / 0.15;
    assert!((push / drag - 1.0).abs() < 0.02, "{push} {drag}");
    // It rolls: far from the friction limit of its tyres only the bristles yield.
    assert!(o.wheel_slip_m_s.iter().all(|s| s.abs() < 1e-3 * speed));
    // Winding equation at that speed.
    let motor_rad_s = o.wheel_rate_rad_s[0] * m.reduction;
    let current = (0.5 * m.supply_v - m.torque_constant_n_m_a * motor_rad_s) / m.resistance_ohm;
    assert!(
        (o.motor_current_a[0] / current - 1.0).abs() < 0.02,
        "{current}"
    );
    // Encoder: four edges a line, 260 turns of the motor a wheel turn.
    let turns = (o.position_m[0] / 0.15 + o.attitude_rad[1]) / std::f64::consts::TAU;
    let edges = turns * 4.0 * f64::from(m.encoder_lines) * 260.0;
    assert!(
        (o.encoder_edges[0] as f64 / edges - 1.0).abs() < 2e-3,
        "{edges}"
    );
    // Coulomb drag of sliding soles.
    let mu = p.contacts.foot.law.mu_kinetic;
    assert!((-o.foot_force_n[0][0] / (mu * o.foot_normal_n[0]) - 1.0).abs() < 0.01);
    // Bridges off: gear and drag stop it.
    run(&plant, &mut state, &Inputs::default(), 1000);
    assert!(plant.outputs(&state).velocity_m_s[0].abs() < 2e-3);
}

#[test]
fn halving_the_step_changes_the_gait_little() {
    // A lift over its first second: contact breaks, stick turns to slip; the test can require only first
    // order, and little of it.
    let stroke = |step_ns| {
        let mut params = wheeleg_2003();
        params.step_ns = step_ns;
        let plant = Plant::new(&params).unwrap();
        let mut state = plant.initial_state(0).unwrap();
        let mut inputs = Inputs::default();
        inputs.valve_on_us[2] = [0, 1000, 1000, 0];
        run(&plant, &mut state, &inputs, 700);
        plant.outputs(&state).cylinders[2].stroke_m
    };
    let (coarse, fine, finest) = (stroke(100_000), stroke(50_000), stroke(12_500));
    assert!((0.02..0.17).contains(&finest), "{finest}");
    assert!((coarse - finest).abs() < 2e-5, "{coarse} {fine} {finest}");
    assert!((fine - finest).abs() < (coarse - finest).abs() + 1e-9);
}

#[test]
fn a_gear_named_twice_must_be_the_same_gear() {
    let mut params = wheeleg_2003();
    params.motors[1].reduction = 130.0;
    let error = Plant::new(&params).unwrap_err().to_string();
    assert!(error.contains("motors.reduction"), "{error}");
}

#[test]
fn survives_nonsense_commands_and_keeps_its_books() {
    use rand::Rng;
    for seed in 0..6 {
        let plant = Plant::new(&wheeleg_2003()).unwrap();
        let start = plant.initial_state(seed).unwrap();
        let mut state = start.clone();
        let mut rng = wheeleg_plant::sensors::signal_rng(seed, "nonsense");
        let mut inputs = Inputs::default();
        for tick in 0..6000 {
            if tick % 37 == 0 {
                for us in inputs.valve_on_us.iter_mut().flatten() {
                    let draw = rng.next_u32();
                    *us = match draw % 4 {
                        0 => 1000,
                        1 => u16::try_from(draw % 1001).unwrap(),
                        _ => 0,
                    };
                }
                for (wheel, duty) in inputs.bridge_duty.iter_mut().enumerate() {
                    *duty = f64::from(rng.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0;
                    inputs.bridge_enabled[wheel] = !rng.next_u32().is_multiple_of(3);
                }
                inputs.dump = tick / 1000 == 4;
            }
            if let Err(error) = plant.tick(&mut state, &inputs) {
                panic!("seed {seed}, tick {tick}: {error}");
            }
        }
        let (before, after) = (
            plant.assembly.mass_balance_kg(&start.core),
            plant.assembly.mass_balance_kg(&state.core),
        );
        assert!(((after - before) / before).abs() < 1e-11);
        for c in plant.outputs(&state).cylinders {
            assert!((-0.002..0.182).contains(&c.stroke_m), "{}", c.stroke_m);
            assert!(
                c.pressure_pa.iter().all(|p| (5e4..9e5).contains(p)),
                "{:?}",
                c.pressure_pa
            );
        }
    }
}
