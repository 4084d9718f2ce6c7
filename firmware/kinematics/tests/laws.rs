//! Properties over the workspace: inverses, finite differences, precision, refusals.

use nalgebra::Vector3;
use proptest::prelude::*;
use wheeleg_kinematics::{
    FootState, KinematicsError, LegGeometry, LegLengths, LegParameters, Phi, Quantity, Theta3,
    r2p::R2p, rpr::Rpr,
};

fn geometry() -> LegGeometry<f64> {
    LegGeometry::new(LegParameters::wheeleg_2003()).unwrap()
}

fn lengths() -> impl Strategy<Value = [f64; 3]> {
    (0.31..0.49, 0.01..0.19, 0.01..0.19).prop_map(|(a, b, c)| [a, b, c])
}

fn rates() -> impl Strategy<Value = Vector3<f64>> {
    (-0.4..0.4, -0.4..0.4, -0.4..0.4).prop_map(|(a, b, c)| Vector3::new(a, b, c))
}

fn of(q: [f64; 3]) -> LegLengths<f64> {
    LegLengths::new(q[0], q[1], q[2])
}

/// Fourth-order central difference.
fn derivative(h: f64, f: impl Fn(f64) -> f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn inverse_undoes_forward(q in lengths(), v in rates(), a in rates()) {
        let g = geometry();
        let leg = g.posture(&of(q)).unwrap();
        let foot = leg.foot_state(&v, &(a * 20.0)).unwrap();
        let back = g.inverse_motion(&foot).unwrap();
        for (x, y) in back.lengths.to_array().iter().zip(q) {
            prop_assert!((x - y).abs() < 1e-13);
        }
        prop_assert!((back.rates - v).norm() < 1e-12);
        // Down to b5 = 0.01 m the yaw terms are divided by b5.
        prop_assert!((back.accelerations - a * 20.0).norm() < 1e-10);
        // and the forward solution of the inverse is the foot again
        let again = g.inverse(&foot.position).unwrap().foot();
        prop_assert!((again - foot.position).norm() < 1e-15);
    }

    #[test]
    fn rates_are_derivatives(q in lengths(), v in rates(), a in rates()) {
        let g = geometry();
        let a = a * 5.0;
        let at = |t: f64| {
            let q = Vector3::from(q) + v * t + a * (0.5 * t * t);
            g.posture(&LegLengths::new(q.x, q.y, q.z)).unwrap()
        };
        let state = at(0.0).foot_state(&v, &a).unwrap();
        let h = 1e-3;
        for i in 0..3 {
            let velocity = derivative(h, |t| at(t).foot()[i]);
            prop_assert!((velocity - state.velocity[i]).abs() < 1e-9);
            let acceleration = derivative(h, |t| at(t).foot_state(&(v + a * t), &a).unwrap().velocity[i]);
            prop_assert!((acceleration - state.acceleration[i]).abs() < 1e-8);
        }
        let xd = at(0.0).joint_rates(&v).unwrap();
        let xdd = at(0.0).joint_accelerations(&v, &a).unwrap();
        let joints = |t: f64| {
            let x = at(t).joints();
            [x.theta1_rad, x.b2_m, x.theta3.rad(), x.theta4_rad, x.b5_m, x.b6_m]
        };
        for i in 0..6 {
            prop_assert!((derivative(h, |t| joints(t)[i]) - xd[i]).abs() < 1e-8);
            let second = derivative(h, |t| at(t).joint_rates(&(v + a * t)).unwrap()[i]);
            prop_assert!((second - xdd[i]).abs() < 1e-7);
        }
    }

    /// The closed loop holds the tip of the open chain at O4: position, velocity, acceleration.
    #[test]
    fn loop_stays_closed(q in lengths(), v in rates(), a in rates()) {
        let g = geometry();
        let leg = g.posture(&of(q)).unwrap();
        let x = leg.joints();
        let open = Rpr::new(0.29, x.theta1_rad, x.b2_m, x.theta3).unwrap();
        prop_assert!((open.tip() - g.o4_in_f1()).norm() < 1e-15);
        let xd = leg.joint_rates(&v).unwrap();
        let xdd = leg.joint_accelerations(&v, &a).unwrap();
        let (r, rd) = (Vector3::new(xd[0], xd[1], xd[2]), Vector3::new(xdd[0], xdd[1], xdd[2]));
        let twist = open.twist(&r).unwrap();
        prop_assert!(twist.fixed_rows::<3>(3).norm() < 1e-14);
        prop_assert!((twist[2] - xd[3]).abs() < 1e-13);
        prop_assert!(open.twist_dot(&r, &rd).unwrap().fixed_rows::<3>(3).norm() < 1e-13);
    }

    /// Three routes to the loop: from b2 (A4), from φ (A1), from θ3 (A5).
    #[test]
    fn closures_agree(q in lengths()) {
        let g = geometry();
        let x = g.posture(&of(q)).unwrap().joints();
        let phi = g.phi_from_b2(q[0]).unwrap();
        let a1 = g.closure_from_phi(phi).unwrap();
        prop_assert!((phi.theta4_rad() - x.theta4_rad).abs() < 1e-14);
        prop_assert!((x.theta3.to_phi(x.theta1_rad).rad() - phi.rad()).abs() < 1e-14);
        prop_assert!((a1.b2_m - q[0]).abs() < 1e-14 && (a1.theta1_rad - x.theta1_rad).abs() < 1e-14);
        let [assembled, reversed] = g.closures_from_theta3(a1.theta3).unwrap();
        prop_assert!((assembled.b2_m - q[0]).abs() < 1e-14);
        prop_assert!((assembled.theta1_rad - x.theta1_rad).abs() < 1e-14);
        prop_assert!(reversed.b2_m < 0.0);
    }

    /// 0.02 mm is a tenth of the finest position the leg needs; single precision must stay below.
    #[test]
    fn single_precision_suffices(q in lengths()) {
        let double = geometry();
        let single = LegGeometry::new(LegParameters::<f32>::wheeleg_2003()).unwrap();
        let q32 = q.map(|x| x as f32);
        let foot = single.posture(&LegLengths::new(q32[0], q32[1], q32[2])).unwrap().foot();
        let exact = double.posture(&of(q)).unwrap().foot();
        prop_assert!((foot.cast::<f64>() - exact).norm() < 0.02e-3);
        let back = single.inverse(&exact.cast::<f32>()).unwrap().lengths.to_array();
        for (x, y) in back.iter().zip(q) {
            prop_assert!((f64::from(*x) - y).abs() < 0.02e-3);
        }
    }

    /// Whatever the arguments, results are finite or an error, never NaN.
    #[test]
    fn never_nan(x in proptest::array::uniform9(any::<f64>())) {
        let g = geometry();
        let v = Vector3::new(x[3], x[4], x[5]);
        let a = Vector3::new(x[6], x[7], x[8]);
        for q in [[x[0], x[1], x[2]], [0.4, x[1], x[2]]] {
            if let Ok(leg) = g.posture(&of(q)) {
                prop_assert!(leg.foot().iter().all(|y| y.is_finite()));
                if let Ok(s) = leg.foot_state(&v, &a) {
                    prop_assert!(s.velocity.iter().chain(s.acceleration.iter()).all(|y| y.is_finite()));
                }
                if let Ok(y) = leg.joint_accelerations(&v, &a) {
                    prop_assert!(y.iter().all(|y| y.is_finite()));
                }
            }
        }
        let foot = FootState { position: Vector3::new(x[0], x[1], x[2]), velocity: v, acceleration: a };
        if let Ok(m) = g.inverse_motion(&foot) {
            prop_assert!(m.lengths.to_array().iter().chain(m.rates.iter()).chain(m.accelerations.iter()).all(|y| y.is_finite()));
        }
    }
}

