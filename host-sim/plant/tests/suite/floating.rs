//! The fast floating robot against the natural orthogonal complement, and both against the models
//! with fewer freedoms; bad input.

use crate::eight::dynamics::{RobotDynamics, RobotSide};
use crate::floating_states::{Draw, STATES, frictionless, rubbing};
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3, Vector4};
use proptest::prelude::*;
use wheeleg_kinematics::KinematicsError;
use wheeleg_plant::dynamics::DynamicsError;
use wheeleg_plant::dynamics::floating::{
    Contacts, DOF, FloatingParams, FloatingReference, FloatingRobot, FloatingState, Velocity,
    Wrench,
};
use wheeleg_plant::dynamics::noc::HalfRobot;

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// Largest difference over the largest entry.
fn relative<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, b: &SMatrix<f64, R, C>) -> f64 {
    // A maximum passes over NaN.
    assert!(a.iter().chain(b).all(|v| v.is_finite()), "{a} {b}");
    (a - b).amax() / b.amax()
}

#[test]
fn fast_and_reference_give_the_same_numbers() {
    let params = rubbing();
    let fast = FloatingRobot::new(&params).unwrap();
    let plain = FloatingReference::new(&params).unwrap();
    let mut draw = Draw::new(31);
    let mut worst = [0.0_f64; 8];
    for _ in 0..2 * STATES {
        let c = draw.case();
        let kin = fast.prepare(&c.state, &c.gravity).unwrap();
        let system = plain.at(&c.state).unwrap();
        let energy = system.blocks.kinetic_energy_j();
        let forward = |r: Result<Velocity, DynamicsError>| r.unwrap();
        let errors = [
            relative(&kin.mass_matrix(), &system.blocks.inertia()),
            relative(&kin.bias(), &system.bias(&c.gravity)),
            relative(
                &kin.contact_force(&c.contacts),
                &system.contact_force(&c.contacts),
            ),
            relative(
                &forward(fast.forward(&c.state, &c.force, &c.gravity, &c.contacts)),
                &forward(system.forward(&c.force, &c.gravity, &c.contacts)),
            ),
            relative(
                &forward(fast.inverse(&c.state, &c.acceleration, &c.gravity, &c.contacts)),
                &forward(system.inverse(&c.acceleration, &c.gravity, &c.contacts)),
            ),
            (kin.kinetic_energy_j() - energy).abs() / energy,
            relative(
                &kin.momentum().angular_kg_m2_s,
                &system.momentum().angular_kg_m2_s,
            )
            .max(relative(
                &kin.momentum().linear_kg_m_s,
                &system.momentum().linear_kg_m_s,
            )),
            (kin.com_m() - system.com_m()).amax()
                + (0..5)
                    .map(|i| {
                        let [turning, moving] = kin.twist(i, &c.state.velocity);
                        let twist = system.contact_jacobians[i] * c.state.velocity;
                        (kin.points_m()[i] - system.points_m[i]).amax()
                            + (turning - twist.fixed_rows::<3>(0)).amax()
                            + (moving - twist.fixed_rows::<3>(3)).amax()
                    })
                    .sum::<f64>()
                + (kin.potential_energy_j(&c.gravity) - system.potential_energy_j(&c.gravity))
                    .abs()
                    / 1000.0,
        ];
        for (w, e) in worst.iter_mut().zip(errors) {
            *w = w.max(e);
        }
    }
    println!("I, bias, contact, forward, inverse, energy, momentum, points: {worst:?}");
    // The condition of the mass matrix separates the two accelerations.
    assert!(worst.iter().all(|w| *w <= 1e-11), "{worst:?}");
}

/// The fourteen velocities for those of a robot that rolls straight ahead: B and Ḃ.
fn straight(
    p: &FloatingParams,
    pitch: f64,
    pitch_rate: f64,
) -> (SMatrix<f64, DOF, 8>, SMatrix<f64, DOF, 8>) {
    let (sin, cos) = pitch.sin_cos();
    let mut b = SMatrix::<f64, DOF, 8>::zeros();
    let mut b_dot = SMatrix::<f64, DOF, 8>::zeros();
    b[(1, 1)] = -1.0;
    b[(3, 0)] = cos;
    b[(5, 0)] = -sin;
    b_dot[(3, 0)] = -sin * pitch_rate;
    b_dot[(5, 0)] = -cos * pitch_rate;
    for k in 0..6 {
        b[(6 + k, 2 + k)] = 1.0;
    }
    for wheel in [12, 13] {
        b[(wheel, 0)] = 1.0 / p.robot.wheel_radius_m;
        b[(wheel, 1)] = 1.0;
    }
    (b, b_dot)
}

