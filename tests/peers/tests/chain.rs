//! The chain engine: check values found by independent programs, the leg against the natural
//! orthogonal complement, and laws of mechanics over random states.

use nalgebra::{SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use wheeleg_peers::chain::reference::{
    GRAVITY_M_S2, LegState, ROBOT14, RPP, RPR, leg_states, robot_state, rpp_dense, weighted,
};
use wheeleg_peers::chain::{
    ChainLeg, DENSE, End, Fixed, Floating, FloatingState, LinkParams, Px, Py, Pz, Rx, Ry, Rz,
};
use wheeleg_plant::dynamics::noc::Leg;
use wheeleg_plant::dynamics::{BodyParams, DynamicsError, RobotDynamicsParams};

const STATES: usize = 1000;

const RPP_TURNS: [bool; 3] = [true, false, false];
const RPR_TURNS: [bool; 3] = [true, false, true];

type Legwise = fn(&LegState) -> Result<[f64; 3], DynamicsError>;

fn total(turns: [bool; 3], f: Legwise) -> f64 {
    leg_states(turns)
        .iter()
        .map(|s| weighted(&f(s).unwrap()))
        .sum()
}

/// Sums that the C reference, CasADi, Pinocchio, KDL, MuJoCo, PyBullet and Drake print alike, to
/// all their decimals.
#[test]
fn reference_legs_give_the_check_values() {
    let cases: [(&str, [bool; 3], Legwise, f64, f64); 4] = [
        (
            "RPP inverse",
            RPP_TURNS,
            |s| RPP.inverse(&s.q, &s.v, &s.a, &GRAVITY_M_S2),
            16615.296029922,
            5e-10,
        ),
        (
            "RPR inverse",
            RPR_TURNS,
            |s| RPR.inverse(&s.q, &s.v, &s.a, &GRAVITY_M_S2),
            10957.805119700,
            5e-10,
        ),
        (
            "RPP forward",
            RPP_TURNS,
            |s| RPP.forward(&s.q, &s.v, &s.a, &GRAVITY_M_S2),
            -17827.297042,
            5e-7,
        ),
        (
            "RPR forward",
            RPR_TURNS,
            |s| RPR.forward(&s.q, &s.v, &s.a, &GRAVITY_M_S2),
            -73047.666571,
            5e-7,
        ),
    ];
    for (name, turns, f, expected, tolerance) in cases {
        let sum = total(turns, f);
        assert!((sum - expected).abs() <= tolerance, "{name}: {sum:.9}");
    }
}

#[test]
fn reference_legs_fall_as_they_should() {
    type Forward = fn(&[f64; 3], &[f64; 3]) -> Result<[f64; 3], DynamicsError>;
    let cases: [(Forward, [f64; 3]); 2] = [
        (
            |q, v| RPP.forward(q, v, &[0.0; 3], &GRAVITY_M_S2),
            [0.265675, -0.185290, -0.061227],
        ),
        (
            |q, v| RPR.forward(q, v, &[0.0; 3], &GRAVITY_M_S2),
            [0.253058, -0.193998, -0.039742],
        ),
    ];
    for (forward, expected) in cases {
        let (mut q, mut v) = ([0.0; 3], [1.0, 0.0, 0.0]);
        for _ in 0..200 {
            let a = forward(&q, &v).unwrap();
            for i in 0..3 {
                v[i] += 1e-3 * a[i];
                q[i] += 1e-3 * v[i];
            }
        }
        for i in 0..3 {
            assert!((q[i] - expected[i]).abs() <= 5e-7, "{q:?} {expected:?}");
        }
    }
}

/// Sum of the first accelerations over 60 001 states; the generated C prints -751.510.
#[test]
fn reference_robot_gives_the_check_value() {
    let sum: f64 = (0..60_001)
        .map(|r| {
            let state = robot_state(1e-6 * f64::from(r));
            ROBOT14
                .forward(&state, &[1.0; 14], &[0.0, 0.0, -9.81])
                .unwrap()[0]
        })
        .sum();
    assert!((sum - -751.510).abs() <= 5e-4, "{sum}");
}

#[test]
fn patterns_change_nothing() {
    let dense = rpp_dense().unwrap();
    for s in leg_states(RPP_TURNS) {
        let sparse = RPP.inverse(&s.q, &s.v, &s.a, &GRAVITY_M_S2).unwrap();
        let full = dense.inverse(&s.q, &s.v, &s.a, &GRAVITY_M_S2).unwrap();
        close("inverse", &sparse, &full, 1e-13);
        let sparse = RPP.forward(&s.q, &s.v, &s.a, &GRAVITY_M_S2).unwrap();
        let full = dense.forward(&s.q, &s.v, &s.a, &GRAVITY_M_S2).unwrap();
        close("forward", &sparse, &full, 1e-12);
    }
}

/// Largest difference relative to the largest entry, or to 1.
fn close<const N: usize>(what: &str, a: &[f64; N], b: &[f64; N], tolerance: f64) {
    let size = b.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
    for i in 0..N {
        let error = (a[i] - b[i]).abs() / size;
        assert!(error <= tolerance, "{what}[{i}]: {error:e}, {a:?} {b:?}");
    }
}

fn random() -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(20_030_003)
}

