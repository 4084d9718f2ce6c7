//! Height maps: the surface between the values, and wheels on it.

use std::sync::Arc;

use nalgebra::Vector3;
use wheeleg_plant::body::BodyMotion;
use wheeleg_plant::terrain::{
    Disc, Ellipsoid, HeightMap, HeightMapError, Material, Part, Plane, Shape, Surface,
};
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Inputs, Plant, PlantParams};

/// Sampled from a function, `n` × `n` values, from `from_m` in both directions.
fn sampled(n: usize, cell_m: f64, from_m: f64, height: impl Fn(f64, f64) -> f64) -> HeightMap {
    let at = |i: usize| from_m + i as f64 * cell_m;
    let rows = (0..n).rev();
    let values: Vec<f64> = rows
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .map(|(i, j)| height(at(i), at(j)))
        .collect();
    HeightMap::new(&values, n, cell_m, [from_m, from_m]).unwrap()
}

/// As in a picture: the first row is the farthest to the left of the robot.
#[test]
fn the_first_row_is_the_one_with_the_largest_y() {
    let map = HeightMap::new(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3, 2.0, [10.0, 20.0]).unwrap();
    assert_eq!(map.height_m(10.0, 22.0), Some(1.0));
    assert_eq!(map.height_m(14.0, 22.0), Some(3.0));
    assert_eq!(map.height_m(10.0, 20.0), Some(4.0));
    assert_eq!(map.extent_m(), [[10.0, 14.0], [20.0, 22.0]]);
    // Beyond: the edge.
    assert_eq!(map.height_m(-50.0, 500.0), Some(1.0));
    assert_eq!(map.height_m(1e6, 0.0), Some(6.0));
    let near = map.to_point(&Vector3::new(1e6, 0.0, 7.0));
    assert_eq!((near.distance_m, near.normal), (1.0, Vector3::z()));
}

#[test]
fn a_plane_is_met_exactly() {
    let plane = Plane::sloping(0.3, 0.7);
    let map = sampled(21, 0.1, -1.0, |x, y| plane.height_m(x, y).unwrap());
    for (x, y) in [(0.013, 0.2), (-0.77, 0.31), (0.5, -0.5)] {
        let at = Vector3::new(x, y, 0.4);
        let (a, b) = (map.to_point(&at), plane.to_point(&at));
        assert!((a.distance_m - b.distance_m).abs() < 1e-12);
        assert!((a.normal - b.normal).norm() < 1e-12);
        let disc = Disc {
            centre_m: at,
            axis: Vector3::new(-0.2, 0.95, 0.1).normalize(),
            radius_m: 0.15,
        };
        let disc = Disc {
            // Within a centimetre of it.
            centre_m: at - (plane.to_disc(&disc).unwrap().distance_m - 0.001) * plane.normal(),
            ..disc
        };
        let (a, b) = (map.to_disc(&disc).unwrap(), plane.to_disc(&disc).unwrap());
        assert!((a.distance_m - b.distance_m).abs() < 1e-12, "{a:?} {b:?}");
        assert!((a.point_m - b.point_m).norm() < 1e-7, "{a:?} {b:?}");
    }
}

