//! The robot at rest on planes: loads by moments.

use nalgebra::Vector3;
use wheeleg_plant::Plant;
use wheeleg_plant::terrain::{Material, Part, Plane, Shape};
use wheeleg_plant::testing::wheeleg_2003;

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
        // Along and across the slope, from the place where the wheels touch it.
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