fn draw<const N: usize>(random: &mut Pcg64Mcg, size: f64) -> [f64; N] {
    std::array::from_fn(|_| random.random_range(-size..size))
}

/// The robot's leg through the engine against the paper's method, block by block.
#[test]
fn own_leg_agrees_with_the_natural_orthogonal_complement() {
    let p = RobotDynamicsParams::wheeleg_2003();
    let viscous = [20.0, 15.0, 12.0];
    // The robot's bodies, and bodies with mass centres in general positions.
    let mut skew = p.leg_bodies;
    for (i, body) in skew.iter_mut().enumerate() {
        let k = 0.01 * (i as f64 + 1.0);
        *body = BodyParams {
            mass_kg: 0.3 + k,
            com_m: [0.05 - k, 0.02 + k, -0.03 - 2.0 * k],
            inertia_kg_m2: [2e-3 + 0.1 * k, 1e-3 + 0.2 * k, 3e-3],
        };
    }
    let mut random = random();
    for bodies in [p.leg_bodies, skew] {
        let noc = Leg::new(p.leg_parameters(), &bodies, viscous).unwrap();
        let chain = ChainLeg::new(p.leg_parameters(), &bodies, viscous).unwrap();
        for _ in 0..STATES {
            let q = [
                random.random_range(0.31..0.49),
                random.random_range(0.01..0.19),
                random.random_range(0.01..0.19),
            ];
            let (v, a): ([f64; 3], [f64; 3]) = (draw(&mut random, 0.5), draw(&mut random, 3.0));
            let (g, f): ([f64; 3], [f64; 3]) = (draw(&mut random, 9.0), draw(&mut random, 60.0));
            let system = noc.at(&q.into(), &v.into()).unwrap();
            let expected = system.inverse(&a.into(), &g.into(), &f.into()).unwrap();
            let tau = chain.inverse(&q, &v, &a, &g, &f).unwrap();
            let error = (Vector3::from(tau) - expected).amax();
            assert!(error <= 1e-11, "inverse: {error:e} at {q:?}");

            let inertia = SMatrix::<f64, 3, 3>::from(chain.inertia(&q).unwrap());
            let error = (inertia - system.inertia()).amax();
            assert!(error <= 1e-11, "inertia: {error:e} at {q:?}");

            let force = draw(&mut random, 100.0);
            let expected = system.forward(&force.into(), &g.into(), &f.into()).unwrap();
            let got = chain.forward(&q, &v, &force, &g, &f).unwrap();
            close("forward", &got, &expected.into(), 1e-11);
        }
    }
}

/// A link with nothing zero.
fn body(random: &mut Pcg64Mcg) -> LinkParams {
    LinkParams {
        origin_m: draw(random, 0.3),
        mass_kg: random.random_range(0.3..2.0),
        com_m: draw(random, 0.1),
        moments_kg_m2: std::array::from_fn(|_| random.random_range(0.004..0.006)),
        products_kg_m2: draw(random, 5e-4),
    }
}

