//! Closest places of the kinds of ground.

use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::terrain::{Disc, Plane, Solid, Surface};

fn upright(x: f64, z: f64) -> Disc {
    Disc {
        centre_m: Vector3::new(x, 0.0, z),
        axis: Vector3::y(),
        radius_m: 0.15,
    }
}

#[test]
fn a_plane_is_met_by_the_lowest_point_of_a_disc() {
    let slope = 20.0_f64.to_radians();
    let plane = Plane::sloping(slope, 0.0);
    let disc = upright(1.0, slope.tan() + 0.149 / slope.cos());
    let near = plane.to_disc(&disc).unwrap();
    assert!((near.distance_m + 0.001).abs() < 1e-15, "{near:?}");
    assert!((near.normal - Vector3::new(-slope.sin(), 0.0, slope.cos())).norm() < 1e-15);
    let lowest = disc.centre_m - 0.15 * near.normal;
    assert!((near.point_m - lowest).norm() < 1e-15);
    // Tilted about its heading: the rim still has one lowest point, nearer to the plane.
    let floor = Plane::level(0.0);
    let tilted = Disc {
        axis: Vector3::new(0.0, 0.1_f64.cos(), 0.1_f64.sin()),
        ..upright(0.0, 0.15)
    };
    let near = floor.to_disc(&tilted).unwrap();
    assert!((near.distance_m - 0.15 * (1.0 - 0.1_f64.cos())).abs() < 1e-15);
}

/// sin gamma = (r − h)/r for the normal at an edge of height h, the wheel on the floor before it.
#[test]
fn at_an_edge_the_normal_points_to_the_axle() {
    for h in [0.01, 0.03, 0.06, 0.1, 0.14] {
        let block = Solid::block([1.0, 0.0], [1.0, 1.0], 0.0, [-1.0, h]);
        let r: f64 = 0.15;
        // The rim touches the edge at x = 0.
        let x = -(r * r - (r - h) * (r - h)).sqrt();
        let near = block.to_disc(&upright(x, r)).unwrap();
        assert!(near.distance_m.abs() < 1e-12, "{h}: {near:?}");
        assert!((near.normal.z - (r - h) / r).abs() < 1e-9, "{h}: {near:?}");
        assert!(near.normal.x < 0.0 && near.normal.y.abs() < 1e-15);
        assert!((near.point_m - Vector3::new(0.0, 0.0, h)).norm() < 1e-12);
    }
}

#[test]
fn walls_push_and_tops_carry() {
    let block = Solid::block([1.0, 0.0], [0.5, 0.5], 0.0, [0.0, 0.3]);
    // Against the wall, axle below the top.
    let near = block.to_disc(&upright(0.5 - 0.149, 0.2)).unwrap();
    assert!((near.distance_m + 0.001).abs() < 1e-12);
    assert!((near.normal + Vector3::x()).norm() < 1e-12);
    // On the top.
    let near = block.to_disc(&upright(1.0, 0.3 + 0.148)).unwrap();
    assert!((near.distance_m + 0.002).abs() < 1e-12);
    assert!((near.normal - Vector3::z()).norm() < 1e-12);
    // Beside it: the disc's plane does not meet it.
    let beside = Disc {
        centre_m: Vector3::new(1.0, 0.7, 0.1),
        ..upright(0.0, 0.0)
    };
    assert!(block.to_disc(&beside).is_none());
}

#[test]
fn a_ramp_is_a_slope_between_its_ends() {
    let ramp = Solid::ramp([1.0, 0.0], [1.0, 0.5], 0.0, [0.0, 0.0], 0.4);
    let up = Vector3::new(-0.4, 0.0, 2.0).normalize();
    let near = ramp.to_point(&(Vector3::new(1.0, 0.0, 0.2) + 0.01 * up));
    assert!((near.distance_m - 0.01).abs() < 1e-12 && (near.normal - up).norm() < 1e-12);
    let disc = Disc {
        centre_m: Vector3::new(1.0, 0.0, 0.2) + 0.149 * up,
        ..upright(0.0, 0.0)
    };
    let near = ramp.to_disc(&disc).unwrap();
    assert!((near.distance_m + 0.001).abs() < 1e-12 && (near.normal - up).norm() < 1e-12);
}

