//! The floating robot, exact and fast: the model. Conventions: [`super`].

use nalgebra::{SVector, Vector3};
use wheeleg_kinematics::{LegGeometry, LegLengths, LegPosture};

use super::contact::Contacts;
use super::group::Sym3;
use super::kin::FloatingKin;
use super::leg::{LegModel, LegTerms, joined};
use super::mirror;
use super::params::FloatingParams;
use super::reference::check_inputs;
use super::solve::MIRROR;
use super::state::{DOF, FloatingState, LEG, Velocity};
use crate::both::Both;
use crate::dynamics::error::{DynamicsError, finite};

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

impl FloatingRobot {
    /// Checks the parameters and precomputes the constant data.
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
        // Both legs: terms odd in Y cancel.
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
        let rates = std::array::from_fn(|k| {
            Both::new([state.velocity[LEG + k], state.velocity[LEG + 3 + k]])
        });
        let legs = self.leg.terms(
            &postures,
            &rates,
            &mirror::both_axial(&omega),
            &mirror::both(&origin),
        );

        let (mass, h, j) = &self.carriage;
        let [left, right] = state.wheel_rates();
        let force = *mass * origin + omega.cross(&omega.cross(h));
        let mut turning = j.times(&omega);
        turning.y += self.spin * (left + right);
        let moment = h.cross(&origin) + omega.cross(&turning);
        let own = joined(&moment, &force);
        // Terms odd in Y change their sign on the right.
        let even = |b: Both| b.to_array()[0] + b.to_array()[1];
        let odd = |b: Both| b.to_array()[0] - b.to_array()[1];
        let h = &legs.first;
        let first = self.first + Vector3::new(even(h.x), odd(h.y), even(h.z));
        let j = &legs.inertia;
        let inertia = self.inertia.plus(&Sym3 {
            xx: even(j.xx),
            yy: even(j.yy),
            zz: even(j.zz),
            xy: odd(j.xy),
            xz: even(j.xz),
            yz: odd(j.yz),
        });
        let base: [f64; 6] = std::array::from_fn(|i| {
            let [left, right] = legs.base[i].to_array();
            own[i] + left + MIRROR[i] * right
        });
        refuse_overflow(&base, &inertia, &legs)?;
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
            legs,
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
fn refuse_overflow(base: &[f64; 6], inertia: &Sym3, legs: &LegTerms) -> Result<(), DynamicsError> {
    finite("bias", base)?;
    let columns = legs.columns.iter().flatten();
    let columns = columns.fold(Both::splat(0.0), |sum, entry| sum + *entry);
    for leg in 0..2 {
        let own = |both: Both| both.to_array()[leg];
        finite("bias", &legs.bias.map(own))?;
        finite("inertia", &[legs.d22, legs.d25, columns].map(own))?;
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
