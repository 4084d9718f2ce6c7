//! The whole plant on every kind of terrain, in steps of 100 µs, with active valves and wheels: the steps of
//! a run without firmware, bus and log.

use std::hint::black_box;
use std::sync::Arc;

use nalgebra::Vector3;
use wheeleg_plant::soil::Soil;
use wheeleg_plant::soil::rolling::{Motion, Rolled, RollingLaw};
use wheeleg_plant::soil::wheel::Wheel;
use wheeleg_plant::terrain::{
    Ellipsoid, HeightMap, Material, Part, Plane, RockField, Shape, Solid, Surface,
};
use wheeleg_plant::testing::{wheeleg_2003, wheeleg_field};
use wheeleg_plant::{Inputs, Plant, PlantParams};

use crate::measure::{put_ns, put_realtime, repetitions, scale, timed};

pub(crate) fn run() {
    let level = || Shape::Plane(Plane::level(0.0));
    let on = |below: Shape, more: Vec<Shape>| {
        let mut shapes = vec![below];
        shapes.extend(more);
        shapes
    };
    plant("plant_flat", on(level(), Vec::new()));
    let slope = Shape::Plane(Plane::sloping(0.1, 0.0));
    plant("plant_slope", on(slope, Vec::new()));
    sand();
    plant("plant_stairs", on(level(), stairs()));
    plant("plant_rocks", on(level(), rocks([0.25, 30.0], 2.0)));
    plant("plant_rocks_100k", on(level(), rocks([0.25, 150.0], 40.0)));
    plant("plant_map", vec![Shape::HeightMap(Arc::new(map(256)))]);
    plant(
        "plant_map_4096",
        vec![Shape::HeightMap(Arc::new(map(4096)))],
    );
    height_query();
    soil_wheel();
}

fn plant(case: &str, shapes: Vec<Shape>) {
    let mut params = wheeleg_2003();
    let part = |shape| Part {
        shape,
        material: Material::ROUGH,
    };
    params.terrain.parts = shapes.into_iter().map(part).collect();
    step(case, &params);
}

/// The field robot on level sand.
fn sand() {
    let mut params = wheeleg_field();
    params.terrain.parts = vec![Part {
        shape: Shape::Plane(Plane::level(0.0)),
        material: Material::soft(Soil::VOLCANIC_SAND),
    }];
    step("plant_sand", &params);
}

fn step(case: &str, params: &PlantParams) {
    let built = Plant::new(params);
    let Ok((plant, mut state)) = built.and_then(|p| p.initial_state(1).map(|s| (p, s))) else {
        return;
    };
    let ticks = (20_000.0 * scale()) as usize + 1;
    let mut failed = 0;
    let took = timed(|| {
        for tick in 0..ticks {
            failed += usize::from(plant.tick(&mut state, black_box(&commands(tick))).is_err());
        }
    });
    if failed == 0 {
        let x = plant.outputs(&state).position_m[0];
        put_realtime(case, "", took, ticks as f64 * 1e-3, &format!("x={x:.3} m"));
    }
}

/// Both legs up and down by turns, valves in pulses, the wheels driving: one step takes a second.
fn commands(tick: usize) -> Inputs {
    let mut inputs = Inputs::default();
    let (leg, up) = (tick / 1000 % 2, tick % 1000 < 400);
    let on = if tick % 20 < 10 { 1000 } else { 0 };
    inputs.valve_on_us[3 * leg + 2] = if up { [0, on, on, 0] } else { [on, 0, 0, on] };
    inputs.bridge_duty = [0.2; 2];
    inputs.bridge_enabled = [true; 2];
    inputs
}

/// Low and long, so that the robot climbs them.
fn stairs() -> Vec<Shape> {
    let tread = |i: u32| {
        let x = 1.0 + 0.4 * f64::from(i);
        let high = 0.02 * f64::from(i + 1);
        Shape::Solid(Solid::block([x, 0.0], [0.2, 2.0], 0.0, [-1.0, high]))
    };
    (0..50).map(tread).collect()
}

/// Small ones, a quarter of the ground, from just ahead of the wheels.
fn rocks(x_m: [f64; 2], half_width_m: f64) -> Vec<Shape> {
    let field = RockField {
        x_m,
        y_m: [-half_width_m, half_width_m],
        seed: 1,
        cover: 0.25,
        size_m: [0.1, 0.22],
        exposed: 0.1,
        aspect: 0.7,
    };
    let rocks: Vec<Ellipsoid> = field.scatter(|_, _| 0.0).unwrap_or_default();
    rocks.into_iter().map(Shape::Ellipsoid).collect()
}

/// Waves of a few centimetres.
fn map(side: usize) -> HeightMap {
    let height = |k: usize| {
        let (x, y) = ((k % side) as f64, (k / side) as f64);
        0.02 * libm::sin(0.35 * x) * libm::cos(0.3 * y)
    };
    let heights: Vec<f64> = (0..side * side).map(height).collect();
    let middle = -0.05 * side as f64;
    HeightMap::new(&heights, side, 0.1, [middle, middle]).unwrap_or_else(|e| panic!("{e}"))
}

/// Height and slope at one place of a map.
fn height_query() {
    let (map, repetitions) = (map(1024), repetitions(1_000_000.0));
    let mut sum = 0.0;
    let took = timed(|| {
        for r in 0..repetitions {
            let point = Vector3::new(1e-5 * r as f64, 1.3, 0.1);
            sum += map.to_point(black_box(&point)).distance_m;
        }
    });
    put_ns(
        "map_height",
        "",
        took,
        repetitions,
        &format!("sum={sum:.3}"),
    );
}

/// The law of a wheel that rolls on sand with a slip, turning a little, in one step.
fn soil_wheel() {
    let wheel = Wheel {
        radius_m: 0.15,
        width_m: 0.10,
        lug_m: 0.015,
    };
    let law = RollingLaw::new(&wheel, &Soil::VOLCANIC_SAND);
    let speed = Motion {
        travel: 0.12,
        tread: 0.15,
        left: 0.01,
    };
    let touch = Rolled {
        depth_m: 0.0167,
        closing_m_s: 0.0,
        speed,
        moved: Motion {
            travel: 1.2e-5,
            tread: 1.5e-5,
            left: 1e-6,
        },
    };
    let mut state = RollingLaw::pressed(0.0167);
    let (mut pull, repetitions) = (0.0, repetitions(1_000_000.0));
    let took = timed(|| {
        for _ in 0..repetitions {
            pull = law.force(&mut state, black_box(&touch)).forward_n;
        }
    });
    put_ns(
        "soil_wheel",
        "",
        took,
        repetitions,
        &format!("DP={pull:.2} N"),
    );
}
