//! The floating robot on a level floor: compared with the robot in eight coordinates, and with the mechanics
//! of energy, rolling, falling and turning.

use nalgebra::Vector3;
use wheeleg_plant::assembly::{Assembly, AssemblyState, Mechanics};
use wheeleg_plant::robot::PlantParams;
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Inputs, Plant, PlantState};

use crate::eight::body::{BodyMechanics, BodyMotion};

const G: f64 = 9.81;
const STEP_NS: u64 = 100_000;

fn built(params: &PlantParams) -> (Plant, PlantState) {
    let plant = Plant::new(params).unwrap();
    let state = plant.initial_state(1).unwrap();
    (plant, state)
}

/// The robot without losses of its own at the wheels: no rolling resistance, no bearings, ideal
/// gears that turn the motors freely.
fn free_wheels() -> PlantParams {
    let mut params = wheeleg_2003();
    params.contacts.wheel.rolling_resistance = 0.0;
    params.body.viscous[0] = 0.0;
    for motor in &mut params.motors {
        motor.efficiency = 1.0;
        motor.friction_n_m = 0.0;
    }
    params
}

/// Feet that slide like ice.
fn icy_feet(mut params: PlantParams) -> PlantParams {
    params.contacts.foot.law.mu_static = 0.0;
    params.contacts.foot.law.mu_kinetic = 0.0;
    params
}

fn set_speed(state: &mut PlantState, forward_m_s: f64, radius_m: f64) {
    let velocity = &mut state.core.motion.state.velocity;
    velocity[3] = forward_m_s;
    velocity[12] = forward_m_s / radius_m;
    velocity[13] = forward_m_s / radius_m;
}

/// Three steps of the left leg as a program of strokes and of a travel: (b5, b6, travel) \[m\].
fn program(t: f64) -> [f64; 3] {
    let (step, u) = ((t / 3.333).floor(), t % 3.333);
    let pushed = ((u - 2.0) * 0.18).clamp(0.0, 0.18);
    let b6 = if u < 1.0 { 0.0 } else { 0.18 };
    let b5 = if u < 0.5 { 0.0 } else { 0.18 - pushed };
    [b5, b6, 0.18 * step + pushed]
}

/// Valve times and duties that make a robot follow the program from its observed state.
fn follow(t: f64, strokes: &[f64; 6], travel: f64) -> Inputs {
    let [b5, b6, x] = program(t);
    let targets = [0.09, b5, b6, 0.09, 0.09, 0.18];
    let mut inputs = Inputs::default();
    for (on, (target, stroke)) in inputs
        .valve_on_us
        .iter_mut()
        .zip(targets.iter().zip(strokes))
    {
        let error = target - stroke;
        // The valves need some milliseconds: pulses within a period of 20 ms.
        let us = if error.abs() < 1e-3 || (t * 1e3) as u64 % 20 > 8 && error.abs() < 0.02 {
            0
        } else {
            1000
        };
        *on = if error > 0.0 {
            [us, 0, 0, us]
        } else {
            [0, us, us, 0]
        };
    }
    inputs.bridge_duty = [(20.0 * (x - travel)).clamp(-1.0, 1.0); 2];
    inputs.bridge_enabled = [true; 2];
    inputs
}

fn start_pose(params: &mut PlantParams) {
    params.initial_stroke_m = [0.09, 0.0, 0.18, 0.09, 0.09, 0.18];
}

/// The plant with the robot in eight coordinates.
type Eight = Assembly<BodyMechanics, 6>;

fn eight(
    params: &PlantParams,
    plant: &Plant,
    from: &PlantState,
) -> (Eight, AssemblyState<BodyMotion>) {
    let assembly = Assembly {
        cylinders: plant.assembly.cylinders.clone(),
        supply: plant.assembly.supply.clone(),
        mechanics: BodyMechanics::new(params),
        step_ns: params.step_ns,
    };
    let mut position = [0.0; 8];
    position[2..].copy_from_slice(from.core.motion.state.lengths_m.as_flattened());
    let mut motion = BodyMotion::at_rest(position);
    assembly.mechanics.settle_pitch(&mut motion).unwrap();
    let mut state = AssemblyState {
        time_ns: 0,
        cylinders: from.core.cylinders.clone(),
        supply: from.core.supply.clone(),
        motion,
    };
    assembly.start(&mut state).unwrap();
    (assembly, state)
}

