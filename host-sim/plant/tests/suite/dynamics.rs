//! The fast engine against the half robot, and against energies summed over bodies whose
//! positions are written down here a second time.

use crate::eight::dynamics::{RobotDynamics, RobotSide};
use nalgebra::{Matrix3, SVector, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::dynamics::RobotDynamicsParams;
use wheeleg_plant::dynamics::noc::HalfRobot;

type V8 = SVector<f64, 8>;

const STATES: usize = 100;

fn params() -> RobotDynamicsParams {
    RobotDynamicsParams {
        viscous: [0.0; 8],
        ..RobotDynamicsParams::wheeleg_2003()
    }
}

fn random(rng: &mut Pcg64Mcg, lo: V8, hi: V8) -> V8 {
    SVector::from_fn(|i, _| rng.random_range(lo[i]..hi[i]))
}

fn random_position(rng: &mut Pcg64Mcg) -> V8 {
    let lo = [-1.0, -0.5, 0.31, 0.01, 0.01, 0.31, 0.01, 0.01];
    let hi = [1.0, 0.5, 0.49, 0.19, 0.19, 0.49, 0.19, 0.19];
    random(rng, lo.into(), hi.into())
}

fn random_rates(rng: &mut Pcg64Mcg, size: f64) -> V8 {
    random(rng, V8::from_element(-size), V8::from_element(size))
}

/// Derivative at 0, sixth-order central differences.
fn derivative<T>(h: f64, f: impl Fn(f64) -> T) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let pair = |k: f64| f(k * h) - f(-k * h);
    (pair(1.0) * 45.0 - pair(2.0) * 9.0 + pair(3.0)) * (1.0 / (60.0 * h))
}

/// A body in ground axes.
struct Body {
    mass: f64,
    inertia: Matrix3<f64>,
    com: Vector3<f64>,
    rotation: Matrix3<f64>,
    /// Turn about the left axis beyond the rotation (rad).
    turn: f64,
}

/// All bodies of the robot at a position, wheels and rotors included, by trigonometry.
fn bodies(p: &RobotDynamicsParams, q: &V8) -> Vec<Body> {
    let (sin, cos) = q[1].sin_cos();
    // Columns: chassis axes in ground axes, nose up.
    let tilt = Matrix3::new(cos, 0.0, -sin, 0.0, 1.0, 0.0, sin, 0.0, cos);
    let axle = Vector3::new(q[0], 0.0, p.wheel_radius_m);
    let [cx, cz] = p.chassis_com_m;
    let pitch_inertia = |j: f64| Matrix3::from_diagonal(&Vector3::new(0.0, j, 0.0));
    let mut all = vec![Body {
        mass: p.chassis_mass_kg,
        inertia: pitch_inertia(p.chassis_pitch_inertia_kg_m2),
        com: axle + tilt * Vector3::new(cx, 0.0, cz),
        rotation: tilt,
        turn: 0.0,
    }];
    // Turns about the left axis: wheel s/r_w; rotor geared to the wheel's angle in the chassis,
    // and carried round by it (nose up is a negative turn).
    let wheel = q[0] / p.wheel_radius_m;
    let rotor = p.gear_ratio * (wheel + q[1]) - q[1];
    for _ in 0..2 {
        all.push(Body {
            mass: p.wheel_mass_kg,
            inertia: pitch_inertia(p.wheel_inertia_kg_m2),
            com: axle,
            rotation: Matrix3::identity(),
            turn: wheel,
        });
        all.push(Body {
            mass: 0.0,
            inertia: pitch_inertia(p.rotor_inertia_kg_m2),
            com: axle,
            rotation: Matrix3::identity(),
            turn: rotor,
        });
    }
    for leg in 0..2 {
        let mirror =
            Matrix3::from_diagonal(&Vector3::new(1.0, if leg == 0 { 1.0 } else { -1.0 }, 1.0));
        let [b2, b5, b6] = [q[2 + 3 * leg], q[3 + 3 * leg], q[4 + 3 * leg]];
        let (ell, [xt, yt]) = (p.crank_m, p.p4_m);
        let reach = xt.hypot(yt);
        let arc = ((reach * reach + ell * ell - b2 * b2) / (2.0 * ell * reach)).acos();
        let phi = yt.atan2(xt) - arc;
        let (v, k) = (Vector3::new(phi.cos(), phi.sin(), 0.0), Vector3::z());
        let n = k.cross(&v);
        let o4 = Vector3::from(p.o4_m);
        let o1 = o4 - Vector3::new(xt, yt, 0.0);
        let o3 = o4 - v * ell;
        let u = (o3 - o1) / b2;
        let w = k.cross(&u);
        let o6 = o4 + v * b5;
        let frames = [
            (o1, [w, k, u]),
            (o3, [-w, u, k]),
            (o4, [v, n, k]),
            (o4, [n, k, v]),
            (o6, [n, v, -k]),
            (o6 - k * b6, [n, v, -k]),
        ];
        for (body, (origin, axes)) in p.leg_bodies.iter().zip(frames) {
            let rotation = Matrix3::from_columns(&axes);
            let com = origin + rotation * Vector3::from(body.com_m);
            all.push(Body {
                mass: body.mass_kg,
                inertia: Matrix3::from_diagonal(&body.inertia_kg_m2.into()),
                com: axle + tilt * mirror * com,
                rotation: tilt * mirror * rotation,
                turn: 0.0,
            });
        }
    }
    all
}

