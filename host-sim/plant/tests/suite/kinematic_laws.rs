//! Laws of the natural orthogonal complement over random states of leg and half robot. Positions
//! are written down here a second time, from the frames of `MODEL.md` section 1; velocities and
//! accelerations come from them by finite differences.

use nalgebra::{DMatrix, Matrix3, SVector, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::dynamics::noc::{HalfRobot, System};
use wheeleg_plant::dynamics::{HalfRobotParams, RobotDynamicsParams};

const STATES: usize = 1000;

type V4 = Vector4<f64>;

fn params(viscous_n_s_m: [f64; 4]) -> HalfRobotParams {
    HalfRobotParams {
        viscous_n_s_m,
        ..RobotDynamicsParams::wheeleg_2003().half()
    }
}

fn random<const N: usize>(rng: &mut Pcg64Mcg, lo: [f64; N], hi: [f64; N]) -> SVector<f64, N> {
    SVector::from_fn(|i, _| rng.random_range(lo[i]..hi[i]))
}

/// Strokes, ±0.5 m/s, ±10 m/s².
fn state(rng: &mut Pcg64Mcg) -> [V4; 3] {
    [
        random(rng, [-1.0, 0.31, 0.01, 0.01], [1.0, 0.49, 0.19, 0.19]),
        random(rng, [-0.5; 4], [0.5; 4]),
        random(rng, [-10.0; 4], [10.0; 4]),
    ]
}

/// A body: its origin, its link axes as columns, its mass centre.
struct Place {
    origin: Vector3<f64>,
    axes: Matrix3<f64>,
    com: Vector3<f64>,
}

/// Six leg bodies, chassis and wheel of [s, b2, b5, b6], ground axes with O4 at height 0 above the
/// origin for s = 0.
fn places(p: &HalfRobotParams, q: &V4) -> Vec<Place> {
    let (ell, [xt, yt]) = (p.crank_m, p.p4_m);
    let (k, ahead) = (Vector3::z(), Vector3::x() * q[0]);
    let reach = xt.hypot(yt);
    let arc = ((reach * reach + ell * ell - q[1] * q[1]) / (2.0 * ell * reach)).acos();
    let phi = yt.atan2(xt) - arc;
    let v = Vector3::new(phi.cos(), phi.sin(), 0.0);
    let (n, o4) = (k.cross(&v), ahead);
    let o1 = o4 - Vector3::new(xt, yt, 0.0);
    let o3 = o4 - v * ell;
    let u = (o3 - o1) / q[1];
    let w = k.cross(&u);
    let o6 = o4 + v * q[2];
    let turn = q[0] / p.wheel_radius_m;
    let rolling = Matrix3::new(
        turn.cos(),
        0.0,
        turn.sin(),
        0.0,
        1.0,
        0.0,
        -turn.sin(),
        0.0,
        turn.cos(),
    );
    let of = |origin, axes: Matrix3<f64>, com: Vector3<f64>| Place {
        origin,
        axes,
        com: origin + axes * com,
    };
    let frames = [
        (o1, [w, k, u]),
        (o3, [-w, u, k]),
        (o4, [v, n, k]),
        (o4, [n, k, v]),
        (o6, [n, v, -k]),
        (o6 - k * q[3], [n, v, -k]),
    ];
    let mut all: Vec<Place> = frames
        .into_iter()
        .zip(&p.leg_bodies)
        .map(|((o, axes), body)| of(o, Matrix3::from_columns(&axes), body.com_m.into()))
        .collect();
    all.push(of(ahead, Matrix3::identity(), Vector3::zeros()));
    all.push(of(ahead, rolling, Vector3::zeros()));
    all
}

/// Derivative at 0, sixth-order central differences.
fn derivative<T>(h: f64, f: impl Fn(f64) -> T) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let pair = |k: f64| f(k * h) - f(-k * h);
    (pair(1.0) * 45.0 - pair(2.0) * 9.0 + pair(3.0)) * (1.0 / (60.0 * h))
}

const STEP: f64 = 2e-3;

/// Angular velocity from the rate of the axes.
fn spin(axes: &Matrix3<f64>, rate: &Matrix3<f64>) -> Vector3<f64> {
    let w = rate * axes.transpose();
    Vector3::new(w.m32 - w.m23, w.m13 - w.m31, w.m21 - w.m12) * 0.5
}