/// First-order low-pass of 20 Hz, twice, at 1 ms.
#[derive(Default, Clone, Copy)]
struct LowPass([f64; 2]);

impl LowPass {
    fn next(&mut self, value: f64) -> f64 {
        let share = 1.0 - (-std::f64::consts::TAU * 20.0 * 1e-3_f64).exp();
        self.0[0] += share * (value - self.0[0]);
        self.0[1] += share * (self.0[0] - self.0[1]);
        self.0[1]
    }
}

/// Commands that made the robot in eight coordinates walk, given to the floating robot open loop.
#[test]
fn with_the_same_commands_it_moves_as_the_robot_in_eight_coordinates() {
    let mut params = wheeleg_2003();
    start_pose(&mut params);
    params.contacts.wheel.rolling_resistance = 0.0;
    // Its wheels roll on a rigid axle height.
    params.contacts.wheel.law.stiffness_n_m *= 20.0;
    params.contacts.wheel.law.bristle_stiffness_n_m *= 20.0;
    let (plant, mut state) = built(&params);
    let (other, mut oracle) = eight(&params, &plant, &state);
    let mut squares = [[0.0; 6]; 2];
    let mut filters = [[LowPass::default(); 6]; 2];
    let ticks = 10_000;
    for tick in 0..ticks {
        let strokes = other.mechanics.strokes_m(&oracle.motion);
        let inputs = follow(tick as f64 * 1e-3, &strokes, oracle.motion.position[0]);
        plant.tick(&mut state, &inputs).unwrap();
        let now = oracle.time_ns;
        for (i, on) in inputs.valve_on_us.iter().enumerate() {
            other.cylinders[i].command(&mut oracle.cylinders[i], now, *on, 1000);
        }
        for (motor, duty) in oracle.motion.motors.iter_mut().zip(inputs.bridge_duty) {
            (motor.duty, motor.enabled) = (duty, true);
        }
        other.advance_to(&mut oracle, now + 1_000_000).unwrap();
        let (a, b) = (plant.assembly.outputs(&state.core), other.outputs(&oracle));
        for i in 0..6 {
            let apart = (a[i].stroke_m - b[i].stroke_m) * 1e3;
            squares[0][i] += apart * apart;
            let force =
                filters[0][i].next(a[i].forces.net_n()) - filters[1][i].next(b[i].forces.net_n());
            squares[1][i] += force * force;
        }
    }
    let [strokes, forces] = squares.map(|s| s.map(|s| f64::sqrt(s / f64::from(ticks))));
    let [x, _, _] = plant.outputs(&state).position_m;
    println!(
        "strokes {strokes:.3?} mm rms, forces {forces:.3?} N rms, travel {x} and {} m",
        oracle.motion.position[0]
    );
    assert!(oracle.motion.position[0] > 0.4, "it walked");
    assert!(strokes.iter().all(|s| *s < 1.0), "{strokes:?} mm");
    assert!(forces.iter().all(|f| *f < 1.0), "{forces:?} N");
    assert!((x - oracle.motion.position[0]).abs() < 2e-3, "{x}");
}

