//! The whole robot on rigid ground against statics, kinematics and energy.

use wheeleg_plant::dynamics::floating::state::WHEEL;
use wheeleg_plant::terrain::{Material, Part, Shape, Solid};
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Inputs, Plant, PlantParams, PlantState};

const TICK_S: f64 = 1e-3;

/// The robot with feet that do not rub.
fn on_slippery_feet(params: &PlantParams) -> (Plant, PlantState) {
    let mut plant = Plant::new(params).unwrap();
    let state = plant.initial_state(1).unwrap();
    plant
        .assembly
        .mechanics
        .touching
        .limit_foot_friction(Some(0.0));
    (plant, state)
}

fn driving(duty: [f64; 2]) -> Inputs {
    Inputs {
        bridge_duty: duty,
        bridge_enabled: [true; 2],
        ..Inputs::default()
    }
}

/// Undriven rolling loses its coefficient times load times distance, and nothing else.
#[test]
fn rolling_loses_its_coefficient_times_load_and_distance() {
    let lost = |coefficient: f64| {
        let mut params = wheeleg_2003();
        params.contacts.wheel.rolling_resistance = coefficient;
        let (plant, mut state) = on_slippery_feet(&params);
        let velocity = &mut state.core.motion.state.velocity;
        velocity[3] = 0.3;
        (velocity[WHEEL], velocity[WHEEL + 1]) = (2.0, 2.0);
        let (mut ground_j, mut expected_j) = (0.0, 0.0);
        for _ in 0..300 {
            plant.tick(&mut state, &Inputs::default()).unwrap();
            let motion = &state.core.motion;
            let power = plant.assembly.mechanics.power(motion, &[0.0; 6]).unwrap();
            ground_j += power.ground_w * TICK_S;
            let outputs = plant.outputs(&state);
            let load: f64 = outputs.wheel_normal_n.iter().sum();
            expected_j -= coefficient * load * outputs.velocity_m_s[0] * TICK_S;
        }
        println!("{coefficient}: ground {ground_j} J, expected {expected_j} J");
        (ground_j, expected_j)
    };
    // The springs of the ground take and give a little as the gait of the load shifts.
    let (spring_j, _) = lost(0.0);
    let (ground_j, expected_j) = lost(0.02);
    assert!(expected_j < -0.1, "{expected_j}");
    assert!(spring_j.abs() < 0.02 * expected_j.abs(), "{spring_j}");
    let ratio = (ground_j - spring_j) / expected_j;
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

/// Dropped from 20 mm it comes to rest in its standing pose; the ground has taken most of the energy.
#[test]
fn a_dropped_robot_comes_to_rest_and_the_ground_takes_its_energy() {
    let params = wheeleg_2003();
    let plant = Plant::new(&params).unwrap();
    let stood = plant.initial_state(1).unwrap();
    let mut state = stood.clone();
    state.core.motion.state.position_m.z += 0.02;
    let mechanics = &plant.assembly.mechanics;
    let begun_j = mechanics.energy_j(&state.core.motion).unwrap();
    let (mut ground_j, mut most_j) = (0.0, begun_j);
    for _ in 0..3000 {
        plant.tick(&mut state, &Inputs::default()).unwrap();
        let motion = &state.core.motion;
        let power = mechanics.power(motion, &[0.0; 6]).unwrap();
        ground_j += power.ground_w * TICK_S;
        most_j = most_j.max(mechanics.energy_j(motion).unwrap());
    }
    let fallen_j = params.body.total_mass_kg() * 9.81 * 0.02;
    let ended_j = mechanics.energy_j(&state.core.motion).unwrap();
    println!("begun {begun_j}, ended {ended_j}, ground {ground_j}, fallen {fallen_j}");
    // Nothing is gained on the way.
    assert!(most_j < begun_j + 1e-3 * fallen_j, "{most_j} {begun_j}");
    assert!((begun_j - ended_j) / fallen_j > 0.95);
    assert!(
        -ground_j > 0.6 * fallen_j && -ground_j < 1.02 * fallen_j,
        "{ground_j}"
    );
    let (a, b) = (plant.outputs(&stood), plant.outputs(&state));
    assert!(
        (a.position_m[2] - b.position_m[2]).abs() < 5e-4,
        "{a:?} {b:?}"
    );
    let speed = b.velocity_m_s.iter().map(|v| v.abs()).fold(0.0, f64::max);
    assert!(speed < 1e-3, "{speed}");
}

/// Both wheels against an edge: they leave the floor at the torque of statics. The torque pushes
/// the chassis back, which takes load from the feet and gives it to the wheels.
#[test]
fn wheels_climb_an_edge_at_the_torque_of_statics() {
    // Higher, the feet carry next to nothing in the end, and rock: tip-back is at 22 N m.
    for height in [0.01, 0.015, 0.02] {
        let mut params = wheeleg_2003();
        params.contacts.wheel.rolling_resistance = 0.0;
        // Hardly sinks in, so that the lever matches the drawing.
        params.contacts.wheel.law.stiffness_n_m = 6e6;
        let r = params.body.wheel_radius_m;
        let lever = (r * r - (r - height) * (r - height)).sqrt();
        // Narrow: only the wheels meet it, the feet stand beyond.
        let edge = Solid::block([lever + 0.101, 0.0], [0.1, 1.0], 0.0, [-1.0, height]);
        params.terrain.parts.push(Part {
            shape: Shape::Solid(edge),
            material: Material::ROUGH,
        });
        let (plant, mut state) = on_slippery_feet(&params);
        let mut climbed = None;
        for tick in 0..20_000 {
            let duty = 0.03 * f64::from(tick) * TICK_S;
            plant.tick(&mut state, &driving([duty; 2])).unwrap();
            let grips = state.core.motion.contacts.wheels.iter().flatten().flatten();
            let parts: Vec<u32> = grips.map(|grip| grip.part).collect();
            if parts.contains(&2) && !parts.contains(&1) {
                climbed = Some(plant.outputs(&state));
                break;
            }
        }
        let outputs = climbed.expect("it climbs");
        let scene = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
        let axle = outputs.position_m[0];
        let weight = params.body.total_mass_kg() * 9.81;
        let ahead = scene.kin.com_m().x - axle;
        let sole = &scene.loads.contacts.feet[0];
        let foot = outputs.sole_m[0][0] - axle - sole.moment_n_m.y / sole.force_n.z;
        // Moments of the whole robot about the axle's edge, and of the wheels about the edge.
        let expected = weight * (1.0 - ahead / foot) * lever / (1.0 - lever / foot);
        let torque: f64 = outputs.wheel_torque_n_m.iter().sum();
        println!("{height} m: {torque} N m, by statics {expected} N m");
        assert!(
            (torque / expected - 1.0).abs() < 0.01,
            "{torque} {expected}"
        );
    }
}

/// Different wheel speeds turn the robot about the centre that follows from them.
#[test]
fn the_radius_of_a_turn_is_speed_over_yaw_rate_of_the_wheels() {
    let params = wheeleg_2003();
    let (plant, mut state) = on_slippery_feet(&params);
    let inputs = driving([0.15, 0.45]);
    (0..1500).for_each(|_| plant.tick(&mut state, &inputs).unwrap());
    let begun = plant.outputs(&state);
    (0..2000).for_each(|_| plant.tick(&mut state, &inputs).unwrap());
    let ended = plant.outputs(&state);
    let turned = ended.attitude_rad[2] - begun.attitude_rad[2];
    let rolled: [f64; 2] =
        [0, 1].map(|i| (ended.wheel_angle_rad[i] - begun.wheel_angle_rad[i]) * 0.15);
    let expected = (rolled[1] - rolled[0]) / params.spatial.track_m;
    assert!(turned > 0.2, "{turned}");
    assert!(
        (turned / expected - 1.0).abs() < 0.02,
        "{turned} {expected}"
    );
    // The chord of the arc.
    let radius = 0.5 * (rolled[0] + rolled[1]) / expected;
    let chord = (ended.position_m[0] - begun.position_m[0])
        .hypot(ended.position_m[1] - begun.position_m[1]);
    let measured = 0.5 * chord / (0.5 * turned).sin();
    println!("turned {turned} rad, expected {expected}; radius {measured}, expected {radius} m");
    assert!(
        (measured / radius - 1.0).abs() < 0.02,
        "{measured} {radius}"
    );
}