/// Halving the cells quarters the error, or better.
#[test]
fn a_rock_from_samples_converges_to_the_rock() {
    let rock = Ellipsoid::new(Vector3::new(0.0, 0.0, -1.0), Vector3::repeat(1.2), 0.0);
    let height = |x: f64, y: f64| rock.height_m(x, y).unwrap();
    let error = |n: usize| {
        let map = sampled(n + 1, 0.8 / n as f64, -0.4, height);
        let mut worst = [0.0_f64; 3];
        for k in 0..40 {
            let (x, y) = (0.007 * f64::from(k) - 0.14, 0.1 - 0.004 * f64::from(k));
            let up = Vector3::new(x, y, height(x, y)) - rock.centre_m();
            let touching = rock.centre_m() + up * (1.0 - 1e-4 / up.norm());
            let (a, b) = (map.to_point(&touching), rock.to_point(&touching));
            worst[0] = worst[0].max((a.distance_m - b.distance_m).abs());
            worst[1] = worst[1].max((a.normal - b.normal).norm());
            let disc = Disc {
                centre_m: rock.centre_m() + up * (1.0 + 0.1499 / up.norm()),
                axis: up.cross(&Vector3::x()).normalize(),
                radius_m: 0.15,
            };
            let (a, b) = (map.to_disc(&disc).unwrap(), rock.to_disc(&disc).unwrap());
            worst[2] = worst[2].max((a.distance_m - b.distance_m).abs());
        }
        worst
    };
    let [coarse, middle, fine] = [error(8), error(16), error(32)];
    println!("distance, normal, disc: {coarse:?} {middle:?} {fine:?}");
    for i in 0..3 {
        // A sixteenth, with room for the positions of the samples. The depth of 0.1 mm itself is accurate to
        // second order.
        assert!(fine[i] < 0.1 * coarse[i] + 1e-7, "{i}: {coarse:?} {fine:?}");
        assert!(fine[i] < 1e-3);
    }
}

/// At the lines between cells nothing jumps.
#[test]
fn height_and_slope_are_continuous() {
    let map = sampled(12, 0.1, 0.0, |x, y| {
        0.03 * (9.0 * x).sin() * (7.0 * y).cos()
    });
    for i in 1..11 {
        for y in [0.13, 0.25, 0.8999] {
            let x = 0.1 * f64::from(i);
            let at = |x: f64, y: f64| map.to_point(&Vector3::new(x, y, 1.0));
            for (a, b) in [
                (at(x - 1e-9, y), at(x + 1e-9, y)),
                (at(y, x - 1e-9), at(y, x + 1e-9)),
            ] {
                assert!((a.distance_m - b.distance_m).abs() < 1e-8);
                assert!((a.normal - b.normal).norm() < 1e-6);
            }
        }
    }
}

#[test]
fn a_cliff_is_refused_with_row_and_column() {
    let mut values = vec![0.0; 12];
    values[6] = 4.0;
    let error = HeightMap::new(&values, 4, 1.0, [0.0; 2]).unwrap_err();
    let HeightMapError::Steep { row, column, .. } = error else {
        panic!("{error}");
    };
    assert_eq!((row, column), (1, 3), "{error}");
    values[6] = 3.7;
    assert!(HeightMap::new(&values, 4, 1.0, [0.0; 2]).is_ok());
    for (count, columns) in [(12, 12), (12, 5), (0, 0), (2, 1)] {
        let error = HeightMap::new(&vec![0.0; count], columns, 1.0, [0.0; 2]);
        assert!(
            matches!(error, Err(HeightMapError::Size { .. })),
            "{error:?}"
        );
    }
    values[6] = f64::NAN;
    assert!(HeightMap::new(&values, 4, 1.0, [0.0; 2]).is_err());
}

fn on(shape: Shape) -> PlantParams {
    let mut params = wheeleg_2003();
    params.terrain.parts = vec![Part {
        shape,
        material: Material::ROUGH,
    }];
    params
}