/// Every joule of the actuators is in the motion, or went into ground and bearings.
#[test]
fn energy_is_accounted_for() {
    let mut params = wheeleg_2003();
    start_pose(&mut params);
    let (plant, mut state) = built(&params);
    let mechanics = &plant.assembly.mechanics;
    let start = mechanics.energy_j(&state.core.motion).unwrap();
    let power = |state: &PlantState| {
        let net = plant.assembly.forces(&state.core).map(|f| f.net_n());
        mechanics.power(&state.core.motion, &net).unwrap()
    };
    let (mut balance, mut actuators, mut ground) = (0.0, 0.0, 0.0);
    let mut before = power(&state);
    for tick in 0..10_000_u64 {
        let strokes = mechanics.strokes_m(&state.core.motion);
        let x = plant.outputs(&state).position_m[0];
        plant
            .apply(&mut state, &follow(tick as f64 * 1e-3, &strokes, x))
            .unwrap();
        for step in 1..=10 {
            plant
                .advance_to(&mut state, tick * 1_000_000 + step * STEP_NS)
                .unwrap();
            let now = power(&state);
            let mean =
                |of: fn(&wheeleg_plant::body::Power) -> f64| 0.5e-4 * (of(&before) + of(&now));
            balance += mean(|p| p.pistons_w + p.motors_w + p.ground_w + p.bearings_w);
            actuators += mean(|p| p.pistons_w.abs() + p.motors_w.abs());
            ground += mean(|p| p.ground_w);
            before = now;
        }
    }
    let residual = mechanics.energy_j(&state.core.motion).unwrap() - start - balance;
    println!("residual {residual:.4} J of {actuators:.1} J by the actuators, ground {ground:.2} J");
    assert!(actuators > 20.0, "{actuators}");
    assert!(ground < 0.0, "the ground takes: {ground}");
    assert!(
        residual.abs() <= 0.005 * actuators + 0.1,
        "{residual} J of {actuators} J"
    );
}

#[test]
fn rolling_freely_it_loses_what_the_rolling_resistance_takes() {
    for resistance in [0.0, 0.02] {
        let mut params = icy_feet(free_wheels());
        params.contacts.wheel.rolling_resistance = resistance;
        let (plant, mut state) = built(&params);
        let mechanics = &plant.assembly.mechanics;
        set_speed(&mut state, 1.0, params.body.wheel_radius_m);
        // The coasting motor keeps its current at zero.
        for _ in 0..200 {
            plant.tick(&mut state, &Inputs::default()).unwrap();
        }
        let energy = |s: &PlantState| mechanics.energy_j(&s.core.motion).unwrap();
        let (mut last, from) = (energy(&state), plant.outputs(&state).position_m[0]);
        let start = last;
        for _ in 0..1000 {
            plant.tick(&mut state, &Inputs::default()).unwrap();
            let now = energy(&state);
            assert!(now < last + 1e-4, "energy rises: {last} {now}");
            last = now;
        }
        let o = plant.outputs(&state);
        let distance = o.position_m[0] - from;
        let load: f64 = o.wheel_normal_n.iter().sum();
        let expected = resistance * load * distance;
        println!(
            "{resistance}: lost {} J, expected {expected} J on {distance} m",
            start - last
        );
        assert!(
            (start - last - expected).abs() < 0.02 * expected + 2e-3,
            "{resistance}"
        );
    }
}

#[test]
fn dropped_it_comes_to_rest_where_it_stands() {
    let params = wheeleg_2003();
    let (plant, mut state) = built(&params);
    let mechanics = &plant.assembly.mechanics;
    let rest = plant.outputs(&state);
    state.core.motion.state.position_m.z += 0.02;
    let energy = |s: &PlantState| mechanics.energy_j(&s.core.motion).unwrap();
    let start = energy(&state);
    let mut floor = 0.0_f64;
    for tick in 0..3000 {
        plant.tick(&mut state, &Inputs::default()).unwrap();
        floor = floor.max(energy(&state) - start);
        if tick == 55 {
            assert_eq!(
                plant.outputs(&state).wheel_normal_n,
                [0.0; 2],
                "60.9 ms of free fall"
            );
        }
    }
    let o = plant.outputs(&state);
    println!("rest {:?} before {:?}", o.position_m, rest.position_m);
    assert!(floor < 1e-3, "it gains {floor} J");
    assert!((o.position_m[2] - rest.position_m[2]).abs() < 5e-4);
    let weight = params.body.total_mass_kg() * G;
    let carried: f64 = o.wheel_normal_n.iter().chain(&o.foot_normal_n).sum();
    assert!((carried / weight - 1.0).abs() < 1e-3, "{carried} {weight}");
    assert!(o.velocity_m_s.iter().all(|v| v.abs() < 1e-3));
}

