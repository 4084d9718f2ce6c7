//! The robot at one state: mass matrix, bias, and the solution for accelerations.

use super::dynamics::RobotSide;
use super::finite;
use super::foot::FootKin;
use super::leg::LegTerms;
use wheeleg_plant::dynamics::DynamicsError;

/// Kinematics and mass matrix at one state, ready to solve for accelerations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RobotKin {
    /// Left and right foot.
    pub(crate) feet: [FootKin; 2],
    pub(super) ss: f64,
    pub(super) sp: f64,
    pub(super) pp: f64,
    pub(super) legs: [LegTerms; 2],
    /// Bias and gravity on s and p.
    pub(super) h_s: f64,
    pub(super) h_p: f64,
    /// Viscous forces already negated.
    pub(super) damping: [f64; 8],
    pub(super) com_m: [f64; 3],
}

impl RobotKin {
    /// Refuses values to which finite positions and rates overflowed.
    pub(super) fn overflow(&self) -> Result<(), DynamicsError> {
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
    pub(crate) fn solve(&self, generalised_force: &[f64; 8]) -> Result<[f64; 8], DynamicsError> {
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
    pub(crate) fn add_foot_force(
        &self,
        side: RobotSide,
        force_n: &[f64; 3],
        generalised: &mut [f64; 8],
    ) {
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
    pub(crate) fn mass_matrix(&self) -> [[f64; 8]; 8] {
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
    pub(crate) fn bias(&self) -> [f64; 8] {
        let [l, r] = &self.legs;
        [
            self.h_s, self.h_p, l.h[2], l.h[3], l.h[4], r.h[2], r.h[3], r.h[4],
        ]
    }

    /// Generalised force that gives an acceleration, friction included.
    #[must_use]
    pub(crate) fn inverse(&self, qdd: &[f64; 8]) -> [f64; 8] {
        let (m, h) = (self.mass_matrix(), self.bias());
        std::array::from_fn(|i| {
            let inertia: f64 = m[i].iter().zip(qdd).map(|(a, b)| a * b).sum();
            inertia + h[i] - self.damping[i]
        })
    }

    /// Kinetic energy (J) at the rates given.
    #[must_use]
    pub(crate) fn kinetic_energy_j(&self, qd: &[f64; 8]) -> f64 {
        let m = self.mass_matrix();
        let rows = m
            .iter()
            .zip(qd)
            .map(|(row, v)| v * row.iter().zip(qd).map(|(a, b)| a * b).sum::<f64>());
        0.5 * rows.sum::<f64>()
    }

    /// Centre of mass of the robot in ground axes (m).
    #[must_use]
    pub(crate) fn com_m(&self) -> [f64; 3] {
        self.com_m
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