type Branch = Py<DENSE, Rz<DENSE, Px<DENSE>>>;
type Tree = Rx<DENSE, (Ry<DENSE, Pz<DENSE>>, Branch)>;

/// All six kinds of joint, with a branch.
fn tree(random: &mut Pcg64Mcg) -> Tree {
    let first = Ry::new(&body(random), Pz::new(&body(random), End).unwrap()).unwrap();
    let third = Rz::new(&body(random), Px::new(&body(random), End).unwrap()).unwrap();
    let second = Py::new(&body(random), third).unwrap();
    Rx::new(&body(random), (first, second)).unwrap()
}

type FixedTree = Fixed<Tree, 6>;
type FreeTree = Floating<DENSE, Tree, 6, 12>;

fn fixed_tree() -> FixedTree {
    Fixed::new(tree(&mut random()))
}

fn free_tree() -> FreeTree {
    let mut random = random();
    let base = LinkParams {
        origin_m: [0.0; 3],
        ..body(&mut random)
    };
    Floating::new(&base, tree(&mut random)).unwrap()
}

fn free_state(random: &mut Pcg64Mcg) -> FloatingState<6, 12> {
    let quaternion = SVector::<f64, 4>::from(draw(random, 1.0)).normalize();
    FloatingState {
        quaternion: quaternion.into(),
        joints: draw(random, 1.5),
        rates: draw(random, 2.0),
    }
}

#[test]
fn inverse_is_linear_in_accelerations_with_the_mass_matrix() {
    let (fixed, free, mut random) = (fixed_tree(), free_tree(), random());
    let none = [0.0; 3];
    for _ in 0..STATES {
        let (q, a): ([f64; 6], [f64; 6]) = (draw(&mut random, 1.5), draw(&mut random, 5.0));
        let m = SMatrix::from(fixed.mass_matrix(&q).unwrap());
        let tau = fixed.inverse(&q, &[0.0; 6], &a, &none).unwrap();
        close("fixed", &tau, &(m * SVector::from(a)).into(), 1e-13);
        assert!(m.cholesky().is_some() && m == m.transpose());

        let mut state = free_state(&mut random);
        let a: [f64; 12] = draw(&mut random, 5.0);
        let m = SMatrix::from(free.mass_matrix(&state.joints).unwrap());
        state.rates = [0.0; 12];
        let tau = free.inverse(&state, &a, &none).unwrap();
        close("free", &tau, &(m * SVector::from(a)).into(), 1e-13);
        assert!(m.cholesky().is_some() && m == m.transpose());
    }
}

#[test]
fn forward_undoes_inverse() {
    let (fixed, free, mut random) = (fixed_tree(), free_tree(), random());
    for _ in 0..STATES {
        let (q, v): ([f64; 6], [f64; 6]) = (draw(&mut random, 1.5), draw(&mut random, 2.0));
        let (a, g): ([f64; 6], [f64; 3]) = (draw(&mut random, 5.0), draw(&mut random, 10.0));
        let tau = fixed.inverse(&q, &v, &a, &g).unwrap();
        close(
            "fixed",
            &fixed.forward(&q, &v, &tau, &g).unwrap(),
            &a,
            1e-10,
        );

        let state = free_state(&mut random);
        let a: [f64; 12] = draw(&mut random, 5.0);
        let tau = free.inverse(&state, &a, &g).unwrap();
        close("free", &free.forward(&state, &tau, &g).unwrap(), &a, 1e-10);
    }
}