/// Wheels at unlike speeds: the circle of a differential drive.
#[test]
fn unlike_wheels_turn_it_on_a_circle() {
    let params = icy_feet(free_wheels());
    let (plant, mut state) = built(&params);
    let inputs = Inputs {
        bridge_duty: [0.20, 0.60],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    for _ in 0..1000 {
        plant.tick(&mut state, &inputs).unwrap();
    }
    let (mut turned, mut travelled) = (0.0, 0.0);
    let mut rates = [0.0; 2];
    for _ in 0..3000 {
        plant.tick(&mut state, &inputs).unwrap();
        let o = plant.outputs(&state);
        turned += 1e-3 * o.angular_velocity_rad_s[2];
        travelled += 1e-3 * o.velocity_m_s[0];
        for (sum, rate) in rates.iter_mut().zip(o.wheel_rate_rad_s) {
            *sum += 1e-3 * rate;
        }
    }
    let r = params.body.wheel_radius_m;
    let yaw = r * (rates[1] - rates[0]) / params.spatial.track_m;
    let radius = 0.5 * r * (rates[0] + rates[1]) / yaw;
    println!(
        "turned {turned} rad, by the wheels {yaw}; radius {} and {radius} m",
        travelled / turned
    );
    assert!(turned > 0.3, "{turned}");
    assert!((turned / yaw - 1.0).abs() < 0.02, "{turned} {yaw}");
    assert!((travelled / turned / radius - 1.0).abs() < 0.02);
}

/// On ice under one wheel it slips there and says so.
#[test]
fn a_wheel_without_grip_spins() {
    let mut params = icy_feet(free_wheels());
    params.contacts.wheel.law.mu_static = 0.02;
    params.contacts.wheel.law.mu_kinetic = 0.02;
    let (plant, mut state) = built(&params);
    let inputs = Inputs {
        bridge_duty: [1.0; 2],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    for _ in 0..300 {
        plant.tick(&mut state, &inputs).unwrap();
    }
    let o = plant.outputs(&state);
    // Only Coulomb friction drives it.
    let most = 0.02 * G * 0.3 * 1.2;
    assert!(
        o.velocity_m_s[0] > 0.0 && o.velocity_m_s[0] < most,
        "{:?}",
        o.velocity_m_s
    );
    for slip in o.wheel_slip_m_s {
        assert!(slip > 0.1, "{slip}");
    }
}

/// An edge low enough that it does not tip back before.
#[test]
fn wheels_climb_an_edge_at_the_torque_of_statics() {
    use wheeleg_plant::terrain::{Material, Part, Shape, Solid};
    let mut params = icy_feet(free_wheels());
    // Stiff, so that the edge keeps its height.
    params.contacts.wheel.law.stiffness_n_m *= 20.0;
    params.contacts.wheel.law.bristle_stiffness_n_m *= 20.0;
    let (r, h): (f64, f64) = (params.body.wheel_radius_m, 0.02);
    let sine = (r - h) / r;
    let cosine = (1.0 - sine * sine).sqrt();
    // Only under the wheels, just not touching yet.
    for y in [-0.28, 0.28] {
        let edge = r * cosine + 1e-4;
        params.terrain.parts.push(Part {
            shape: Shape::Solid(Solid::block([edge + 0.15, y], [0.15, 0.04], 0.0, [-0.5, h])),
            material: Material::ROUGH,
        });
    }
    let (plant, mut state) = built(&params);
    let mechanics = &plant.assembly.mechanics;
    let mut inputs = Inputs {
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    let mut torque = 0.0;
    for tick in 0..20_000_u32 {
        inputs.bridge_duty = [f64::from(tick) * 2e-5; 2];
        plant.tick(&mut state, &inputs).unwrap();
        let o = plant.outputs(&state);
        torque = o.wheel_torque_n_m.iter().sum();
        if o.position_m[2] > r + 2e-4 {
            break;
        }
    }
    let o = plant.outputs(&state);
    let kin = mechanics.scene(&state.core.motion).unwrap().kin;
    let weight = params.body.total_mass_kg() * G;
    let axle = Vector3::from(o.position_m);
    let (com, foot) = (kin.com_m().x - axle.x, o.sole_m[0][0] - axle.x);
    // Tangential force T at the edge: T/cos up, T r about the axle; the rest on the feet.
    let drive = weight * (1.0 - com / foot) / (1.0 / cosine - r / foot);
    println!("torque {torque} N m, by statics {} N m", drive * r);
    assert!(
        (torque / (drive * r) - 1.0).abs() < 0.01,
        "{torque} {}",
        drive * r
    );
}
