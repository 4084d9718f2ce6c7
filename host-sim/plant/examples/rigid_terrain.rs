//! The robot on rigid ground in our plant, as JSON for a comparison with another physics engine
//! (`tests/python/check_terrain.py`).
//!
//!     cargo run --example rigid_terrain > terrain.json
//!
//! `body`: chassis and legs as one body at the start pose, about the middle of the axle, chassis
//! axes. Contacts are a hundred times as stiff as the robot's, as those of an engine that solves
//! for rigid ones; motors have neither friction nor loss.

use std::error::Error;
use std::f64::consts::FRAC_PI_2;

use serde_json::{Value, json};
use wheeleg_plant::dynamics::floating::FloatingState;
use wheeleg_plant::terrain::{Material, Part, Plane, Shape, Solid};
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Inputs, Outputs, Plant, PlantParams, PlantState};

type Failed = Box<dyn Error>;

/// Legs at mid stroke; the left foot 60 mm up if only three support it.
fn robot(three: bool) -> PlantParams {
    let mut params = wheeleg_2003();
    let left = if three { 0.12 } else { 0.18 };
    params.initial_stroke_m = [0.09, 0.09, left, 0.09, 0.09, 0.18];
    params.contacts.wheel.law.stiffness_n_m = 6e6;
    params.contacts.wheel.law.bristle_stiffness_n_m = 6e6;
    params.contacts.foot.law.stiffness_n_m = 2e6;
    params.contacts.foot.law.bristle_stiffness_n_m = 2e6;
    params.contacts.wheel.rolling_resistance = 0.0;
    params.body.viscous = [0.0; 8];
    for motor in &mut params.motors {
        motor.friction_n_m = 0.0;
        motor.efficiency = 1.0;
    }
    params
}

fn on(params: &PlantParams, degrees: f64) -> PlantParams {
    let mut params = params.clone();
    params.terrain.parts[0].shape = Shape::Plane(Plane::sloping(degrees.to_radians(), 0.0));
    params
}

/// Feet that do not rub.
fn slippery(params: &PlantParams) -> Result<(Plant, PlantState), Failed> {
    let mut plant = Plant::new(params)?;
    let state = plant.initial_state(1)?;
    let touching = &mut plant.assembly.mechanics.touching;
    touching.limit_foot_friction(Some(0.0));
    Ok((plant, state))
}

fn driven(duty: [f64; 2]) -> Inputs {
    Inputs {
        bridge_duty: duty,
        bridge_enabled: [true; 2],
        ..Inputs::default()
    }
}

/// Chassis and legs as one body, and the positions of the soles.
fn body(params: &PlantParams) -> Result<Value, Failed> {
    let plant = Plant::new(params)?;
    let zero = &params.stroke_zero_m;
    let at = |i: usize| zero[i] + params.initial_stroke_m[i];
    let state = FloatingState::at_rest([[0, 1, 2].map(at), [3, 4, 5].map(at)]);
    let mechanics = &plant.assembly.mechanics;
    let kin = mechanics
        .dynamics
        .prepare(&state, &nalgebra::Vector3::zeros())?;
    // Composite inertia about the axle's middle, wheels not turning on their own.
    let m = kin.mass_matrix();
    let inertia: Vec<Vec<f64>> = (0..3)
        .map(|i| (0..3).map(|j| m[(i, j)]).collect())
        .collect();
    let soles: Vec<[f64; 3]> = kin.points_m()[..2].iter().map(|p| (*p).into()).collect();
    let (b, c) = (&params.body, &params.contacts);
    Ok(json!({
        "mass_kg": m[(3, 3)],
        "com_m": <[f64; 3]>::from(kin.com_m()),
        "inertia_kg_m2": inertia,
        "soles_m": soles,
        "wheel_mass_kg": b.wheel_mass_kg,
        "wheel_inertia_kg_m2": b.wheel_inertia_kg_m2,
        "wheel_transverse_kg_m2": params.spatial.wheel_transverse_inertia_kg_m2,
        "wheel_radius_m": b.wheel_radius_m,
        "wheel_width_m": c.wheel.width_m,
        "track_m": params.spatial.track_m,
        "armature_kg_m2": b.rotor_inertia_kg_m2 * b.gear_ratio * b.gear_ratio,
        "ring_m": c.foot.sole_radius_m * 5.0 / 6.0,
        "sphere_m": c.foot.sphere_radius_m,
        "mu": c.wheel.law.mu_static,
    }))
}

fn loads(three: bool, degrees: f64) -> Result<Value, Failed> {
    let params = on(&robot(three), degrees);
    let plant = Plant::new(&params)?;
    let o = plant.outputs(&plant.initial_state(1)?);
    Ok(json!({
        "three": three,
        "slope_deg": degrees,
        "wheels_n": o.wheel_normal_n,
        "feet_n": o.foot_normal_n,
    }))
}