#[test]
fn held_on_its_axle_it_is_the_robot_in_eight_coordinates() {
    let mut params = frictionless();
    let floating = FloatingRobot::new(&params).unwrap();
    let mut draw = Draw::new(32);
    let mut worst = [0.0_f64; 3];
    for _ in 0..STATES {
        let drawn = draw.case();
        params.robot.gravity_m_s2 = drawn.gravity.into();
        let eight = RobotDynamics::new(&params.robot).unwrap();
        let [s, pitch] = [draw.within(1.0), draw.within(0.5)];
        let [l, r] = drawn.state.lengths_m;
        let q = [s, pitch, l[0], l[1], l[2], r[0], r[1], r[2]];
        let qd = SVector::<f64, 8>::from_fn(|_, _| draw.within(1.0));
        let (b, b_dot) = straight(&params, pitch, qd[1]);
        let state = FloatingState {
            position_m: Vector3::new(s, 0.0, params.robot.wheel_radius_m),
            orientation: UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -pitch),
            velocity: b * qd,
            ..drawn.state
        };
        let kin = floating.prepare(&state, &drawn.gravity).unwrap();
        let m = kin.mass_matrix();
        let reference = eight.prepare(&q, &qd.into()).unwrap();
        let rows = reference.mass_matrix();
        let expected = SMatrix::<f64, 8, 8>::from_fn(|i, j| rows[i][j]);
        worst[0] = worst[0].max(relative(&(b.transpose() * m * b), &expected));
        let bias = b.transpose() * (m * b_dot * qd + kin.bias());
        worst[1] = worst[1].max(relative(&bias, &SVector::from(reference.bias())));
        // A foot force does the same work on both.
        for (leg, side) in [RobotSide::Left, RobotSide::Right].into_iter().enumerate() {
            let force = drawn.contacts.feet[leg].force_n;
            let mut general = [0.0; 8];
            reference.add_foot_force(side, &force.into(), &mut general);
            let mut contacts = Contacts::NONE;
            contacts.feet[leg] = Wrench::force(force);
            let ours = b.transpose() * kin.contact_force(&contacts);
            worst[2] = worst[2].max(relative(&ours, &SVector::from(general)));
        }
    }
    println!("I, bias, foot: {worst:?}");
    assert!(worst.iter().all(|w| *w <= 1e-11), "{worst:?}");
}

#[test]
fn symmetric_and_level_it_is_two_half_robots() {
    let mut params = rubbing();
    params.robot.viscous[5..].copy_from_slice(&[20.0, 15.0, 14.0]);
    let plain = FloatingReference::new(&params).unwrap();
    let half = HalfRobot::new(&params.robot.half()).unwrap();
    let mut draw = Draw::new(33);
    let mut worst = 0.0_f64;
    for _ in 0..STATES {
        let drawn = draw.case();
        let l = drawn.state.lengths_m[0];
        let qd = Vector4::from_fn(|_, _| draw.within(0.5));
        let mut b = SMatrix::<f64, DOF, 4>::zeros();
        b[(3, 0)] = 1.0;
        for wheel in [12, 13] {
            b[(wheel, 0)] = 1.0 / params.robot.wheel_radius_m;
        }
        for k in 0..3 {
            b[(6 + k, 1 + k)] = 1.0;
            b[(9 + k, 1 + k)] = 1.0;
        }
        let state = FloatingState {
            velocity: b * qd,
            ..FloatingState::at_rest([l, l])
        };
        let whole = plain.at(&state).unwrap();
        let half = half.at(&Vector4::new(0.0, l[0], l[1], l[2]), &qd).unwrap();
        let inertia = b.transpose() * whole.blocks.inertia() * b;
        worst = worst.max(relative(&inertia, &(half.inertia() * 2.0)));
        // Gravity across would not be alike on both legs.
        let gravity = Vector3::new(drawn.gravity.x, 0.0, drawn.gravity.z);
        let force = b.transpose() * (whole.bias(&gravity) - whole.blocks.dissipation());
        let expected = half
            .inverse(&Vector4::zeros(), &gravity, &Vector3::zeros())
            .unwrap();
        worst = worst.max(relative(&force, &(expected * 2.0)));
    }
    assert!(worst <= 1e-11, "{worst:e}");
}

