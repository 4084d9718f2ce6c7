//! Rocks: their closest places, their fields, and the index that finds them.

use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::Plant;
use wheeleg_plant::terrain::{
    Disc, Ellipsoid, Index, Material, Part, Plane, RockError, RockField, Shape, Surface,
};
use wheeleg_plant::testing::wheeleg_2003;

pub(super) fn vector(rng: &mut Pcg64Mcg, from: f64, to: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(from..to))
}

pub(super) fn rock(rng: &mut Pcg64Mcg) -> (Ellipsoid, [Vector3<f64>; 2], f64) {
    let (centre, radii) = (vector(rng, -1.0, 1.0), vector(rng, 0.03, 0.15));
    let heading = rng.random_range(-3.0..3.0);
    (
        Ellipsoid::new(centre, radii, heading),
        [centre, radii],
        heading,
    )
}

/// The closest place is on the ellipsoid, and the normal there is that of the gradient.
#[test]
fn the_closest_place_of_a_rock_is_the_foot_of_its_normal() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    for k in 0..20_000 {
        let (rock, [centre, radii], heading) = rock(&mut rng);
        // Far away, near, and up to half of the thinnest axis inside.
        let out = vector(&mut rng, -1.0, 1.0);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), heading);
        let direction = out.normalize();
        let on = radii.component_mul(&direction);
        let gradient = direction.component_div(&radii).normalize();
        let far = match k % 3 {
            0 => rng.random_range(0.0..1.0),
            1 => rng.random_range(-1e-3..1e-3),
            // Within the smallest radius of curvature: the foot of the normal stays the closest.
            _ => {
                let curved = radii.min() * radii.min() / radii.max();
                -rng.random_range(0.0..0.9) * curved
            }
        };
        let point = centre + turn * (on + far * gradient);
        let near = rock.to_point(&point);
        assert!((near.distance_m - far).abs() < 1e-9, "{near:?} {far}");
        let normal = turn * gradient;
        assert!((near.normal - normal).norm() < 1e-7, "{near:?} {normal}");
    }
}

/// Against a fine walk over the disc, rim and side.
#[test]
fn a_disc_is_as_near_to_a_rock_as_its_nearest_point() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let (mut rims, mut sides, mut clear, mut apart) = (0, 0, 0, 0);
    for _ in 0..1500 {
        let (rock, [centre, _], _) = rock(&mut rng);
        let axis = vector(&mut rng, -1.0, 1.0).normalize();
        let disc = Disc {
            centre_m: centre + vector(&mut rng, -0.3, 0.3),
            axis,
            radius_m: 0.15,
        };
        let near = rock.to_disc(&disc).unwrap();
        if rock.is_clear_of_wheel(&disc, 0.0) {
            assert!(near.distance_m > 0.0, "{near:?} {rock:?} {disc:?}");
            clear += 1;
        }
        let u = axis.cross(&Vector3::new(0.3, 0.5, 0.81)).normalize();
        let w = axis.cross(&u);
        let mut least = f64::INFINITY;
        for ring in 0..=30 {
            let r = 0.15 * f64::from(ring) / 30.0;
            for k in 0..240 {
                let (s, c) = (f64::from(k) * std::f64::consts::TAU / 240.0).sin_cos();
                let point = disc.centre_m + r * (c * u + s * w);
                least = least.min(rock.to_point(&point).distance_m);
            }
        }
        apart += u32::from(least > 0.0);
        // Deeper than any contact: the nearest way out may be another.
        if least < -2e-3 {
            continue;
        }
        // The walk is never nearer, and misses by its mesh error.
        assert!(near.distance_m <= least + 1e-9, "{near:?} {least}");
        assert!(near.distance_m > least - 2e-3, "{near:?} {least}");
        // The point is of the disc, and the rock is there.
        let arm = near.point_m - disc.centre_m;
        assert!(arm.dot(&axis).abs() < 1e-9 && arm.norm() < 0.15 + 1e-9);
        let there = rock.to_point(&near.point_m);
        assert!(
            (there.distance_m - near.distance_m).abs() < 1e-9,
            "{near:?} {there:?} {rock:?} {disc:?}"
        );
        assert!(
            (there.normal - near.normal).norm() < 1e-6,
            "{near:?} {there:?}"
        );
        if arm.norm() > 0.15 - 1e-9 {
            rims += 1;
        } else {
            sides += 1;
        }
    }
    assert!(rims > 500 && sides > 100, "{rims} {sides}");
    // Most pairs that are apart are recognized without the search.
    assert!(2 * clear > apart, "{clear} {apart}");
}

