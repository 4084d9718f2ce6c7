//! The paper's natural orthogonal complement, block by block (readable, not fast).
//!
//! Body i: M_i ṫ_i = −W_i M_i t_i + w_i with the twist t = \[ω; ċ\], M_i = diag(I_i, m_i 1) and
//! W_i = diag(\[ω_i ×\], 0). With t = T q̇ stacked over the bodies (paper eqs. (40)–(54)):
//!
//! * I = Tᵀ M T, C = Tᵀ (M Ṫ + W M T);
//! * τ_l = I q̈ + C q̇ = τ_a + τ_g + τ_d + J_Pᵀ f_c, where the contact term is DERIVED (`MODEL.md`
//!   section 7).
//!
//! M and W are block-diagonal, so the products are sums over bodies and the stacked 6r × 6r
//! matrices are never formed. [`r2p`] and [`rpr`] are the two chains, (57)–(59) and (63)–(65)
//! with (58*) and (64*); [`Leg`] joins them through N; [`HalfRobot`] adds half the chassis and a
//! wheel (DERIVED, `MODEL.md` section 8).
//!
//! Vectors in F4 axes (X forward, Y left, Z up), SI units. Only the leg and the half robot have
//! foot and friction; the chains carry zeros there.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};
use wheeleg_kinematics::{LegGeometry, LegLengths, LegParameters, LegPosture};

use super::error::{DynamicsError, finite};
use super::params::{BodyParams, HalfRobotParams, LegBodies};

/// Unit vectors forward, left and up.
const I: Vector3<f64> = Vector3::new(1.0, 0.0, 0.0);
const J: Vector3<f64> = Vector3::new(0.0, 1.0, 0.0);
const K: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);
const O: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// Which rates of the vectors r_ij go into Ṫ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SlideRates {
    /// (58*), (64*): with the slides' own rates.
    Included,
    /// (58), (64) as printed: without them.
    Omitted,
}

/// One body's blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyBlock<const N: usize> {
    /// M_i = diag(I_i, m_i 1), inertia about the centre of mass in F4 axes (kg m², kg).
    pub m: Matrix6<f64>,
    /// W_i = diag(\[ω_i ×\], 0) (rad/s).
    pub w: Matrix6<f64>,
    /// T_i: twist of the body per rate.
    pub t: SMatrix<f64, 6, N>,
    /// Ṫ_i.
    pub t_dot: SMatrix<f64, 6, N>,
}

/// A system of B bodies and N coordinates at one position and velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct System<const B: usize, const N: usize> {
    /// The bodies in the order of the paper.
    pub bodies: [BodyBlock<N>; B],
    /// Rates q̇ the blocks were built for.
    pub rates: SVector<f64, N>,
    /// Viscous friction of each coordinate (N s/m).
    pub viscous: SVector<f64, N>,
    /// Foot Jacobian J_P.
    pub foot_jacobian: SMatrix<f64, 3, N>,
}

impl<const B: usize, const N: usize> System<B, N> {
    /// Generalised inertia I = TᵀMT.
    #[must_use]
    pub fn inertia(&self) -> SMatrix<f64, N, N> {
        self.bodies
            .iter()
            .map(|b| b.t.transpose() * b.m * b.t)
            .sum()
    }

    /// C = Tᵀ(MṪ + WMT).
    #[must_use]
    pub fn coriolis(&self) -> SMatrix<f64, N, N> {
        let of = |b: &BodyBlock<N>| b.t.transpose() * (b.m * b.t_dot + b.w * b.m * b.t);
        self.bodies.iter().map(of).sum()
    }

    /// τ_g for a gravity vector (m/s²).
    #[must_use]
    pub fn gravity_force(&self, gravity_m_s2: &Vector3<f64>) -> SVector<f64, N> {
        // M_i [0; g] = [0; m_i g]
        let pull = twist(O, *gravity_m_s2);
        self.bodies
            .iter()
            .map(|b| b.t.transpose() * (b.m * pull))
            .sum()
    }

    /// τ_d, viscous.
    #[must_use]
    pub fn dissipation(&self) -> SVector<f64, N> {
        -self.viscous.component_mul(&self.rates)
    }

    /// τ_l = I q̈ + C q̇.
    #[must_use]
    pub fn inertial_force(&self, accelerations: &SVector<f64, N>) -> SVector<f64, N> {
        self.inertia() * accelerations + self.coriolis() * self.rates
    }

