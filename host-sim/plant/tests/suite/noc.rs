//! The natural orthogonal complement against the reference vectors, the golden state of
//! `MODEL.md` section 12, and laws over random states.

use std::f64::consts::PI;

use nalgebra::{SMatrix, SVector, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use wheeleg_plant::dynamics::noc::{HalfRobot, Leg, System, r2p, rpr};
use wheeleg_plant::dynamics::printed::tau_l_printed_58_64;
use wheeleg_plant::dynamics::{BodyParams, DynamicsError, HalfRobotParams, RobotDynamicsParams};

const TOLERANCE: f64 = 1e-10;
const STATES: usize = 1000;

fn vectors() -> Value {
    let text = include_str!("../../../../tests/vectors/model-7.json");
    let value: Value = serde_json::from_str(text).unwrap();
    assert_eq!(value["schema"], "wheeleg-reference-vectors/1");
    assert_eq!(value["cases"].as_array().unwrap().len(), 50);
    value
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn vector<const N: usize>(value: &Value) -> SVector<f64, N> {
    SVector::from_column_slice(&flat(value))
}

/// Largest error, refused above the tolerance. The vectors store matrices row by row.
fn close<const R: usize, const C: usize>(what: &str, got: &SMatrix<f64, R, C>, expected: &Value) {
    let expected = flat(expected);
    assert_eq!(expected.len(), R * C, "{what}");
    let error = (got - SMatrix::<f64, R, C>::from_row_slice(&expected)).amax();
    assert!(error <= TOLERANCE, "{what}: {error:e}\n{got}");
}

/// The vectors' parameters: those of the robot, with viscous friction on the cylinders and all of
/// the 4 N s/m on the half robot's travel.
fn params() -> HalfRobotParams {
    HalfRobotParams {
        viscous_n_s_m: [4.0, 20.0, 15.0, 15.0],
        ..RobotDynamicsParams::wheeleg_2003().half()
    }
}

fn leg_of(p: &HalfRobotParams) -> Leg {
    let [_, a, b, c] = p.viscous_n_s_m;
    Leg::new(p.leg_parameters(), &p.leg_bodies, [a, b, c]).unwrap()
}

fn leg() -> Leg {
    leg_of(&params())
}

fn half() -> HalfRobot {
    HalfRobot::new(&params()).unwrap()
}

fn chain_bodies() -> ([BodyParams; 3], [BodyParams; 3]) {
    let [a, b, c, d, e, f] = params().leg_bodies;
    ([a, b, c], [d, e, f])
}

fn stacked(blocks: [SMatrix<f64, 6, 3>; 3]) -> SMatrix<f64, 18, 3> {
    SMatrix::from_fn(|row, column| blocks[row / 6][(row % 6, column)])
}

#[test]
fn parameters_are_those_of_the_vectors() {
    let file = vectors();
    let (v, p) = (&file["params"], params());
    let number = |key: &str| v[key].as_f64().unwrap();
    for (body, expected) in p.leg_bodies.iter().zip(v["bodies"].as_array().unwrap()) {
        assert_eq!(body.mass_kg, expected["m"].as_f64().unwrap());
        assert_eq!(body.com_m.to_vec(), flat(&expected["com"]));
        assert_eq!(body.inertia_kg_m2.to_vec(), flat(&expected["inertia_diag"]));
    }
    assert_eq!(p.crank_m, number("crank"));
    assert_eq!(p.p4_m.to_vec(), flat(&v["p4"]));
    assert_eq!(p.chassis_mass_kg, 0.5 * number("chassis_mass"));
    assert_eq!(p.wheel_mass_kg, number("wheel_mass"));
    assert_eq!(p.wheel_radius_m, number("wheel_radius"));
    assert_eq!(p.wheel_inertia_kg_m2, number("wheel_inertia"));
    assert_eq!(p.rotor_inertia_kg_m2, number("rotor_inertia"));
    assert_eq!(p.gear_ratio, number("gear"));
    assert_eq!(p.viscous_n_s_m[0], number("wheel_viscous"));
    assert_eq!(p.viscous_n_s_m[1..].to_vec(), flat(&v["viscous"]));
}

#[test]
fn chains_match_the_reference_vectors() {
    let (yaw, foot) = chain_bodies();
    for case in vectors()["cases"].as_array().unwrap() {
        let gravity: Vector3<f64> = vector(&case["gravity"]);
        for name in ["r2p", "rpr"] {
            let v = &case[name];
            let (q, qd, qdd) = (vector(&v["q"]), vector(&v["qd"]), vector(&v["qdd"]));
            let system = if name == "r2p" {
                r2p(&foot, &q, &qd)
            } else {
                rpr(params().crank_m, &yaw, &q, &qd)
            }
            .unwrap();
            let check = |key: &str| format!("{name}.{key} of case {}", case["id"]);
            close(&check("T"), &stacked(system.bodies.map(|b| b.t)), &v["T"]);
            close(
                &check("Tdot"),
                &stacked(system.bodies.map(|b| b.t_dot)),
                &v["Tdot"],
            );
            close(&check("I"), &system.inertia(), &v["I"]);
            close(&check("C"), &system.coriolis(), &v["C"]);
            close(&check("C_qd"), &(system.coriolis() * qd), &v["C_qd"]);
            close(
                &check("tau_g"),
                &system.gravity_force(&gravity),
                &v["tau_g"],
            );
            let tau = system.inverse(&qdd, &gravity, &Vector3::zeros()).unwrap();
            close(&check("tau"), &tau, &v["tau"]);
        }
    }
}

#[test]
fn leg_matches_the_reference_vectors() {
    let leg = leg();
    for case in vectors()["cases"].as_array().unwrap() {
        let v = &case["leg"];
        let (q, qd, qdd) = (vector(&v["q"]), vector(&v["qd"]), vector(&v["qdd"]));
        let (gravity, contact) = (vector(&case["gravity"]), vector(&v["contact_force"]));
        let system = leg.at(&q, &qd).unwrap();
        let check = |key: &str| format!("leg.{key} of case {}", case["id"]);
        close(&check("I"), &system.inertia(), &v["I"]);
        close(&check("C"), &system.coriolis(), &v["C"]);
        close(&check("C_qd"), &(system.coriolis() * qd), &v["C_qd"]);
        close(
            &check("tau_g"),
            &system.gravity_force(&gravity),
            &v["tau_g"],
        );
        close(&check("tau_d"), &system.dissipation(), &v["tau_d"]);
        close(&check("tau_l"), &system.inertial_force(&qdd), &v["tau_l"]);
        let tau = system.inverse(&qdd, &gravity, &contact).unwrap();
        close(&check("tau_a"), &tau, &v["tau_a"]);
        let printed = tau_l_printed_58_64(&leg, &q, &qd, &qdd).unwrap();
        close(
            &check("tau_l_printed_58_64"),
            &printed,
            &v["tau_l_printed_58_64"],
        );
    }
}

#[test]
fn half_robot_matches_the_reference_vectors() {
    let robot = half();
    for case in vectors()["cases"].as_array().unwrap() {
        let v = &case["half_robot"];
        let (q, qd, qdd) = (vector(&v["q"]), vector(&v["qd"]), vector(&v["qdd"]));
        let (gravity, contact) = (vector(&case["gravity"]), vector(&v["contact_force"]));
        let system = robot.at(&q, &qd).unwrap();
        let check = |key: &str| format!("half_robot.{key} of case {}", case["id"]);
        close(&check("I"), &system.inertia(), &v["I"]);
        close(&check("C"), &system.coriolis(), &v["C"]);
        close(&check("C_qd"), &(system.coriolis() * qd), &v["C_qd"]);
        close(
            &check("tau_g"),
            &system.gravity_force(&gravity),
            &v["tau_g"],
        );
        let tau = system.inverse(&qdd, &gravity, &contact).unwrap();
        close(&check("tau_a"), &tau, &v["tau_a"]);
    }
}

/// Golden numbers, printed to twelve decimals.
fn golden<const R: usize, const C: usize>(got: SMatrix<f64, R, C>, expected: SMatrix<f64, R, C>) {
    assert!((got - expected).amax() < 1e-12, "{got} {expected}");
}

#[test]
fn golden_state_of_the_model() {
    let (q, qd) = (
        Vector3::new(0.43, 0.12, 0.15),
        Vector3::new(0.10, -0.20, 0.30),
    );
    let (qdd, contact) = (Vector3::new(1.0, -2.0, 3.0), Vector3::new(1.0, 2.0, 20.0));
    let down = Vector3::new(0.0, 0.0, -9.81);
    let leg = leg();
    let system = leg.at(&q, &qd).unwrap();
    #[rustfmt::skip]
    let inertia = SMatrix::<f64, 3, 3>::new(
        0.664352244202, 0.024952259088, 0.0,
        0.024952259088, 1.7,            0.0,
        0.0,            0.0,            0.8,
    );
    golden(system.inertia(), inertia);
    golden(
        system.coriolis() * qd,
        Vector3::new(-0.085073147823, -0.021657761052, 0.0),
    );
    golden(system.gravity_force(&down), Vector3::new(0.0, 0.0, 7.848));
    golden(system.dissipation(), Vector3::new(-2.0, 3.0, -4.5));
    golden(
        system.inertial_force(&qdd),
        Vector3::new(0.529374578203, -3.396705501964, 2.4),
    );
    golden(
        tau_l_printed_58_64(&leg, &q, &qd, &qdd).unwrap(),
        Vector3::new(0.572777909820, -3.396705501964, 2.4),
    );
    golden(
        system.inverse(&qdd, &down, &Vector3::zeros()).unwrap(),
        Vector3::new(2.529374578203, -6.396705501964, -0.948),
    );
    golden(
        system.inverse(&qdd, &down, &contact).unwrap(),
        Vector3::new(3.399672055084, -7.184464199871, 19.052),
    );
    let robot = half()
        .at(
            &Vector4::new(0.0, q.x, q.y, q.z),
            &Vector4::new(0.12, qd.x, qd.y, qd.z),
        )
        .unwrap();
    let qdd = Vector4::new(0.5, qdd.x, qdd.y, qdd.z);
    golden(
        robot.inverse(&qdd, &down, &contact).unwrap(),
        Vector4::new(5.742362841502, 3.409963542769, -6.339023732700, 19.052),
    );
}

#[test]
fn home_pose_and_pinned_foot() {
    let home = leg()
        .at(&Vector3::new(0.40, 0.10, 0.10), &Vector3::zeros())
        .unwrap();
    let i = home.inertia();
    assert!((i[(0, 0)] - 0.580718).abs() < 5e-7 && (i[(0, 1)] - 0.024828).abs() < 5e-7);
    assert!((i[(1, 1)] - 1.7).abs() < 1e-12 && (i[(2, 2)] - 0.8).abs() < 1e-12);
    // Foot pinned, wheels and horizontal cylinder work on one mass.
    let robot = half()
        .at(&Vector4::new(0.0, 0.40, 0.10, 0.10), &Vector4::zeros())
        .unwrap();
    let n = Vector4::new(1.0, 0.0, -1.0, 0.0);
    let mass = n.dot(&(robot.inertia() * n));
    assert!((mass - 17.529).abs() < 5e-4, "{mass}");
}

fn random<const N: usize>(rng: &mut Pcg64Mcg, lo: [f64; N], hi: [f64; N]) -> SVector<f64, N> {
    SVector::from_fn(|i, _| rng.random_range(lo[i]..hi[i]))
}

/// Strokes, ±0.5 m/s, ±10 m/s².
fn random_half(rng: &mut Pcg64Mcg) -> [Vector4<f64>; 3] {
    [
        random(rng, [-1.0, 0.31, 0.01, 0.01], [1.0, 0.49, 0.19, 0.19]),
        random(rng, [-0.5; 4], [0.5; 4]),
        random(rng, [-10.0; 4], [10.0; 4]),
    ]
}

/// İ along the motion, sixth-order central differences.
fn inertia_rate<const N: usize>(
    inertia: impl Fn(SVector<f64, N>) -> SMatrix<f64, N, N>,
    q: &SVector<f64, N>,
    qd: &SVector<f64, N>,
) -> SMatrix<f64, N, N> {
    let h = 1e-3;
    let pair = |k: f64| inertia(q + qd * (k * h)) - inertia(q - qd * (k * h));
    (pair(1.0) * 45.0 - pair(2.0) * 9.0 + pair(3.0)) / (60.0 * h)
}

#[test]
fn coriolis_forces_do_no_work_beyond_the_change_of_inertia() {
    let robot = half();
    let (yaw, foot) = chain_bodies();
    let mut rng = Pcg64Mcg::seed_from_u64(41);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let [q, qd, _] = random_half(&mut rng);
        let at = |q: Vector4<f64>| robot.at(&q, &qd).unwrap();
        let rate = inertia_rate(|q| at(q).inertia(), &q, &qd);
        let power = qd.dot(&((rate - at(q).coriolis() * 2.0) * qd));
        worst = worst.max(power.abs());
        largest = largest.max(qd.dot(&(rate * qd)).abs());
        // The open chains, with full turns of both angles.
        let q = random(&mut rng, [-PI, 0.2, -PI], [PI, 0.6, PI]);
        let qd = random(&mut rng, [-1.0; 3], [1.0; 3]);
        for system in [
            &(|q: Vector3<f64>| r2p(&foot, &q, &qd).unwrap()) as &dyn Fn(_) -> System<3, 3>,
            &|q| rpr(0.29, &yaw, &q, &qd).unwrap(),
        ] {
            let rate = inertia_rate(|q| system(q).inertia(), &q, &qd);
            let power = qd.dot(&((rate - system(q).coriolis() * 2.0) * qd));
            worst = worst.max(power.abs());
        }
    }
    println!("worst {worst:e} W against {largest:e} W");
    assert!(largest > 0.05, "{largest}");
    assert!(worst < 1e-10, "{worst:e}");
}

#[test]
fn forward_undoes_inverse() {
    let (robot, leg) = (half(), leg());
    let mut rng = Pcg64Mcg::seed_from_u64(42);
    let mut worst = 0.0_f64;
    for _ in 0..STATES {
        let [q, qd, qdd] = random_half(&mut rng);
        let gravity = random(&mut rng, [-10.0; 3], [10.0; 3]);
        let contact = random(&mut rng, [-40.0; 3], [40.0; 3]);
        let system = robot.at(&q, &qd).unwrap();
        let tau = system.inverse(&qdd, &gravity, &contact).unwrap();
        let back = system.forward(&tau, &gravity, &contact).unwrap();
        worst = worst.max((back - qdd).amax());
        let (q, qd, qdd): (Vector3<f64>, Vector3<f64>, Vector3<f64>) = (
            q.fixed_rows::<3>(1).into(),
            qd.fixed_rows::<3>(1).into(),
            qdd.fixed_rows::<3>(1).into(),
        );
        let system = leg.at(&q, &qd).unwrap();
        let tau = system.inverse(&qdd, &gravity, &contact).unwrap();
        let back = system.forward(&tau, &gravity, &contact).unwrap();
        worst = worst.max((back - qdd).amax());
        let i = system.inertia();
        assert!((i - i.transpose()).amax() < 1e-14);
    }
    println!("worst {worst:e} m/s²");
    assert!(worst < TOLERANCE, "{worst:e}");
}

/// Height of the leg's mass centres against gravity (J), from positions built here.
fn leg_potential_j(q: &Vector3<f64>, gravity: &Vector3<f64>) -> f64 {
    let p = params();
    let (ell, [xt, yt]) = (p.crank_m, p.p4_m);
    let reach = xt.hypot(yt);
    let arc = (reach * reach + ell * ell - q.x * q.x) / (2.0 * ell * reach);
    let phi = yt.atan2(xt) - arc.acos();
    let u = Vector3::new(xt - ell * phi.cos(), yt - ell * phi.sin(), 0.0) / q.x;
    let k = Vector3::z();
    let (w, v) = (k.cross(&u), Vector3::new(phi.cos(), phi.sin(), 0.0));
    let (n, f) = (k.cross(&v), v);
    // θ4 = φ + 90°: n = [cos θ4, sin θ4] = k × v, f = [sin θ4, −cos θ4] = v.
    let (o3, o4) = (u * q.x, Vector3::new(xt, yt, 0.0));
    let o6 = o4 + f * q.y;
    let place = |i: usize, o: Vector3<f64>, x: Vector3<f64>, y: Vector3<f64>, z: Vector3<f64>| {
        let [a, b, c] = p.leg_bodies[i].com_m;
        (o + x * a + y * b + z * c) * p.leg_bodies[i].mass_kg
    };
    let moment = place(0, Vector3::zeros(), w, k, u)
        + place(1, o3, -w, u, k)
        + place(2, o3 + v * ell, v, n, k)
        + place(3, o4, n, k, f)
        + place(4, o6, n, f, -k)
        + place(5, o6 - k * q.z, n, f, -k);
    -gravity.dot(&moment)
}

/// Change of energy (J) of an undriven, frictionless leg under tilted gravity, by steps of RK4.
fn energy_drift_j(step_s: f64, steps: usize) -> f64 {
    let mut p = params();
    p.viscous_n_s_m = [0.0; 4];
    let leg = leg_of(&p);
    let gravity = Vector3::new(-20.0_f64.to_radians().sin(), 0.3, -0.9) * 9.81;
    let rate = |q: &Vector3<f64>, v: &Vector3<f64>| {
        let system = leg.at(q, v).unwrap();
        system
            .forward(&Vector3::zeros(), &gravity, &Vector3::zeros())
            .unwrap()
    };
    let energy = |q: &Vector3<f64>, v: &Vector3<f64>| {
        leg.at(q, v).unwrap().kinetic_energy_j() + leg_potential_j(q, &gravity)
    };
    let (mut q, mut v) = (Vector3::new(0.36, 0.14, 0.05), Vector3::new(0.4, -0.5, 0.2));
    let start = energy(&q, &v);
    for _ in 0..steps {
        crate::rk4::step(&mut q, &mut v, step_s, rate);
    }
    assert!(
        (energy(&q, &v) - leg_potential_j(&q, &gravity)) > 0.05,
        "it moves"
    );
    (energy(&q, &v) - start).abs()
}

#[test]
fn energy_is_kept_on_a_slope_to_the_order_of_the_integrator() {
    let drifts = [20, 40, 80].map(|steps| energy_drift_j(0.2 / steps as f64, steps));
    println!("drift {drifts:?} J");
    // Fourth order: sixteen times less for half the step; energy of one trajectory may do better.
    assert!(drifts[0] < 1e-4 && drifts[2] < 1e-7, "{drifts:?}");
    assert!(
        drifts[0] > 10.0 * drifts[1] && drifts[1] > 10.0 * drifts[2],
        "{drifts:?}"
    );
    assert!(energy_drift_j(0.2 / 1000.0, 1000) < 1e-11);
}

#[test]
fn impossible_states_are_named() {
    let still = Vector3::zeros();
    let far = leg().at(&Vector3::new(0.9, 0.1, 0.1), &still);
    assert!(
        matches!(far, Err(DynamicsError::Leg { leg: 0, .. })),
        "{far:?}"
    );
    let fast = leg().at(
        &Vector3::new(0.4, 0.1, 0.1),
        &Vector3::new(0.0, f64::NAN, 0.0),
    );
    assert!(
        matches!(
            fast,
            Err(DynamicsError::NonFinite {
                name: "velocity",
                index: 1,
                ..
            })
        ),
        "{fast:?}"
    );
    let mut p = params();
    p.leg_bodies[5].mass_kg = 0.0;
    let system = leg_of(&p).at(&Vector3::new(0.4, 0.1, 0.1), &still).unwrap();
    let massless = system.forward(&still, &still, &still);
    assert_eq!(massless, Err(DynamicsError::Singular { pivot: 0.0 }));
    let system = half()
        .at(&Vector4::new(0.0, 0.4, 0.1, 0.1), &Vector4::zeros())
        .unwrap();
    let lost = system.inverse(&Vector4::from_element(f64::INFINITY), &still, &still);
    assert!(
        matches!(
            lost,
            Err(DynamicsError::NonFinite {
                name: "acceleration",
                index: 0,
                value: f64::INFINITY
            })
        ),
        "{lost:?}"
    );
}
