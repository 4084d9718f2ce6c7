//! Times of the dynamics and of a plant step (criterion): `cargo bench -p wheeleg-plant`.
//!
//! For figures beside the C references in one run, and for instruction counts, see
//! `cargo xtask bench`; for dated results `RESULTS.md`.

use std::hint::black_box;

use criterion::Criterion;
use nalgebra::Vector3;
use wheeleg_plant::dynamics::RobotDynamicsParams;
use wheeleg_plant::dynamics::floating::{Contacts, FloatingParams, FloatingRobot, FloatingState};
use wheeleg_plant::dynamics::noc::Leg;
use wheeleg_plant::soil::Soil;
use wheeleg_plant::soil::rolling::{Motion, Rolled, RollingLaw};
use wheeleg_plant::soil::wheel::Wheel;
use wheeleg_plant::terrain::Material;
use wheeleg_plant::testing::{wheeleg_2003, wheeleg_field};
use wheeleg_plant::{Inputs, Plant};

const LENGTHS_M: [f64; 3] = [0.40, 0.10, 0.19];

/// The readable reference of the robot's leg.
fn own_leg(c: &mut Criterion) {
    let p = RobotDynamicsParams::wheeleg_2003();
    let viscous = [20.0, 15.0, 15.0];
    let noc = Leg::new(p.leg_parameters(), &p.leg_bodies, viscous).expect("leg");
    let (q, v, a, f) = (
        LENGTHS_M,
        [0.1, -0.2, 0.3],
        [1.0, -2.0, 3.0],
        [1.0, 2.0, 60.0],
    );
    let g = [0.0, 0.0, -9.81];
    let vectors = [q, v, a, g, f].map(Vector3::from);
    c.bench_function("leg_id_own_noc", |b| {
        let [q, v, a, g, f] = &vectors;
        b.iter(|| noc.at(black_box(q), v)?.inverse(a, g, f));
    });
    c.bench_function("leg_fd_own_noc", |b| {
        let [q, v, a, g, f] = &vectors;
        b.iter(|| noc.at(black_box(q), v)?.forward(a, g, f));
    });
}

/// The engine that every run steps.
fn robot(c: &mut Criterion) {
    let floating = FloatingRobot::new(&FloatingParams::wheeleg_2003()).expect("floating robot");
    let state = FloatingState::at_rest([LENGTHS_M; 2]);
    let force = nalgebra::SVector::<f64, 14>::repeat(1.0);
    let (down, contacts) = (Vector3::new(0.0, 0.0, -9.81), Contacts::default());
    c.bench_function("robot_fd_own_14dof", |b| {
        b.iter(|| floating.forward(black_box(&state), &force, &down, &contacts));
    });
}

/// One joint tick of the whole plant, 1 ms: six cylinders, robot, contact, motors, sensors.
fn plant_tick(c: &mut Criterion) {
    let plant = Plant::new(&wheeleg_2003()).expect("plant");
    let start = plant.initial_state(1).expect("state");
    let inputs = Inputs::default();
    c.bench_function("plant_tick_1ms", |b| {
        let mut state = start.clone();
        b.iter(|| plant.tick(&mut state, black_box(&inputs)));
    });
}

/// A wheel in soil: integrals, table, and the law that a step takes; the field robot on sand.
fn soil(c: &mut Criterion) {
    let (wheel, sand) = (
        Wheel {
            radius_m: 0.15,
            width_m: 0.10,
            lug_m: 0.015,
        },
        Soil::VOLCANIC_SAND,
    );
    c.bench_function("soil_wheel_integral", |b| {
        b.iter(|| wheel.forces(black_box(&sand), black_box(0.0167), black_box(0.2)));
    });
    let law = RollingLaw::new(&wheel, &sand);
    let (h, v) = (1e-4, 0.12);
    for (name, rolled, left) in [
        ("soil_wheel_rolling", 1.0, 0.0),
        ("soil_wheel_turning", 1.0, 0.01),
        ("soil_wheel_at_rest", 0.0, 0.01),
    ] {
        let speed = Motion {
            travel: rolled * v,
            tread: rolled * v / 0.8,
            left,
        };
        let touch = Rolled {
            depth_m: 0.0167,
            closing_m_s: 1e-4,
            speed,
            moved: Motion {
                travel: h * speed.travel,
                tread: h * speed.tread,
                left: h * speed.left,
            },
        };
        let mut state = RollingLaw::pressed(0.0167);
        state.rolled = rolled;
        c.bench_function(name, |b| {
            b.iter(|| law.force(black_box(&mut state), black_box(&touch)));
        });
    }
    c.bench_function("soil_table_build", |b| {
        b.iter(|| RollingLaw::new(black_box(&wheel), black_box(&sand)));
    });
    let mut params = wheeleg_field();
    params.terrain.parts[0].material = Material::soft(sand);
    let plant = Plant::new(&params).expect("plant");
    let start = plant.initial_state(1).expect("state");
    let inputs = Inputs {
        bridge_duty: [0.3; 2],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    c.bench_function("plant_tick_1ms_sand", |b| {
        let mut state = start.clone();
        b.iter(|| plant.tick(&mut state, black_box(&inputs)));
    });
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    own_leg(&mut criterion);
    robot(&mut criterion);
    plant_tick(&mut criterion);
    soil(&mut criterion);
    criterion.final_summary();
}