#[test]
fn open_loop_is_refused_with_its_length() {
    let g = geometry();
    let (lo, hi) = g.closing_interval_m();
    for b2 in [lo, hi, 0.1, 1.0, -0.4, 0.0] {
        match g.posture(&LegLengths::new(b2, 0.1, 0.1)) {
            Err(KinematicsError::LoopOpen { b2_m, min_m, max_m }) => {
                assert_eq!((b2_m, min_m, max_m), (b2, lo, hi));
            }
            other => panic!("{b2}: {other:?}"),
        }
    }
    assert!(matches!(
        g.phi_from_b2(0.9),
        Err(KinematicsError::LoopOpen { b2_m: 0.9, .. })
    ));
}

#[test]
fn missing_moment_arm_is_refused_with_its_cosine() {
    let g = geometry();
    let (lo, hi) = g.closing_interval_m();
    for b2 in [lo + 1e-5, hi - 1e-5] {
        match g.posture(&LegLengths::new(b2, 0.1, 0.1)) {
            Err(KinematicsError::NoMomentArm {
                cos_theta3,
                minimum,
            }) => {
                assert!(cos_theta3 > 0.0 && cos_theta3 < minimum && minimum == 0.05);
            }
            other => panic!("{b2}: {other:?}"),
        }
    }
    // A foot behind the axis would need the mirrored assembly: negative cosine.
    match g.inverse(&Vector3::new(0.0, 0.1, -0.1)) {
        Err(KinematicsError::NoMomentArm { cos_theta3, .. }) => assert!(cos_theta3 < 0.0),
        other => panic!("{other:?}"),
    }
    assert!(matches!(
        g.closures_from_theta3(Theta3::new(1.6)),
        Err(KinematicsError::NoMomentArm { .. })
    ));
    assert!(matches!(
        g.closure_from_phi(Phi::new(2.5)),
        Err(KinematicsError::NoMomentArm { .. })
    ));
    // The whole stroke and a centimetre beyond is accepted.
    for b2 in [0.30, 0.50] {
        assert!(g.posture(&LegLengths::new(b2, 0.1, 0.1)).is_ok());
    }
}

