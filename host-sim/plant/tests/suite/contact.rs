//! A foot on the ground: unilateral, dissipative, sticking.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::contact::{ContactParams, ContactState, FlatGround, GroundPoint};
use wheeleg_plant::dynamics::FootKin;
use wheeleg_plant::testing::wheeleg_2003;

const H: f64 = 1e-4;

fn params() -> ContactParams {
    wheeleg_2003().contact
}

fn foot(position_m: [f64; 3], velocity_m_s: [f64; 3]) -> FootKin {
    FootKin {
        position_m,
        velocity_m_s,
        jacobian: [[0.0; 3]; 5],
        forward: [1.0, 0.0, 0.0],
        left: [0.0, 1.0, 0.0],
    }
}

#[test]
fn it_never_pulls_and_stays_inside_the_friction_circle() {
    let p = params();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let (mut touching, mut slips) = (0, 0);
    for _ in 0..10_000 {
        let f = foot(
            [0.0, 0.0, rng.random_range(-2e-3..1e-3)],
            std::array::from_fn(|_| rng.random_range(-0.5..0.5)),
        );
        let state = ContactState {
            bristle_m: std::array::from_fn(|_| rng.random_range(-1e-3..1e-3)),
        };
        let force = p.force(&state, &f, &FlatGround);
        let friction = force.force_n[0].hypot(force.force_n[1]);
        assert!(force.normal_n >= 0.0 && force.force_n[2] == force.normal_n);
        assert!(friction <= p.mu_static * force.normal_n * (1.0 + 1e-12));
        if f.position_m[2] >= 0.0 {
            assert_eq!(force.force_n, [0.0; 3]);
        } else {
            touching += 1;
        }
        slips += usize::from(force.slipping);
    }
    assert!(touching > 5000 && slips > 1000, "{touching} {slips}");
}

#[test]
fn force_is_continuous_at_touch_down_and_lift_off() {
    let p = params();
    for speed in [-1.0, -0.1, 0.0, 0.1, 1.0] {
        for depth in [1e-6, 1e-9, 1e-12] {
            let f = foot([0.0, 0.0, -depth], [0.3, -0.2, speed]);
            let force = p.force(&ContactState::default(), &f, &FlatGround).force_n;
            let bound = p.stiffness_n_m * depth * (1.0 + p.damping_s_m) * (1.0 + p.mu_static);
            assert!(force.iter().all(|v| v.abs() <= bound), "{force:?} {bound}");
        }
    }
}

#[test]
fn a_dropped_foot_bounces_lower_and_faster_drops_lose_a_larger_share() {
    let p = params();
    let restitution = |speed: f64| {
        let (mut z, mut v, mass, h) = (0.0, -speed, 5.0, 1e-6);
        for _ in 0..1_000_000 {
            let f = p.force(
                &ContactState::default(),
                &foot([0.0, 0.0, z], [0.0, 0.0, v]),
                &FlatGround,
            );
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
    let p = params();
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    for _ in 0..20 {
        let w: [f64; 3] = std::array::from_fn(|_| rng.random_range(5.0..60.0));
        let a: [f64; 2] = std::array::from_fn(|_| rng.random_range(1e-5..5e-3));
        let mut state = ContactState::default();
        let (mut work, mut h) = (0.0, 0.0_f64);
        // From the air, through the ground, to the air: nothing stored at either end.
        let step = 1e-5;
        let place = |t: f64| {
            let (x, y) = (a[0] * (w[0] * t).sin(), a[1] * (w[1] * t).sin());
            let z = 1e-4 + 6e-4 * ((w[2] * t).cos() - 1.0);
            let v = [
                a[0] * w[0] * (w[0] * t).cos(),
                a[1] * w[1] * (w[1] * t).cos(),
                -6e-4 * w[2] * (w[2] * t).sin(),
            ];
            foot([x, y, z], v)
        };
        let period = std::f64::consts::TAU / w[2];
        while h < period {
            let f = place(h);
            let force = p.force(&state, &f, &FlatGround).force_n;
            let power: f64 = force.iter().zip(f.velocity_m_s).map(|(f, v)| f * v).sum();
            work += power * step;
            p.advance(&mut state, &f, &FlatGround, step);
            h += step;
        }
        assert_eq!(state, ContactState::default());
        assert!(work < 0.0, "{work}");
    }
}

/// A mass on a plane under a steady pull, 10 s: (place at 5 s, place at 10 s, speed at the end).
fn pulled(share_of_limit: f64) -> (f64, f64, f64) {
    let p = params();
    let (mass, normal) = (3.0, 30.0);
    let depth = normal / p.stiffness_n_m;
    let pull = share_of_limit * p.mu_static * normal;
    let (mut x, mut v, mut state, mut half) = (0.0, 0.0, ContactState::default(), 0.0);
    for k in 0..100_000 {
        let f = foot([x, 0.0, -depth], [v, 0.0, 0.0]);
        let friction = p.force(&state, &f, &FlatGround).force_n[0];
        v += H * (pull + friction) / mass;
        x += H * v;
        p.advance(
            &mut state,
            &foot([x, 0.0, -depth], [v, 0.0, 0.0]),
            &FlatGround,
            H,
        );
        if k == 50_000 {
            half = x;
        }
    }
    (half, x, v)
}

#[test]
fn below_the_limit_a_foot_sticks_without_creep_above_it_slides() {
    let (half, end, speed) = pulled(0.7);
    println!("creep {:e} m, speed {speed:e} m/s", end - half);
    assert!(
        (end - half).abs() < 1e-9 && speed.abs() < 1e-9,
        "{half} {end} {speed}"
    );
    // Loaded gently enough that the swing stays below the limit, it moves by the bristle's stretch.
    let (_, end, _) = pulled(0.35);
    let p = params();
    let stretch = 0.35 * p.mu_static * 30.0 / p.bristle_stiffness_n_m;
    assert!((end / stretch - 1.0).abs() < 1e-6, "{end} {stretch}");
    let (half, end, speed) = pulled(1.1);
    assert!(speed > 1.0 && end > half + 1.0, "{half} {end} {speed}");
}

#[test]
fn on_a_slope_the_force_follows_the_normal() {
    let p = params();
    let angle = 20.0_f64.to_radians();
    let normal = [-angle.sin(), 0.0, angle.cos()];
    let ground = |x: f64, _y: f64| GroundPoint {
        height_m: x * angle.tan(),
        normal,
    };
    let f = foot([1.0, 0.0, angle.tan() - 1e-3 / angle.cos()], [0.0; 3]);
    let force = p.force(&ContactState::default(), &f, &ground);
    assert!((force.penetration_m - 1e-3).abs() < 1e-15);
    for (got, n) in force.force_n.iter().zip(normal) {
        assert!((got - n * p.stiffness_n_m * 1e-3).abs() < 1e-9);
    }
}