/// The search over faces, edges and corners against the box's own coordinates.
#[test]
fn the_closest_place_of_a_block_is_that_of_a_clamped_point() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut seen = [0; 2];
    for _ in 0..5000 {
        let yaw = rng.random_range(-3.0..3.0);
        let half = Vector3::new(
            rng.random_range(0.05..0.5),
            rng.random_range(0.05..0.5),
            rng.random_range(0.02..0.2),
        );
        let middle = Vector3::new(
            rng.random_range(-1.0..1.0),
            rng.random_range(-1.0..1.0),
            half.z,
        );
        let block = Solid::block(
            [middle.x, middle.y],
            [half.x, half.y],
            yaw,
            [0.0, 2.0 * half.z],
        );
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        let local = Vector3::from_fn(|i, _| rng.random_range(-2.0..2.0) * half[i]);
        let near = block.to_point(&(middle + turn * local));
        let clamped = Vector3::from_fn(|i, _| local[i].clamp(-half[i], half[i]));
        let out = local - clamped;
        let inside = out.norm() == 0.0;
        let expected = if inside {
            (0..3)
                .map(|i| local[i].abs() - half[i])
                .fold(f64::NEG_INFINITY, f64::max)
        } else {
            out.norm()
        };
        seen[usize::from(inside)] += 1;
        assert!(
            (near.distance_m - expected).abs() < 1e-9,
            "{near:?} {expected}"
        );
        if !inside && expected > 1e-6 {
            let normal = turn * (out / expected);
            assert!((near.normal - normal).norm() < 1e-6, "{near:?} {normal:?}");
        }
    }
    assert!(seen.iter().all(|n| *n > 300), "{seen:?}");
}

/// Against a fine walk along the rim.
#[test]
fn a_disc_is_as_deep_in_a_block_as_its_rim() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut met = 0;
    for _ in 0..300 {
        let block = Solid::block(
            [0.3, 0.0],
            [0.3, 2.0],
            0.0,
            [0.0, rng.random_range(0.02..0.1)],
        );
        let heading: f64 = rng.random_range(-0.6..0.6);
        let roll: f64 = rng.random_range(-0.15..0.15);
        let axis = Vector3::new(
            -heading.sin() * roll.cos(),
            heading.cos() * roll.cos(),
            roll.sin(),
        );
        let disc = Disc {
            centre_m: Vector3::new(
                rng.random_range(-0.3..0.6),
                0.0,
                rng.random_range(0.12..0.26),
            ),
            axis,
            radius_m: 0.15,
        };
        let Some(near) = block.to_disc(&disc) else {
            continue;
        };
        let (mut least, mut deepest) = (f64::INFINITY, f64::INFINITY);
        let u = axis.cross(&Vector3::z()).normalize();
        let w = axis.cross(&u);
        for k in 0..20_000 {
            let (s, c) = (f64::from(k) * std::f64::consts::TAU / 20_000.0).sin_cos();
            let place = disc.centre_m + 0.15 * (c * u + s * w);
            let there = block.to_point(&place).distance_m;
            least = least.min(there);
            deepest = deepest.min((place - near.point_m).norm());
        }
        assert!(deepest < 1e-4, "the point is on the rim: {deepest}");
        if near.distance_m > 1e-4 && least > 1e-4 {
            // Apart: the search in the disc's plane is never nearer than space.
            assert!(near.distance_m > least - 1e-6, "{near:?} {least}");
        } else if near.distance_m < -1e-4 {
            met += 1;
            assert!(least < 0.0, "{near:?} {least}");
        }
    }
    assert!(met > 50, "{met}");
}