#[test]
fn it_stands_on_wheels_and_feet_with_its_weight_on_them() {
    let params = FloatingParams::wheeleg_2003();
    let robot = FloatingRobot::new(&params).unwrap();
    let mut state = FloatingState::at_rest([[0.40, 0.10, 0.19]; 2]);
    state.position_m.z = params.robot.wheel_radius_m;
    let kin = robot.prepare(&state, &DOWN).unwrap();
    // MODEL.md section 9.2: 25 kg, mass centre 0.090 m ahead of the axle, 0.20 m high.
    let weight = 25.0 * 9.81;
    let com = kin.com_m();
    assert!((com.x - 0.090).abs() < 1e-3 && (com.z - 0.20).abs() < 1e-3);
    assert!(com.y.abs() < 1e-15);
    let points = kin.points_m();
    assert!(points[0].z.abs() < 1e-12 && (points[0] - points[1]).xz().norm() < 1e-12);
    // Moments about the axle share the weight out; the cylinders bear the soles' reaction.
    let foot = weight * com.x / points[0].x / 2.0;
    let up = |n: f64| Wrench::force(Vector3::new(0.0, 0.0, n));
    let contacts = Contacts {
        feet: [up(foot); 2],
        wheels: [up(0.5 * weight - foot); 2],
        ..Contacts::NONE
    };
    let force = robot
        .inverse(&state, &Velocity::zeros(), &DOWN, &contacts)
        .unwrap();
    assert!(force.fixed_rows::<6>(0).amax() < 1e-10, "{force}");
    let lift = foot - params.robot.leg_bodies[5].mass_kg * 9.81;
    for b6 in [8, 11] {
        assert!((force[b6] - lift).abs() < 1e-10, "{force}");
    }
}

#[test]
fn a_state_comes_back_from_json_bit_for_bit() {
    let mut draw = Draw::new(34);
    for _ in 0..100 {
        let state = draw.state();
        let text = serde_json::to_string(&state).unwrap();
        assert_eq!(serde_json::from_str::<FloatingState>(&text).unwrap(), state);
    }
}

#[test]
fn impossible_input_is_named() {
    let params = FloatingParams::wheeleg_2003();
    let fast = FloatingRobot::new(&params).unwrap();
    let plain = FloatingReference::new(&params).unwrap();
    let good = Draw::new(35).case();
    let both = |state: &FloatingState, force: &Velocity, g: &Vector3<f64>, c: &Contacts| {
        let slow = plain
            .at(state)
            .and_then(|s| s.forward(force, g, c))
            .unwrap_err();
        let quick = fast.forward(state, force, g, c).unwrap_err();
        assert_eq!(quick.to_string(), slow.to_string());
        quick.to_string()
    };
    let bad_state = |change: &dyn Fn(&mut FloatingState)| {
        let mut state = good.state;
        change(&mut state);
        both(&state, &good.force, &good.gravity, &good.contacts)
    };
    let nan = f64::NAN;
    assert_eq!(
        bad_state(&|s| s.position_m.y = nan),
        "position[1] = NaN is not finite"
    );
    assert_eq!(
        bad_state(&|s| s.lengths_m[1][0] = f64::INFINITY),
        "length[3] = inf is not finite"
    );
    assert_eq!(
        bad_state(&|s| s.wheel_rad[1] = nan),
        "wheel angle[1] = NaN is not finite"
    );
    assert_eq!(
        bad_state(&|s| s.velocity[13] = f64::NEG_INFINITY),
        "velocity[13] = -inf is not finite"
    );
    assert_eq!(
        bad_state(&|s| s.orientation.as_mut_unchecked().coords.z = nan),
        "orientation[2] = NaN is not finite"
    );
    assert_eq!(
        bad_state(&|s| s.orientation =
            UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(1.5, 0.0, 0.0, 0.0))),
        "orientation has norm 1.5, not 1"
    );
    for leg in 0..2 {
        let error = bad_state(&|s| s.lengths_m[leg][0] = 0.85);
        assert!(error.starts_with(&format!("leg {leg}: ")), "{error}");
        assert!(error.contains("0.85 m cannot close the loop"), "{error}");
        let mut state = good.state;
        state.lengths_m[leg][0] = 0.7838;
        assert!(matches!(
            fast.prepare(&state, &good.gravity),
            Err(DynamicsError::Leg {
                leg: at,
                source: KinematicsError::NoMomentArm { .. }
            }) if at == leg
        ));
    }
    let mut force = good.force;
    force[7] = nan;
    assert_eq!(
        both(&good.state, &force, &good.gravity, &good.contacts),
        "force[7] = NaN is not finite"
    );
    let gravity = Vector3::new(0.0, nan, 0.0);
    assert_eq!(
        both(&good.state, &good.force, &gravity, &good.contacts),
        "gravity[1] = NaN is not finite"
    );
    let mut contacts = good.contacts;
    contacts.wheels[0].force_n.z = nan;
    assert_eq!(
        both(&good.state, &good.force, &good.gravity, &contacts),
        "contact[17] = NaN is not finite"
    );
}