#[test]
fn foot_on_the_yaw_axis_is_refused_with_its_radius() {
    let g = geometry();
    for (x, refused) in [(0.0, true), (0.0099, true), (0.01, false), (0.0101, false)] {
        match g.inverse(&Vector3::new(x, 0.0, -0.1)) {
            Err(KinematicsError::FootOnYawAxis {
                radius_m,
                minimum_m,
            }) => {
                assert!(refused);
                assert_eq!((radius_m, minimum_m), (x, 0.01));
            }
            Ok(_) => assert!(!refused),
            other => panic!("{other:?}"),
        }
    }
    let chain = R2p::new(1.5, 0.0, 0.1).unwrap();
    assert!(matches!(
        chain.rates(&Vector3::new(1.0, 0.0, 0.0)),
        Err(KinematicsError::FootOnYawAxis { radius_m: 0.0, .. })
    ));
}

#[test]
fn non_finite_arguments_are_named() {
    let g = geometry();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let same = |v: f64| v.to_bits() == bad.to_bits();
        for i in 0..3 {
            let mut q = [0.4, 0.1, 0.1];
            q[i] = bad;
            assert!(matches!(
                g.posture(&of(q)),
                Err(KinematicsError::NonFinite { quantity: Quantity::Coordinate, value }) if same(value)
            ));
        }
        assert!(matches!(
            g.inverse(&Vector3::new(0.1, bad, 0.0)),
            Err(KinematicsError::NonFinite { quantity: Quantity::FootPosition, value }) if same(value)
        ));
        let leg = g.posture(&of([0.4, 0.1, 0.1])).unwrap();
        assert!(matches!(
            leg.foot_state(&Vector3::new(bad, 0.0, 0.0), &Vector3::zeros()),
            Err(KinematicsError::NonFinite { quantity: Quantity::Rate, value }) if same(value)
        ));
    }
}

#[test]
fn strokes_and_lengths() {
    let g = geometry();
    let q = g.lengths_from_strokes([0.09, 0.0, 0.18]);
    assert_eq!(q.b2_m, 0.31 + 0.09);
    assert_eq!((q.b5_m, q.b6_m), (0.01, 0.01 + 0.18));
    for (s, e) in g.strokes_from_lengths(&q).iter().zip([0.09, 0.0, 0.18]) {
        assert!((s - e).abs() < 1e-16);
    }
    assert!(g.check_strokes(&q).is_ok());
    match g.check_strokes(&LegLengths::new(0.4, 0.1, 0.1902)) {
        Err(KinematicsError::OutsideStroke {
            cylinder, length_m, ..
        }) => {
            assert_eq!(cylinder, wheeleg_kinematics::Cylinder::Vertical);
            assert_eq!(length_m, 0.1902);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn impossible_dimensions_are_refused() {
    let base = LegParameters::<f64>::wheeleg_2003();
    for (bad, value) in [
        (
            LegParameters {
                crank_m: 0.5,
                ..base
            },
            0.5,
        ),
        (
            LegParameters {
                crank_m: 0.0,
                ..base
            },
            0.0,
        ),
        (
            LegParameters {
                min_cos_theta3: 1.0,
                ..base
            },
            1.0,
        ),
        (
            LegParameters {
                stroke_m: [0.18, -0.1, 0.18],
                ..base
            },
            -0.1,
        ),
    ] {
        assert_eq!(
            LegGeometry::new(bad),
            Err(KinematicsError::BadParameter { value })
        );
    }
}
