//! The law of a hard contact: normal force, friction with true stick.
//!
//! # Normal force
//!
//! Hunt and Crossley (1975) with exponent one: F = k δ (1 + λ δ̇), never below zero. It is
//! continuous at touch-down (F = 0 at δ = 0 whatever the speed), pulls nothing back on lift-off,
//! and dissipates.
//!
//! # Friction
//!
//! An elastic–plastic bristle (a two-dimensional brush): the bristle stretches with the sliding of the body,
//! F = −σ0 z − σ1 v, and total force and stretch are limited to the friction circle μ(v) F. Below the limit
//! it is a spring: a foot under a steady load below μ F does not creep, as it would with the plain LuGre
//! bristle (Dupont et al., 2002). Above the limit the bristle is dragged along: Coulomb friction, with μ
//! falling from static to kinetic over the Stribeck velocity. The stretch is a vector in the world frame,
//! projected into the tangent plane in every step, so that it follows a curved surface.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::both::{Both, both, each, same};
use crate::error::{PlantError, check};
use crate::terrain::Material;

/// Parameters of one contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ContactLaw {
    /// Normal stiffness k \[N/m\].
    pub stiffness_n_m: f64,
    /// Hunt–Crossley damping λ \[s/m\].
    pub damping_s_m: f64,
    /// Static friction coefficient.
    pub mu_static: f64,
    /// Kinetic friction coefficient, at most the static one.
    pub mu_kinetic: f64,
    /// Stribeck velocity \[m/s\].
    pub stribeck_m_s: f64,
    /// Bristle stiffness σ0 \[N/m\].
    pub bristle_stiffness_n_m: f64,
    /// Bristle damping σ1 \[N s/m\].
    pub bristle_damping_n_s_m: f64,
}

/// How a body touches one surface at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Penetration \[m\], above 0.
    pub depth_m: f64,
    /// Outward unit normal of the surface.
    pub normal: Vector3<f64>,
    /// Velocity of the body's point against the surface \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Displacement of that point since the last instant \[m\].
    pub moved_m: Vector3<f64>,
    /// The ground.
    pub material: Material,
}

/// Force of a surface on a body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ContactForce {
    /// Force \[N\], world axes.
    pub force_n: Vector3<f64>,
    /// Normal component \[N\], not negative.
    pub normal_n: f64,
    /// The friction circle is reached.
    pub slipping: bool,
}

impl ContactLaw {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("contact.stiffness_n_m", self.stiffness_n_m, 1.0, 1e9)?;
        check("contact.damping_s_m", self.damping_s_m, 0.0, 1e3)?;
        check("contact.mu_static", self.mu_static, 0.0, 10.0)?;
        check("contact.mu_kinetic", self.mu_kinetic, 0.0, self.mu_static)?;
        check("contact.stribeck_m_s", self.stribeck_m_s, 1e-6, 10.0)?;
        check(
            "contact.bristle_stiffness_n_m",
            self.bristle_stiffness_n_m,
            1.0,
            1e9,
        )?;
        check(
            "contact.bristle_damping_n_s_m",
            self.bristle_damping_n_s_m,
            0.0,
            1e6,
        )
    }

    /// The law of one of `count` equal contacts that make up this one.
    #[must_use]
    pub fn shared_by(&self, count: usize) -> Self {
        self.scaled(1.0 / count as f64)
    }

    /// The law of a contact that bears this share of it.
    #[must_use]
    #[inline]
    pub fn scaled(&self, share: f64) -> Self {
        Self {
            stiffness_n_m: share * self.stiffness_n_m,
            bristle_stiffness_n_m: share * self.bristle_stiffness_n_m,
            bristle_damping_n_s_m: share * self.bristle_damping_n_s_m,
            ..*self
        }
    }

    /// Static and kinetic friction on a material: of two the smaller.
    #[inline]
    pub(crate) fn friction_on(&self, material: &Material) -> [f64; 2] {
        // A comparison alone: `f64::min` also minds NaN, in every contact of every step.
        let less = |own: f64, other: f64| if other < own { other } else { own };
        [
            less(self.mu_static, material.mu_static),
            less(self.mu_kinetic, material.mu_kinetic),
        ]
    }

    /// Normal force \[N\] at a penetration \[m\] and a speed into the ground \[m/s\].
    #[must_use]
    #[inline]
    pub fn normal_force_n(&self, depth_m: f64, closing_m_s: f64) -> f64 {
        if depth_m <= 0.0 {
            return 0.0;
        }
        let elastic = self.stiffness_n_m * depth_m;
        (elastic * (1.0 + self.damping_s_m * closing_m_s)).max(0.0)
    }

    /// Stretches the bristle by the body's displacement, and returns the force on the body.
    #[must_use]
    #[inline]
    pub fn force(&self, stretch_m: &mut Vector3<f64>, touch: &Touch) -> ContactForce {
        let n = &touch.normal;
        // Speed, and where the bristle's end has come to: along the surface.
        let motion = both(&touch.velocity_m_s, &(*stretch_m + touch.moved_m));
        let normal: Vector3<Both> = same(n);
        let away = normal.x * motion.x + normal.y * motion.y + normal.z * motion.z;
        let [slide, laid] = each(&(motion - normal * away));
        let normal_n = self.normal_force_n(touch.depth_m, -away.to_array()[0]);
        let elastic = -self.bristle_stiffness_n_m * laid;
        let pull = elastic - self.bristle_damping_n_s_m * slide;

        // Within the kinetic circle nothing slips at any speed.
        let [mu_static, mu_kinetic] = self.friction_on(&touch.material);
        let sure = mu_kinetic * normal_n;
        let (stretched, pulled) = (elastic.norm_squared(), pull.norm_squared());
        let (friction, slipping) = if stretched <= sure * sure && pulled <= sure * sure {
            *stretch_m = laid;
            (pull, false)
        } else {
            let ratio = slide.norm() / self.stribeck_m_s;
            // Beyond six Stribeck velocities static friction has no share left.
            let share = if ratio < 6.0 {
                libm::exp(-ratio * ratio)
            } else {
                0.0
            };
            let most = (mu_kinetic + (mu_static - mu_kinetic) * share) * normal_n;
            *stretch_m = laid * shortening(stretched, most);
            (pull * shortening(pulled, most), pulled > most * most)
        };
        ContactForce {
            force_n: normal_n * n + friction,
            normal_n,
            slipping,
        }
    }
}

/// Factor that brings a vector of this squared length down to `most`.
#[inline]
fn shortening(squared: f64, most: f64) -> f64 {
    if squared <= most * most {
        1.0
    } else {
        most / squared.sqrt()
    }
}
