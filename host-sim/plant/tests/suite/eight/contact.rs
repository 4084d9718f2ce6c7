//! A foot on level ground as one point: normal force, friction with true stick.
//!
//! # Normal force
//!
//! Hunt and Crossley (1975) with exponent one: F = k δ (1 + λ δ̇), never below zero. It is
//! continuous at touch-down (F = 0 at δ = 0 whatever the speed), pulls nothing back on lift-off,
//! and dissipates.
//!
//! # Friction
//!
//! An elastic–plastic bristle (a two-dimensional brush): the bristle stretches with the sliding
//! of the sole, F = −σ0 z − σ1 v, and total force and stretch are limited to the friction
//! circle μ(v) F. Below the limit it is a spring: a foot under a steady load below μ F does not
//! creep, as it would with the plain LuGre bristle (Dupont et al., 2002). Above the limit the
//! bristle is dragged along: Coulomb friction, with μ falling from static to kinetic over the
//! Stribeck velocity.
//!
//! The foot touches in its sole's centre: a moment about the sole is not transferred.

use super::foot::FootKin;
use wheeleg_plant::contact::ContactLaw;

/// Height and normal of the ground at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GroundPoint {
    /// Height (m).
    pub(crate) height_m: f64,
    /// Unit normal, upwards.
    pub(crate) normal: [f64; 3],
}

/// The ground's surface in ground axes (x along the travel, y left, z up).
pub(crate) trait GroundHeight {
    /// Surface at x, y (m).
    fn at(&self, x_m: f64, y_m: f64) -> GroundPoint;
}

/// Flat ground at height 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct FlatGround;

impl GroundHeight for FlatGround {
    fn at(&self, _x_m: f64, _y_m: f64) -> GroundPoint {
        GroundPoint {
            height_m: 0.0,
            normal: [0.0, 0.0, 1.0],
        }
    }
}

/// Parameters of foot and ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactParams {
    /// Normal stiffness k (N/m).
    pub(crate) stiffness_n_m: f64,
    /// Hunt–Crossley damping λ (s/m).
    pub(crate) damping_s_m: f64,
    /// Static friction coefficient.
    pub(crate) mu_static: f64,
    /// Kinetic friction coefficient, at most the static one.
    pub(crate) mu_kinetic: f64,
    /// Stribeck velocity (m/s).
    pub(crate) stribeck_m_s: f64,
    /// Bristle stiffness σ0 (N/m).
    pub(crate) bristle_stiffness_n_m: f64,
    /// Bristle damping σ1 (N s/m).
    pub(crate) bristle_damping_n_s_m: f64,
}

/// State of a contact from step to step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct ContactState {
    /// Bristle stretch along the two tangents (m): sole ahead of its bristle's root.
    pub(crate) bristle_m: [f64; 2],
}

/// Forces of one foot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct ContactForce {
    /// Force on the foot (N), ground axes.
    pub(crate) force_n: [f64; 3],
    /// Normal component (N), not negative.
    pub(crate) normal_n: f64,
    /// Penetration (m), zero in the air.
    pub(crate) penetration_m: f64,
    /// The friction circle is reached: the foot slips.
    pub(crate) slipping: bool,
}

/// Where the sole's centre is against the ground.
struct Touch {
    penetration_m: f64,
    /// Speed into the ground (m/s).
    closing_m_s: f64,
    normal: [f64; 3],
    tangents: [[f64; 3]; 2],
    slide_m_s: [f64; 2],
}

impl ContactParams {
    /// The sole's law.
    pub(crate) fn of(law: &ContactLaw) -> Self {
        Self {
            stiffness_n_m: law.stiffness_n_m,
            damping_s_m: law.damping_s_m,
            mu_static: law.mu_static,
            mu_kinetic: law.mu_kinetic,
            stribeck_m_s: law.stribeck_m_s,
            bristle_stiffness_n_m: law.bristle_stiffness_n_m,
            bristle_damping_n_s_m: law.bristle_damping_n_s_m,
        }
    }

