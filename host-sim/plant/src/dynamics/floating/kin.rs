//! The floating robot at one state: its mass matrix, bias and contacts, and the accelerations that
//! follow. Conventions: [`super`].

use nalgebra::{Matrix3, SMatrix, Vector3};
use wheeleg_kinematics::LegPosture;

use super::contact::{Contacts, Wrench};
use super::group::Sym3;
use super::leg::{LegTerms, joined};
use super::mirror;
use super::solve::{MIRROR, Packed, add_mirrored, assemble, at, eliminate, solve_block};
use super::state::{DOF, LEG, Velocity, WHEEL};
use crate::both::{Both, Number, same};
use crate::dynamics::error::{DynamicsError, finite};

/// Linear momentum, and angular momentum about the mass centre, in world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Momentum {
    /// kg m/s.
    pub linear_kg_m_s: Vector3<f64>,
    /// kg m²/s.
    pub angular_kg_m2_s: Vector3<f64>,
}

/// Everything that depends only on position and velocity.
#[derive(Debug, Clone, Copy)]
pub struct FloatingKin {
    pub(super) rotation: Matrix3<f64>,
    pub(super) position: Vector3<f64>,
    pub(super) postures: [LegPosture<f64>; 2],
    pub(super) soles: [Vector3<f64>; 2],
    pub(super) half_track: f64,
    pub(super) legs: LegTerms,
    pub(super) leg_masses: [f64; 2],
    pub(super) mass: f64,
    pub(super) first: Vector3<f64>,
    pub(super) inertia: Sym3,
    pub(super) spin: f64,
    pub(super) axle: f64,
    pub(super) base: [f64; 6],
    pub(super) velocity: Velocity,
    pub(super) viscous: Velocity,
}

impl FloatingKin {
    /// ν̇ for a generalised force that holds contacts already; viscous friction is added here.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], [`DynamicsError::Singular`].
    pub fn solve(&self, force: &Velocity) -> Result<Velocity, DynamicsError> {
        let f = force + self.dissipation();
        let t = &self.legs;
        let net = std::array::from_fn(|k| Both::new([f[LEG + k], f[LEG + 3 + k]]) - t.bias[k]);
        let (legs, block, side) = eliminate(t, self.leg_masses, net)?;
        let mut block = add_mirrored(&block);
        self.add_base(&mut block);
        // Wheels: both couple only with the pitch rate.
        if self.axle <= 0.0 {
            return Err(DynamicsError::Singular { pivot: self.axle });
        }
        let share = self.spin / self.axle;
        let wheels = [f[WHEEL], f[WHEEL + 1]];
        block[at(1, 1)] -= 2.0 * share * self.spin;
        let mut x: [f64; 6] = std::array::from_fn(|i| {
            let [left, right] = side[i].to_array();
            f[i] - self.base[i] + left + MIRROR[i] * right
        });
        x[1] -= share * (wheels[0] + wheels[1]);
        solve_block(&mut block, &mut x)?;
        let mirrored = std::array::from_fn(|i| Both::new([x[i], MIRROR[i] * x[i]]));
        let acceleration = assemble(
            &x,
            &one_by_one(&legs.follow(&mirrored)),
            wheels.map(|w| w / self.axle - share * x[1]),
        );
        let values: [f64; DOF] = acceleration.into();
        finite("acceleration", &values)?;
        Ok(acceleration)
    }

    /// Adds the 6 × 6 composite inertia \[J, h×; −h×, m\].
    #[inline]
    fn add_base(&self, block: &mut Packed) {
        let (j, h, m) = (&self.inertia, &self.first, self.mass);
        block[at(0, 0)] += j.xx;
        block[at(1, 0)] += j.xy;
        block[at(1, 1)] += j.yy;
        block[at(2, 0)] += j.xz;
        block[at(2, 1)] += j.yz;
        block[at(2, 2)] += j.zz;
        // Linear rows: p = m v + ω × h.
        block[at(3, 1)] += h.z;
        block[at(3, 2)] -= h.y;
        block[at(4, 0)] -= h.z;
        block[at(4, 2)] += h.x;
        block[at(5, 0)] += h.y;
        block[at(5, 1)] -= h.x;
        block[at(3, 3)] += m;
        block[at(4, 4)] += m;
        block[at(5, 5)] += m;
    }

    /// Mass matrix (kg, kg m, kg m²), symmetric.
    #[must_use]
    pub fn mass_matrix(&self) -> SMatrix<f64, DOF, DOF> {
        let mut m = SMatrix::zeros();
        let mut block = [0.0; 21];
        self.add_base(&mut block);
        let mut put = |i: usize, j: usize, value: f64| {
            m[(i, j)] = value;
            m[(j, i)] = value;
        };
        for i in 0..6 {
            for j in 0..=i {
                put(i, j, block[at(i, j)]);
            }
        }
        for leg in 0..2 {
            let (s, t) = (LEG + 3 * leg, LegMasses::of(&self.legs, leg));
            for (k, column) in t.columns.iter().enumerate() {
                for (i, value) in column.iter().enumerate() {
                    let sign = if leg == 0 { 1.0 } else { MIRROR[i] };
                    put(i, s + k, sign * value);
                }
            }
            put(s, s, t.d22);
            put(s + 1, s, t.d25);
            put(s + 1, s + 1, self.leg_masses[0]);
            put(s + 2, s + 2, self.leg_masses[1]);
        }
        for wheel in WHEEL..DOF {
            put(wheel, 1, self.spin);
            put(wheel, wheel, self.axle);
        }
        m
    }