/// d/dt ½ vᵀMv = vᵀ(τ − g(q)): the velocity terms do no work beyond Ṁ's.
#[test]
fn power_of_the_forces_is_the_rate_of_energy() {
    let (fixed, mut random) = (fixed_tree(), random());
    let none = [0.0; 3];
    for _ in 0..STATES {
        let (q, v): ([f64; 6], [f64; 6]) = (draw(&mut random, 1.5), draw(&mut random, 2.0));
        let (a, g): ([f64; 6], [f64; 3]) = (draw(&mut random, 5.0), draw(&mut random, 10.0));
        let energy = |h: f64| {
            let q = std::array::from_fn(|i| q[i] + h * (v[i] + 0.5 * h * a[i]));
            let v = SVector::<f64, 6>::from_fn(|i, _| v[i] + h * a[i]);
            0.5 * v.dot(&(SMatrix::from(fixed.mass_matrix(&q).unwrap()) * v))
        };
        let h = 1e-4;
        let rate =
            (8.0 * (energy(h) - energy(-h)) - (energy(2.0 * h) - energy(-2.0 * h))) / (12.0 * h);
        let tau = SVector::from(fixed.inverse(&q, &v, &a, &g).unwrap());
        let weight = SVector::from(fixed.inverse(&q, &[0.0; 6], &[0.0; 6], &g).unwrap());
        let power = SVector::from(v).dot(&(tau - weight));
        // Without gravity the weight is nothing.
        assert_eq!(
            fixed.inverse(&q, &[0.0; 6], &[0.0; 6], &none).unwrap(),
            [0.0; 6]
        );
        let error = (rate - power).abs();
        assert!(error <= 1e-8 * power.abs().max(10.0), "{rate} {power}");
    }
}

/// Total energy of the fixed tree over 0.5 s without joint forces; potential energy is the work of
/// the weight, integrated along.
#[test]
fn energy_does_not_drift() {
    let fixed = fixed_tree();
    let g = [-3.355, 0.0, -9.218];
    let rhs = |x: &SVector<f64, 13>| {
        let q: [f64; 6] = std::array::from_fn(|i| x[i]);
        let v: [f64; 6] = std::array::from_fn(|i| x[6 + i]);
        let a = fixed.forward(&q, &v, &[0.0; 6], &g).unwrap();
        let weight = fixed.inverse(&q, &[0.0; 6], &[0.0; 6], &g).unwrap();
        let work: f64 = (0..6).map(|i| v[i] * weight[i]).sum();
        SVector::<f64, 13>::from_fn(|i, _| match i {
            0..6 => v[i],
            6..12 => a[i - 6],
            _ => work,
        })
    };
    let energy = |x: &SVector<f64, 13>| {
        let q: [f64; 6] = std::array::from_fn(|i| x[i]);
        let v = SVector::<f64, 6>::from_fn(|i, _| x[6 + i]);
        0.5 * v.dot(&(SMatrix::from(fixed.mass_matrix(&q).unwrap()) * v)) + x[12]
    };
    let mut x = SVector::<f64, 13>::zeros();
    x[6] = 1.0;
    let (start, h) = (energy(&x), 1e-4);
    let mut moved = 0.0_f64;
    for _ in 0..5000 {
        let k1 = rhs(&x);
        let k2 = rhs(&(x + 0.5 * h * k1));
        let k3 = rhs(&(x + 0.5 * h * k2));
        let k4 = rhs(&(x + h * k3));
        x += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
        moved = moved.max(x[12].abs());
    }
    let drift = (energy(&x) - start).abs();
    assert!(moved > 1.0, "nothing happened: {moved} J");
    assert!(drift < 1e-8 * moved, "{drift} J of {moved} J");
}

/// Free fall: momentum and angular momentum about the base, turned into world axes, are kept.
#[test]
fn a_free_tree_keeps_its_momentum() {
    let (free, mut random) = (free_tree(), random());
    let rotate = |q: &[f64; 4], v: [f64; 3]| {
        let [x, y, z, w] = *q;
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        turn * Vector3::from(v)
    };
    for _ in 0..50 {
        let state = free_state(&mut random);
        let a = free.forward(&state, &[0.0; 12], &[0.0; 3]).unwrap();
        // Momenta at the state carried on by h: rotation by ω h, velocities by their derivatives.
        let at = |h: f64| {
            let r = &state.rates;
            let [x, y, z, w] = state.quaternion;
            let spin = Vector3::new(
                r[3] + 0.5 * h * a[3],
                r[4] + 0.5 * h * a[4],
                r[5] + 0.5 * h * a[5],
            );
            let turned =
                nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
                    * nalgebra::UnitQuaternion::from_scaled_axis(spin * h);
            let quaternion = turned.coords.into();
            let joints: [f64; 6] =
                std::array::from_fn(|i| state.joints[i] + h * (r[6 + i] + 0.5 * h * a[6 + i]));
            let rates = SVector::<f64, 12>::from_fn(|i, _| r[i] + h * a[i]);
            let p = SMatrix::from(free.mass_matrix(&joints).unwrap()) * rates;
            let linear = rotate(&quaternion, [p[0], p[1], p[2]]);
            let angular = rotate(&quaternion, [p[3], p[4], p[5]]);
            let velocity = rotate(&quaternion, [rates[0], rates[1], rates[2]]);
            (linear, angular, velocity)
        };
        let h = 1e-5;
        let (low, here, high) = (at(-h), at(0.0), at(h));
        let force = (high.0 - low.0) / (2.0 * h);
        // The base point moves: dL/dt = −v × p.
        let moment = (high.1 - low.1) / (2.0 * h) + here.2.cross(&here.0);
        assert!(
            force.amax() < 1e-6 && moment.amax() < 1e-6,
            "{force} {moment}"
        );
        assert!(here.0.amax() > 1e-2);
    }
}