    /// Actuator forces τ_a = τ_l − τ_g − τ_d − J_Pᵀ f_c for accelerations, gravity (m/s²) and the
    /// ground's force on the foot (N).
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`].
    pub fn inverse(
        &self,
        accelerations: &SVector<f64, N>,
        gravity_m_s2: &Vector3<f64>,
        foot_force_n: &Vector3<f64>,
    ) -> Result<SVector<f64, N>, DynamicsError> {
        let force = self.inertial_force(accelerations)
            - self.gravity_force(gravity_m_s2)
            - self.dissipation()
            - self.foot_jacobian.transpose() * foot_force_n;
        checked("force", force)
    }

    /// Accelerations q̈ = I⁻¹ (τ_a + τ_g + τ_d + J_Pᵀ f_c − C q̇).
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`]; [`DynamicsError::Singular`] for a massless coordinate.
    pub fn forward(
        &self,
        actuators: &SVector<f64, N>,
        gravity_m_s2: &Vector3<f64>,
        foot_force_n: &Vector3<f64>,
    ) -> Result<SVector<f64, N>, DynamicsError> {
        let force = actuators
            + self.gravity_force(gravity_m_s2)
            + self.dissipation()
            + self.foot_jacobian.transpose() * foot_force_n
            - self.coriolis() * self.rates;
        checked("force", force)?;
        let inertia = self.inertia();
        let Some(factor) = inertia.cholesky() else {
            return Err(DynamicsError::Singular {
                pivot: inertia.diagonal().min(),
            });
        };
        checked("acceleration", factor.solve(&force))
    }

    /// Kinetic energy ½ q̇ᵀ I q̇ (J).
    #[must_use]
    pub fn kinetic_energy_j(&self) -> f64 {
        0.5 * self.rates.dot(&(self.inertia() * self.rates))
    }
}

/// R2P chain, bodies 4–6, q = [θ4, b5, b6] (rad, m, m).
///
/// # Errors
/// [`DynamicsError::NonFinite`].
pub fn r2p(
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    r2p_with(SlideRates::Included, bodies, q, rates)
}

pub(super) fn r2p_with(
    slides: SlideRates,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    checked("position", *q)?;
    checked("velocity", *rates)?;
    let (sin4, cos4) = q.x.sin_cos();
    let n = Vector3::new(cos4, sin4, 0.0);
    let f = Vector3::new(sin4, -cos4, 0.0);
    let omega = rates.x * K;
    let (slide5, slide6) = match slides {
        SlideRates::Included => (rates.y * f, -rates.z * K),
        SlideRates::Omitted => (O, O),
    };
    let r5 = Matrix3::from_columns(&[n, K, f]);
    let r6 = Matrix3::from_columns(&[n, f, -K]);
    let a5 = q.y * f;
    let rho4 = r5 * com(&bodies[0]);
    let rho5 = a5 + r6 * com(&bodies[1]);
    let rho6 = -q.z * K + r6 * com(&bodies[2]);
    let r64 = a5 + rho6;
    let (r44_dot, r54_dot) = (omega.cross(&rho4), omega.cross(&rho5) + slide5);
    let r64_dot = omega.cross(&a5) + slide5 + omega.cross(&rho6) + slide6;
    let f_dot = omega.cross(&f);
    Ok(chain(
        rates,
        [
            block(
                &bodies[0],
                &r5,
                omega,
                [revolute(rho4), twist(O, O), twist(O, O)],
                [twist(O, K.cross(&r44_dot)), twist(O, O), twist(O, O)],
            ),
            block(
                &bodies[1],
                &r6,
                omega,
                [revolute(rho5), twist(O, f), twist(O, O)],
                [twist(O, K.cross(&r54_dot)), twist(O, f_dot), twist(O, O)],
            ),
            block(
                &bodies[2],
                &r6,
                omega,
                [revolute(r64), twist(O, f), twist(O, -K)],
                [twist(O, K.cross(&r64_dot)), twist(O, f_dot), twist(O, O)],
            ),
        ],
    ))
}

/// RPR chain, bodies 1–3, open, q = [θ1, b2, θ3] (rad, m, rad; θ3 relative), crank ℓ (m).
///
/// # Errors
/// [`DynamicsError::NonFinite`].
pub fn rpr(
    crank_m: f64,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    rpr_with(SlideRates::Included, crank_m, bodies, q, rates)
}

