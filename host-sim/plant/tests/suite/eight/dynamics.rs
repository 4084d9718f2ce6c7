//! The whole robot in eight coordinates.
//!
//! # Coordinates
//!
//! `q = [s, p, b2L, b5L, b6L, b2R, b5R, b6R]` (m, rad, m…): s travel of the wheel axle along the
//! ground, p pitch of the chassis about the axle (nose up positive), b cylinder lengths. The axle
//! stays r_w above the ground and the wheels roll without slip.
//!
//! # Generalised forces
//!
//! Cylinder forces act on their own coordinate (positive extends). A wheel torque τ acts between
//! chassis and wheel, on the relative angle s/r_w + p, so it enters as τ/r_w on s **and** as τ on
//! p: the stator's reaction lifts the nose. [`RobotDynamics::add_wheel_torque`] does both.
//!
//! # Wheels and rotors
//!
//! A wheel turns at ṡ/r_w. A rotor turns, in space, at i(ṡ/r_w + ṗ) − ṗ for the reduction i (the
//! gear's input and output turn the same way): it is carried by the chassis and geared to the
//! relative angle. Its kinetic energy therefore appears on s as J_rotor i²/r_w², as in the half
//! robot, but also on p (0.27 kg m² for both) and between s and p; neither is small against the
//! chassis.
//!
//! # Method
//!
//! Each body contributes its Jacobian columns in chassis axes and its bias acceleration
//! (centripetal, Coriolis, pitch) in closed form; I = TᵀMT and Tᵀ(MṪ + WMT)q̇ are summed without
//! forming T. All link axes are vertical or horizontal in the chassis, so every body has one yaw
//! angle and products of inertia only between X and Y. The right leg is computed in mirrored axes,
//! where the equations are the same and only gravity's Y component changes sign.
//!
//! The mass matrix is an arrow: a 2 × 2 block (s, p), a 3 × 3 block a leg whose b6 row is
//! diagonal, and no block between the legs. It is solved by its Schur complement.

use wheeleg_kinematics::{LegGeometry, LegLengths, LegPosture};

use super::finite;
use super::kin::RobotKin;
use super::leg::{Axes, Slide, YawBody};
use wheeleg_plant::dynamics::{DynamicsError, RobotDynamicsParams};

/// Left or right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RobotSide {
    /// Left leg and wheel.
    Left = 0,
    /// Right leg and wheel.
    Right = 1,
}

/// Model of the robot: built once.
#[derive(Debug, Clone)]
pub(crate) struct RobotDynamics {
    pub(super) params: RobotDynamicsParams,
    pub(super) geometry: LegGeometry<f64>,
    pub(super) bodies: [YawBody; 6],
    /// Constant part of the (s, p) block: total mass and rolling inertia; rotor coupling; rotors
    /// and chassis.
    pub(super) constant_ss: f64,
    pub(super) constant_sp: f64,
    pub(super) constant_pp: f64,
}