/// Kinetic energy (J), velocities by finite differences of the positions.
fn kinetic_j(p: &RobotDynamicsParams, q: &V8, qd: &V8) -> f64 {
    let h = 1e-3;
    let samples = [1.0, 2.0, 3.0].map(|k| [k, -k].map(|k| bodies(p, &(q + qd * (k * h)))));
    let here = bodies(p, q);
    let mut energy = 0.0;
    for (i, body) in here.iter().enumerate() {
        let weights = [45.0, -9.0, 1.0].map(|w| w / (60.0 * h));
        let mut velocity = Vector3::zeros();
        let mut rotation = Matrix3::zeros();
        let mut turn = 0.0;
        for (pair, weight) in samples.iter().zip(weights) {
            velocity += (pair[0][i].com - pair[1][i].com) * weight;
            turn += (pair[0][i].turn - pair[1][i].turn) * weight;
            rotation += (pair[0][i].rotation - pair[1][i].rotation) * weight;
        }
        // Mirrored frames included: Rᵀ Ṙ is the turn in body axes up to the mirror's sign.
        let spin = body.rotation.transpose() * rotation;
        let omega = Vector3::new(spin[(2, 1)], spin[(0, 2)] + turn, spin[(1, 0)]);
        energy +=
            0.5 * body.mass * velocity.norm_squared() + 0.5 * omega.dot(&(body.inertia * omega));
    }
    energy
}

fn potential_j(p: &RobotDynamicsParams, q: &V8) -> f64 {
    let g = Vector3::from(p.gravity_m_s2);
    bodies(p, q).iter().map(|b| -b.mass * g.dot(&b.com)).sum()
}

fn array(v: &V8) -> [f64; 8] {
    (*v).into()
}

#[test]
fn level_and_symmetric_it_is_twice_the_half_robot() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let mut p = RobotDynamicsParams::wheeleg_2003();
        p.viscous = [4.0, 3.0, 20.0, 15.0, 12.0, 20.0, 15.0, 12.0];
        // No sideways gravity: it would break the symmetry.
        p.gravity_m_s2 = [
            rng.random_range(-4.0..4.0),
            0.0,
            rng.random_range(-10.0..-8.0),
        ];
        let (fast, half) = (
            RobotDynamics::new(&p).unwrap(),
            HalfRobot::new(&p.half()).unwrap(),
        );
        let pose = random_position(&mut rng);
        let (rates, acc) = (random_rates(&mut rng, 0.5), random_rates(&mut rng, 10.0));
        let both = |v: &V8| [v[0], 0.0, v[2], v[3], v[4], v[2], v[3], v[4]];
        let one = |v: &V8| Vector4::new(v[0], v[2], v[3], v[4]);
        let contact: [f64; 3] = std::array::from_fn(|_| rng.random_range(-40.0..40.0));
        let kin = fast.prepare(&both(&pose), &both(&rates)).unwrap();
        let mut feet = [0.0; 8];
        kin.add_foot_force(RobotSide::Left, &contact, &mut feet);
        kin.add_foot_force(
            RobotSide::Right,
            &[contact[0], -contact[1], contact[2]],
            &mut feet,
        );
        let whole = V8::from(kin.inverse(&both(&acc))) - V8::from(feet);
        let gravity = p.gravity_m_s2.into();
        let expected = half
            .at(&one(&pose), &one(&rates))
            .unwrap()
            .inverse(&one(&acc), &gravity, &contact.into())
            .unwrap();
        worst = worst.max((whole[0] - 2.0 * expected[0]).abs());
        for leg in [2, 5] {
            for k in 0..3 {
                worst = worst.max((whole[leg + k] - expected[1 + k]).abs());
            }
        }
    }
    println!("worst {worst:e} N");
    assert!(worst < 1e-10, "{worst:e}");
}

