//! Random states of the robot with a floating chassis, and the results of our dynamics for them, as JSON for
//! a comparison with other rigid-body programs.
//!
//!     cargo run --example floating_states -- [ROBOT] [SEED] [COUNT] > states.json
//!
//! Conventions: `wheeleg_plant::dynamics::floating`. Viscous friction is left out. Positions of
//! cylinders are strokes (m); everything else as in `FloatingState`. `contacts`: moment and force
//! (world axes) on left sole, right sole, left wheel, right wheel, at the sole's centre or the
//! wheel's centre.

use std::error::Error;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use wheeleg_config::{RobotConfig, builtin};
use wheeleg_plant::dynamics::floating::{Contacts, FloatingRobot, FloatingState, Velocity, Wrench};

struct Draw<'a> {
    rng: Pcg64Mcg,
    robot: &'a RobotConfig,
}

impl Draw<'_> {
    fn within(&mut self, size: f64) -> f64 {
        self.rng.random_range(-size..size)
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(size))
    }

    fn wrench(&mut self) -> Wrench {
        Wrench {
            moment_n_m: self.vector(20.0),
            force_n: self.vector(100.0),
        }
    }

    /// Angular, linear, cylinders, wheels.
    fn velocity(&mut self, sizes: [f64; 4]) -> Velocity {
        Velocity::from_fn(|i, _| {
            let group = [3, 6, 12, 14].iter().take_while(|end| i >= **end).count();
            self.within(sizes[group])
        })
    }

    /// Any attitude, all strokes.
    fn state(&mut self) -> ([f64; 6], FloatingState) {
        let mut normal = || StandardNormal.sample(&mut self.rng);
        let q = Quaternion::new(normal(), normal(), normal(), normal());
        let plant = &self.robot.plant;
        let strokes: [f64; 6] =
            std::array::from_fn(|i| self.rng.random_range(0.0..plant.cylinders[i].stroke_m));
        let length = |i: usize| plant.stroke_zero_m[i] + strokes[i];
        let lengths_m = [[0, 1, 2].map(length), [3, 4, 5].map(length)];
        let state = FloatingState {
            position_m: self.vector(3.0),
            orientation: UnitQuaternion::new_normalize(q),
            wheel_rad: [self.within(3.0), self.within(3.0)],
            velocity: self.velocity([2.0, 1.0, 0.5, 10.0]),
            ..FloatingState::at_rest(lengths_m)
        };
        (strokes, state)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments
        .next()
        .unwrap_or_else(|| "wheeleg-2003".to_owned());
    let seed: u64 = arguments.next().map_or(Ok(1), |a| a.parse())?;
    let count: usize = arguments.next().map_or(Ok(200), |a| a.parse())?;
    let robot = builtin::robot(&name)?;
    let mut params = robot.floating_params();
    params.robot.viscous = [0.0; 8];
    let model = FloatingRobot::new(&params)?;
    let mut draw = Draw {
        rng: Pcg64Mcg::seed_from_u64(seed),
        robot: &robot,
    };
    let mut states = Vec::with_capacity(count);
    for _ in 0..count {
        states.push(one(&model, &mut draw)?);
    }
    let file = json!({
        "schema": "wheeleg-floating-states/1",
        "robot": robot.name,
        "seed": seed,
        "rotor_inertia_kg_m2": params.robot.rotor_inertia_kg_m2,
        "gear_ratio": params.robot.gear_ratio,
        "states": states,
    });
    println!("{file:#}");
    Ok(())
}

fn one(model: &FloatingRobot, draw: &mut Draw) -> Result<Value, Box<dyn Error>> {
    let (strokes, state) = draw.state();
    let gravity = draw.vector(10.0);
    let force = draw.velocity([20.0, 100.0, 200.0, 10.0]);
    let contacts = Contacts {
        feet: [draw.wrench(), draw.wrench()],
        wheels: [draw.wrench(), draw.wrench()],
        chassis: draw.wrench(),
    };
    let kin = model.prepare(&state, &gravity)?;
    let acceleration = model.forward(&state, &force, &gravity, &contacts)?;
    let mass = kin.mass_matrix();
    let rows: Vec<Vec<f64>> = mass
        .row_iter()
        .map(|r| r.iter().copied().collect())
        .collect();
    let list = |v: &Velocity| v.as_slice().to_vec();
    let momentum = kin.momentum();
    Ok(json!({
        "position_m": state.position_m.as_slice(),
        // x, y, z, w
        "orientation": state.orientation.coords.as_slice(),
        "strokes_m": strokes,
        "wheel_rad": state.wheel_rad,
        "velocity": list(&state.velocity),
        "gravity_m_s2": gravity.as_slice(),
        "force": list(&force),
        "contacts": contacts.all().map(|w| {
            let (n, f) = (w.moment_n_m, w.force_n);
            [n.x, n.y, n.z, f.x, f.y, f.z]
        }),
        "mass_matrix": rows,
        "bias": list(&kin.bias()),
        "contact_force": list(&kin.contact_force(&contacts)),
        "acceleration": list(&acceleration),
        "com_m": kin.com_m().as_slice(),
        "linear_momentum": momentum.linear_kg_m_s.as_slice(),
        "angular_momentum": momentum.angular_kg_m2_s.as_slice(),
    }))
}