impl RobotDynamics {
    /// Checks the parameters and precomputes the constant data.
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`], or [`DynamicsError::Leg`] for impossible leg dimensions.
    pub(crate) fn new(params: &RobotDynamicsParams) -> Result<Self, DynamicsError> {
        params.validate()?;
        let geometry = LegGeometry::new(params.leg_parameters())
            .map_err(|source| DynamicsError::Leg { leg: 0, source })?;
        // F2: w, up, u. F3: −w, u, up. F4′: f, n, up. F5: n, up, f. F6, F7: n, f, down.
        let axes: [(Axes, Slide, bool); 6] = [
            ([(0, 1.0), (2, 1.0), (1, 1.0)], Slide::None, false),
            ([(0, -1.0), (1, 1.0), (2, 1.0)], Slide::B2, false),
            ([(1, 1.0), (0, 1.0), (2, 1.0)], Slide::None, false),
            ([(0, 1.0), (2, 1.0), (1, 1.0)], Slide::None, false),
            ([(0, 1.0), (1, 1.0), (2, -1.0)], Slide::B5, false),
            ([(0, 1.0), (1, 1.0), (2, -1.0)], Slide::B5, true),
        ];
        let bodies = std::array::from_fn(|i| {
            let (axes, slide, lowered) = axes[i];
            YawBody::new(&params.leg_bodies[i], axes, slide, lowered)
        });
        let r = params.wheel_radius_m;
        let (gear, rotor) = (params.gear_ratio, params.rotor_inertia_kg_m2);
        let [cx, cz] = params.chassis_com_m;
        Ok(Self {
            geometry,
            bodies,
            constant_ss: params.total_mass_kg()
                + 2.0 * (params.wheel_inertia_kg_m2 + rotor * gear * gear) / (r * r),
            constant_sp: 2.0 * rotor * gear * (gear - 1.0) / r,
            constant_pp: 2.0 * rotor * (gear - 1.0) * (gear - 1.0)
                + params.chassis_mass_kg * (cx * cx + cz * cz)
                + params.chassis_pitch_inertia_kg_m2,
            params: params.clone(),
        })
    }

    /// The parameters.
    #[must_use]
    pub(crate) fn params(&self) -> &RobotDynamicsParams {
        &self.params
    }

    /// Adds a wheel torque (N m, positive drives forward) to a generalised force: on s and, as the
    /// stator's reaction, on p.
    pub(crate) fn add_wheel_torque(&self, torque_n_m: f64, force: &mut [f64; 8]) {
        force[0] += torque_n_m / self.params.wheel_radius_m;
        force[1] += torque_n_m;
    }

    /// Angle of a wheel relative to the chassis (rad), as its encoder sees it.
    #[must_use]
    pub(crate) fn wheel_angle_rad(&self, q: &[f64; 8]) -> f64 {
        q[0] / self.params.wheel_radius_m + q[1]
    }

    /// Everything that depends only on position and velocity: feet, mass matrix, bias, gravity.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], [`DynamicsError::Leg`].
    pub(crate) fn prepare(&self, q: &[f64; 8], qd: &[f64; 8]) -> Result<RobotKin, DynamicsError> {
        finite("position", q)?;
        finite("velocity", qd)?;
        let p = &self.params;
        let (sin_p, cos_p) = libm::sincos(q[1]);
        let pitch_rate = qd[1];
        let [gx, gy, gz] = p.gravity_m_s2;
        // Gravity and the direction of travel in chassis axes.
        let g = [cos_p * gx + sin_p * gz, gy, cos_p * gz - sin_p * gx];
        let e = [cos_p, -sin_p];

        let postures = [self.posture(0, q)?, self.posture(1, q)?];
        let terms = |leg: usize| {
            let rates = [qd[2 + 3 * leg], qd[3 + 3 * leg], qd[4 + 3 * leg]];
            let g_leg = [g[0], if leg == 0 { g[1] } else { -g[1] }, g[2]];
            self.leg_terms(&postures[leg], &rates, pitch_rate, e, g_leg)
        };
        let legs = [terms(0), terms(1)];

        let [cx, cz] = p.chassis_com_m;
        let m = p.chassis_mass_kg;
        let pitch_squared = pitch_rate * pitch_rate;
        let a = [-pitch_squared * cx - g[0], -pitch_squared * cz - g[2]];
        let wheels = 2.0 * p.wheel_mass_kg;
        let mass = p.total_mass_kg();
        let moment = [
            m * cx + legs[0].moment[0] + legs[1].moment[0],
            legs[0].moment[1] - legs[1].moment[1],
            m * cz + legs[0].moment[2] + legs[1].moment[2],
        ];
        let kin = RobotKin {
            feet: [
                self.foot(0, &postures[0], q, qd, sin_p, cos_p),
                self.foot(1, &postures[1], q, qd, sin_p, cos_p),
            ],
            ss: self.constant_ss,
            sp: self.constant_sp + m * (e[1] * cx - e[0] * cz) + legs[0].sp + legs[1].sp,
            pp: self.constant_pp + legs[0].pp + legs[1].pp,
            h_s: m * (e[0] * a[0] + e[1] * a[1]) - wheels * gx + legs[0].h[0] + legs[1].h[0],
            h_p: m * (cx * a[1] - cz * a[0]) + legs[0].h[1] + legs[1].h[1],
            damping: std::array::from_fn(|i| -p.viscous[i] * qd[i]),
            com_m: [
                q[0] + (cos_p * moment[0] - sin_p * moment[2]) / mass,
                moment[1] / mass,
                p.wheel_radius_m + (sin_p * moment[0] + cos_p * moment[2]) / mass,
            ],
            legs,
        };
        kin.overflow()?;
        Ok(kin)
    }

    /// Accelerations (m/s², rad/s²) for a generalised force (N, N m).
    ///
    /// # Errors
    /// [`DynamicsError`].
    pub(crate) fn accelerations(
        &self,
        q: &[f64; 8],
        qd: &[f64; 8],
        generalised_force: &[f64; 8],
    ) -> Result<[f64; 8], DynamicsError> {
        self.prepare(q, qd)?.solve(generalised_force)
    }

    /// Potential energy (J), zero with the centre of mass at the origin of the ground.
    #[must_use]
    pub(crate) fn potential_energy_j(&self, kin: &RobotKin) -> f64 {
        let g = self.params.gravity_m_s2;
        let lift: f64 = (0..3).map(|i| g[i] * kin.com_m[i]).sum();
        -self.params.total_mass_kg() * lift
    }

    fn posture(&self, leg: usize, q: &[f64; 8]) -> Result<LegPosture<f64>, DynamicsError> {
        let i = 2 + 3 * leg;
        self.geometry
            .posture(&LegLengths::new(q[i], q[i + 1], q[i + 2]))
            .map_err(|source| DynamicsError::Leg { leg, source })
    }
}