#[test]
fn kinetic_and_potential_energy_are_the_sums_over_bodies() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let mut p = params();
    p.gravity_m_s2 = [-3.0, 0.7, -9.0];
    let fast = RobotDynamics::new(&p).unwrap();
    let (mut worst_t, mut worst_v) = (0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let (q, qd) = (random_position(&mut rng), random_rates(&mut rng, 0.8));
        let kin = fast.prepare(&array(&q), &array(&qd)).unwrap();
        let (t, v) = (kinetic_j(&p, &q, &qd), potential_j(&p, &q));
        worst_t = worst_t.max((kin.kinetic_energy_j(&array(&qd)) / t - 1.0).abs());
        worst_v = worst_v.max((fast.potential_energy_j(&kin) - v).abs());
        let m = nalgebra::SMatrix::<f64, 8, 8>::from_fn(|r, c| kin.mass_matrix()[r][c]);
        assert_eq!(m, m.transpose());
        assert!(m.cholesky().is_some(), "{m}");
        let force = random_rates(&mut rng, 100.0);
        let a = kin.solve(&array(&force)).unwrap();
        let back = V8::from(kin.inverse(&a));
        assert!((back - force).amax() < 1e-9, "{back} {force}");
    }
    println!("worst T {worst_t:e} relative, V {worst_v:e} J");
    assert!(worst_t < 1e-9 && worst_v < 1e-11, "{worst_t:e} {worst_v:e}");
}

#[test]
fn forces_are_those_of_the_numeric_lagrangian() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut p = params();
    p.gravity_m_s2 = [-3.0, 0.7, -9.0];
    let fast = RobotDynamics::new(&p).unwrap();
    let unit = |i: usize| V8::from_fn(|k, _| if k == i { 1.0 } else { 0.0 });
    let mut worst = 0.0_f64;
    for _ in 0..STATES {
        let (q, qd) = (random_position(&mut rng), random_rates(&mut rng, 0.8));
        let qdd = random_rates(&mut rng, 5.0);
        let kin = fast.prepare(&array(&q), &array(&qd)).unwrap();
        let got = V8::from(kin.inverse(&array(&qdd)));
        let expected = V8::from_fn(|i, _| {
            // ∂T/∂q̇_i is exact from two energies, T being quadratic in the rates.
            let momentum = |t: f64| {
                let (q, qd) = (q + qd * t + qdd * (0.5 * t * t), qd + qdd * t);
                0.5 * (kinetic_j(&p, &q, &(qd + unit(i))) - kinetic_j(&p, &q, &(qd - unit(i))))
            };
            let lagrangian = |x: f64| {
                let q = q + unit(i) * x;
                kinetic_j(&p, &q, &qd) - potential_j(&p, &q)
            };
            derivative(4e-3, momentum) - derivative(2e-3, lagrangian)
        });
        worst = worst.max((got - expected).amax() / got.amax());
    }
    println!("worst {worst:e} relative");
    assert!(worst < 1e-6, "{worst:e}");
}

/// Energy gained (J) beyond the work of a constant wheel torque, in 0.4 s of RK4 steps.
fn energy_drift_j(torque: f64, steps: usize) -> f64 {
    let mut p = params();
    p.gravity_m_s2 = [-3.0, 0.7, -9.0];
    let fast = RobotDynamics::new(&p).unwrap();
    let mut force = [0.0; 8];
    fast.add_wheel_torque(torque, &mut force);
    let rate = |q: &V8, v: &V8| V8::from(fast.accelerations(&array(q), &array(v), &force).unwrap());
    let energy = |q: &V8, v: &V8| kinetic_j(&p, q, v) + potential_j(&p, q);
    let mut q = V8::from([0.0, 0.2, 0.36, 0.14, 0.05, 0.43, 0.06, 0.12]);
    let mut v = V8::from([0.5, 0.6, 0.2, -0.3, 0.2, -0.15, 0.4, -0.3]);
    let (start, angle) = (energy(&q, &v), fast.wheel_angle_rad(&array(&q)));
    let h = 0.4 / steps as f64;
    for _ in 0..steps {
        crate::rk4::step(&mut q, &mut v, h, rate);
    }
    let turned = fast.wheel_angle_rad(&array(&q)) - angle;
    assert!(turned.abs() > 0.1, "{turned}");
    (energy(&q, &v) - start - torque * turned).abs()
}