/// Gravity acts on a free tree as an acceleration of everything.
#[test]
fn a_free_tree_falls_with_g() {
    let (free, mut random) = (free_tree(), random());
    for _ in 0..STATES {
        let state = free_state(&mut random);
        let g = draw(&mut random, 10.0);
        let still = free.forward(&state, &[0.0; 12], &[0.0; 3]).unwrap();
        let falling = free.forward(&state, &[0.0; 12], &g).unwrap();
        let [x, y, z, w] = state.quaternion;
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let down = turn.inverse() * Vector3::from(g);
        let expected = std::array::from_fn(|i| still[i] + if i < 3 { down[i] } else { 0.0 });
        close("fall", &falling, &expected, 1e-11);
    }
}

/// With its base held, the free tree is the fixed one.
#[test]
fn a_held_base_is_a_fixed_base() {
    let mut random = random();
    let tree = tree(&mut random);
    let fixed: FixedTree = Fixed::new(tree);
    let base = LinkParams {
        origin_m: [0.0; 3],
        ..body(&mut random)
    };
    let free: FreeTree = Floating::new(&base, tree).unwrap();
    for _ in 0..STATES {
        let (q, v, a): ([f64; 6], [f64; 6], [f64; 6]) = (
            draw(&mut random, 1.5),
            draw(&mut random, 2.0),
            draw(&mut random, 5.0),
        );
        let g = draw(&mut random, 10.0);
        let behind = |x: [f64; 6]| std::array::from_fn(|i| if i < 6 { 0.0 } else { x[i - 6] });
        let state = FloatingState {
            quaternion: [0.0, 0.0, 0.0, 1.0],
            joints: q,
            rates: behind(v),
        };
        let tau = free.inverse(&state, &behind(a), &g).unwrap();
        let joints = std::array::from_fn(|i| tau[6 + i]);
        close(
            "joints",
            &joints,
            &fixed.inverse(&q, &v, &a, &g).unwrap(),
            1e-13,
        );
    }
}