#[test]
fn impossible_robots_are_named() {
    let refused = |change: &dyn Fn(&mut FloatingParams)| {
        let mut params = FloatingParams::wheeleg_2003();
        change(&mut params);
        let error = FloatingRobot::new(&params).unwrap_err();
        assert_eq!(
            FloatingReference::new(&params).unwrap_err().to_string(),
            error.to_string()
        );
        error.to_string()
    };
    assert!(refused(&|p| p.track_m = 0.0).contains("track_m = 0"));
    assert!(refused(&|p| p.chassis_yaw_inertia_kg_m2 = 5.0).contains("chassis inertia = 5"));
    assert!(refused(&|p| p.wheel_transverse_inertia_kg_m2 = 1e-3).contains("wheel inertia"));
    assert!(refused(&|p| p.robot.leg_bodies[2].inertia_kg_m2[0] = 1.0).contains("inertia"));
    assert!(refused(&|p| p.robot.chassis_mass_kg = -1.0).contains("chassis_mass_kg = -1"));
    // Nothing turns with the wheel: its acceleration is undefined.
    let mut params = FloatingParams::wheeleg_2003();
    params.robot.wheel_inertia_kg_m2 = 0.0;
    params.robot.rotor_inertia_kg_m2 = 0.0;
    let case = Draw::new(36).case();
    let error = FloatingRobot::new(&params)
        .unwrap()
        .forward(&case.state, &case.force, &case.gravity, &case.contacts)
        .unwrap_err();
    assert_eq!(error, DynamicsError::Singular { pivot: 0.0 });
}

/// Ordinary numbers, and among them raw bits and edges of the format.
fn number(size: f64) -> impl Strategy<Value = f64> {
    prop_oneof![
        24 => -size..size,
        1 => any::<u64>().prop_map(f64::from_bits),
        1 => prop::sample::select(vec![
            0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN,
            f64::MIN_POSITIVE, 1e154, 1e160, 1e300,
        ]),
    ]
}

/// A finite answer, or a refusal with the refused value.
fn right<T>(
    answer: Result<T, DynamicsError>,
    is_finite: impl Fn(&T) -> bool,
) -> Result<Option<T>, TestCaseError> {
    match answer {
        Ok(answer) => {
            prop_assert!(is_finite(&answer));
            Ok(Some(answer))
        }
        Err(error) => {
            let named = match error {
                DynamicsError::NonFinite { value, .. } => !value.is_finite(),
                DynamicsError::NotUnit { norm } => (norm - 1.0).abs() > 1e-9,
                _ => true,
            };
            prop_assert!(named && !error.to_string().is_empty(), "{error:?}");
            Ok(None)
        }
    }
}

fn all_finite<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> bool {
    m.iter().all(|v| v.is_finite())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any bits give a finite acceleration or a refusal, in both models.
    #[test]
    fn no_input_gives_nan(
        b in prop::array::uniform6(prop_oneof![30 => 0.25..0.75_f64, 1 => number(1.0)]),
        q in prop::array::uniform4(-1.0..1.0_f64),
        position in prop::array::uniform3(number(3.0)),
        velocity in prop::array::uniform14(number(10.0)),
        force in prop::array::uniform14(number(1e3)),
        gravity in prop::array::uniform3(number(10.0)),
        contact in proptest::collection::vec(number(100.0), 30),
    ) {
        let params = FloatingParams::wheeleg_2003();
        let fast = FloatingRobot::new(&params).unwrap();
        let plain = FloatingReference::new(&params).unwrap();
        let [w, i, j, k] = q;
        let state = FloatingState {
            position_m: position.into(),
            orientation: UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, i, j, k)),
            velocity: velocity.into(),
            ..FloatingState::at_rest([[b[0], b[1], b[2]], [b[3], b[4], b[5]]])
        };
        let (force, gravity) = (Velocity::from(force), Vector3::from(gravity));
        let wrench = |at: usize| Wrench {
            moment_n_m: Vector3::from_column_slice(&contact[at..at + 3]),
            force_n: Vector3::from_column_slice(&contact[at + 3..at + 6]),
        };
        let contacts = Contacts {
            feet: [wrench(0), wrench(6)],
            wheels: [wrench(12), wrench(18)],
            chassis: wrench(24),
        };
        right(fast.prepare(&state, &gravity), |kin| {
            all_finite(&kin.bias()) && all_finite(&kin.mass_matrix())
        })?;
        right(fast.forward(&state, &force, &gravity, &contacts), all_finite)?;
        right(fast.inverse(&state, &force, &gravity, &contacts), all_finite)?;
        let blocks = |s: &wheeleg_plant::dynamics::floating::FloatingSystem| {
            s.blocks.bodies.iter().all(|b| all_finite(&b.t) && all_finite(&b.t_dot))
        };
        if let Some(system) = right(plain.at(&state), blocks)? {
            right(system.forward(&force, &gravity, &contacts), all_finite)?;
            right(system.inverse(&force, &gravity, &contacts), all_finite)?;
        }
    }
}