pub(super) fn rpr_with(
    slides: SlideRates,
    crank_m: f64,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    checked("position", *q)?;
    checked("velocity", *rates)?;
    let (sin1, cos1) = q.x.sin_cos();
    let phi = q.x + q.z - std::f64::consts::PI;
    let w = Vector3::new(cos1, sin1, 0.0);
    let u = Vector3::new(sin1, -cos1, 0.0);
    let v = Vector3::new(phi.cos(), phi.sin(), 0.0);
    let (omega1, omega3) = (rates.x * K, (rates.x + rates.z) * K);
    let slide2 = match slides {
        SlideRates::Included => rates.y * u,
        SlideRates::Omitted => O,
    };
    let r2 = Matrix3::from_columns(&[w, K, u]);
    let r3 = Matrix3::from_columns(&[-w, u, K]);
    let r4 = Matrix3::from_columns(&[v, K.cross(&v), K]);
    let a2 = q.y * u;
    let rho1 = r2 * com(&bodies[0]);
    let rho2 = a2 + r3 * com(&bodies[1]);
    let r33 = crank_m * v + r4 * com(&bodies[2]);
    let r31 = a2 + r33;
    let (r11_dot, r21_dot) = (omega1.cross(&rho1), omega1.cross(&rho2) + slide2);
    let r33_dot = omega3.cross(&r33);
    let r31_dot = omega1.cross(&a2) + slide2 + r33_dot;
    let u_dot = omega1.cross(&u);
    Ok(chain(
        rates,
        [
            block(
                &bodies[0],
                &r2,
                omega1,
                [revolute(rho1), twist(O, O), twist(O, O)],
                [twist(O, K.cross(&r11_dot)), twist(O, O), twist(O, O)],
            ),
            block(
                &bodies[1],
                &r3,
                omega1,
                [revolute(rho2), twist(O, u), twist(O, O)],
                [twist(O, K.cross(&r21_dot)), twist(O, u_dot), twist(O, O)],
            ),
            block(
                &bodies[2],
                &r4,
                omega3,
                [revolute(r31), twist(O, u), revolute(r33)],
                [
                    twist(O, K.cross(&r31_dot)),
                    twist(O, u_dot),
                    twist(O, K.cross(&r33_dot)),
                ],
            ),
        ],
    ))
}

/// The assembled leg, q = [b2, b5, b6] (m): six bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    geometry: LegGeometry<f64>,
    bodies: LegBodies,
    viscous: Vector3<f64>,
}

impl Leg {
    /// Dimensions, bodies and viscous friction of b2, b5, b6 (N s/m).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`] for impossible dimensions; [`DynamicsError::NonFinite`].
    pub fn new(
        dimensions: LegParameters<f64>,
        bodies: &LegBodies,
        viscous_n_s_m: [f64; 3],
    ) -> Result<Self, DynamicsError> {
        finite("viscous", &viscous_n_s_m)?;
        let geometry = LegGeometry::new(dimensions).map_err(refused)?;
        Ok(Self {
            geometry,
            bodies: *bodies,
            viscous: viscous_n_s_m.into(),
        })
    }

    /// The leg at lengths (m) and rates (m/s).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`], [`DynamicsError::NonFinite`].
    pub fn at(
        &self,
        q: &Vector3<f64>,
        rates: &Vector3<f64>,
    ) -> Result<System<6, 3>, DynamicsError> {
        self.at_with(SlideRates::Included, q, rates)
    }

    pub(super) fn at_with(
        &self,
        slides: SlideRates,
        q: &Vector3<f64>,
        rates: &Vector3<f64>,
    ) -> Result<System<6, 3>, DynamicsError> {
        checked("velocity", *rates)?;
        let posture: LegPosture<f64> = self
            .geometry
            .posture(&LegLengths::new(q.x, q.y, q.z))
            .map_err(refused)?;
        let x = posture.joints();
        let (n, n_dot) = (posture.n(), posture.n_dot(rates.x));
        let x_dot = n * rates;
        let [b1, b2, b3, b4, b5, b6] = self.bodies;
        let yaw = rpr_with(
            slides,
            self.geometry.parameters().crank_m,
            &[b1, b2, b3],
            &Vector3::new(x.theta1_rad, x.b2_m, x.theta3.rad()),
            &x_dot.fixed_rows::<3>(0).into_owned(),
        )?;
        let foot = r2p_with(
            slides,
            &[b4, b5, b6],
            &Vector3::new(x.theta4_rad, x.b5_m, x.b6_m),
            &x_dot.fixed_rows::<3>(3).into_owned(),
        )?;
        // T_leg = T N, Ṫ_leg = Ṫ N + T Ṅ, each chain with its own rows of N.
        let bodies = std::array::from_fn(|i| {
            let (body, row) = if i < 3 {
                (yaw.bodies[i], 0)
            } else {
                (foot.bodies[i - 3], 3)
            };
            let (n, n_dot) = (n.fixed_rows::<3>(row), n_dot.fixed_rows::<3>(row));
            BodyBlock {
                t: body.t * n,
                t_dot: body.t_dot * n + body.t * n_dot,
                ..body
            }
        });
        Ok(System {
            bodies,
            rates: *rates,
            viscous: self.viscous,
            foot_jacobian: posture.foot_jacobian(),
        })
    }
}

/// Half robot, q = [s, b2, b5, b6] (m): one leg, half the chassis, one wheel; no pitch.
#[derive(Debug, Clone, PartialEq)]
pub struct HalfRobot {
    params: HalfRobotParams,
    leg: Leg,
}

