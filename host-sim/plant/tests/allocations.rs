//! A step of the plant allocates nothing, on every kind of terrain.

use std::sync::Arc;

use nalgebra::Vector3;
use wheeleg_plant::soil::Soil;
use wheeleg_plant::terrain::{
    Ellipsoid, HeightMap, Material, Part, Plane, RockField, Shape, Solid,
};
use wheeleg_plant::testing::{wheeleg_2003, wheeleg_field};
use wheeleg_plant::{Inputs, Plant};

fn waves() -> HeightMap {
    let height =
        |k: usize| 0.01 * f64::sin(0.4 * (k % 64) as f64) * f64::cos(0.3 * (k / 64) as f64);
    let heights: Vec<f64> = (0..64 * 64).map(height).collect();
    HeightMap::new(&heights, 64, 0.1, [-3.2; 2]).unwrap()
}

fn rocks() -> Vec<Shape> {
    let field = RockField {
        x_m: [0.25, 5.0],
        y_m: [-1.0, 1.0],
        seed: 1,
        cover: 0.25,
        size_m: [0.05, 0.2],
        exposed: 0.1,
        aspect: 0.5,
    };
    let rocks: Vec<Ellipsoid> = field.scatter(|_, _| 0.0).unwrap();
    rocks.into_iter().map(Shape::Ellipsoid).collect()
}

#[test]
fn a_step_allocates_nothing() {
    let level = Shape::Plane(Plane::level(0.0));
    let block = Solid::block([0.6, 0.0], [0.4, 1.0], 0.0, [-1.0, 0.02]);
    let sphere = Ellipsoid::new(Vector3::new(0.3, 0.28, -0.1), Vector3::repeat(0.12), 0.0);
    let kinds = [
        ("level", vec![level.clone()]),
        ("slope", vec![Shape::Plane(Plane::sloping(0.2, 1.0))]),
        ("block", vec![level.clone(), Shape::Solid(block)]),
        ("rock", vec![level.clone(), Shape::Ellipsoid(sphere)]),
        ("rocks", [vec![level], rocks()].concat()),
        ("map", vec![Shape::HeightMap(Arc::new(waves()))]),
    ];
    let sand = Material::soft(Soil::VOLCANIC_SAND);
    let hard = kinds.iter().map(|kind| (kind, Material::ROUGH));
    let soft = kinds.iter().map(|kind| (kind, sand));
    for ((name, shapes), material) in hard.chain(soft) {
        let mut params = match material.soil {
            None => wheeleg_2003(),
            Some(_) => wheeleg_field(),
        };
        let part = |shape: Shape| Part { shape, material };
        params.terrain.parts = shapes.iter().cloned().map(part).collect();
        let plant = Plant::new(&params).unwrap();
        let mut state = plant.initial_state(1).unwrap();
        let mut inputs = Inputs {
            bridge_duty: [0.4; 2],
            bridge_enabled: [true; 2],
            ..Inputs::default()
        };
        let mut run = |ticks: u32| {
            for k in 0..ticks {
                // Pulses, so that steps are divided at edges.
                let on = if k % 4 == 0 { 700 } else { 0 };
                inputs.valve_on_us[2] = [0, on, on, 0];
                plant.tick(&mut state, &inputs).unwrap();
                std::hint::black_box(plant.outputs(&state));
            }
        };
        // Queues grow to their size once.
        run(50);
        let counted = allocation_counter::measure(|| run(1500));
        assert_eq!(counted.count_total, 0, "{name}: {counted:?}");
    }
    // The counter does count.
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(vec![1; 9])));
    assert_eq!(counted.count_total, 1);
}