/// A sphere of the same radius as a wheel: sin gamma as on an edge of its height.
#[test]
fn on_a_sphere_the_normal_points_from_its_centre_to_the_axle() {
    let sphere = Ellipsoid::new(Vector3::new(0.3, 0.0, -0.05), Vector3::repeat(0.15), 0.4);
    for (x, z) in [(0.05, 0.11), (0.3, 0.2), (0.5, 0.15)] {
        let disc = Disc {
            centre_m: Vector3::new(x, 0.0, z),
            axis: Vector3::y(),
            radius_m: 0.15,
        };
        let away = disc.centre_m - Vector3::new(0.3, 0.0, -0.05);
        let near = sphere.to_disc(&disc).unwrap();
        assert!(
            (near.distance_m - (away.norm() - 0.3)).abs() < 1e-12,
            "{near:?}"
        );
        assert!((near.normal - away.normalize()).norm() < 1e-12, "{near:?}");
    }
}

fn field() -> RockField {
    RockField {
        x_m: [1.0, 9.0],
        y_m: [-2.0, 2.0],
        seed: 7,
        cover: 0.25,
        size_m: [0.10, 0.30],
        exposed: 1.0 / 3.0,
        aspect: 1.0,
    }
}

#[test]
fn a_field_covers_its_share_with_rocks_of_its_sizes_that_do_not_overlap() {
    let field = field();
    let rocks = field.scatter(|x, _| 0.1 * x).unwrap();
    // The visible part of a sphere that shows a third of its height has 8/9 of its area.
    let seen: f64 = rocks
        .iter()
        .map(|r| std::f64::consts::PI * r.radii_m().x.powi(2) * 8.0 / 9.0)
        .sum();
    assert!((seen / 32.0 - 0.25).abs() < 0.003, "{seen}");
    for (i, a) in rocks.iter().enumerate() {
        let (c, r) = (a.centre_m(), a.radii_m());
        assert!((0.05..=0.15).contains(&r.x) && r.x == r.y && r.x == r.z);
        assert!((1.0..9.0).contains(&c.x) && (-2.0..2.0).contains(&c.y));
        let above = a.top_m() - 0.1 * c.x;
        assert!((above - 2.0 * r.z / 3.0).abs() < 1e-12, "{above}");
        for b in &rocks[i + 1..] {
            let apart = (c - b.centre_m()).xy().norm();
            let seen = (8.0_f64 / 9.0).sqrt() * (r.x + b.radii_m().x);
            assert!(apart >= seen - 1e-12);
        }
    }
    assert_eq!(rocks, field.scatter(|x, _| 0.1 * x).unwrap());
    let other = RockField { seed: 8, ..field };
    assert_ne!(rocks, other.scatter(|x, _| 0.1 * x).unwrap());
}

#[test]
fn flat_rocks_are_as_flat_as_their_aspect() {
    let field = RockField {
        aspect: 0.4,
        ..field()
    };
    let rocks = field.scatter(|_, _| 0.0).unwrap();
    let ratios = |axis: usize| rocks.iter().map(move |r| r.radii_m()[axis] / r.radii_m().x);
    for axis in [1, 2] {
        let least = ratios(axis).fold(f64::INFINITY, f64::min);
        let most = ratios(axis).fold(0.0, f64::max);
        assert!(
            (0.4..0.5).contains(&least) && most > 0.9 && most <= 1.0,
            "{least} {most}"
        );
    }
}

#[test]
fn a_field_that_cannot_be_is_refused() {
    let full = RockField {
        cover: 0.9,
        ..field()
    };
    let error = full.scatter(|_, _| 0.0).unwrap_err();
    assert!(matches!(error, RockError::NoRoom { placed, wanted } if placed < wanted));
    let many = RockField {
        size_m: [0.01, 0.01],
        x_m: [0.0, 100.0],
        y_m: [0.0, 100.0],
        ..field()
    };
    assert_eq!(many.scatter(|_, _| 0.0), Err(RockError::TooMany));
}

/// Parts of very different sizes: near ones are found on any grid.
#[test]
fn the_index_misses_nothing_and_gives_nothing_twice() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let part = |shape| Part {
        shape,
        material: Material::ROUGH,
    };
    let mut parts = vec![part(Shape::Plane(Plane::level(0.0)))];
    for k in 0..600 {
        let size = if k % 100 == 0 { 3.0 } else { 0.1 };
        let radii = vector(&mut rng, 0.2 * size, size);
        let centre = vector(&mut rng, -10.0, 10.0);
        parts.push(part(Shape::Ellipsoid(Ellipsoid::new(centre, radii, 0.0))));
    }
    let index = Index::new(&parts);
    let mut found = 0;
    for _ in 0..5000 {
        let (at, reach) = (vector(&mut rng, -12.0, 12.0), rng.random_range(0.0..0.5));
        let mut given = Vec::new();
        index.near(&at, Vector3::repeat(reach), |number| given.push(number));
        let mut once = given.clone();
        once.sort_unstable();
        once.dedup();
        assert_eq!(once.len(), given.len());
        for (number, part) in (0..).zip(&parts) {
            if part.shape.to_point(&at).distance_m < reach {
                assert!(given.contains(&number), "{number}");
                found += 1;
            }
        }
    }
    assert!(found > 1000, "{found}");
}

