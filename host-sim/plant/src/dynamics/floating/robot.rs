//! The floating robot, exact and fast. Conventions: [`super`].

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use wheeleg_kinematics::{LegGeometry, LegLengths, LegPosture};

use super::contact::Contacts;
use super::group::Sym3;
use super::leg::{LegModel, LegTerms, joined};
use super::mirror;
use super::params::FloatingParams;
use super::reference::check_inputs;
use super::solve::{MIRROR, Packed, add_mirrored, assemble, at, eliminate, solve_block};
use super::state::{DOF, FloatingState, LEG, Velocity, WHEEL};
use crate::dynamics::error::{DynamicsError, finite};

/// Linear momentum, and angular momentum about the mass centre, in world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Momentum {
    /// kg m/s.
    pub linear_kg_m_s: Vector3<f64>,
    /// kg m²/s.
    pub angular_kg_m2_s: Vector3<f64>,
}

/// Model of the floating robot: built once, read only, no allocation per call.
#[derive(Debug, Clone)]
pub struct FloatingRobot {
    params: FloatingParams,
    geometry: LegGeometry<f64>,
    leg: LegModel,
    viscous: Velocity,
    mass: f64,
    /// Chassis, wheels and rotors without the spin: mass, first moment, inertia about the origin
    /// of B.
    carriage: (f64, Vector3<f64>, Sym3),
    /// The same with each leg's composites at their yaw axes.
    first: Vector3<f64>,
    inertia: Sym3,
    /// Angular momentum about the axle per wheel rate: wheel and rotor.
    spin: f64,
    /// Inertia of a wheel rate: wheel and geared rotor.
    axle: f64,
}

/// Everything that depends on position and velocity alone.
#[derive(Debug, Clone, Copy)]
pub struct FloatingKin {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    postures: [LegPosture<f64>; 2],
    soles: [Vector3<f64>; 2],
    half_track: f64,
    legs: [LegTerms; 2],
    leg_masses: [f64; 2],
    mass: f64,
    first: Vector3<f64>,
    inertia: Sym3,
    spin: f64,
    axle: f64,
    base: [f64; 6],
    velocity: Velocity,
    viscous: Velocity,
}

