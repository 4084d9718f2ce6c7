//! The robot's own leg on the chain engine: the open tree of six bodies, closed by N.
//!
//! The tree has two branches, yaw barrel – yaw rod – crank and carriage – horizontal carriage –
//! vertical rod. Joint rates are N q̇ and joint accelerations N q̈ + Ṅ q̇ (paper eqs. (36)–(39)), so
//! forces and mass matrix of the tree become Nᵀτ and NᵀHN.

use wheeleg_kinematics::{LegGeometry, LegLengths, LegParameters, LegPosture};

use super::finite;
use super::link::{End, LinkParams, Py, Pz, Rz};
use super::model::{Fixed, floats};
use super::tree::Rates;
use wheeleg_plant::dynamics::{BodyParams, DynamicsError, LegBodies};

/// Origins and products are zero, the mass centre is anywhere.
const BODY: u16 = 0b000_111_000;

type Crank = Rz<BODY>;
type YawRod = Py<BODY, Crank>;
type YawBarrel = Rz<BODY, YawRod>;
type VerticalRod = Pz<BODY>;
type Horizontal = Py<BODY, VerticalRod>;
type Carriage = Rz<BODY, Horizontal>;

/// The assembled leg, q = [b2, b5, b6] (m): same numbers as [`wheeleg_plant::dynamics::noc::Leg`].
#[derive(Debug, Clone, PartialEq)]
pub struct ChainLeg {
    geometry: LegGeometry<f64>,
    /// Joints θ1, −b2, θ3 − π; θ4, −b5, −b6: the slides' axes point against theirs.
    tree: Fixed<(YawBarrel, Carriage), 6>,
    viscous_n_s_m: [f64; 3],
}

/// The leg's frames in the tree's: source index and sign of x, y and z.
type Axes = [(usize, f64); 3];

impl ChainLeg {
    /// Dimensions, bodies and viscous friction of b2, b5, b6 (N s/m).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`] for impossible dimensions, [`DynamicsError::NonFinite`] for friction,
    /// [`DynamicsError::Parameter`] for a body.
    pub fn new(
        dimensions: LegParameters<f64>,
        bodies: &LegBodies,
        viscous_n_s_m: [f64; 3],
    ) -> Result<Self, DynamicsError> {
        finite("viscous", &viscous_n_s_m)?;
        let geometry = LegGeometry::new(dimensions).map_err(refused)?;
        // Columns of the link frames with lateral axis x, forward axis −y and z up.
        let upright: Axes = [(0, 1.0), (2, -1.0), (1, 1.0)];
        let rod: Axes = [(0, -1.0), (1, -1.0), (2, 1.0)];
        let crank: Axes = [(0, 1.0), (1, 1.0), (2, 1.0)];
        let hanging: Axes = [(0, 1.0), (1, -1.0), (2, -1.0)];
        let [b1, b2, b3, b4, b5, b6] = bodies;
        let mut b3 = link(b3, crank);
        b3.com_m[0] += dimensions.crank_m;
        let yaw = Crank::new(&b3, End)?;
        let yaw = YawBarrel::new(&link(b1, upright), YawRod::new(&link(b2, rod), yaw)?)?;
        let foot = VerticalRod::new(&link(b6, hanging), End)?;
        let foot = Carriage::new(
            &link(b4, upright),
            Horizontal::new(&link(b5, hanging), foot)?,
        )?;
        Ok(Self {
            geometry,
            tree: Fixed::new((yaw, foot)),
            viscous_n_s_m,
        })
    }

    /// Actuator forces (N) for lengths, rates, accelerations, gravity (m/s²) and the ground's force
    /// on the foot (N), all in chassis axes.
    ///
    /// # Errors
    /// [`DynamicsError::Leg`], [`DynamicsError::NonFinite`].
    pub fn inverse(
        &self,
        q_m: &[f64; 3],
        v_m_s: &[f64; 3],
        a_m_s2: &[f64; 3],
        gravity_m_s2: &[f64; 3],
        foot_force_n: &[f64; 3],
    ) -> Result<[f64; 3], DynamicsError> {
        finite("velocity", v_m_s)?;
        finite("acceleration", a_m_s2)?;
        let posture = self.posture(q_m)?;
        let tau = self.forces(&posture, v_m_s, a_m_s2, gravity_m_s2);
        let outer = self.outer(&posture, v_m_s, foot_force_n);
        result("force", std::array::from_fn(|i| tau[i] - outer[i]))
    }

    /// Accelerations (m/s²) for lengths, rates, actuator forces (N), gravity (m/s²) and the ground's
    /// force on the foot (N).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`], [`DynamicsError::NonFinite`]; [`DynamicsError::Singular`] for a
    /// massless coordinate.
    pub fn forward(
        &self,
        q_m: &[f64; 3],
        v_m_s: &[f64; 3],
        actuators_n: &[f64; 3],
        gravity_m_s2: &[f64; 3],
        foot_force_n: &[f64; 3],
    ) -> Result<[f64; 3], DynamicsError> {
        finite("velocity", v_m_s)?;
        let posture = self.posture(q_m)?;
        let bias = self.forces(&posture, v_m_s, &[0.0; 3], gravity_m_s2);
        let outer = self.outer(&posture, v_m_s, foot_force_n);
        let force: [f64; 3] = std::array::from_fn(|i| actuators_n[i] + outer[i] - bias[i]);
        finite("force", &force)?;
        let m = self.inertia_at(&posture);
        // b6 moves along the yaw axis: it is coupled with nothing. The rest is 2 × 2.
        let schur = m[0][0] - m[0][1] * m[0][1] / m[1][1];
        for pivot in [m[1][1], m[2][2], schur] {
            if pivot.is_nan() || pivot <= 0.0 {
                return Err(DynamicsError::Singular { pivot });
            }
        }
        let a2 = (force[0] - m[0][1] / m[1][1] * force[1]) / schur;
        let a5 = (force[1] - m[0][1] * a2) / m[1][1];
        result("acceleration", [a2, a5, force[2] / m[2][2]])
    }

