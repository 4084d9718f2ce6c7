//! Bodies that share a yaw angle, as one composite.
//!
//! Axes (a, b, z): a along the cylinder, b to its left, z up; a = \[sin, −cos\] and b = \[cos, sin\]
//! of the yaw angle (θ1 or θ4) in chassis axes. Moments are about the yaw axis's point O.

use nalgebra::Vector3;

use crate::dynamics::params::BodyParams;

/// Symmetric 3 × 3.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sym3 {
    pub(super) xx: f64,
    pub(super) yy: f64,
    pub(super) zz: f64,
    pub(super) xy: f64,
    pub(super) xz: f64,
    pub(super) yz: f64,
}

impl Sym3 {
    /// Of a mass at r: m (|r|² 1 − r rᵀ), plus principal inertias.
    #[inline]
    pub(super) fn of_body(m: f64, r: &Vector3<f64>, principal: &Vector3<f64>) -> Self {
        let s = m * r;
        let (xx, yy, zz) = (s.x * r.x, s.y * r.y, s.z * r.z);
        Self {
            xx: principal.x + yy + zz,
            yy: principal.y + xx + zz,
            zz: principal.z + xx + yy,
            xy: -s.x * r.y,
            xz: -s.x * r.z,
            yz: -s.y * r.z,
        }
    }

    #[inline]
    pub(super) fn plus(&self, o: &Self) -> Self {
        Self {
            xx: self.xx + o.xx,
            yy: self.yy + o.yy,
            zz: self.zz + o.zz,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yz: self.yz + o.yz,
        }
    }

    #[inline]
    pub(super) fn times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// Moves the point of reference: the composite lies at `pivot` from the new one, with first
    /// moment h about the old one, both in this tensor's axes. The constant part
    /// m (|pivot|² 1 − pivot pivotᵀ) is left out: it is added once and for all.
    #[inline]
    pub(super) fn shifted(&self, pivot: &Vector3<f64>, h: &Vector3<f64>) -> Self {
        let (x, y, z) = (pivot.x * h.x, pivot.y * h.y, pivot.z * h.z);
        Self {
            xx: self.xx + 2.0 * (y + z),
            yy: self.yy + 2.0 * (x + z),
            zz: self.zz + 2.0 * (x + y),
            xy: self.xy - pivot.x * h.y - h.x * pivot.y,
            xz: self.xz - pivot.x * h.z - h.x * pivot.z,
            yz: self.yz - pivot.y * h.z - h.y * pivot.z,
        }
    }
}

/// A leg body in its group's axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct GroupBody {
    pub(super) m: f64,
    pub(super) com: Vector3<f64>,
    pub(super) inertia: Vector3<f64>,
}

/// Link axes in group axes: (source index, sign) of a, b and z.
pub(super) type Axes = [(usize, f64); 3];

/// Link axes of bodies 1 to 6 (`MODEL.md` section 1): F2 w, up, u; F3 −w, u, up; F4′ v, left, up;
/// F5 n, up, f; F6 and F7 n, f, down.
pub(super) const AXES: [Axes; 6] = [
    [(2, 1.0), (0, 1.0), (1, 1.0)],
    [(1, 1.0), (0, -1.0), (2, 1.0)],
    [(0, 1.0), (1, 1.0), (2, 1.0)],
    [(2, 1.0), (0, 1.0), (1, 1.0)],
    [(1, 1.0), (0, 1.0), (2, -1.0)],
    [(1, 1.0), (0, 1.0), (2, -1.0)],
];

impl GroupBody {
    pub(super) fn new(body: &BodyParams, axes: Axes) -> Self {
        Self {
            m: body.mass_kg,
            com: Vector3::from(axes.map(|(i, sign)| sign * body.com_m[i])),
            inertia: Vector3::from(axes.map(|(i, _)| body.inertia_kg_m2[i])),
        }
    }

    /// At a displacement of its link frame.
    #[inline]
    pub(super) fn at(&self, slide: &Vector3<f64>) -> (Vector3<f64>, Sym3) {
        let r = self.com + slide;
        (self.m * r, Sym3::of_body(self.m, &r, &self.inertia))
    }
}

/// Group axes in the chassis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Yaw {
    pub(super) sin: f64,
    pub(super) cos: f64,
}

impl Yaw {
    #[inline]
    pub(super) fn to_chassis(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.sin * v.x + self.cos * v.y,
            self.sin * v.y - self.cos * v.x,
            v.z,
        )
    }

    #[inline]
    pub(super) fn to_group(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.sin * v.x - self.cos * v.y,
            self.cos * v.x + self.sin * v.y,
            v.z,
        )
    }

    #[inline]
    pub(super) fn tensor_to_chassis(self, t: &Sym3) -> Sym3 {
        let (s, c) = (self.sin, self.cos);
        let (ss, cc, sc) = (s * s, c * c, s * c);
        Sym3 {
            xx: ss * t.xx + 2.0 * sc * t.xy + cc * t.yy,
            yy: cc * t.xx - 2.0 * sc * t.xy + ss * t.yy,
            zz: t.zz,
            xy: sc * (t.yy - t.xx) + (ss - cc) * t.xy,
            xz: s * t.xz + c * t.yz,
            yz: s * t.yz - c * t.xz,
        }
    }
}

/// The group's motion for a chassis without acceleration of its velocity components.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// Angular velocity of the group.
    pub(super) omega: Vector3<f64>,
    /// Its angular acceleration.
    pub(super) alpha: Vector3<f64>,
    /// Acceleration of O, less gravity.
    pub(super) origin: Vector3<f64>,
}

impl Motion {
    /// `omega` of the chassis and `origin` in group axes; yaw rate and its bias.
    #[inline]
    pub(super) fn new(omega: Vector3<f64>, origin: Vector3<f64>, rate: f64, bias: f64) -> Self {
        Self {
            // ω × (rate z)
            alpha: Vector3::new(rate * omega.y, -rate * omega.x, bias),
            omega: Vector3::new(omega.x, omega.y, omega.z + rate),
            origin,
        }
    }

    /// α × r + Ω × (Ω × r).
    #[inline]
    pub(super) fn carry(&self, r: &Vector3<f64>) -> Vector3<f64> {
        self.alpha.cross(r) + self.omega.cross(&self.omega.cross(r))
    }

    /// Moment about O that the composite as a rigid body needs.
    #[inline]
    pub(super) fn moment(&self, h: &Vector3<f64>, j: &Sym3) -> Vector3<f64> {
        h.cross(&self.origin) + j.times(&self.alpha) + self.omega.cross(&j.times(&self.omega))
    }
}