impl FloatingRobot {
    /// Checks the parameters and precomputes what does not move.
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`], [`DynamicsError::Leg`].
    pub fn new(params: &FloatingParams) -> Result<Self, DynamicsError> {
        params.validate()?;
        let p = &params.robot;
        let geometry = LegGeometry::new(p.leg_parameters())
            .map_err(|source| DynamicsError::Leg { leg: 0, source })?;
        let leg = LegModel::new(p);
        let [cx, cz] = p.chassis_com_m;
        let chassis = Sym3::of_body(
            p.chassis_mass_kg,
            &Vector3::new(cx, 0.0, cz),
            &Vector3::new(
                params.chassis_roll_inertia_kg_m2,
                p.chassis_pitch_inertia_kg_m2,
                params.chassis_yaw_inertia_kg_m2,
            ),
        );
        let across = params.wheel_transverse_inertia_kg_m2;
        let wheels = Sym3::of_body(
            2.0 * p.wheel_mass_kg,
            &Vector3::new(0.0, 0.5 * params.track_m, 0.0),
            &Vector3::new(
                2.0 * across,
                2.0 * (p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2),
                2.0 * across,
            ),
        );
        let carriage = (
            p.chassis_mass_kg + 2.0 * p.wheel_mass_kg,
            p.chassis_mass_kg * Vector3::new(cx, 0.0, cz),
            chassis.plus(&wheels),
        );
        // Both legs: what is odd in Y cancels.
        let (leg_mass, h, j) = leg.fixed();
        let both = Sym3 {
            xx: 2.0 * j.xx,
            yy: 2.0 * j.yy,
            zz: 2.0 * j.zz,
            xz: 2.0 * j.xz,
            ..Sym3::default()
        };
        Ok(Self {
            geometry,
            leg,
            viscous: SVector::from(params.viscous()),
            mass: carriage.0 + 2.0 * leg_mass,
            first: carriage.1 + Vector3::new(2.0 * h.x, 0.0, 2.0 * h.z),
            inertia: carriage.2.plus(&both),
            carriage,
            spin: p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2 * p.gear_ratio,
            axle: p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2 * p.gear_ratio * p.gear_ratio,
            params: params.clone(),
        })
    }

    /// The parameters.
    #[must_use]
    pub fn params(&self) -> &FloatingParams {
        &self.params
    }

    /// Mass matrix and bias at a state, ready to be solved.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] (`position`, `orientation`, `length`, `wheel angle`,
    /// `velocity`, `gravity`), [`DynamicsError::NotUnit`], [`DynamicsError::Leg`] with the side and
    /// the length that no leg can take.
    pub fn prepare(
        &self,
        state: &FloatingState,
        gravity_m_s2: &Vector3<f64>,
    ) -> Result<FloatingKin, DynamicsError> {
        state.check()?;
        finite("gravity", &(*gravity_m_s2).into())?;
        let rotation = state.orientation.to_rotation_matrix().into_inner();
        let (omega, v) = (state.angular_velocity(), state.linear_velocity());
        let origin = omega.cross(&v) - rotation.tr_mul(gravity_m_s2);
        let postures = [
            self.posture(0, &state.lengths_m)?,
            self.posture(1, &state.lengths_m)?,
        ];
        let terms = |leg: usize| {
            let s = mirror::sign(leg);
            self.leg.terms(
                &postures[leg],
                &state.leg_rates(leg).into(),
                &mirror::axial(s, &omega),
                &mirror::vector(s, &origin),
            )
        };
        let [l, r] = [terms(0), terms(1)];

        let (mass, h, j) = &self.carriage;
        let [left, right] = state.wheel_rates();
        let force = *mass * origin + omega.cross(&omega.cross(h));
        let mut turning = j.times(&omega);
        turning.y += self.spin * (left + right);
        let moment = h.cross(&origin) + omega.cross(&turning);
        let own = joined(&moment, &force);
        let first = self.first
            + Vector3::new(
                l.first.x + r.first.x,
                l.first.y - r.first.y,
                l.first.z + r.first.z,
            );
        let (a, b) = (&l.inertia, &r.inertia);
        let inertia = self.inertia.plus(&Sym3 {
            xx: a.xx + b.xx,
            yy: a.yy + b.yy,
            zz: a.zz + b.zz,
            xy: a.xy - b.xy,
            xz: a.xz + b.xz,
            yz: a.yz - b.yz,
        });
        let base: [f64; 6] = std::array::from_fn(|i| own[i] + l.base[i] + MIRROR[i] * r.base[i]);
        refuse_overflow(&base, &inertia, &l, &r)?;
        Ok(FloatingKin {
            rotation,
            position: state.position_m,
            soles: [
                self.leg.sole(&postures[0]),
                mirror::vector(-1.0, &self.leg.sole(&postures[1])),
            ],
            postures,
            half_track: 0.5 * self.params.track_m,
            leg_masses: [self.leg.m56, self.leg.m6],
            mass: self.mass,
            first,
            inertia,
            spin: self.spin,
            axle: self.axle,
            base,
            legs: [l, r],
            velocity: state.velocity,
            viscous: self.viscous,
        })
    }

    /// Acceleration ν̇ for a generalised force, gravity (m/s², world) and contacts; viscous
    /// friction included.
    ///
    /// # Errors
    /// As [`FloatingRobot::prepare`]; [`DynamicsError::NonFinite`] (`force`, `contact`,
    /// `acceleration`), [`DynamicsError::Singular`].
    pub fn forward(
        &self,
        state: &FloatingState,
        force: &Velocity,
        gravity_m_s2: &Vector3<f64>,
        contacts: &Contacts,
    ) -> Result<Velocity, DynamicsError> {
        check_inputs(force, "force", gravity_m_s2, contacts)?;
        let kin = self.prepare(state, gravity_m_s2)?;
        kin.solve(&(force + kin.contact_force(contacts)))
    }

    /// Generalised force for an acceleration ν̇: the converse of [`FloatingRobot::forward`].
    ///
    /// # Errors
    /// As [`FloatingRobot::prepare`]; [`DynamicsError::NonFinite`].
    pub fn inverse(
        &self,
        state: &FloatingState,
        acceleration: &Velocity,
        gravity_m_s2: &Vector3<f64>,
        contacts: &Contacts,
    ) -> Result<Velocity, DynamicsError> {
        check_inputs(acceleration, "acceleration", gravity_m_s2, contacts)?;
        let kin = self.prepare(state, gravity_m_s2)?;
        let force = kin.times_mass(acceleration) + kin.bias()
            - kin.dissipation()
            - kin.contact_force(contacts);
        let values: [f64; DOF] = force.into();
        finite("force", &values)?;
        Ok(force)
    }

    /// One step of the classical fourth-order Runge–Kutta method with force, gravity and contacts
    /// held; the quaternion is normalised at every stage.
    ///
    /// # Errors
    /// As [`FloatingRobot::forward`].
    pub fn step_rk4(
        &self,
        state: &FloatingState,
        force: &Velocity,
        gravity_m_s2: &Vector3<f64>,
        contacts: &Contacts,
        step_s: f64,
    ) -> Result<FloatingState, DynamicsError> {
        let rate = |s: &FloatingState| {
            self.forward(s, force, gravity_m_s2, contacts)
                .map(|a| (s.position_rate(), a))
        };
        let half = 0.5 * step_s;
        let (p1, a1) = rate(state)?;
        let (p2, a2) = rate(&state.moved(&(half * p1), &(half * a1)))?;
        let (p3, a3) = rate(&state.moved(&(half * p2), &(half * a2)))?;
        let (p4, a4) = rate(&state.moved(&(step_s * p3), &(step_s * a3)))?;
        let sixth = step_s / 6.0;
        Ok(state.moved(
            &(sixth * (p1 + 2.0 * (p2 + p3) + p4)),
            &(sixth * (a1 + 2.0 * (a2 + a3) + a4)),
        ))
    }

    fn posture(
        &self,
        leg: usize,
        lengths_m: &[[f64; 3]; 2],
    ) -> Result<LegPosture<f64>, DynamicsError> {
        let [b2, b5, b6] = lengths_m[leg];
        self.geometry
            .posture(&LegLengths::new(b2, b5, b6))
            .map_err(|source| DynamicsError::Leg { leg, source })
    }
}

/// Finite input so large that the arithmetic overflowed.
#[inline]
fn refuse_overflow(
    base: &[f64; 6],
    inertia: &Sym3,
    left: &LegTerms,
    right: &LegTerms,
) -> Result<(), DynamicsError> {
    let sum = |values: &[f64]| values.iter().sum::<f64>();
    finite("bias", base)?;
    for t in [left, right] {
        finite("bias", &t.bias)?;
        finite(
            "inertia",
            &[t.d22, t.d25, t.columns.iter().map(|c| sum(c)).sum()],
        )?;
    }
    let Sym3 {
        xx,
        yy,
        zz,
        xy,
        xz,
        yz,
    } = *inertia;
    finite("inertia", &[xx, yy, zz, xy, xz, yz])
}

impl FloatingKin {
    /// ν̇ for a generalised force that holds contacts already; viscous friction is added here.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], [`DynamicsError::Singular`].
    pub fn solve(&self, force: &Velocity) -> Result<Velocity, DynamicsError> {
        let f = force + self.dissipation();
        let mut block = [0.0; 21];
        let mut side = [0.0; 6];
        let mut left = || {
            let right = std::array::from_fn(|k| f[LEG + k] - self.legs[0].bias[k]);
            eliminate(&self.legs[0], self.leg_masses, right, &mut block, &mut side)
        };
        let left = left()?;
        let mut block_r = [0.0; 21];
        let mut side_r = [0.0; 6];
        let right = std::array::from_fn(|k| f[LEG + 3 + k] - self.legs[1].bias[k]);
        let right = eliminate(
            &self.legs[1],
            self.leg_masses,
            right,
            &mut block_r,
            &mut side_r,
        )?;
        add_mirrored(&mut block, &block_r);
        self.add_base(&mut block);
        // Wheels: both couple with the pitch rate alone.
        if self.axle <= 0.0 {
            return Err(DynamicsError::Singular { pivot: self.axle });
        }
        let share = self.spin / self.axle;
        let wheels = [f[WHEEL], f[WHEEL + 1]];
        block[at(1, 1)] -= 2.0 * share * self.spin;
        let mut x: [f64; 6] =
            std::array::from_fn(|i| f[i] - self.base[i] + side[i] + MIRROR[i] * side_r[i]);
        x[1] -= share * (wheels[0] + wheels[1]);
        solve_block(&mut block, &mut x)?;
        let mirrored: [f64; 6] = std::array::from_fn(|i| MIRROR[i] * x[i]);
        let acceleration = assemble(
            &x,
            &[left.follow(&x), right.follow(&mirrored)],
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
        for (leg, t) in self.legs.iter().enumerate() {
            let s = LEG + 3 * leg;
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
        for (leg, t) in self.legs.iter().enumerate() {
            let s = LEG + 3 * leg;
            let [m56, m6] = self.leg_masses;
            let own = [a[s], a[s + 1], a[s + 2]];
            legs[leg] = [
                t.d22 * own[0] + t.d25 * own[1],
                t.d25 * own[0] + m56 * own[1],
                m6 * own[2],
            ];
            for (k, column) in t.columns.iter().enumerate() {
                for i in 0..6 {
                    let entry = if leg == 0 { 1.0 } else { MIRROR[i] } * column[i];
                    base[i] += entry * own[k];
                    legs[leg][k] += entry * a[i];
                }
            }
        }
        let wheels = [a[WHEEL], a[WHEEL + 1]].map(|w| self.axle * w + self.spin * omega.y);
        assemble(&base, &legs, wheels)
    }

    /// C ν − τ_g: the force that holds ν̇ at zero, friction and contact apart.
    #[must_use]
    pub fn bias(&self) -> Velocity {
        assemble(
            &self.base,
            &[self.legs[0].bias, self.legs[1].bias],
            [0.0; 2],
        )
    }

    /// τ_d, viscous.
    #[must_use]
    pub fn dissipation(&self) -> Velocity {
        -self.viscous.component_mul(&self.velocity)
    }

    /// Contact reference points in the world (m): left and right sole, left and right wheel centre.
    #[must_use]
    pub fn points_m(&self) -> [Vector3<f64>; 4] {
        self.local_points()
            .map(|r| self.position + self.rotation * r)
    }

    fn local_points(&self) -> [Vector3<f64>; 4] {
        let wheel = Vector3::new(0.0, self.half_track, 0.0);
        [self.soles[0], self.soles[1], wheel, -wheel]
    }

    /// Generalised force of the contacts.
    #[must_use]
    pub fn contact_force(&self, contacts: &Contacts) -> Velocity {
        if *contacts == Contacts::NONE {
            return Velocity::zeros();
        }
        let (mut angular, mut linear) = (Vector3::zeros(), Vector3::zeros());
        let mut local = [(Vector3::zeros(), Vector3::zeros()); 4];
        for ((wrench, point), own) in contacts
            .all()
            .iter()
            .zip(self.local_points())
            .zip(&mut local)
        {
            let n = self.rotation.tr_mul(&wrench.moment_n_m);
            let f = self.rotation.tr_mul(&wrench.force_n);
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