#[test]
fn energy_is_kept_and_a_wheel_torque_works_on_the_relative_angle() {
    for torque in [0.0, 3.0] {
        let drifts = [20, 40, 400].map(|steps| energy_drift_j(torque, steps));
        println!("torque {torque}: drift {drifts:?} J");
        assert!(
            drifts[0] < 1e-2 && drifts[0] > 8.0 * drifts[1],
            "{drifts:?}"
        );
        assert!(drifts[2] < 1e-8, "{drifts:?}");
    }
}

#[test]
fn mass_and_centre_of_mass_are_the_robots() {
    let p = params();
    assert!((p.total_mass_kg() - 25.0).abs() < 1e-12);
    let q = [0.0, 0.0, 0.40, 0.10, 0.19, 0.40, 0.10, 0.19];
    let fast = RobotDynamics::new(&p).unwrap();
    let [x, y, z] = fast.prepare(&q, &[0.0; 8]).unwrap().com_m();
    assert!((x - 0.090).abs() < 5e-4, "{x}");
    assert!(y.abs() < 1e-12, "{y}");
    assert!((z - 0.20).abs() < 2e-3, "{z}");
}

#[test]
fn foot_loads_at_rest_follow_from_moments_about_the_axle() {
    let p = params();
    let fast = RobotDynamics::new(&p).unwrap();
    let q = [0.0, 0.0, 0.40, 0.10, 0.19, 0.40, 0.10, 0.19];
    let kin = fast.prepare(&q, &[0.0; 8]).unwrap();
    // At rest both feet carry the same; the pitch row of the statics gives the load.
    let held = kin.inverse(&[0.0; 8]);
    let mut lift = [0.0; 8];
    for side in [RobotSide::Left, RobotSide::Right] {
        kin.add_foot_force(side, &[0.0, 0.0, 0.5], &mut lift);
    }
    let load = held[1] / lift[1];
    let weight = p.total_mass_kg() * 9.81;
    let x_foot = p.o4_m[0] + 0.10;
    assert!(
        (load - weight * kin.com_m()[0] / x_foot).abs() < 1e-10,
        "{load}"
    );
    assert!((kin.feet[0].position_m[0] - x_foot).abs() < 1e-12);
    // 31.5 N: weight × 0.090 / 0.70.
    assert!((load - 31.5).abs() < 0.2, "{load}");
}

#[test]
fn foot_jacobian_is_the_slope_of_its_position() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let fast = RobotDynamics::new(&params()).unwrap();
    let mut worst = 0.0_f64;
    for _ in 0..STATES {
        let (q, qd) = (random_position(&mut rng), random_rates(&mut rng, 0.8));
        let kin = fast.prepare(&array(&q), &array(&qd)).unwrap();
        for leg in 0..2 {
            let foot = |q: V8| {
                Vector3::from(fast.prepare(&array(&q), &[0.0; 8]).unwrap().feet[leg].position_m)
            };
            let columns = [0, 1, 2 + 3 * leg, 3 + 3 * leg, 4 + 3 * leg];
            for i in 0..8 {
                let step = V8::from_fn(|k, _| if k == i { 1.0 } else { 0.0 });
                let slope = derivative(1e-3, |x| foot(q + step * x));
                let expected = columns.iter().position(|c| *c == i);
                let column = expected.map_or([0.0; 3], |c| kin.feet[leg].jacobian[c]);
                worst = worst.max((slope - Vector3::from(column)).amax());
            }
            let speed = derivative(1e-3, |t| foot(q + qd * t));
            worst = worst.max((speed - Vector3::from(kin.feet[leg].velocity_m_s)).amax());
        }
    }
    println!("worst {worst:e}");
    assert!(worst < 1e-9, "{worst:e}");
}
