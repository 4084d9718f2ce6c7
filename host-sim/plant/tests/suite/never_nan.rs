//! Any bits as input of the dynamics: a finite answer or a typed refusal, never NaN, never a panic.

use crate::eight::dynamics::{RobotDynamics, RobotSide};
use crate::odd::{finite, lengths, named, number, numbers};
use nalgebra::{Vector3, Vector4};
use proptest::prelude::*;
use wheeleg_plant::dynamics::noc::{HalfRobot, Leg, System, r2p, rpr};
use wheeleg_plant::dynamics::printed::tau_l_printed_58_64;
use wheeleg_plant::dynamics::{BodyParams, DynamicsError, HalfRobotParams, RobotDynamicsParams};

fn system<const B: usize, const N: usize>(
    system: Result<System<B, N>, DynamicsError>,
    force: [f64; N],
    gravity: [f64; 3],
    contact: [f64; 3],
) -> Result<(), TestCaseError> {
    let system = match system {
        Ok(system) => system,
        Err(error) => {
            prop_assert!(named(&error), "{error:?}");
            return Ok(());
        }
    };
    for body in &system.bodies {
        prop_assert!(finite(body.t.iter().chain(&body.t_dot)));
        prop_assert!(finite(body.m.iter().chain(&body.w)));
    }
    prop_assert!(finite(&system.foot_jacobian));
    let (gravity, contact) = (gravity.into(), contact.into());
    for answer in [
        system.inverse(&force.into(), &gravity, &contact),
        system.forward(&force.into(), &gravity, &contact),
    ] {
        match answer {
            Ok(answer) => prop_assert!(finite(&answer)),
            Err(error) => prop_assert!(named(&error), "{error:?}"),
        }
    }
    Ok(())
}

fn half() -> HalfRobotParams {
    RobotDynamicsParams::wheeleg_2003().half()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn chains(q in numbers::<3>(), v in numbers::<3>(), f in numbers::<3>(), g in numbers::<3>(), crank in number()) {
        let [a, b, c, d, e, h] = half().leg_bodies;
        system(r2p(&[d, e, h], &q.into(), &v.into()), f, g, g)?;
        system(rpr(0.29, &[a, b, c], &q.into(), &v.into()), f, g, g)?;
        system(rpr(crank, &[a, b, c], &q.into(), &v.into()), f, g, g)?;
    }

    #[test]
    fn chains_of_any_mass(m in numbers::<7>(), f in numbers::<3>()) {
        let body = BodyParams {
            mass_kg: m[0],
            com_m: [m[1], m[2], m[3]],
            inertia_kg_m2: [m[4], m[5], m[6]],
        };
        let (q, v) = (Vector3::new(1.5, 0.1, 0.1), Vector3::new(0.3, 0.2, -0.1));
        system(r2p(&[body; 3], &q, &v), f, [0.0, 0.0, -9.81], [0.0; 3])?;
        system(rpr(0.29, &[body; 3], &q, &v), f, [0.0, 0.0, -9.81], [0.0; 3])?;
    }

    #[test]
    fn leg(q in lengths(), v in numbers::<3>(), f in numbers::<3>(), g in numbers::<3>(), c in numbers::<3>()) {
        let p = half();
        let leg = Leg::new(p.leg_parameters(), &p.leg_bodies, [20.0, 15.0, 15.0]).unwrap();
        let (q, v) = (Vector3::from(q), Vector3::from(v));
        system(leg.at(&q, &v), f, g, c)?;
        if let Ok(places) = leg.placements(&q) {
            prop_assert!(places.iter().all(|p| finite(&p.com_m) && finite(&p.rotation)));
        }
        if let Ok(foot) = leg.foot(&q) {
            prop_assert!(finite(&foot));
        }
        match tau_l_printed_58_64(&leg, &q, &v, &f.into()) {
            Ok(tau) => prop_assert!(finite(&tau)),
            Err(error) => prop_assert!(named(&error), "{error:?}"),
        }
    }

    #[test]
    fn half_robot(q in lengths(), s in number(), v in numbers::<4>(), f in numbers::<4>(), g in numbers::<3>()) {
        let robot = HalfRobot::new(&half()).unwrap();
        let q = Vector4::new(s, q[0], q[1], q[2]);
        system(robot.at(&q, &v.into()), f, g, g)?;
    }

    #[test]
    fn half_robot_of_any_parameters(x in numbers::<14>(), which in 0..14_usize) {
        let mut p = half();
        let [x4, y4] = &mut p.p4_m;
        let [_, _, b3, _, b5, b6] = &mut p.leg_bodies;
        let [_, _, _, v6] = &mut p.viscous_n_s_m;
        let places = [
            &mut p.crank_m, x4, y4, &mut p.min_cos_theta3,
            &mut b3.mass_kg, &mut b5.com_m[1],
            &mut b6.inertia_kg_m2[2], &mut p.chassis_mass_kg, &mut p.wheel_mass_kg,
            &mut p.wheel_radius_m, &mut p.wheel_inertia_kg_m2, &mut p.rotor_inertia_kg_m2,
            &mut p.gear_ratio, v6,
        ];
        for (i, place) in places.into_iter().enumerate() {
            if i == which {
                *place = x[i];
            }
        }
        match HalfRobot::new(&p) {
            Ok(robot) => {
                let state = robot.at(&Vector4::new(0.0, 0.4, 0.1, 0.1), &Vector4::repeat(0.2));
                system(state, [x[0]; 4], [0.0, 0.0, -9.81], [0.0; 3])?;
            }
            Err(error) => prop_assert!(named(&error), "{error:?}"),
        }
    }

    #[test]
    fn robot(l in lengths(), r in lengths(), s in number(), pitch in number(), v in numbers::<8>(), f in numbers::<8>(), foot in numbers::<3>()) {
        let robot = RobotDynamics::new(&RobotDynamicsParams::wheeleg_2003()).unwrap();
        let q = [s, pitch, l[0], l[1], l[2], r[0], r[1], r[2]];
        match robot.prepare(&q, &v) {
            Ok(kin) => {
                prop_assert!(finite(&kin.bias()) && finite(&kin.com_m()));
                prop_assert!(finite(kin.mass_matrix().iter().flatten()));
                for side in &kin.feet {
                    prop_assert!(finite(&side.position_m) && finite(&side.velocity_m_s));
                    prop_assert!(finite(side.jacobian.iter().flatten()));
                }
                let mut force = f;
                kin.add_foot_force(RobotSide::Right, &foot, &mut force);
                match kin.solve(&force) {
                    Ok(a) => prop_assert!(finite(&a)),
                    Err(error) => prop_assert!(named(&error), "{error:?}"),
                }
            }
            Err(error) => prop_assert!(named(&error), "{error:?}"),
        }
        match robot.accelerations(&q, &v, &f) {
            Ok(a) => prop_assert!(finite(&a)),
            Err(error) => prop_assert!(named(&error), "{error:?}"),
        }
    }
}
