//! Random states of the floating robot, and differentiation along a motion.

use nalgebra::{Quaternion, SVector, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::dynamics::floating::{
    Contacts, FloatingParams, FloatingState, Velocity, Wrench,
};

/// Random states per law.
pub(crate) const STATES: usize = 1000;

/// The robot without any friction.
pub(crate) fn frictionless() -> FloatingParams {
    let mut p = FloatingParams::wheeleg_2003();
    p.robot.viscous = [0.0; 8];
    p
}

/// The robot with friction in every joint.
pub(crate) fn rubbing() -> FloatingParams {
    let mut p = FloatingParams::wheeleg_2003();
    p.robot.viscous = [4.0, 0.0, 20.0, 15.0, 14.0, 21.0, 16.0, 13.0];
    p
}

/// A state with everything that acts on it.
pub(crate) struct Case {
    pub(crate) state: FloatingState,
    pub(crate) acceleration: Velocity,
    pub(crate) force: Velocity,
    pub(crate) gravity: Vector3<f64>,
    pub(crate) contacts: Contacts,
}

/// Source of random cases.
pub(crate) struct Draw(Pcg64Mcg);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    pub(crate) fn within(&mut self, size: f64) -> f64 {
        self.0.random_range(-size..size)
    }

    pub(crate) fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(size))
    }

    fn wrench(&mut self) -> Wrench {
        Wrench {
            moment_n_m: self.vector(20.0),
            force_n: self.vector(100.0),
        }
    }

    /// Any attitude, all strokes; 2 rad/s, 1 m/s, 0.5 m/s in the cylinders, 10 rad/s in the wheels.
    pub(crate) fn state(&mut self) -> FloatingState {
        let mut normal = || StandardNormal.sample(&mut self.0);
        let q = Quaternion::new(normal(), normal(), normal(), normal());
        let leg = |rng: &mut Pcg64Mcg| {
            [
                rng.random_range(0.31..0.49),
                rng.random_range(0.01..0.19),
                rng.random_range(0.01..0.19),
            ]
        };
        let lengths_m = [leg(&mut self.0), leg(&mut self.0)];
        let sizes = [2.0, 1.0, 0.5, 0.5, 10.0];
        FloatingState {
            position_m: self.vector(3.0),
            orientation: UnitQuaternion::new_normalize(q),
            lengths_m,
            wheel_rad: [self.within(3.0), self.within(3.0)],
            velocity: self.sized(sizes),
        }
    }

    /// Angular, linear, left and right leg, wheels.
    pub(crate) fn sized(&mut self, size: [f64; 5]) -> Velocity {
        SVector::from_fn(|i, _| {
            let group = [3, 6, 9, 12, 14].iter().position(|end| i < *end);
            self.within(size[group.expect("fourteen entries")])
        })
    }

    pub(crate) fn case(&mut self) -> Case {
        Case {
            state: self.state(),
            acceleration: self.sized([20.0, 10.0, 10.0, 10.0, 50.0]),
            force: self.sized([20.0, 100.0, 200.0, 200.0, 10.0]),
            gravity: self.vector(10.0),
            contacts: Contacts {
                feet: [self.wrench(), self.wrench()],
                wheels: [self.wrench(), self.wrench()],
                chassis: self.wrench(),
            },
        }
    }
}

/// The state `t` seconds along a motion of constant ν̇.
pub(crate) fn along(state: &FloatingState, acceleration: &Velocity, t: f64) -> FloatingState {
    // Runge–Kutta on the position alone: ν(t) is known.
    let rate = |s: FloatingState| s.position_rate();
    let at = |s: FloatingState, time: f64| FloatingState {
        velocity: state.velocity + acceleration * time,
        ..s
    };
    let still = Velocity::zeros();
    let k1 = rate(*state);
    let k2 = rate(at(state.moved(&(k1 * (0.5 * t)), &still), 0.5 * t));
    let k3 = rate(at(state.moved(&(k2 * (0.5 * t)), &still), 0.5 * t));
    let k4 = rate(at(state.moved(&(k3 * t), &still), t));
    let change = (k1 + (k2 + k3) * 2.0 + k4) * (t / 6.0);
    at(state.moved(&change, &still), t)
}

/// Derivative at 0, sixth-order central differences 1 ms apart.
pub(crate) fn derivative<T>(f: impl Fn(f64) -> T) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    derivative_over(1e-3, f)
}

/// The same with the differences `h` apart.
pub(crate) fn derivative_over<T>(h: f64, f: impl Fn(f64) -> T) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let pair = |k: f64| f(k * h) - f(-k * h);
    (pair(1.0) * 45.0 - pair(2.0) * 9.0 + pair(3.0)) * (1.0 / (60.0 * h))
}
