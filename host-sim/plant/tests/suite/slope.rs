//! The robot at rest on planes: loads by moments.

use std::sync::Arc;

use nalgebra::Vector3;
use wheeleg_plant::terrain::{HeightMap, Material, Part, Plane, Shape, Solid};
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Plant, PlantError};

#[test]
fn static_loads_on_planes_are_those_of_moments() {
    let mut feet_at = Vec::new();
    for degrees in [0.0, 5.0, 10.0, 15.0, 20.0] {
        let mut params = wheeleg_2003();
        // Legs at mid stroke.
        params.initial_stroke_m = [0.09, 0.09, 0.18, 0.09, 0.09, 0.18];
        let slope = f64::to_radians(degrees);
        params.terrain.parts = vec![Part {
            shape: Shape::Plane(Plane::sloping(slope, 0.0)),
            material: Material::ROUGH,
        }];
        let plant = Plant::new(&params).unwrap();
        let state = plant.initial_state(1).unwrap();
        let scene = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
        let weight = params.body.total_mass_kg() * 9.81;
        let contacts = &scene.loads.contacts;
        let total: Vector3<f64> = contacts.all().iter().map(|w| w.force_n).sum();
        let error = total - Vector3::new(0.0, 0.0, weight);
        assert!(error.norm() < 1e-6 * weight, "{degrees}: {error}");
        // Along and across the slope, from the wheels' contact place.
        let (up, out) = (
            Vector3::new(slope.cos(), 0.0, slope.sin()),
            Vector3::new(-slope.sin(), 0.0, slope.cos()),
        );
        let o = plant.outputs(&state);
        let touch = Vector3::from(o.position_m) - params.body.wheel_radius_m * out;
        let com = scene.kin.com_m() - touch;
        let (ahead, high) = (com.dot(&up), com.dot(&out));
        let sole = &contacts.feet[0];
        let centre = Vector3::from(o.sole_m[0]) - touch;
        let lever = centre.dot(&up) - sole.moment_n_m.y / sole.force_n.dot(&out);
        let expected = weight * (ahead * slope.cos() - high * slope.sin()) / lever;
        let carried: f64 = o.foot_normal_n.iter().sum();
        println!("{degrees} degrees: feet {carried} N, by moments {expected} N");
        assert!(
            (carried - expected).abs() < 0.1,
            "{degrees}: {carried} {expected}"
        );
        feet_at.push(carried);
    }
    assert!((feet_at[0] - 31.5).abs() < 1.5, "{feet_at:?}");
    assert!((feet_at[4] - 5.6).abs() < 1.5, "{feet_at:?}");
}

fn on(degrees: f64, azimuth_deg: f64) -> wheeleg_plant::PlantParams {
    let mut params = wheeleg_2003();
    params.terrain.parts = vec![Part {
        shape: Shape::Plane(Plane::sloping(
            degrees.to_radians(),
            azimuth_deg.to_radians(),
        )),
        material: Material::ROUGH,
    }];
    params
}

/// Up, down and across: nothing pushes the chassis, and wheels and feet touch.
#[test]
fn the_start_is_an_equilibrium_whichever_way_the_slope_runs() {
    for azimuth in [0.0, 45.0, 90.0, 180.0, -135.0] {
        let params = on(15.0, azimuth);
        let plant = Plant::new(&params).unwrap();
        let state = plant.initial_state(1).unwrap();
        let scene = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
        let contacts = &scene.loads.contacts;
        let total: Vector3<f64> = contacts.all().iter().map(|w| w.force_n).sum();
        let weight = params.body.total_mass_kg() * 9.81;
        let error = total - Vector3::new(0.0, 0.0, weight);
        assert!(error.norm() < 1e-6, "{azimuth}: {error}");
        let o = plant.outputs(&state);
        // The chassis is parallel to the plane, within the give of contacts and legs.
        let slope = 15.0_f64.to_radians();
        let across = azimuth.to_radians();
        let up = state.core.motion.state.orientation * Vector3::z();
        let normal = Vector3::new(
            -slope.sin() * across.cos(),
            -slope.sin() * across.sin(),
            slope.cos(),
        );
        assert!(up.angle(&normal) < 0.02, "{azimuth}: {up} {normal}");
        assert!(o.wheel_normal_n.iter().all(|n| *n > 20.0), "{o:?}");
        assert_eq!(o.chassis_normal_n, 0.0);
    }
}