    /// Friction coefficient at a sliding speed (m/s).
    #[must_use]
    pub(crate) fn mu(&self, speed_m_s: f64) -> f64 {
        let ratio = speed_m_s / self.stribeck_m_s;
        self.mu_kinetic + (self.mu_static - self.mu_kinetic) * libm::exp(-ratio * ratio)
    }

    /// Normal force (N) at a penetration (m) and a speed into the ground (m/s).
    #[must_use]
    pub(crate) fn normal_force_n(&self, penetration_m: f64, closing_m_s: f64) -> f64 {
        if penetration_m <= 0.0 {
            return 0.0;
        }
        let elastic = self.stiffness_n_m * penetration_m;
        (elastic * (1.0 + self.damping_s_m * closing_m_s)).max(0.0)
    }

    /// Force of the ground on a foot.
    #[must_use]
    pub(crate) fn force(
        &self,
        state: &ContactState,
        foot: &FootKin,
        ground: &impl GroundHeight,
    ) -> ContactForce {
        let Some(touch) = Touch::of(foot, ground) else {
            return ContactForce::default();
        };
        let normal_n = self.normal_force_n(touch.penetration_m, touch.closing_m_s);
        let limit = self.mu(length(touch.slide_m_s)) * normal_n;
        let pull: [f64; 2] = std::array::from_fn(|i| {
            -self.bristle_stiffness_n_m * state.bristle_m[i]
                - self.bristle_damping_n_s_m * touch.slide_m_s[i]
        });
        let (friction, slipping) = within(pull, limit);
        ContactForce {
            force_n: std::array::from_fn(|i| {
                normal_n * touch.normal[i]
                    + friction[0] * touch.tangents[0][i]
                    + friction[1] * touch.tangents[1][i]
            }),
            normal_n,
            penetration_m: touch.penetration_m,
            slipping,
        }
    }

    /// Bristle after `h_s` seconds at the foot's speed. In the air it relaxes at once.
    pub(crate) fn advance(
        &self,
        state: &mut ContactState,
        foot: &FootKin,
        ground: &impl GroundHeight,
        h_s: f64,
    ) {
        let Some(touch) = Touch::of(foot, ground) else {
            *state = ContactState::default();
            return;
        };
        let normal_n = self.normal_force_n(touch.penetration_m, touch.closing_m_s);
        let limit = self.mu(length(touch.slide_m_s)) * normal_n / self.bristle_stiffness_n_m;
        let stretched = std::array::from_fn(|i| state.bristle_m[i] + h_s * touch.slide_m_s[i]);
        (state.bristle_m, _) = within(stretched, limit);
    }
}

impl Touch {
    fn of(foot: &FootKin, ground: &impl GroundHeight) -> Option<Self> {
        let surface = ground.at(foot.position_m[0], foot.position_m[1]);
        let penetration_m = depth(&foot.position_m, &surface);
        if penetration_m <= 0.0 {
            return None;
        }
        let n = surface.normal;
        // First tangent: X laid into the surface. It is never vertical, so never zero.
        let scale = 1.0 / libm::hypot(n[2], n[0]);
        let t1 = [n[2] * scale, 0.0, -n[0] * scale];
        let t2 = [
            n[1] * t1[2] - n[2] * t1[1],
            n[2] * t1[0] - n[0] * t1[2],
            n[0] * t1[1] - n[1] * t1[0],
        ];
        let v = foot.velocity_m_s;
        Some(Self {
            penetration_m,
            closing_m_s: -dot(n, v),
            normal: n,
            tangents: [t1, t2],
            slide_m_s: [dot(t1, v), dot(t2, v)],
        })
    }
}

/// Depth of a point below the surface, along the normal (m).
fn depth(point: &[f64; 3], surface: &GroundPoint) -> f64 {
    (surface.height_m - point[2]) * surface.normal[2]
}

/// A vector shortened to a limit; true if it was longer.
fn within(v: [f64; 2], limit: f64) -> ([f64; 2], bool) {
    let size = length(v);
    if size <= limit {
        return (v, false);
    }
    let scale = limit / size;
    ([v[0] * scale, v[1] * scale], true)
}

fn length(v: [f64; 2]) -> f64 {
    libm::hypot(v[0], v[1])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