    /// Generalised inertia NᵀHN (kg).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`]; [`DynamicsError::NonFinite`] if an entry overflows (with its column).
    pub fn inertia(&self, q_m: &[f64; 3]) -> Result<[[f64; 3]; 3], DynamicsError> {
        let rows = self.inertia_at(&self.posture(q_m)?);
        for row in &rows {
            finite("mass matrix", row)?;
        }
        Ok(rows)
    }

    fn posture(&self, q: &[f64; 3]) -> Result<LegPosture<f64>, DynamicsError> {
        let [b2, b5, b6] = *q;
        self.geometry
            .posture(&LegLengths::new(b2, b5, b6))
            .map_err(refused)
    }

    /// I q̈ + C q̇ − τ_g.
    #[inline(always)]
    fn forces(&self, p: &LegPosture<f64>, v: &[f64; 3], a: &[f64; 3], g: &[f64; 3]) -> [f64; 3] {
        let n = column(p);
        let n_dot = [
            p.theta1_second * v[0],
            0.0,
            (p.phi_second - p.theta1_second) * v[0],
            p.phi_second * v[0],
        ];
        let rate = |i: usize| n[i] * v[0];
        let acceleration = |i: usize| n[i] * a[0] + n_dot[i] * v[0];
        let rates = [rate(0), rate(1), rate(2), rate(3), -v[1], -v[2]];
        let accelerations = [
            acceleration(0),
            acceleration(1),
            acceleration(2),
            acceleration(3),
            -a[1],
            -a[2],
        ];
        let poses = self.tree.poses(&positions(p));
        let rates = Rates {
            v: &rates,
            a: Some(&accelerations),
        };
        let tau = floats(&self.tree.forces(&poses, &rates, g));
        let b2 = (n[0] * tau[0] - tau[1]) + (n[2] * tau[2] + n[3] * tau[3]);
        [b2, -tau[4], -tau[5]]
    }

    /// Contact and friction: J_Pᵀ f_c + τ_d.
    #[inline(always)]
    fn outer(&self, p: &LegPosture<f64>, v: &[f64; 3], force: &[f64; 3]) -> [f64; 3] {
        let [x, y, z] = *force;
        let [d2, d5, d6] = self.viscous_n_s_m;
        let arm = p.lengths.b5_m * p.phi_prime;
        [
            arm * (p.cos4 * x + p.sin4 * y) - d2 * v[0],
            p.sin4 * x - p.cos4 * y - d5 * v[1],
            -z - d6 * v[2],
        ]
    }

    #[inline(always)]
    fn inertia_at(&self, p: &LegPosture<f64>) -> [[f64; 3]; 3] {
        let h = self.tree.matrix(&self.tree.poses(&positions(p)));
        // Lower triangle; the slides' signs are in N.
        let h = |i: usize, j: usize| h[i][j].get();
        let n = column(p);
        let mut b22 = n[3] * n[3] * h(3, 3);
        for i in 0..3 {
            b22 += n[i] * n[i] * h(i, i);
            for j in 0..i {
                b22 += 2.0 * n[i] * n[j] * h(i, j);
            }
        }
        let (b25, b26) = (-n[3] * h(4, 3), -n[3] * h(5, 3));
        [
            [b22, b25, b26],
            [b25, h(4, 4), h(5, 4)],
            [b26, h(5, 4), h(5, 5)],
        ]
    }
}

/// N's column of b2 over the tree's joints θ1, −b2, θ3, θ4.
fn column(p: &LegPosture<f64>) -> [f64; 4] {
    [
        p.theta1_prime,
        -1.0,
        p.phi_prime - p.theta1_prime,
        p.phi_prime,
    ]
}

/// The posture knows sines and cosines; no angle is needed.
fn positions(p: &LegPosture<f64>) -> [(f64, f64); 6] {
    let slide = |b: f64| (-b, 0.0);
    [
        (p.sin1, p.cos1),
        slide(p.lengths.b2_m),
        (-p.sin3, -p.cos3),
        (p.sin4, p.cos4),
        slide(p.lengths.b5_m),
        slide(p.lengths.b6_m),
    ]
}

fn link(body: &BodyParams, axes: Axes) -> LinkParams {
    LinkParams {
        origin_m: [0.0; 3],
        mass_kg: body.mass_kg,
        com_m: axes.map(|(i, sign)| sign * body.com_m[i]),
        moments_kg_m2: axes.map(|(i, _)| body.inertia_kg_m2[i]),
        products_kg_m2: [0.0; 3],
    }
}

fn refused(source: wheeleg_kinematics::KinematicsError<f64>) -> DynamicsError {
    DynamicsError::Leg { leg: 0, source }
}

fn result(name: &'static str, values: [f64; 3]) -> Result<[f64; 3], DynamicsError> {
    finite(name, &values)?;
    Ok(values)
}