/// Tip-back is at 24.2 degrees with the legs drawn in; the plant's error says so.
#[test]
fn too_steep_a_start_is_refused() {
    let plant = Plant::new(&on(26.0, 0.0)).unwrap();
    let error = plant.initial_state(1).unwrap_err();
    assert_eq!(error, PlantError::NotStanding);
    assert!(error.to_string().contains("start place"), "{error}");
}

/// Bounds of the step: 3.2e6 N/m at a foot, whose lightest part is the vertical rod.
#[test]
fn a_contact_too_stiff_for_the_step_is_named() {
    let refused = |change: fn(&mut wheeleg_plant::PlantParams)| {
        let mut params = wheeleg_2003();
        change(&mut params);
        match Plant::new(&params).map(drop) {
            Err(wheeleg_plant::PlantError::Parameter { name, max, .. }) => Some((name, max)),
            other => {
                assert_eq!(other, Ok(()));
                None
            }
        }
    };
    let (name, max) = refused(|p| p.contacts.foot.law.stiffness_n_m = 5e6).unwrap();
    assert_eq!(name, "contact.stiffness_n_m");
    assert!((max / 3.2e6 - 1.0).abs() < 0.1, "{max}");
    assert!(refused(|p| p.contacts.foot.law.stiffness_n_m = 2.5e6).is_none());
    let (name, max) = refused(|p| p.contacts.wheel.law.bristle_stiffness_n_m = 5e7).unwrap();
    assert_eq!(name, "wheel_contact.bristle_stiffness_n_m");
    assert!(max > 1e7, "{max}");
    let (name, _) = refused(|p| p.contacts.foot.law.bristle_damping_n_s_m = 2e3).unwrap();
    assert_eq!(name, "contact.bristle_damping_n_s_m");
    // Half the step bears four times the stiffness.
    let finer = refused(|p| {
        p.step_ns = 50_000;
        p.contacts.foot.law.stiffness_n_m = 5e6;
    });
    assert!(finer.is_none());
}

/// A ramp that begins behind the robot: the level ground before it props the chassis up, and the
/// wheels hang in the air between. The same pose stands where the ramp is flatter.
#[test]
fn a_start_on_the_chassis_is_refused() {
    let on_ramp = |degrees: f64, begin_m: f64| {
        let cell_m = 0.05;
        let (columns, rows) = (61, 3);
        let height = |i: usize| {
            let x_m = cell_m * (i % columns) as f64 - 1.0;
            degrees.to_radians().tan() * (x_m - begin_m).max(0.0)
        };
        let heights: Vec<f64> = (0..columns * rows).map(height).collect();
        let map = HeightMap::new(&heights, columns, cell_m, [-1.0, -0.05]).unwrap();
        let mut params = wheeleg_2003();
        params.terrain.parts = vec![Part {
            shape: Shape::HeightMap(Arc::new(map)),
            material: Material::ROUGH,
        }];
        Plant::new(&params).unwrap().initial_state(1)
    };
    assert!(on_ramp(20.0, -0.15).is_ok());
    let error = on_ramp(30.0, -0.15).unwrap_err();
    let PlantError::OnChassis { chassis_n, feet_n } = error else {
        panic!("{error}");
    };
    // The two carry the weight, and more: they press against each other along the ramp.
    let weight_n = wheeleg_2003().body.total_mass_kg() * 9.81;
    let (least_n, most_n) = (weight_n, 1.3 * weight_n);
    let sum_n = chassis_n + feet_n;
    assert!((least_n..most_n).contains(&sum_n), "{sum_n} {weight_n}");
    // With nothing behind it the robot falls.
    assert_eq!(on_ramp(30.0, -0.6).unwrap_err(), PlantError::NotStanding);
}

/// A block between corners and edges of the chassis, which none of its contacts would feel.
#[test]
fn a_block_inside_the_chassis_is_refused() {
    let with_block = |top_m: f64| {
        let mut params = wheeleg_2003();
        params.terrain.parts.push(Part {
            shape: Shape::Solid(Solid::block([0.0; 2], [0.1; 2], 0.0, [0.0, top_m])),
            material: Material::ROUGH,
        });
        Plant::new(&params).unwrap().initial_state(1)
    };
    let belly_m = wheeleg_2003().contacts.chassis.from_m[2] + wheeleg_2003().body.wheel_radius_m;
    assert!(with_block(belly_m - 0.02).is_ok());
    let error = with_block(belly_m + 0.03).unwrap_err();
    let PlantError::InChassis { place_m, into_m } = error else {
        panic!("{error}");
    };
    assert!((into_m - 0.03).abs() < 5e-3, "{into_m}");
    assert!(place_m.iter().all(|m| m.abs() < 0.1), "{place_m:?}");
}
