//! The contact law in isolation: unilateral, dissipative, sticking.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::contact::{ContactForce, ContactLaw, Touch};
use wheeleg_plant::terrain::Material;
use wheeleg_plant::testing::wheeleg_2003;

const H: f64 = 1e-4;

fn law() -> ContactLaw {
    wheeleg_2003().contacts.foot.law
}

/// On level ground, moving for `h` seconds.
fn touch(depth_m: f64, velocity_m_s: [f64; 3], h: f64) -> Touch {
    let velocity_m_s = Vector3::from(velocity_m_s);
    Touch {
        depth_m,
        normal: Vector3::z(),
        velocity_m_s,
        moved_m: h * velocity_m_s,
        material: Material::ROUGH,
    }
}

fn unstretched(touch: &Touch) -> ContactForce {
    law().force(&mut Vector3::zeros(), touch)
}

#[test]
fn it_never_pulls_and_stays_inside_the_friction_circle() {
    let p = law();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut slips = 0;
    for _ in 0..10_000 {
        let t = touch(
            rng.random_range(0.0..2e-3),
            std::array::from_fn(|_| rng.random_range(-0.5..0.5)),
            0.0,
        );
        let mut stretch = Vector3::new(
            rng.random_range(-1e-3..1e-3),
            rng.random_range(-1e-3..1e-3),
            0.0,
        );
        let force = p.force(&mut stretch, &t);
        let friction = force.force_n.xy().norm();
        assert!(force.normal_n >= 0.0 && force.force_n.z == force.normal_n);
        let most = p.mu_static * force.normal_n * (1.0 + 1e-12);
        assert!(friction <= most);
        assert!(p.bristle_stiffness_n_m * stretch.norm() <= most);
        slips += usize::from(force.slipping);
    }
    assert!(slips > 1000, "{slips}");
}

#[test]
fn of_two_frictions_the_smaller_holds() {
    let mut t = touch(1e-3, [0.5, 0.0, 0.0], 0.0);
    let rough = unstretched(&t);
    t.material = Material {
        mu_static: 0.1,
        mu_kinetic: 0.05,
        soil: None,
    };
    let icy = unstretched(&t);
    assert!((rough.force_n.x + 0.7 * rough.normal_n).abs() < 1e-9);
    assert!((icy.force_n.x + 0.05 * icy.normal_n).abs() < 1e-9);
}

#[test]
fn force_is_continuous_at_touch_down_and_lift_off() {
    let p = law();
    for speed in [-1.0, -0.1, 0.0, 0.1, 1.0] {
        for depth in [1e-6, 1e-9, 1e-12] {
            let force = unstretched(&touch(depth, [0.3, -0.2, speed], 0.0)).force_n;
            let bound = p.stiffness_n_m * depth * (1.0 + p.damping_s_m) * (1.0 + p.mu_static);
            assert!(force.iter().all(|v| v.abs() <= bound), "{force:?} {bound}");
        }
    }
}

#[test]
fn a_dropped_foot_bounces_lower_and_faster_drops_lose_a_larger_share() {
    let restitution = |speed: f64| {
        let (mut z, mut v, mass, h) = (0.0_f64, -speed, 5.0, 1e-6);
        for _ in 0..1_000_000 {
            let f = unstretched(&touch(-z, [0.0, 0.0, v], 0.0));
            v += h * f.normal_n / mass;
            z += h * v;
            if z > 0.0 {
                return v / speed;
            }
        }
        0.0
    };
    let (slow, fast) = (restitution(0.05), restitution(0.4));
    println!("restitution {slow} at 0.05 m/s, {fast} at 0.4 m/s");
    assert!(fast > 0.0 && fast < slow && slow < 1.0, "{slow} {fast}");
}

#[test]
fn any_motion_through_the_ground_loses_energy() {
    let p = law();
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    for _ in 0..20 {
        let w: [f64; 3] = std::array::from_fn(|_| rng.random_range(5.0..60.0));
        let a: [f64; 2] = std::array::from_fn(|_| rng.random_range(1e-5..5e-3));
        let mut stretch = Vector3::zeros();
        let (mut work, mut t) = (0.0, 0.0_f64);
        // From the air, through the ground, to the air: nothing stored at either end.
        let step = 1e-5;
        while t < std::f64::consts::TAU / w[2] {
            let z = 1e-4 + 6e-4 * ((w[2] * t).cos() - 1.0);
            let v = [
                a[0] * w[0] * (w[0] * t).cos(),
                a[1] * w[1] * (w[1] * t).cos(),
                -6e-4 * w[2] * (w[2] * t).sin(),
            ];
            if z < 0.0 {
                let force = p.force(&mut stretch, &touch(-z, v, step));
                work += force.force_n.dot(&Vector3::from(v)) * step;
            }
            t += step;
        }
        assert!(work < 0.0, "{work}");
    }
}

/// A block of 3 kg on a plane of this slope for `seconds`: places at their half and end, speed.
fn on_a_plane(slope_deg: f64, seconds: f64) -> (f64, f64, f64) {
    let p = law();
    let (sin, cos) = slope_deg.to_radians().sin_cos();
    let (mass, g) = (3.0, 9.81);
    let depth = mass * g * cos / p.stiffness_n_m;
    let steps = (seconds / H) as usize;
    // It starts where its bristle holds it, as far as that bears.
    let hold = (mass * g * sin).min(p.mu_static * mass * g * cos);
    let mut stretch = Vector3::new(hold / p.bristle_stiffness_n_m, 0.0, 0.0);
    let (mut x, mut v, mut half) = (0.0, 0.0, 0.0);
    for k in 0..steps {
        let force = p.force(&mut stretch, &touch(depth, [v, 0.0, 0.0], H));
        v += H * (g * sin + force.force_n.x / mass);
        x += H * v;
        if k == steps / 2 {
            half = x;
        }
    }
    (half, x, v)
}

/// atan 0.8 is 38.66 degrees.
#[test]
fn a_block_on_a_plane_sticks_at_38_degrees_and_slides_at_39_and_a_half() {
    let (_, drift, speed) = on_a_plane(38.0, 10.0);
    assert!(drift.abs() < 1e-6 && speed.abs() < 1e-9, "{drift} {speed}");
    let (half, end, speed) = on_a_plane(39.5, 10.0);
    let (sin, cos) = 39.5_f64.to_radians().sin_cos();
    let expected = 9.81 * (sin - law().mu_kinetic * cos);
    let acceleration = (end - 2.0 * half) / 25.0;
    assert!(
        (acceleration / expected - 1.0).abs() < 0.01 && speed > 1.0,
        "{acceleration} {expected}"
    );
}

#[test]
fn at_95_percent_of_the_limit_nothing_creeps_in_a_minute() {
    let angle = (0.95 * law().mu_static).atan().to_degrees();
    let (half, end, speed) = on_a_plane(angle, 60.0);
    assert!(
        end.abs() < 1e-6 && (end - half).abs() < 1e-12 && speed.abs() < 1e-12,
        "{half} {end} {speed}"
    );
}
