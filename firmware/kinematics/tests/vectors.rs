//! Kinematic keys of the reference vectors, and the golden state, to 1e-12.

use nalgebra::{Matrix6x3, Vector3};
use serde_json::Value;
use wheeleg_kinematics::{
    FootState, JointAngles, LegGeometry, LegLengths, LegParameters, Phi, Theta3, printed, r2p::R2p,
    rpr::Rpr,
};

const TOLERANCE: f64 = 1e-12;

fn vectors() -> Value {
    let text = include_str!("../../../tests/vectors/model-7.json");
    let value: Value = serde_json::from_str(text).unwrap();
    assert_eq!(value["schema"], "wheeleg-reference-vectors/1");
    value
}

fn cases(of: &Value) -> &[Value] {
    let cases = of["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 50);
    cases
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn vector3(value: &Value) -> Vector3<f64> {
    Vector3::from_column_slice(&flat(value))
}

fn close(what: &str, got: &[f64], expected: &Value) {
    let expected = flat(expected);
    assert_eq!(got.len(), expected.len(), "{what}");
    for (g, e) in got.iter().zip(&expected) {
        assert!(
            (g - e).abs() <= TOLERANCE,
            "{what}: {got:?} vs {expected:?}"
        );
    }
}

/// The vectors store matrices row by row.
fn rows(m: &Matrix6x3<f64>) -> Vec<f64> {
    m.transpose().iter().copied().collect()
}

fn geometry() -> LegGeometry<f64> {
    LegGeometry::new(LegParameters::wheeleg_2003()).unwrap()
}

fn joints(x: &JointAngles<f64>) -> [f64; 6] {
    [
        x.theta1_rad,
        x.b2_m,
        x.theta3.rad(),
        x.theta4_rad,
        x.b5_m,
        x.b6_m,
    ]
}

#[test]
fn parameters_are_those_of_the_vectors() {
    let v = vectors();
    let p = LegParameters::<f64>::wheeleg_2003();
    assert_eq!(p.crank_m, v["params"]["crank"].as_f64().unwrap());
    assert_eq!(p.p4_m.to_vec(), flat(&v["params"]["p4"]));
    assert_eq!(p.stroke_m[1], v["params"]["stroke"].as_f64().unwrap());
    let (lo, hi) = geometry().closing_interval_m();
    let r = v["params"]["R"].as_f64().unwrap();
    assert!((lo - (r - 0.29)).abs() < 1e-15 && (hi - (r + 0.29)).abs() < 1e-15);
}

#[test]
fn r2p_chain() {
    for case in cases(&vectors()) {
        let c = &case["r2p"];
        let (q, qd, qdd) = (vector3(&c["q"]), vector3(&c["qd"]), vector3(&c["qdd"]));
        let chain = R2p::new(q.x, q.y, q.z).unwrap();
        close("p", chain.foot().as_slice(), &c["p"]);
        close("J", &rows(&chain.jacobian()), &c["J"]);
        let twist = chain.twist(&qd).unwrap();
        let twist_dot = chain.twist_dot(&qd, &qdd).unwrap();
        close("twist", twist.as_slice(), &c["twist"]);
        close("twist_dot", twist_dot.as_slice(), &c["twist_dot"]);
        close(
            "(13)",
            printed::twist_13(&qd).as_slice(),
            &c["twist_printed_13"],
        );
        close(
            "(16)",
            printed::twist_dot_16(&qd, &qdd).as_slice(),
            &c["twist_dot_printed_16"],
        );

        let back = R2p::from_foot(&vector3(&c["p"]), 0.01).unwrap();
        close("q", back.coordinates().as_slice(), &c["q"]);
        let velocity = twist.fixed_rows::<3>(3).into_owned();
        let acceleration = twist_dot.fixed_rows::<3>(3).into_owned();
        close("qd", back.rates(&velocity).unwrap().as_slice(), &c["qd"]);
        // The reference state is near b5 = 0.02, which amplifies rounding of the foot acceleration.
        let again = back.accelerations(&qd, &acceleration).unwrap();
        assert!((again - qdd).norm() < 1e-11, "{again} {qdd}");
    }
}

#[test]
fn rpr_chain() {
    for case in cases(&vectors()) {
        let c = &case["rpr"];
        let (q, qd, qdd) = (vector3(&c["q"]), vector3(&c["qd"]), vector3(&c["qdd"]));
        let theta3 = Theta3::new(q.z);
        let chain = Rpr::new(0.29, q.x, q.y, theta3).unwrap();
        close("p", chain.tip().as_slice(), &c["p"]);
        close("J", &rows(&chain.jacobian()), &c["J"]);
        close("twist", chain.twist(&qd).unwrap().as_slice(), &c["twist"]);
        close(
            "twist_dot",
            chain.twist_dot(&qd, &qdd).unwrap().as_slice(),
            &c["twist_dot"],
        );
        close(
            "(32)",
            printed::twist_32(0.29, theta3, &qd).as_slice(),
            &c["twist_printed_32"],
        );
        close(
            "(38)",
            printed::twist_dot_38(0.29, theta3, &qd, &qdd).as_slice(),
            &c["twist_dot_printed_38"],
        );
    }
}

#[test]
fn assembled_leg() {
    let geometry = geometry();
    for case in cases(&vectors()) {
        let c = &case["leg"];
        let (q, qd, qdd) = (vector3(&c["q"]), vector3(&c["qd"]), vector3(&c["qdd"]));
        let leg = geometry.posture(&LegLengths::new(q.x, q.y, q.z)).unwrap();
        close("joints", &joints(&leg.joints()), &c["joints"]);
        close("N", &rows(&leg.n()), &c["N"]);
        close("Ndot", &rows(&leg.n_dot(qd.x)), &c["Ndot"]);
        close(
            "joints_d",
            leg.joint_rates(&qd).unwrap().as_slice(),
            &c["joints_d"],
        );
        close(
            "joints_dd",
            leg.joint_accelerations(&qd, &qdd).unwrap().as_slice(),
            &c["joints_dd"],
        );
        let foot = leg.foot_state(&qd, &qdd).unwrap();
        close("foot_p", foot.position.as_slice(), &c["foot_p"]);
        close("foot_v", foot.velocity.as_slice(), &c["foot_v"]);
        close("foot_a", foot.acceleration.as_slice(), &c["foot_a"]);
        close(
            "foot_p_f1",
            (foot.position + geometry.o4_in_f1()).as_slice(),
            &c["foot_p_f1"],
        );

        let x = leg.joints();
        let roots = geometry.closures_from_theta3(x.theta3).unwrap();
        let got = roots.map(|r| [r.theta1_rad, r.b2_m]).concat();
        close("theta1_roots", &got, &c["theta1_roots"]);

        let motion = geometry.inverse_motion(&foot).unwrap();
        close("inverse q", &motion.lengths.to_array(), &c["q"]);
        close("inverse qd", motion.rates.as_slice(), &c["qd"]);
        assert!((motion.accelerations - qdd).norm() <= 2e-12 * qdd.norm().max(1.0));
    }
}

#[test]
fn golden_state() {
    let geometry = geometry();
    let leg = geometry
        .posture(&LegLengths::new(0.43, 0.12, 0.15))
        .unwrap();
    let (qd, qdd) = (
        Vector3::new(0.10, -0.20, 0.30),
        Vector3::new(1.0, -2.0, 3.0),
    );
    let near = |got: &[f64], expected: &[f64]| {
        for (g, e) in got.iter().zip(expected) {
            assert!((g - e).abs() < 1e-12, "{got:?} {expected:?}");
        }
    };
    near(
        &joints(&leg.joints()),
        &[
            3.137974958912,
            0.43,
            -0.100006229553,
            1.467172402564,
            0.12,
            0.15,
        ],
    );
    let xd = leg.joint_rates(&qd).unwrap();
    near(
        &[xd[0], xd[2], xd[3]],
        &[-0.023335107990, -0.323224046010, -0.346559154000],
    );
    let xdd = leg.joint_accelerations(&qd, &qdd).unwrap();
    near(
        &[xdd[0], xdd[2], xdd[3]],
        &[-0.303849511905, -3.172981846834, -3.476831358739],
    );
    let FootState {
        position,
        velocity,
        acceleration,
    } = leg.foot_state(&qd, &qdd).unwrap();
    near(
        position.as_slice(),
        &[0.119356301248, -0.012412628749, -0.15],
    );
    near(
        velocity.as_slice(),
        &[-0.203228878864, -0.020676304203, -0.3],
    );
    near(
        acceleration.as_slice(),
        &[-2.032424349970, -0.068733725582, -3.0],
    );
}

/// Degrees over the stroke of the yaw cylinder: θ4 − 90°, θ1 − 180°, θ3.
#[test]
fn table_over_the_yaw_stroke() {
    let geometry = geometry();
    for (b2, yaw, theta1, theta3) in [
        (0.31, 18.14985, -2.66779, 20.81765),
        (0.35, 9.93361, -0.71173, 10.64534),
        (0.40, 0.0, 0.0, 0.0),
        (0.45, -9.92400, -0.55249, -9.37150),
        (0.49, -18.03694, -1.66666, -16.37028),
    ] {
        let x = geometry
            .posture(&LegLengths::new(b2, 0.1, 0.1))
            .unwrap()
            .joints();
        let degrees = |rad: f64| rad.to_degrees();
        assert!((degrees(x.theta4_rad) - 90.0 - yaw).abs() < 6e-6);
        assert!((degrees(x.theta1_rad) - 180.0 - theta1).abs() < 6e-6);
        assert!((degrees(x.theta3.rad()) - theta3).abs() < 6e-6);
    }
}

/// The two forms of the printed quartic agree, and it does not vanish at the true angle.
#[test]
fn printed_quartic_is_a_different_equation() {
    let (l, p4) = (0.29, [0.29, 0.40]);
    let theta3 = Theta3::new((-9.43994_f64).to_radians());
    for gamma in [-3.0, -0.4, 0.2, 1.7] {
        let theta1 = 2.0 * f64::atan(gamma);
        let direct = p4[0] * theta1.cos() - p4[1] * theta1.sin()
            + l * theta3.rad().cos() * (2.0 * theta1).cos();
        let g2: f64 = 1.0 + gamma * gamma;
        let quartic = printed::quartic_27(l, p4, theta3, gamma);
        assert!((quartic - direct * g2 * g2).abs() < 1e-12 * g2 * g2);
    }
    let [true_root, _] = geometry().closures_from_theta3(theta3).unwrap();
    let gamma = (true_root.theta1_rad / 2.0).tan();
    let scale = gamma.abs().powi(3);
    assert!(printed::quartic_27(l, p4, theta3, gamma).abs() > 0.1 * scale);
    // Printed (39) has the opposite slope of the foot at home.
    let y = printed::foot_y_39(0.40, Phi::new(0.01));
    assert!(y < -0.0039 && 0.1 * Phi::new(0.01_f64).rad().sin() > 0.0);
}
