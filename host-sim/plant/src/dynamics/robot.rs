//! The whole robot in eight coordinates, fast.
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

use super::error::{DynamicsError, finite};
use super::params::{BodyParams, RobotDynamicsParams};

/// Left or right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RobotSide {
    /// Left leg and wheel.
    Left = 0,
    /// Right leg and wheel.
    Right = 1,
}

/// What slides a body along its yaw frame's forward axis.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slide {
    None,
    B2,
    B5,
}

/// A leg body in its yaw frame: n lateral, f forward (along the cylinder), z up.
#[derive(Debug, Clone, Copy)]
struct YawBody {
    m: f64,
    n: f64,
    f: f64,
    z: f64,
    i_n: f64,
    i_f: f64,
    i_up: f64,
    slide: Slide,
    /// Also lowered by b6.
    lowered: bool,
}

/// Link frame axes in the yaw frame, as (source index, sign) of n, f and up.
type Axes = [(usize, f64); 3];

impl YawBody {
    fn new(body: &BodyParams, axes: Axes, slide: Slide, lowered: bool) -> Self {
        let [n, f, z] = axes.map(|(i, sign)| sign * body.com_m[i]);
        let [i_n, i_f, i_up] = axes.map(|(i, _)| body.inertia_kg_m2[i]);
        Self {
            m: body.mass_kg,
            n,
            f,
            z,
            i_n,
            i_f,
            i_up,
            slide,
            lowered,
        }
    }
}

/// A yaw frame in motion.
struct YawFrame {
    pivot_x: f64,
    n: [f64; 2],
    f: [f64; 2],
    /// Yaw angle's first and second derivative by b2.
    prime: f64,
    second: f64,
}

/// One leg's share of the equations, chassis axes (mirrored for the right leg).
#[derive(Debug, Clone, Copy, Default)]
struct LegTerms {
    /// Contributions to the (s, p) block: ss is the mass, the others as named.
    sp: f64,
    pp: f64,
    /// Coupling of s and p with b2, b5, b6.
    s: [f64; 3],
    p: [f64; 3],
    /// Leg block: 22, 25, 55, 66.
    d: [f64; 4],
    /// Bias and gravity: s, p, b2, b5, b6.
    h: [f64; 5],
    /// First mass moments from the axle (kg m).
    moment: [f64; 3],
}

/// Model of the robot: built once.
#[derive(Debug, Clone)]
pub struct RobotDynamics {
    params: RobotDynamicsParams,
    geometry: LegGeometry<f64>,
    bodies: [YawBody; 6],
    /// Constant part of the (s, p) block: total mass and rolling inertia; rotor coupling; rotors
    /// and chassis.
    constant_ss: f64,
    constant_sp: f64,
    constant_pp: f64,
}

/// Position, velocity and Jacobian of a sole's centre in ground axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootKin {
    /// Sole centre (m); z = 0 is the ground under the wheels.
    pub position_m: [f64; 3],
    /// Its velocity (m/s).
    pub velocity_m_s: [f64; 3],
    /// Its Jacobian, one column for each of s, p and this leg's b2, b5, b6.
    pub jacobian: [[f64; 3]; 5],
    /// Unit vector from the sole's centre to its front (along the leg).
    pub forward: [f64; 3],
    /// Unit vector from the sole's centre to its left side, on both legs.
    pub left: [f64; 3],
}

/// Kinematics and mass matrix at one state, ready to solve for accelerations.
#[derive(Debug, Clone, Copy)]
pub struct RobotKin {
    /// Left and right foot.
    pub feet: [FootKin; 2],
    ss: f64,
    sp: f64,
    pp: f64,
    legs: [LegTerms; 2],
    /// Bias and gravity on s and p.
    h_s: f64,
    h_p: f64,
    /// Viscous forces already negated.
    damping: [f64; 8],
    com_m: [f64; 3],
}