/// Parts that are all very long and thin, along one axis or both, and a crowd with a few far away: each is
/// found at its place.
#[test]
fn long_thin_and_far_parts_are_found() {
    let part = |centre: [f64; 2], radii: [f64; 3]| {
        let centre = Vector3::new(centre[0], centre[1], 0.0);
        Part {
            shape: Shape::Ellipsoid(Ellipsoid::new(centre, Vector3::from(radii), 0.0)),
            material: Material::ROUGH,
        }
    };
    let along_y = |k: u32| part([0.1 * f64::from(k), 0.0], [0.002, 40.0, 0.01]);
    let along_x = |k: u32| part([0.0, 0.1 * f64::from(k)], [40.0, 0.002, 0.01]);
    let small = |k: u32| {
        let place = [0.1 * f64::from(k % 20), 0.1 * f64::from(k / 20)];
        part(place, [0.02, 0.02, 0.01])
    };
    let far = [900.0, -900.0].map(|far| part([far, far], [0.02, 0.02, 0.01]));
    let grounds: [Vec<Part>; 4] = [
        (0..50).map(along_y).collect(),
        (0..50).map(along_x).collect(),
        (0..50).flat_map(|k| [along_x(k), along_y(k)]).collect(),
        (0..400).map(small).chain(far).collect(),
    ];
    for (number, parts) in grounds.iter().enumerate() {
        let index = Index::new(parts);
        let mut found = 0;
        for k in 0..400 {
            let at = Vector3::new(0.0137 * f64::from(k % 100), 0.0071 * f64::from(k), 0.02);
            let (mut given, mut above) = (Vec::new(), Vec::new());
            index.near(&at, Vector3::repeat(0.1), |part| given.push(part));
            index.above([at.x, at.y], |part| above.push(part));
            for (place, part) in (0..).zip(parts) {
                let times = given.iter().filter(|other| **other == place).count();
                if part.shape.to_point(&at).distance_m < 0.1 {
                    assert_eq!(times, 1, "ground {number}, part {place} at {at}");
                    found += 1;
                }
                assert!(times < 2, "ground {number}, part {place} at {at}");
                if part.shape.height_m(at.x, at.y).is_some() {
                    assert!(above.contains(&place), "ground {number}, {place} at {at}");
                }
            }
        }
        assert!(found > 100, "ground {number}: {found}");
    }
}

/// A search that narrows as it goes gives the same least distance from fewer parts.
#[test]
fn a_search_that_narrows_finds_the_nearest_part() {
    let mut rng = Pcg64Mcg::seed_from_u64(6);
    let rocks = field().scatter(|_, _| 0.0).unwrap();
    let part = |rock| Part {
        shape: Shape::Ellipsoid(rock),
        material: Material::ROUGH,
    };
    let parts: Vec<Part> = rocks.into_iter().map(part).collect();
    let index = Index::new(&parts);
    let (mut asked, mut all) = (0, 0);
    for _ in 0..5000 {
        let at = Vector3::new(
            rng.random_range(0.0..10.0),
            rng.random_range(-3.0..3.0),
            rng.random_range(-0.1..0.2),
        );
        let far = |number: u32| parts[number as usize].shape.to_point(&at).distance_m;
        let mut least = 0.3_f64;
        index.near(&at, Vector3::repeat(0.3), |number| {
            least = least.min(far(number));
            all += 1;
        });
        let mut narrowed = 0.3_f64;
        index.nearest(&at, 0.3, |number| {
            narrowed = narrowed.min(far(number));
            asked += 1;
            narrowed + 1e-6
        });
        assert_eq!(least.to_bits(), narrowed.to_bits(), "{at}");
    }
    assert!(4 * asked < 3 * all, "{asked} of {all}");
}

/// The robot over a field: it stands, and stands on the same rocks with or without many others.
#[test]
fn a_robot_on_rocks_does_not_feel_rocks_far_away() {
    let mut params = wheeleg_2003();
    let near = RockField {
        x_m: [0.5, 1.5],
        y_m: [-0.5, 0.5],
        size_m: [0.10, 0.15],
        seed: 3,
        ..field()
    };
    let rocks = |field: &RockField| -> Vec<Part> {
        let rocks = field.scatter(|_, _| 0.0).unwrap();
        let part = |rock| Part {
            shape: Shape::Ellipsoid(rock),
            material: Material::ROUGH,
        };
        rocks.into_iter().map(part).collect()
    };
    params.terrain.parts.extend(rocks(&near));
    let state = |params: &wheeleg_plant::PlantParams| {
        let plant = Plant::new(params).unwrap();
        let mut state = plant.initial_state(1).unwrap();
        let inputs = wheeleg_plant::Inputs::default();
        (0..50).for_each(|_| plant.tick(&mut state, &inputs).unwrap());
        state.core.motion.state
    };
    let few = state(&params);
    let far = RockField {
        x_m: [10.0, 60.0],
        y_m: [-20.0, 20.0],
        ..field()
    };
    params.terrain.parts.extend(rocks(&far));
    assert!(params.terrain.parts.len() > 10_000);
    assert_eq!(few, state(&params));
}