fn rolled(shape: Shape, seconds: u32) -> (Plant, BodyMotion) {
    let plant = Plant::new(&on(shape)).unwrap();
    let mut state = plant.initial_state(1).unwrap();
    let inputs = Inputs {
        bridge_duty: [0.35; 2],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    for _ in 0..1000 * seconds {
        plant.tick(&mut state, &inputs).unwrap();
    }
    (plant, state.core.motion)
}

/// The whole robot drives over a map of a plane as over the plane.
#[test]
fn a_robot_on_the_map_of_a_plane_goes_as_on_the_plane() {
    let plane = Plane::sloping(0.05, 0.3);
    let map = sampled(64, 0.1, -2.0, |x, y| plane.height_m(x, y).unwrap());
    let (_, on_plane) = rolled(Shape::Plane(plane), 2);
    let (_, on_map) = rolled(Shape::HeightMap(Arc::new(map)), 2);
    let (a, b) = (&on_plane.state, &on_map.state);
    assert!(a.position_m.x > 0.1, "{}", a.position_m);
    assert!((a.position_m - b.position_m).norm() < 1e-6, "{a:?} {b:?}");
    assert!(a.orientation.angle_to(&b.orientation) < 1e-6);
}

/// In a groove narrower than the wheel both of its walls carry, and nothing rattles.
#[test]
fn a_wheel_in_a_groove_stands_on_both_walls() {
    // Walls at 45 degrees, 60 mm deep, rounded at the top: across the heading, below the axle.
    let groove = |x: f64, _: f64| x.abs().min(0.06);
    let map = sampled(121, 0.01, -0.6, groove);
    let disc = |z: f64| Disc {
        centre_m: Vector3::new(0.0, 0.0, z),
        axis: Vector3::y(),
        radius_m: 0.15,
    };
    // It touches the rims of the groove at x = ±0.06.
    let z = 0.06 + (0.15_f64 * 0.15 - 0.06 * 0.06).sqrt();
    let near = map.to_disc(&disc(z)).unwrap();
    assert!(
        near.point_m.x.abs() > 0.04 && near.distance_m.abs() < 2e-3,
        "{near:?}"
    );
    // The robot with its wheels in it.
    let params = on(Shape::HeightMap(Arc::new(map)));
    let plant = Plant::new(&params).unwrap();
    let mut state = plant.initial_state(1).unwrap();
    for _ in 0..1000 {
        plant.tick(&mut state, &Inputs::default()).unwrap();
    }
    let outputs = plant.outputs(&state);
    assert!(
        outputs.position_m[0].abs() < 0.01,
        "{:?}",
        outputs.position_m
    );
    // The legs are held by trapped air and give way slowly.
    assert!(
        outputs.velocity_m_s.iter().all(|v| v.abs() < 5e-3),
        "{outputs:?}"
    );
    // Every disc of both wheels touches both walls, and they carry it.
    let contacts = &state.core.motion.contacts;
    for grips in contacts.wheels.iter().flatten() {
        assert_eq!(grips.iter().filter(|grip| grip.part != 0).count(), 2);
    }
    assert!(
        outputs
            .wheel_normal_n
            .iter()
            .all(|n| (90.0..130.0).contains(n))
    );
}

/// The heights of an elevation model are those above the sea.
#[test]
fn a_robot_stands_as_well_on_high_ground() {
    let standing = |height_m: f64| {
        let mut params = wheeleg_2003();
        let map = sampled(9, 0.5, -2.0, |x, _| height_m + 0.02 * x);
        params.terrain.parts = vec![Part {
            shape: Shape::HeightMap(Arc::new(map)),
            material: Material::ROUGH,
        }];
        let plant = Plant::new(&params).unwrap();
        let state = plant
            .initial_state(1)
            .unwrap_or_else(|e| panic!("{height_m} m: {e}"));
        let o = plant.outputs(&state);
        (o.position_m[2] - height_m, o.foot_normal_n)
    };
    let (low_m, low_n) = standing(0.0);
    for height_m in [
        999.7, 1000.0, 1024.0, 1500.0, 8848.0, -430.0, 9999.0, -9999.0,
    ] {
        let (above_m, feet_n) = standing(height_m);
        assert!(
            (above_m - low_m).abs() < 1e-9,
            "{height_m}: {above_m}, {low_m}"
        );
        for (foot, low) in feet_n.iter().zip(low_n) {
            assert!(
                (foot - low).abs() < 1e-3,
                "{height_m}: {feet_n:?}, {low_n:?}"
            );
        }
    }
}