/// T q̇ is the velocity and T q̈ + Ṫ q̇ the acceleration of every body, by differences of places.
#[test]
fn twists_and_their_rates_are_those_of_the_places() {
    let p = params([0.0; 4]);
    let robot = HalfRobot::new(&p).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(51);
    let (mut velocity, mut acceleration, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let [q, qd, qdd] = state(&mut rng);
        let system = robot.at(&q, &qd).unwrap();
        let path = |t: f64| q + qd * t + qdd * (0.5 * t * t);
        for (i, body) in system.bodies.iter().enumerate() {
            let twist_at = |t: f64| {
                let rate = derivative(STEP, |d| places(&p, &path(t + d)).swap_remove(i).com);
                let axes = |d: f64| places(&p, &path(t + d)).swap_remove(i).axes;
                let omega = spin(&axes(0.0), &derivative(STEP, axes));
                SVector::<f64, 6>::from_iterator(omega.iter().chain(rate.iter()).copied())
            };
            let twist = body.t * qd;
            velocity = velocity.max((twist_at(0.0) - twist).amax());
            let rate = body.t * qdd + body.t_dot * qd;
            acceleration = acceleration.max((derivative(STEP, twist_at) - rate).amax());
            largest = largest.max(rate.amax());
        }
    }
    println!("velocity {velocity:e}, acceleration {acceleration:e} of {largest}");
    assert!(largest > 10.0);
    assert!(
        velocity < 1e-9 && acceleration < 1e-6,
        "{velocity:e} {acceleration:e}"
    );
}

/// Rows of the constraint matrix K of K t = 0: motions that the joints forbid, from the places alone.
struct Constraints {
    rows: Vec<Vec<f64>>,
    columns: usize,
}

/// A body of the stack, or the ground.
#[derive(Clone, Copy)]
enum Side<'a> {
    Ground,
    Body(usize, &'a Place),
}

impl Constraints {
    fn add(
        &mut self,
        spin: Vector3<f64>,
        point: Option<(Vector3<f64>, Vector3<f64>)>,
        a: Side,
        b: Side,
    ) {
        let mut row = vec![0.0; self.columns];
        for (side, sign) in [(a, -1.0), (b, 1.0)] {
            let Side::Body(i, place) = side else { continue };
            // axis · (ċ + ω × (A − c)) = axis · ċ + ((A − c) × axis) · ω
            let (turn, slide) = match point {
                Some((at, axis)) => ((at - place.com).cross(&axis), axis),
                None => (spin, Vector3::zeros()),
            };
            for k in 0..3 {
                row[6 * i + k] += sign * turn[k];
                row[6 * i + 3 + k] += sign * slide[k];
            }
        }
        self.rows.push(row);
    }

    /// No relative spin about the axes, no relative velocity at the point along the others.
    fn joint(
        &mut self,
        a: Side,
        b: Side,
        at: Vector3<f64>,
        spins: &[Vector3<f64>],
        slides: &[Vector3<f64>],
    ) {
        for spin in spins {
            self.add(*spin, None, a, b);
        }
        for axis in slides {
            self.add(Vector3::zeros(), Some((at, *axis)), a, b);
        }
    }

    fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows.len(), self.columns, |r, c| self.rows[r][c])
    }
}