    /// I a.
    #[must_use]
    pub fn times_mass(&self, a: &Velocity) -> Velocity {
        let (omega, v) = (
            a.fixed_rows::<3>(0).into_owned(),
            a.fixed_rows::<3>(3).into_owned(),
        );
        let mut angular = self.inertia.times(&omega) + self.first.cross(&v);
        angular.y += self.spin * (a[WHEEL] + a[WHEEL + 1]);
        let mut base = joined(&angular, &(self.mass * v + omega.cross(&self.first)));
        let mut legs = [[0.0; 3]; 2];
        for (leg, forces) in legs.iter_mut().enumerate() {
            let (s, t) = (LEG + 3 * leg, LegMasses::of(&self.legs, leg));
            let [m56, m6] = self.leg_masses;
            let own = [a[s], a[s + 1], a[s + 2]];
            *forces = [
                t.d22 * own[0] + t.d25 * own[1],
                t.d25 * own[0] + m56 * own[1],
                m6 * own[2],
            ];
            for (k, column) in t.columns.iter().enumerate() {
                for i in 0..6 {
                    let entry = if leg == 0 { 1.0 } else { MIRROR[i] } * column[i];
                    base[i] += entry * own[k];
                    forces[k] += entry * a[i];
                }
            }
        }
        let wheels = [a[WHEEL], a[WHEEL + 1]].map(|w| self.axle * w + self.spin * omega.y);
        assemble(&base, &legs, wheels)
    }

    /// C ν − τ_g: the force that holds ν̇ at zero, friction and contact apart.
    #[must_use]
    pub fn bias(&self) -> Velocity {
        assemble(&self.base, &one_by_one(&self.legs.bias), [0.0; 2])
    }

    /// τ_d, viscous.
    #[must_use]
    pub fn dissipation(&self) -> Velocity {
        -self.viscous.component_mul(&self.velocity)
    }

    /// Contact reference points in the world (m): left and right sole, left and right wheel
    /// centre, origin of B.
    #[must_use]
    pub fn points_m(&self) -> [Vector3<f64>; 5] {
        self.local_points()
            .map(|r| self.position + turned(&self.rotation, &r))
    }

    #[inline]
    fn local_points(&self) -> [Vector3<f64>; 5] {
        let wheel = Vector3::new(0.0, self.half_track, 0.0);
        [
            self.soles[0],
            self.soles[1],
            wheel,
            -wheel,
            Vector3::zeros(),
        ]
    }

    /// Chassis axes in world components.
    #[must_use]
    pub fn rotation(&self) -> &Matrix3<f64> {
        &self.rotation
    }

    /// Axes of a foot (0 left, 1 right) in the world: forward along the leg, left as the robot
    /// looks on both legs, up.
    #[must_use]
    pub fn foot_axes(&self, leg: usize) -> [Vector3<f64>; 3] {
        let (s, posture) = (mirror::sign(leg), &self.postures[leg]);
        let (s4, c4) = (posture.sin4, posture.cos4);
        let r = &self.rotation;
        [
            turned(r, &Vector3::new(s4, -s * c4, 0.0)),
            turned(r, &Vector3::new(s * c4, s4, 0.0)),
            r.column(2).into_owned(),
        ]
    }

    /// Twist of a body at a velocity ν in world axes, about its point of
    /// [`FloatingKin::points_m`]: angular velocity (rad/s) and velocity of the point (m/s). A wheel
    /// turns with its rate.
    #[must_use]
    #[inline]
    pub fn twist(&self, body: usize, velocity: &Velocity) -> [Vector3<f64>; 2] {
        self.twist_at(body, |i| velocity[i])
    }

    /// The same at two velocities.
    #[inline]
    pub(crate) fn twists(&self, body: usize, velocities: [&Velocity; 2]) -> [Vector3<Both>; 2] {
        self.twist_at(body, |i| Both::new(velocities.map(|v| v[i])))
    }