impl HalfRobot {
    /// The half robot.
    ///
    /// # Errors
    /// As [`Leg::new`].
    pub fn new(params: &HalfRobotParams) -> Result<Self, DynamicsError> {
        let [_, v2, v5, v6] = params.viscous_n_s_m;
        finite("viscous", &params.viscous_n_s_m)?;
        Ok(Self {
            leg: Leg::new(params.leg_parameters(), &params.leg_bodies, [v2, v5, v6])?,
            params: params.clone(),
        })
    }

    /// The half robot at lengths (m) and rates (m/s). The force on s is the wheel torque over r_w.
    ///
    /// # Errors
    /// As [`Leg::at`].
    pub fn at(
        &self,
        q: &SVector<f64, 4>,
        rates: &SVector<f64, 4>,
    ) -> Result<System<8, 4>, DynamicsError> {
        checked("position", *q)?;
        checked("velocity", *rates)?;
        let p = &self.params;
        let leg = self.leg.at(
            &q.fixed_rows::<3>(1).into_owned(),
            &rates.fixed_rows::<3>(1).into_owned(),
        )?;
        let carried = twist(O, I);
        let rolling = twist(J / p.wheel_radius_m, I);
        let still = SMatrix::zeros();
        let axle = p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2 * p.gear_ratio.powi(2);
        let bodies = std::array::from_fn(|i| match i {
            0..6 => BodyBlock {
                m: leg.bodies[i].m,
                w: leg.bodies[i].w,
                t: beside(&carried, &leg.bodies[i].t),
                t_dot: beside(&twist(O, O), &leg.bodies[i].t_dot),
            },
            6 => BodyBlock {
                m: body_mass(&Matrix3::zeros(), p.chassis_mass_kg),
                w: Matrix6::zeros(),
                t: beside(&carried, &still),
                t_dot: SMatrix::zeros(),
            },
            _ => BodyBlock {
                m: body_mass(&Matrix3::from_diagonal(&(axle * J)), p.wheel_mass_kg),
                w: spin(&(J * rates[0] / p.wheel_radius_m)),
                t: beside(&rolling, &still),
                t_dot: SMatrix::zeros(),
            },
        });
        Ok(System {
            bodies,
            rates: *rates,
            viscous: p.viscous_n_s_m.into(),
            foot_jacobian: beside(&I, &leg.foot_jacobian),
        })
    }
}

fn chain(rates: &Vector3<f64>, bodies: [BodyBlock<3>; 3]) -> System<3, 3> {
    System {
        bodies,
        rates: *rates,
        viscous: Vector3::zeros(),
        foot_jacobian: Matrix3::zeros(),
    }
}

fn block(
    body: &BodyParams,
    rotation: &Matrix3<f64>,
    omega: Vector3<f64>,
    t: [Vector6<f64>; 3],
    t_dot: [Vector6<f64>; 3],
) -> BodyBlock<3> {
    let principal = Matrix3::from_diagonal(&body.inertia_kg_m2.into());
    BodyBlock {
        m: body_mass(&(rotation * principal * rotation.transpose()), body.mass_kg),
        w: spin(&omega),
        t: SMatrix::from_columns(&t),
        t_dot: SMatrix::from_columns(&t_dot),
    }
}

fn body_mass(inertia: &Matrix3<f64>, mass_kg: f64) -> Matrix6<f64> {
    let mut m = Matrix6::from_diagonal_element(mass_kg);
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(inertia);
    m
}

fn spin(omega: &Vector3<f64>) -> Matrix6<f64> {
    let mut w = Matrix6::zeros();
    w.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&omega.cross_matrix());
    w
}

/// Twist \[ω; ċ\].
fn twist(omega: Vector3<f64>, velocity: Vector3<f64>) -> Vector6<f64> {
    let (w, v) = (omega, velocity);
    Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z)
}

/// Column \[k; k × r\] of a vertical revolute joint with its mass centre at r.
fn revolute(r: Vector3<f64>) -> Vector6<f64> {
    twist(K, K.cross(&r))
}

/// A column and three more.
fn beside<const R: usize>(
    first: &SVector<f64, R>,
    rest: &SMatrix<f64, R, 3>,
) -> SMatrix<f64, R, 4> {
    SMatrix::from_fn(|row, column| {
        if column == 0 {
            first[row]
        } else {
            rest[(row, column - 1)]
        }
    })
}

fn com(body: &BodyParams) -> Vector3<f64> {
    body.com_m.into()
}

fn refused(source: wheeleg_kinematics::KinematicsError<f64>) -> DynamicsError {
    DynamicsError::Leg { leg: 0, source }
}

fn checked<const N: usize>(
    name: &'static str,
    v: SVector<f64, N>,
) -> Result<SVector<f64, N>, DynamicsError> {
    let values: [f64; N] = v.into();
    finite(name, &values)?;
    Ok(v)
}
