//! Any bits as input: a finite answer or a refusal that names the value, never NaN, never a panic.
//! The same for both scalars that are used: `f32` on the master, `f64` in the plant.

use nalgebra::{RealField, Vector3};
use proptest::prelude::*;
use wheeleg_kinematics::{
    FootState, KinematicsError, LegGeometry, LegLengths, LegParameters, Phi, Theta3, r2p::R2p,
    rpr::Rpr, wrap_pi, wrap_two_pi,
};

/// All entry points for one scalar: `$number` is a strategy for single numbers.
macro_rules! entry_points {
    ($name:ident, $scalar:ty, $bits:ty) => {
        mod $name {
            use super::*;

            type T = $scalar;

            /// Raw bits, edges of the format, ordinary numbers.
            fn number() -> impl Strategy<Value = T> {
                let root = T::MAX.sqrt();
                prop_oneof![
                    3 => any::<$bits>().prop_map(T::from_bits),
                    1 => prop::sample::select(vec![
                        0.0, -0.0, T::NAN, T::INFINITY, T::NEG_INFINITY, T::MAX, T::MIN,
                        T::MIN_POSITIVE, T::from_bits(1), root, 1.0 / root, 2.0 * root, 1.0,
                    ]),
                    3 => -1.0..(1.0 as T),
                    2 => 0.3..(0.5 as T),
                ]
            }

            fn numbers<const N: usize>() -> impl Strategy<Value = [T; N]> {
                proptest::array::uniform(number())
            }

            fn finite<'a>(values: impl IntoIterator<Item = &'a T>) -> bool {
                values.into_iter().all(|v| v.is_finite())
            }

            /// The value that is carried is really one to refuse.
            fn named(error: &KinematicsError<T>) -> bool {
                let refused = match *error {
                    KinematicsError::NonFinite { value, .. } => !value.is_finite(),
                    KinematicsError::FootOnYawAxis { radius_m, minimum_m } => radius_m <= 0.0 || radius_m <= minimum_m,
                    // At the very ends rounding may leave a hair between value and limit.
                    KinematicsError::LoopOpen { b2_m, min_m, max_m } => {
                        b2_m <= min_m * 1.001 || b2_m >= max_m * 0.999
                    }
                    KinematicsError::NoMomentArm { cos_theta3, minimum } => {
                        cos_theta3.is_nan() || cos_theta3 < minimum
                    }
                    KinematicsError::OutsideStroke { length_m, min_m, max_m, .. } => {
                        length_m < min_m || length_m > max_m
                    }
                    KinematicsError::BadParameter { value } => value.is_finite(),
                };
                refused && !error.to_string().is_empty()
            }

            /// A finite answer, or a named refusal.
            fn right<A>(
                answer: Result<A, KinematicsError<T>>,
                is_finite: impl Fn(&A) -> bool,
            ) -> Result<Option<A>, TestCaseError> {
                match answer {
                    Ok(answer) => {
                        prop_assert!(is_finite(&answer));
                        Ok(Some(answer))
                    }
                    Err(error) => {
                        prop_assert!(named(&error), "{error:?}");
                        Ok(None)
                    }
                }
            }

            fn every_leg_function(
                geometry: &LegGeometry<T>,
                q: [T; 3],
                v: [T; 3],
                a: [T; 3],
            ) -> Result<(), TestCaseError> {
                let lengths = LegLengths::new(q[0], q[1], q[2]);
                let (v, a) = (Vector3::from(v), Vector3::from(a));
                right(geometry.check_strokes(&lengths), |()| finite(&q))?;
                right(geometry.phi_from_b2(q[0]), |phi| phi.rad().is_finite())?;
                let closed = |c: &wheeleg_kinematics::Closure<T>| {
                    finite(&[c.theta1_rad, c.b2_m, c.theta3.rad()])
                };
                right(geometry.closure_from_phi(Phi::new(q[0])), closed)?;
                right(geometry.closures_from_theta3(Theta3::new(q[0])), |c| {
                    c.iter().all(closed)
                })?;
                right(geometry.inverse(&Vector3::from(q)), |leg| {
                    finite(&leg.foot()) && finite(&leg.lengths.to_array())
                })?;
                let foot = FootState { position: Vector3::from(q), velocity: v, acceleration: a };
                right(geometry.inverse_motion(&foot), |m| {
                    finite(&m.lengths.to_array()) && finite(&m.rates) && finite(&m.accelerations)
                })?;
                let leg = right(geometry.posture(&lengths), |leg| {
                    let x = leg.joints();
                    let angles = [x.theta1_rad, x.theta3.rad(), x.theta4_rad, leg.phi().rad()];
                    finite(&leg.foot())
                        && finite(&leg.n())
                        && finite(&leg.foot_jacobian())
                        && finite(&angles)
                })?;
                if let Some(leg) = leg {
                    right(leg.joint_rates(&v), |x| finite(x))?;
                    right(leg.joint_accelerations(&v, &a), |x| finite(x))?;
                    right(leg.foot_state(&v, &a), |s| {
                        finite(&s.position) && finite(&s.velocity) && finite(&s.acceleration)
                    })?;
                }
                Ok(())
            }

            proptest! {
                #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

                #[test]
                fn the_leg(q in numbers::<3>(), v in numbers::<3>(), a in numbers::<3>()) {
                    let geometry = LegGeometry::new(LegParameters::<T>::wheeleg_2003()).unwrap();
                    every_leg_function(&geometry, q, v, a)?;
                    // One bad number among good ones reaches further.
                    for i in 0..3 {
                        let mut near = [0.4, 0.1, 0.1];
                        near[i] = q[i];
                        every_leg_function(&geometry, near, v, a)?;
                    }
                }

                #[test]
                fn any_dimensions(x in numbers::<11>(), q in numbers::<3>(), which in 0..12_usize) {
                    let mut p = LegParameters::<T>::wheeleg_2003();
                    let places = [
                        &mut p.crank_m, &mut p.min_foot_radius_m, &mut p.min_cos_theta3,
                    ];
                    let arrays = p.p4_m.iter_mut().chain(&mut p.stroke_zero_m).chain(&mut p.stroke_m);
                    for (i, place) in places.into_iter().chain(arrays).enumerate() {
                        // Number 11 spoils all of them.
                        if i == which || which == 11 {
                            *place = x[i];
                        }
                    }
                    if let Some(geometry) = right(LegGeometry::new(p), |_| true)? {
                        let (lo, hi) = geometry.closing_interval_m();
                        prop_assert!(finite(&[lo, hi]));
                        every_leg_function(&geometry, q, q, q)?;
                        every_leg_function(&geometry, [lo + (hi - lo) / 2.0, 0.1, 0.1], q, q)?;
                    }
                }

                #[test]
                fn the_chains(q in numbers::<3>(), v in numbers::<3>(), a in numbers::<3>(), p in numbers::<2>()) {
                    let (rates, accelerations) = (Vector3::from(v), Vector3::from(a));
                    let foot_chain = [
                        right(R2p::new(q[0], q[1], q[2]), |c| finite(&c.foot()) && finite(&c.jacobian()))?,
                        right(R2p::from_foot(&Vector3::from(q), p[0]), |c| {
                            finite(&c.foot()) && finite(&c.coordinates())
                        })?,
                    ];
                    for chain in foot_chain.into_iter().flatten() {
                        right(chain.twist(&rates), |t| finite(t))?;
                        right(chain.twist_dot(&rates, &accelerations), |t| finite(t))?;
                        right(chain.rates(&rates), |t| finite(t))?;
                        right(chain.accelerations(&rates, &accelerations), |t| finite(t))?;
                    }
                    for crank in [p[1], 0.29] {
                        let chain = Rpr::new(crank, q[0], q[1], Theta3::new(q[2]));
                        let chain = right(chain, |c| finite(&c.tip()) && finite(&c.jacobian()))?;
                        if let Some(chain) = chain {
                            right(chain.twist(&rates), |t| finite(t))?;
                            right(chain.twist_dot(&rates, &accelerations), |t| finite(t))?;
                        }
                    }
                }

                /// However many turns, a finite angle ends inside the range.
                #[test]
                fn angles(x in number()) {
                    let (half, whole) = (wrap_pi(x), wrap_two_pi(x));
                    if x.is_finite() {
                        let pi = T::pi();
                        prop_assert!(half > -pi && half <= pi, "{half}");
                        prop_assert!((0.0..T::two_pi()).contains(&whole), "{whole}");
                    } else {
                        prop_assert!(!half.is_finite() && !whole.is_finite());
                    }
                }
            }
        }
    };
}

entry_points!(single, f32, u32);
entry_points!(double, f64, u64);