impl RobotDynamics {
    /// Checks the parameters and precomputes what does not move.
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`], or [`DynamicsError::Leg`] for impossible leg dimensions.
    pub fn new(params: &RobotDynamicsParams) -> Result<Self, DynamicsError> {
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
    pub fn params(&self) -> &RobotDynamicsParams {
        &self.params
    }

    /// Adds a wheel torque (N m, positive drives forward) to a generalised force: on s and, as the
    /// stator's reaction, on p.
    pub fn add_wheel_torque(&self, torque_n_m: f64, force: &mut [f64; 8]) {
        force[0] += torque_n_m / self.params.wheel_radius_m;
        force[1] += torque_n_m;
    }

    /// Angle of a wheel against the chassis (rad), what its encoder sees.
    #[must_use]
    pub fn wheel_angle_rad(&self, q: &[f64; 8]) -> f64 {
        q[0] / self.params.wheel_radius_m + q[1]
    }

    /// Everything that depends on position and velocity alone: feet, mass matrix, bias, gravity.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], [`DynamicsError::Leg`].
    pub fn prepare(&self, q: &[f64; 8], qd: &[f64; 8]) -> Result<RobotKin, DynamicsError> {
        finite("position", q)?;
        finite("velocity", qd)?;
        let p = &self.params;
        let (sin_p, cos_p) = q[1].sin_cos();
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
    pub fn accelerations(
        &self,
        q: &[f64; 8],
        qd: &[f64; 8],
        generalised_force: &[f64; 8],
    ) -> Result<[f64; 8], DynamicsError> {
        self.prepare(q, qd)?.solve(generalised_force)
    }

    /// Potential energy (J), zero with the centre of mass at the origin of the ground.
    #[must_use]
    pub fn potential_energy_j(&self, kin: &RobotKin) -> f64 {
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

    fn leg_terms(
        &self,
        leg: &LegPosture<f64>,
        rates: &[f64; 3],
        pitch_rate: f64,
        e: [f64; 2],
        g: [f64; 3],
    ) -> LegTerms {
        let p = &self.params;
        let [b2_dot, b5_dot, b6_dot] = *rates;
        let frames = [
            YawFrame {
                pivot_x: p.o4_m[0] - p.p4_m[0],
                n: [leg.cos1, leg.sin1],
                f: [leg.sin1, -leg.cos1],
                prime: leg.theta1_prime,
                second: leg.theta1_second,
            },
            YawFrame {
                pivot_x: p.o4_m[0],
                n: [leg.cos4, leg.sin4],
                f: [leg.sin4, -leg.cos4],
                prime: leg.phi_prime,
                second: leg.phi_second,
            },
        ];
        let pivot_y = [p.o4_m[1] - p.p4_m[1], p.o4_m[1]];
        let pitch_squared = pitch_rate * pitch_rate;
        let mut t = LegTerms::default();
        for (i, body) in self.bodies.iter().enumerate() {
            let group = usize::from(i >= 2);
            let frame = &frames[group];
            let (n, f) = (frame.n, frame.f);
            let (slide, slide_dot) = match body.slide {
                Slide::None => (0.0, 0.0),
                Slide::B2 => (leg.lengths.b2_m, b2_dot),
                Slide::B5 => (leg.lengths.b5_m, b5_dot),
            };
            let (drop, drop_dot) = if body.lowered {
                (leg.lengths.b6_m, b6_dot)
            } else {
                (0.0, 0.0)
            };
            let ahead = body.f + slide;
            let r = [body.n * n[0] + ahead * f[0], body.n * n[1] + ahead * f[1]];
            // k × r, with k × f = n and k × n = −f
            let k_r = [ahead * n[0] - body.n * f[0], ahead * n[1] - body.n * f[1]];
            let mut l2 = [frame.prime * k_r[0], frame.prime * k_r[1]];
            let mut l5 = [0.0; 2];
            match body.slide {
                Slide::None => {}
                Slide::B2 => l2 = [l2[0] + f[0], l2[1] + f[1]],
                Slide::B5 => l5 = f,
            }
            let v_x = l2[0] * b2_dot + l5[0] * b5_dot;
            let v_z = -drop_dot;
            let yaw_rate = frame.prime * b2_dot;
            let yaw_bias = frame.second * b2_dot * b2_dot;
            let coriolis = 2.0 * yaw_rate * slide_dot;
            let c_x = frame.pivot_x + r[0];
            let c_z = p.o4_m[2] + body.z - drop;
            let centripetal = yaw_rate * yaw_rate;
            // Acceleration with all second derivatives zero, less gravity.
            let a = [
                yaw_bias * k_r[0] - centripetal * r[0] + coriolis * n[0]
                    - pitch_squared * c_x
                    - 2.0 * pitch_rate * v_z
                    - g[0],
                yaw_bias * k_r[1] - centripetal * r[1] + coriolis * n[1] - g[1],
                2.0 * pitch_rate * v_x - pitch_squared * c_z - g[2],
            ];
            let i_yy = body.i_n * n[1] * n[1] + body.i_f * f[1] * f[1];
            let i_xy = body.i_n * n[0] * n[1] + body.i_f * f[0] * f[1];

            let m = body.m;
            t.sp += m * (e[1] * c_x - e[0] * c_z);
            t.pp += m * (c_x * c_x + c_z * c_z) + i_yy;
            t.s[0] += m * e[0] * l2[0];
            t.s[1] += m * e[0] * l5[0];
            t.p[0] -= m * c_z * l2[0];
            t.p[1] -= m * c_z * l5[0];
            t.d[0] += m * (l2[0] * l2[0] + l2[1] * l2[1]) + frame.prime * frame.prime * body.i_up;
            t.d[1] += m * (l2[0] * l5[0] + l2[1] * l5[1]);
            t.d[2] += m * (l5[0] * l5[0] + l5[1] * l5[1]);
            t.h[0] += m * (e[0] * a[0] + e[1] * a[2]);
            // Pitch and yaw exchange momentum through the product of inertia:
            // dI_yy/dyaw = 2 I_xy.
            t.h[1] += m * (c_x * a[2] - c_z * a[0]) + 2.0 * pitch_rate * yaw_rate * i_xy;
            t.h[2] += m * (l2[0] * a[0] + l2[1] * a[1])
                + frame.prime * (body.i_up * yaw_bias - pitch_squared * i_xy);
            t.h[3] += m * (l5[0] * a[0] + l5[1] * a[1]);
            if body.lowered {
                t.s[2] -= m * e[1];
                t.p[2] -= m * c_x;
                t.d[3] += m;
                t.h[4] -= m * a[2];
            }
            t.moment[0] += m * c_x;
            t.moment[1] += m * (pivot_y[group] + r[1]);
            t.moment[2] += m * c_z;
        }
        t
    }

    fn foot(
        &self,
        leg: usize,
        posture: &LegPosture<f64>,
        q: &[f64; 8],
        qd: &[f64; 8],
        sin_p: f64,
        cos_p: f64,
    ) -> FootKin {
        let p = &self.params;
        // Mirrored axes of the right leg back to the robot's.
        let mirror = if leg == 0 { 1.0 } else { -1.0 };
        let (s4, c4) = (posture.sin4, posture.cos4);
        let b5 = posture.lengths.b5_m;
        let x = p.o4_m[0] + b5 * s4;
        let y = mirror * (p.o4_m[1] - b5 * c4);
        let z = p.o4_m[2] - posture.lengths.b6_m - p.foot_pad_m;
        let arm = b5 * posture.phi_prime;
        let world = |v: [f64; 2]| [cos_p * v[0], mirror * v[1], sin_p * v[0]];
        let forward = world([s4, -c4]);
        let n = world([c4, s4]);
        let yaw = world([arm * c4, arm * s4]);
        let jacobian = [
            [1.0, 0.0, 0.0],
            [-sin_p * x - cos_p * z, 0.0, cos_p * x - sin_p * z],
            yaw,
            forward,
            [sin_p, 0.0, -cos_p],
        ];
        let i = 2 + 3 * leg;
        let rates = [qd[0], qd[1], qd[i], qd[i + 1], qd[i + 2]];
        FootKin {
            position_m: [
                q[0] + cos_p * x - sin_p * z,
                y,
                p.wheel_radius_m + sin_p * x + cos_p * z,
            ],
            velocity_m_s: std::array::from_fn(|axis| {
                jacobian
                    .iter()
                    .zip(rates)
                    .map(|(column, rate)| column[axis] * rate)
                    .sum()
            }),
            jacobian,
            forward,
            left: n.map(|v| mirror * v),
        }
    }
}

impl RobotKin {
    /// Refuses what finite positions and rates overflowed to.
    fn overflow(&self) -> Result<(), DynamicsError> {
        finite(
            "mass matrix and bias of the chassis",
            &[self.ss, self.sp, self.pp, self.h_s, self.h_p],
        )?;
        finite("centre of mass", &self.com_m)?;
        finite("damping", &self.damping)?;
        for (index, (leg, foot)) in self.legs.iter().zip(&self.feet).enumerate() {
            let leg = [leg.s, leg.p]
                .into_iter()
                .flatten()
                .chain(leg.d)
                .chain(leg.h);
            let foot = [foot.position_m, foot.velocity_m_s].into_iter();
            let jacobian = self.feet[index].jacobian.into_iter();
            let all = leg.chain(foot.chain(jacobian).flatten());
            if let Some(value) = all.into_iter().find(|v| !v.is_finite()) {
                return Err(DynamicsError::NonFinite {
                    name: "mass matrix, bias or foot of leg",
                    index,
                    value,
                });
            }
        }
        Ok(())
    }

    /// Accelerations (m/s², rad/s²) for a generalised force (N, N m); gravity, bias and viscous
    /// friction are added here.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], [`DynamicsError::Singular`].
    pub fn solve(&self, generalised_force: &[f64; 8]) -> Result<[f64; 8], DynamicsError> {
        let f: [f64; 8] = std::array::from_fn(|i| generalised_force[i] + self.damping[i]);
        finite("force", &f)?;
        let (mut ss, mut sp, mut pp) = (self.ss, self.sp, self.pp);
        let (mut r_s, mut r_p) = (f[0] - self.h_s, f[1] - self.h_p);
        // Per leg: D⁻¹ of the right side and of the couplings, then the Schur complement.
        let mut free = [[0.0; 3]; 2];
        let mut by_s = [[0.0; 3]; 2];
        let mut by_p = [[0.0; 3]; 2];
        for (leg, t) in self.legs.iter().enumerate() {
            let i = 2 + 3 * leg;
            let [d22, d25, d55, d66] = t.d;
            let det = d22 * d55 - d25 * d25;
            if det.is_nan() || det <= 0.0 || d66 <= 0.0 {
                return Err(DynamicsError::Singular {
                    pivot: det.min(d66),
                });
            }
            let (inv, inv66) = (1.0 / det, 1.0 / d66);
            let apply = |v: [f64; 3]| {
                [
                    (d55 * v[0] - d25 * v[1]) * inv,
                    (d22 * v[1] - d25 * v[0]) * inv,
                    v[2] * inv66,
                ]
            };
            free[leg] = apply([f[i] - t.h[2], f[i + 1] - t.h[3], f[i + 2] - t.h[4]]);
            by_s[leg] = apply(t.s);
            by_p[leg] = apply(t.p);
            ss -= dot(t.s, by_s[leg]);
            sp -= dot(t.s, by_p[leg]);
            pp -= dot(t.p, by_p[leg]);
            r_s -= dot(t.s, free[leg]);
            r_p -= dot(t.p, free[leg]);
        }
        let det = ss * pp - sp * sp;
        if det.is_nan() || det <= 0.0 {
            return Err(DynamicsError::Singular { pivot: det });
        }
        let s = (pp * r_s - sp * r_p) / det;
        let p = (ss * r_p - sp * r_s) / det;
        let leg = |l: usize, k: usize| free[l][k] - by_s[l][k] * s - by_p[l][k] * p;
        let qdd = [
            s,
            p,
            leg(0, 0),
            leg(0, 1),
            leg(0, 2),
            leg(1, 0),
            leg(1, 1),
            leg(1, 2),
        ];
        finite("acceleration", &qdd)?;
        Ok(qdd)
    }

    /// Adds a force on a sole's centre (N, ground axes) to a generalised force.
    pub fn add_foot_force(&self, side: RobotSide, force_n: &[f64; 3], generalised: &mut [f64; 8]) {
        let leg = side as usize;
        let work = self.feet[leg].jacobian.map(|column| dot(column, *force_n));
        generalised[0] += work[0];
        generalised[1] += work[1];
        for k in 0..3 {
            generalised[2 + 3 * leg + k] += work[2 + k];
        }
    }

    /// Mass matrix (kg, kg m, kg m²), symmetric.
    #[must_use]
    pub fn mass_matrix(&self) -> [[f64; 8]; 8] {
        let mut m = [[0.0; 8]; 8];
        m[0][0] = self.ss;
        m[0][1] = self.sp;
        m[1][0] = self.sp;
        m[1][1] = self.pp;
        for (leg, t) in self.legs.iter().enumerate() {
            let i = 2 + 3 * leg;
            for k in 0..3 {
                m[0][i + k] = t.s[k];
                m[i + k][0] = t.s[k];
                m[1][i + k] = t.p[k];
                m[i + k][1] = t.p[k];
            }
            m[i][i] = t.d[0];
            m[i][i + 1] = t.d[1];
            m[i + 1][i] = t.d[1];
            m[i + 1][i + 1] = t.d[2];
            m[i + 2][i + 2] = t.d[3];
        }
        m
    }

    /// Bias forces less gravity, C q̇ − τ_g (N, N m): the force that holds q̈ at zero, friction
    /// apart.
    #[must_use]
    pub fn bias(&self) -> [f64; 8] {
        let [l, r] = &self.legs;
        [
            self.h_s, self.h_p, l.h[2], l.h[3], l.h[4], r.h[2], r.h[3], r.h[4],
        ]
    }

    /// Generalised force that gives an acceleration, friction included.
    #[must_use]
    pub fn inverse(&self, qdd: &[f64; 8]) -> [f64; 8] {
        let (m, h) = (self.mass_matrix(), self.bias());
        std::array::from_fn(|i| {
            let inertia: f64 = m[i].iter().zip(qdd).map(|(a, b)| a * b).sum();
            inertia + h[i] - self.damping[i]
        })
    }

    /// Kinetic energy (J) at the rates given.
    #[must_use]
    pub fn kinetic_energy_j(&self, qd: &[f64; 8]) -> f64 {
        let m = self.mass_matrix();
        let rows = m
            .iter()
            .zip(qd)
            .map(|(row, v)| v * row.iter().zip(qd).map(|(a, b)| a * b).sum::<f64>());
        0.5 * rows.sum::<f64>()
    }

    /// Centre of mass of the robot in ground axes (m).
    #[must_use]
    pub fn com_m(&self) -> [f64; 3] {
        self.com_m
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