/// K of the leg on its chassis (36 columns), or with chassis and wheel (48 columns).
fn constraints(p: &HalfRobotParams, q: &V4, whole: bool) -> DMatrix<f64> {
    let places = places(p, q);
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let all = [x, y, z];
    let mut k = Constraints {
        rows: Vec::new(),
        columns: if whole { 48 } else { 36 },
    };
    let body = |i: usize| Side::Body(i, &places[i]);
    let base = if whole { body(6) } else { Side::Ground };
    let column = |i: usize, axis: usize| places[i].axes.column(axis).into_owned();
    let o4 = places[3].origin;
    // Yaw barrel on the chassis; rod in the barrel along u; crank on the rod, with the carriage;
    // carriage on the chassis: the loop. Then the horizontal and the vertical slide.
    k.joint(base, body(0), places[0].origin, &[x, y], &all);
    k.joint(body(0), body(1), places[1].com, &all, &[column(0, 0), z]);
    k.joint(body(1), body(2), places[1].origin, &[x, y], &all);
    k.joint(body(2), body(3), o4, &all, &all);
    k.joint(base, body(3), o4, &[x, y], &all);
    k.joint(body(3), body(4), places[4].com, &all, &[column(3, 0), z]);
    k.joint(
        body(4),
        body(5),
        places[5].com,
        &all,
        &[column(4, 0), column(4, 1)],
    );
    if whole {
        k.joint(Side::Ground, body(6), places[6].com, &all, &[y, z]);
        k.joint(body(6), body(7), places[7].com, &[x, z], &all);
        // Rolling: the wheel's point on the ground rests.
        let touch = places[7].com - z * p.wheel_radius_m;
        k.joint(Side::Ground, body(7), touch, &[], &[x]);
    }
    k.matrix()
}

fn stacked<const B: usize, const N: usize>(system: &System<B, N>) -> DMatrix<f64> {
    DMatrix::from_fn(6 * B, N, |r, c| system.bodies[r / 6].t[(r % 6, c)])
}

/// K T = 0, and T spans all that K leaves free: rank 33 for the leg (paper 7.2), 44 for the half
/// robot, so that T is an orthogonal complement and not merely inside it.
#[test]
fn t_is_the_orthogonal_complement_of_the_constraints() {
    let p = params([0.0; 4]);
    let robot = HalfRobot::new(&p).unwrap();
    let leg = wheeleg_plant::dynamics::noc::Leg::new(p.leg_parameters(), &p.leg_bodies, [0.0; 3]);
    let leg = leg.unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(52);
    let mut worst = 0.0_f64;
    for i in 0..STATES {
        let [q, qd, _] = state(&mut rng);
        let whole = stacked(&robot.at(&q, &qd).unwrap());
        let part: Vector3<f64> = q.fixed_rows::<3>(1).into();
        let part = stacked(&leg.at(&part, &qd.fixed_rows::<3>(1).into()).unwrap());
        for (t, with_chassis, rank) in [(&part, false, 33), (&whole, true, 44)] {
            let k = constraints(&p, &q, with_chassis);
            worst = worst.max((&k * t).amax());
            // The singular values are the slow part.
            if i % 50 == 0 {
                assert_eq!(k.rank(1e-9), rank);
                assert_eq!(t.rank(1e-9), t.ncols());
            }
        }
        // A body that goes its own way is noticed.
        let mut broken = part.clone();
        broken[(6 * (i % 6) + 3, 0)] += 1e-3;
        let k = constraints(&p, &q, false);
        assert!((k * broken).amax() > 1e-4);
    }
    println!("K T {worst:e}");
    assert!(worst < 1e-12, "{worst:e}");
}