#[test]
fn what_is_not_finite_is_named() {
    let (fixed, free) = (fixed_tree(), free_tree());
    let good = ([0.1; 6], [0.2; 6], [0.3; 6], [0.0, 0.0, -9.81]);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for i in 0..6 {
            let (mut q, mut v, mut a, mut g) = good;
            let named = |name: &str, result: Result<[f64; 6], DynamicsError>, i: usize| {
                let Err(DynamicsError::NonFinite {
                    name: n,
                    index,
                    value,
                }) = result
                else {
                    panic!("{name}[{i}] = {bad}: {result:?}");
                };
                assert!(n == name && index == i && value.to_bits() == bad.to_bits());
            };
            q[i] = bad;
            named("position", fixed.inverse(&q, &v, &a, &g), i);
            named("position", fixed.forward(&q, &v, &a, &g), i);
            assert!(matches!(
                fixed.mass_matrix(&q),
                Err(DynamicsError::NonFinite { index, .. }) if index == i
            ));
            q = good.0;
            v[i] = bad;
            named("velocity", fixed.inverse(&q, &v, &a, &g), i);
            named("velocity", fixed.forward(&q, &v, &a, &g), i);
            v = good.1;
            a[i] = bad;
            named("acceleration", fixed.inverse(&q, &v, &a, &g), i);
            named("force", fixed.forward(&q, &v, &a, &g), i);
            a = good.2;
            if i < 3 {
                g[i] = bad;
                named("gravity", fixed.inverse(&q, &v, &a, &g), i);
                named("gravity", fixed.forward(&q, &v, &a, &g), i);
            }
        }
        let mut state = FloatingState {
            quaternion: [0.0, 0.0, 0.0, 1.0],
            joints: [0.1; 6],
            rates: [0.2; 12],
        };
        state.quaternion[2] = bad;
        assert!(matches!(
            free.forward(&state, &[0.0; 12], &good.3),
            Err(DynamicsError::NonFinite {
                name: "quaternion",
                index: 2,
                ..
            })
        ));
        state.quaternion = [0.0, 0.0, 0.0, 1.0];
        state.rates[7] = bad;
        assert!(matches!(
            free.inverse(&state, &[0.0; 12], &good.3),
            Err(DynamicsError::NonFinite {
                name: "velocity",
                index: 7,
                ..
            })
        ));
        state.rates[7] = 0.0;
        state.quaternion[3] = 1.1;
        assert!(matches!(
            free.forward(&state, &[0.0; 12], &good.3),
            Err(DynamicsError::NotUnit { norm }) if (norm - 1.1).abs() < 1e-12
        ));
    }
    // Finite arguments too large for the arithmetic: an error or a finite answer, never NaN.
    for size in [1e90, 1e160, 1e307] {
        for result in [
            fixed.inverse(&[size; 6], &[size; 6], &[size; 6], &[size; 3]),
            fixed.forward(&[0.1; 6], &[size; 6], &[size; 6], &[size; 3]),
        ] {
            match result {
                Ok(values) => assert!(values.iter().all(|x| x.is_finite())),
                Err(error) => assert!(matches!(
                    error,
                    DynamicsError::NonFinite { .. } | DynamicsError::Singular { .. }
                )),
            }
        }
    }
}

#[test]
fn impossible_bodies_are_refused() {
    let good = body(&mut random());
    let build = |params: &LinkParams| Rx::<DENSE>::new(params, End).map(drop);
    assert_eq!(build(&good), Ok(()));
    let refused = |params: LinkParams, field: &str, bad: f64| {
        let Err(DynamicsError::Parameter { name, value }) = build(&params) else {
            panic!("{field} = {bad} was accepted");
        };
        assert!(name == field && value.to_bits() == bad.to_bits());
    };
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        refused(
            LinkParams {
                mass_kg: bad,
                ..good
            },
            "mass_kg",
            bad,
        );
        let moments_kg_m2 = [0.004, bad, 0.004];
        refused(
            LinkParams {
                moments_kg_m2,
                ..good
            },
            "moments_kg_m2",
            bad,
        );
    }
    let com_m = [f64::NAN, 0.0, 0.0];
    refused(LinkParams { com_m, ..good }, "com_m", f64::NAN);
    // A value where the type promises a zero.
    let flat = LinkParams {
        com_m: [0.1, 0.0, 0.0],
        products_kg_m2: [0.0; 3],
        ..good
    };
    const FLAT: u16 = 0b000_001_111;
    assert_eq!(flat.pattern(), FLAT);
    assert!(Rx::<FLAT>::new(&flat, End).is_ok());
    assert!(matches!(
        Rx::<FLAT>::new(&LinkParams { com_m: [0.1, 0.2, 0.0], ..flat }, End),
        Err(DynamicsError::Parameter { name: "com_m", value }) if value == 0.2
    ));
    // A joint that moves no mass cannot be accelerated.
    let empty = LinkParams {
        mass_kg: 0.0,
        moments_kg_m2: [0.0; 3],
        products_kg_m2: [0.0; 3],
        ..good
    };
    let chain: Fixed<Px<DENSE>, 1> = Fixed::new(Px::new(&empty, End).unwrap());
    assert_eq!(
        chain.forward(&[0.0], &[0.0], &[1.0], &[0.0; 3]),
        Err(DynamicsError::Singular { pivot: 0.0 })
    );
}
