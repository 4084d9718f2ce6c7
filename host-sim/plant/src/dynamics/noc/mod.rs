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

mod chains;
mod half_robot;
mod leg;

pub use chains::{r2p, rpr};
pub use half_robot::HalfRobot;
pub use leg::Leg;

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use super::error::{DynamicsError, finite};
use super::params::BodyParams;

/// Unit vectors forward, left and up.
pub(super) const I: Vector3<f64> = Vector3::new(1.0, 0.0, 0.0);
pub(super) const J: Vector3<f64> = Vector3::new(0.0, 1.0, 0.0);
pub(super) const K: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);
pub(super) const O: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

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
    /// Passes a system whose blocks are finite; refuses finite states that overflowed, with the number of the
    /// body.
    pub(super) fn finite(self) -> Result<Self, DynamicsError> {
        for (index, b) in self.bodies.iter().enumerate() {
            let parts = [
                ("mass of body", b.m.as_slice()),
                ("spin of body", b.w.as_slice()),
                ("twist of body", b.t.as_slice()),
                ("twist rate of body", b.t_dot.as_slice()),
            ];
            for (name, values) in parts {
                if let Some(&value) = values.iter().find(|v| !v.is_finite()) {
                    return Err(DynamicsError::NonFinite { name, index, value });
                }
            }
        }
        Ok(self)
    }

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
        checked("acceleration", *accelerations)?;
        checked("gravity", *gravity_m_s2)?;
        checked("foot force", *foot_force_n)?;
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
        checked("actuator force", *actuators)?;
        checked("gravity", *gravity_m_s2)?;
        checked("foot force", *foot_force_n)?;
        let force = actuators
            + self.gravity_force(gravity_m_s2)
            + self.dissipation()
            + self.foot_jacobian.transpose() * foot_force_n
            - self.coriolis() * self.rates;
        checked("force", force)?;
        let inertia = self.inertia();
        let Some(factor) = inertia.cholesky() else {
            return Err(DynamicsError::Singular {
                pivot: bad_pivot(inertia),
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

/// The first pivot of an elimination that is not positive, NaN included; the last one if only rounding made
/// the difference.
fn bad_pivot<const N: usize>(mut m: SMatrix<f64, N, N>) -> f64 {
    let mut pivot = 0.0;
    for k in 0..N {
        pivot = m[(k, k)];
        if pivot.is_nan() || pivot <= 0.0 {
            break;
        }
        for i in k + 1..N {
            let factor = m[(i, k)] / pivot;
            for j in k + 1..N {
                m[(i, j)] -= factor * m[(k, j)];
            }
        }
    }
    pivot
}

/// Where a body is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Rotation: link axes of `MODEL.md` section 1 to F4 axes.
    pub rotation: Matrix3<f64>,
    /// Centre of mass (m, F4 axes) from the origin of the body's chain.
    pub com_m: Vector3<f64>,
}

pub(super) fn body_mass(inertia: &Matrix3<f64>, mass_kg: f64) -> Matrix6<f64> {
    let mut m = Matrix6::from_diagonal_element(mass_kg);
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(inertia);
    m
}

pub(super) fn spin(omega: &Vector3<f64>) -> Matrix6<f64> {
    let mut w = Matrix6::zeros();
    w.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&omega.cross_matrix());
    w
}

/// Twist \[ω; ċ\].
pub(super) fn twist(omega: Vector3<f64>, velocity: Vector3<f64>) -> Vector6<f64> {
    let (w, v) = (omega, velocity);
    Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z)
}

fn com(body: &BodyParams) -> Vector3<f64> {
    body.com_m.into()
}

pub(super) fn checked<const N: usize>(
    name: &'static str,
    v: SVector<f64, N>,
) -> Result<SVector<f64, N>, DynamicsError> {
    let values: [f64; N] = v.into();
    finite(name, &values)?;
    Ok(v)
}