/// Speed once it has gone a metre by itself.
fn speed_after_a_metre(plant: &Plant, state: &mut PlantState) -> Result<f64, Failed> {
    let norm = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let begun = plant.outputs(state).position_m;
    for _ in 0..10_000 {
        plant.tick(state, &Inputs::default())?;
        let now = plant.outputs(state);
        let gone: [f64; 3] = std::array::from_fn(|i| now.position_m[i] - begun[i]);
        if norm(gone) >= 1.0 {
            return Ok(norm(now.velocity_m_s));
        }
    }
    Err("it does not go a metre".into())
}

/// Backwards down 10°, wheels free, feet slippery: speed after a metre along the slope.
fn roll() -> Result<f64, Failed> {
    let (plant, mut state) = slippery(&on(&robot(false), 10.0))?;
    speed_after_a_metre(&plant, &mut state)
}

/// Down 25° with this friction below wheels and feet, the slope across, so that no wheel rolls:
/// speed after a metre.
fn slide(mu: f64) -> Result<f64, Failed> {
    let mut params = robot(false);
    let slope = Plane::sloping(25_f64.to_radians(), FRAC_PI_2);
    params.terrain.parts[0].shape = Shape::Plane(slope);
    // It stands while it holds; then the ground becomes slippery.
    let mut state = Plant::new(&params)?.initial_state(1)?;
    for law in [
        &mut params.contacts.wheel.law,
        &mut params.contacts.foot.law,
    ] {
        law.mu_static = mu;
        law.mu_kinetic = mu;
    }
    speed_after_a_metre(&Plant::new(&params)?, &mut state)
}

/// Height of the axle at rest after a drop.
fn drop_height() -> Result<f64, Failed> {
    let plant = Plant::new(&robot(false))?;
    let mut state = plant.initial_state(1)?;
    state.core.motion.state.position_m.z += 0.02;
    (0..3000).try_for_each(|_| plant.tick(&mut state, &Inputs::default()))?;
    Ok(plant.outputs(&state).position_m[2])
}

/// Torque of both wheels at which they leave the floor at an edge.
fn step(height: f64) -> Result<f64, Failed> {
    let mut params = robot(false);
    let r = params.body.wheel_radius_m;
    let lever = (r * r - (r - height) * (r - height)).sqrt();
    params.terrain.parts.push(Part {
        shape: Shape::Solid(Solid::block(
            [lever + 0.101, 0.0],
            [0.1, 1.0],
            0.0,
            [-1.0, height],
        )),
        material: Material::ROUGH,
    });
    let (plant, mut state) = slippery(&params)?;
    for tick in 0..20_000 {
        let duty = 3e-5 * f64::from(tick);
        plant.tick(&mut state, &driven([duty; 2]))?;
        let grips = state.core.motion.contacts.wheels.iter().flatten().flatten();
        let parts: Vec<u32> = grips.map(|grip| grip.part).collect();
        if parts.contains(&2) && !parts.contains(&1) {
            return Ok(plant.outputs(&state).wheel_torque_n_m.iter().sum());
        }
    }
    Err("it does not climb".into())
}

/// Two seconds of an arc: wheel rates and the robot's turn.
fn arc() -> Result<Value, Failed> {
    let (plant, mut state) = slippery(&robot(false))?;
    let mut run = |ticks: u32| -> Result<Outputs, Failed> {
        for _ in 0..ticks {
            plant.tick(&mut state, &driven([0.15, 0.45]))?;
        }
        Ok(plant.outputs(&state))
    };
    let (a, b) = (run(1500)?, run(2000)?);
    let rates = [0, 1].map(|i| (b.wheel_angle_rad[i] - a.wheel_angle_rad[i]) / 2.0);
    Ok(json!({
        "seconds": 2.0,
        "rates_rad_s": rates,
        "turned_rad": b.attitude_rad[2] - a.attitude_rad[2],
    }))
}

/// Steepest slope on which it stands, nose uphill.
fn tip_back() -> f64 {
    let (mut stands, mut falls) = (20.0, 28.0);
    while falls - stands > 0.01 {
        let middle = 0.5 * (stands + falls);
        let plant = Plant::new(&on(&robot(false), middle));
        if plant.and_then(|p| p.initial_state(1)).is_ok() {
            stands = middle;
        } else {
            falls = middle;
        }
    }
    stands
}

fn main() -> Result<(), Failed> {
    let mut statics = Vec::new();
    for three in [false, true] {
        for degrees in [0.0, 10.0, 20.0] {
            statics.push(loads(three, degrees)?);
        }
    }
    let result = json!({
        "body": body(&robot(false))?,
        "body_three": body(&robot(true))?,
        "static": statics,
        "roll_speed_m_s": roll()?,
        "slide_mu": 0.3,
        "slide_speed_m_s": slide(0.3)?,
        "drop_height_m": drop_height()?,
        "step_height_m": 0.02,
        "step_torque_n_m": step(0.02)?,
        "arc": arc()?,
        "tip_back_deg": tip_back(),
    });
    println!("{result}");
    Ok(())
}