/// Kinetic energy by bodies, and its rate = power of actuators, gravity, friction and contact, with
/// the foot's velocity from differences of its place.
#[test]
fn power_is_balanced_with_contact_on_any_slope() {
    let p = params([4.0, 20.0, 15.0, 15.0]);
    let robot = HalfRobot::new(&p).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(53);
    let (mut worst, mut energy, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let [q, qd, _] = state(&mut rng);
        let tau = random(&mut rng, [-30.0; 4], [30.0; 4]);
        let gravity = random(&mut rng, [-10.0; 3], [10.0; 3]);
        let contact = random(&mut rng, [-40.0; 3], [40.0; 3]);
        let system = robot.at(&q, &qd).unwrap();
        let qdd = system.forward(&tau, &gravity, &contact).unwrap();
        let path = |t: f64| q + qd * t + qdd * (0.5 * t * t);
        let kinetic = |t: f64| {
            robot
                .at(&path(t), &(qd + qdd * t))
                .unwrap()
                .kinetic_energy_j()
        };
        let weight = |t: f64| -> f64 {
            let places = places(&p, &path(t));
            let leg = places.iter().zip(&p.leg_bodies);
            let leg: Vector3<f64> = leg.map(|(at, body)| at.com * body.mass_kg).sum();
            let rest = places[6].com * (p.chassis_mass_kg + p.wheel_mass_kg);
            gravity.dot(&(leg + rest))
        };
        let foot = derivative(STEP, |t| places(&p, &path(t)).swap_remove(5).origin);
        let friction: f64 = (0..4).map(|i| -p.viscous_n_s_m[i] * qd[i] * qd[i]).sum();
        let power = tau.dot(&qd) + contact.dot(&foot) + friction + derivative(STEP, weight);
        let rate = derivative(1e-4, kinetic);
        largest = largest.max(power.abs());
        worst = worst.max((power - rate).abs());

        let by_bodies: f64 = places(&p, &q)
            .iter()
            .enumerate()
            .map(|(i, place)| {
                let of = |t: f64| places(&p, &(q + qd * t)).swap_remove(i);
                let velocity = derivative(STEP, |t| of(t).com);
                let omega = spin(&place.axes, &derivative(STEP, |t| of(t).axes));
                let inner = place.axes.transpose() * omega;
                let axle = p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2 * p.gear_ratio.powi(2);
                let (mass, inertia) = match i {
                    0..6 => (p.leg_bodies[i].mass_kg, p.leg_bodies[i].inertia_kg_m2),
                    6 => (p.chassis_mass_kg, [0.0; 3]),
                    _ => (p.wheel_mass_kg, [0.0, axle, 0.0]),
                };
                let turning: f64 = (0..3).map(|a| inertia[a] * inner[a] * inner[a]).sum();
                0.5 * (mass * velocity.norm_squared() + turning)
            })
            .sum();
        energy = energy.max((by_bodies - system.kinetic_energy_j()).abs());
    }
    println!("power {worst:e} W of {largest} W, energy {energy:e} J");
    assert!(largest > 20.0);
    assert!(worst < 1e-6 && energy < 1e-10, "{worst:e} W, {energy:e} J");
}

/// One RK4 trajectory without drive and friction on a slope: change of the total energy (J).
fn drift_j(start: [V4; 2], step_s: f64, steps: usize) -> f64 {
    let p = params([0.0; 4]);
    let robot = HalfRobot::new(&p).unwrap();
    let slope = 20.0_f64.to_radians();
    let gravity = Vector3::new(-slope.sin(), 0.0, -slope.cos()) * 9.81;
    let none = V4::zeros();
    let rate = |q: &V4, v: &V4| {
        let system = robot.at(q, v).unwrap();
        system.forward(&none, &gravity, &Vector3::zeros()).unwrap()
    };
    let energy = |q: &V4, v: &V4| {
        let places = places(&p, q);
        let leg = places.iter().zip(&p.leg_bodies);
        let leg: Vector3<f64> = leg.map(|(at, body)| at.com * body.mass_kg).sum();
        let rest = places[6].com * (p.chassis_mass_kg + p.wheel_mass_kg);
        robot.at(q, v).unwrap().kinetic_energy_j() - gravity.dot(&(leg + rest))
    };
    let [mut q, mut v] = start;
    let before = energy(&q, &v);
    for _ in 0..steps {
        crate::rk4::step(&mut q, &mut v, step_s, rate);
    }
    energy(&q, &v) - before
}

/// 1000 starts on a slope of 20°, 20 ms each with two step sizes: the drift is the integrator's,
/// of fourth order or better, and vanishes with the step.
#[test]
fn energy_of_the_half_robot_is_kept_on_a_slope() {
    let mut rng = Pcg64Mcg::seed_from_u64(54);
    let (mut coarse, mut fine) = (0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let q = random(&mut rng, [-1.0, 0.34, 0.04, 0.04], [1.0, 0.46, 0.16, 0.16]);
        let v = random(&mut rng, [-0.5; 4], [0.5; 4]);
        coarse = coarse.max(drift_j([q, v], 5e-3, 4).abs());
        fine = fine.max(drift_j([q, v], 1e-3, 20).abs());
    }
    println!("drift {coarse:e} J, {fine:e} J");
    assert!(fine < 1e-10, "{fine:e}");
    // Five times smaller steps: 625 times less at fourth order.
    assert!(
        coarse > 100.0 * fine && coarse < 1e-6,
        "{coarse:e} {fine:e}"
    );
}