    #[inline]
    fn twist_at<T: Number>(&self, body: usize, velocity: impl Fn(usize) -> T) -> [Vector3<T>; 2] {
        let omega = Vector3::new(velocity(0), velocity(1), velocity(2));
        let mut turning = omega;
        let mut moving = Vector3::new(velocity(3), velocity(4), velocity(5));
        moving += omega.cross(&same(&self.local_points()[body]));
        match body {
            0 | 1 => {
                let (s, posture) = (T::of(mirror::sign(body)), &self.postures[body]);
                let (s4, c4) = (T::of(posture.sin4), T::of(posture.cos4));
                let k = LEG + 3 * body;
                let yaw = T::of(posture.phi_prime) * velocity(k);
                let arm = T::of(posture.lengths.b5_m) * yaw;
                turning.z += s * yaw;
                moving += Vector3::new(
                    arm * c4 + s4 * velocity(k + 1),
                    s * (arm * s4 - c4 * velocity(k + 1)),
                    -velocity(k + 2),
                );
            }
            2 | 3 => turning.y += velocity(WHEEL + body - 2),
            _ => {}
        }
        [
            turned(&self.rotation, &turning),
            turned(&self.rotation, &moving),
        ]
    }

    /// Generalised force of the contacts.
    #[must_use]
    pub fn contact_force(&self, contacts: &Contacts) -> Velocity {
        if *contacts == Contacts::NONE {
            return Velocity::zeros();
        }
        let (mut angular, mut linear) = (Vector3::zeros(), Vector3::zeros());
        let mut local = [(Vector3::zeros(), Vector3::zeros()); 5];
        for ((wrench, point), own) in contacts
            .all()
            .iter()
            .zip(self.local_points())
            .zip(&mut local)
        {
            if *wrench == Wrench::ZERO {
                continue;
            }
            let n = turned_back(&self.rotation, &wrench.moment_n_m);
            let f = turned_back(&self.rotation, &wrench.force_n);
            angular += n + point.cross(&f);
            linear += f;
            *own = (n, f);
        }
        let legs = [0, 1].map(|leg| {
            let (s, posture) = (mirror::sign(leg), &self.postures[leg]);
            let n = mirror::axial(s, &local[leg].0);
            let f = mirror::vector(s, &local[leg].1);
            let (s4, c4) = (posture.sin4, posture.cos4);
            let arm = posture.lengths.b5_m * (c4 * f.x + s4 * f.y);
            [posture.phi_prime * (arm + n.z), s4 * f.x - c4 * f.y, -f.z]
        });
        assemble(
            &joined(&angular, &linear),
            &legs,
            [local[2].0.y, local[3].0.y],
        )
    }

    /// Kinetic energy ½ νᵀ I ν (J).
    #[must_use]
    pub fn kinetic_energy_j(&self) -> f64 {
        0.5 * self.velocity.dot(&self.times_mass(&self.velocity))
    }

    /// Mass centre of the robot in the world (m).
    #[must_use]
    pub fn com_m(&self) -> Vector3<f64> {
        self.position + self.rotation * (self.first / self.mass)
    }

    /// Potential energy (J), zero with the mass centre at the origin of the world.
    #[must_use]
    pub fn potential_energy_j(&self, gravity_m_s2: &Vector3<f64>) -> f64 {
        -self.mass * gravity_m_s2.dot(&self.com_m())
    }

    /// Momentum: the chassis rows of I ν, moved to the mass centre.
    #[must_use]
    pub fn momentum(&self) -> Momentum {
        let p = self.times_mass(&self.velocity);
        let linear = p.fixed_rows::<3>(3).into_owned();
        let about_origin: Vector3<f64> = p.fixed_rows::<3>(0).into_owned();
        let about_com = about_origin - (self.first / self.mass).cross(&linear);
        Momentum {
            linear_kg_m_s: self.rotation * linear,
            angular_kg_m2_s: self.rotation * about_com,
        }
    }
}

/// The masses of one leg.
struct LegMasses {
    columns: [[f64; 6]; 3],
    d22: f64,
    d25: f64,
}

impl LegMasses {
    fn of(legs: &LegTerms, leg: usize) -> Self {
        let own = |both: Both| both.to_array()[leg];
        Self {
            columns: legs.columns.map(|column| column.map(own)),
            d22: own(legs.d22),
            d25: own(legs.d25),
        }
    }
}

/// The left leg's, then the right leg's.
#[inline]
fn one_by_one(both: &[Both; 3]) -> [[f64; 3]; 2] {
    let [a, b, c] = both.map(Both::to_array);
    [[a[0], b[0], c[0]], [a[1], b[1], c[1]]]
}

/// R v. The general product of matrices is no faster than its loops.
#[inline]
fn turned<T: Number>(r: &Matrix3<f64>, v: &Vector3<T>) -> Vector3<T> {
    let row = |a, b, c| T::of(a) * v.x + T::of(b) * v.y + T::of(c) * v.z;
    Vector3::new(
        row(r.m11, r.m12, r.m13),
        row(r.m21, r.m22, r.m23),
        row(r.m31, r.m32, r.m33),
    )
}

/// Rᵀ v.
#[inline]
fn turned_back(r: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        r.m11 * v.x + r.m21 * v.y + r.m31 * v.z,
        r.m12 * v.x + r.m22 * v.y + r.m32 * v.z,
        r.m13 * v.x + r.m23 * v.y + r.m33 * v.z,
    )
}
