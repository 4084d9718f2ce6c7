//! Bodies that share a yaw angle, as one composite.
//!
//! Axes (a, b, z): a along the cylinder, b to its left, z up; a = \[sin, −cos\] and b = \[cos, sin\]
//! of the yaw angle (θ1 or θ4) in chassis axes. Moments are about the yaw axis's point O.

use nalgebra::Vector3;

use crate::both::{Both, Number, same};
use crate::dynamics::params::BodyParams;

/// Symmetric 3 × 3.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sym3<T = f64> {
    pub(super) xx: T,
    pub(super) yy: T,
    pub(super) zz: T,
    pub(super) xy: T,
    pub(super) xz: T,
    pub(super) yz: T,
}

impl<T: Number> Sym3<T> {
    /// Of a mass at r: m (|r|² 1 − r rᵀ), plus principal inertias.
    #[inline]
    pub(super) fn of_body(m: T, r: &Vector3<T>, principal: &Vector3<T>) -> Self {
        let s = r * m;
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
    pub(super) fn times(&self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// The tensor with each entry converted.
    #[inline]
    pub(super) fn map<U>(&self, f: impl Fn(T) -> U) -> Sym3<U> {
        Sym3 {
            xx: f(self.xx),
            yy: f(self.yy),
            zz: f(self.zz),
            xy: f(self.xy),
            xz: f(self.xz),
            yz: f(self.yz),
        }
    }
}

impl Sym3<Both> {
    /// Moves the point of reference: the composite lies at `pivot` from the new one, with first
    /// moment h about the old one, both in this tensor's axes. The constant part
    /// m (|pivot|² 1 − pivot pivotᵀ) is left out: it is added once and for all.
    #[inline]
    pub(super) fn shifted(&self, pivot: &Vector3<Both>, h: &Vector3<Both>) -> Self {
        let (x, y, z) = (pivot.x * h.x, pivot.y * h.y, pivot.z * h.z);
        Self {
            xx: self.xx + (y + z) * 2.0,
            yy: self.yy + (x + z) * 2.0,
            zz: self.zz + (x + y) * 2.0,
            xy: self.xy - pivot.x * h.y - h.x * pivot.y,
            xz: self.xz - pivot.x * h.z - h.x * pivot.z,
            yz: self.yz - pivot.y * h.z - h.y * pivot.z,
        }
    }
}

/// A leg body in its group's axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct GroupBody<T = f64> {
    pub(super) m: T,
    pub(super) com: Vector3<T>,
    pub(super) inertia: Vector3<T>,
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

    /// The same body in both legs.
    pub(super) fn twice(&self) -> GroupBody<Both> {
        GroupBody {
            m: Both::splat(self.m),
            com: same(&self.com),
            inertia: same(&self.inertia),
        }
    }
}

impl<T: Number> GroupBody<T> {
    /// At a displacement of its link frame.
    #[inline]
    pub(super) fn at(&self, slide: &Vector3<T>) -> (Vector3<T>, Sym3<T>) {
        let r = self.com + slide;
        (r * self.m, Sym3::of_body(self.m, &r, &self.inertia))
    }
}

/// Group axes in the chassis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Yaw {
    pub(super) sin: Both,
    pub(super) cos: Both,
}

impl Yaw {
    #[inline]
    pub(super) fn to_chassis(self, v: &Vector3<Both>) -> Vector3<Both> {
        Vector3::new(
            self.sin * v.x + self.cos * v.y,
            self.sin * v.y - self.cos * v.x,
            v.z,
        )
    }

    #[inline]
    pub(super) fn to_group(self, v: &Vector3<Both>) -> Vector3<Both> {
        Vector3::new(
            self.sin * v.x - self.cos * v.y,
            self.cos * v.x + self.sin * v.y,
            v.z,
        )
    }

    #[inline]
    pub(super) fn tensor_to_chassis(self, t: &Sym3<Both>) -> Sym3<Both> {
        let (s, c) = (self.sin, self.cos);
        let (ss, cc, sc) = (s * s, c * c, s * c);
        Sym3 {
            xx: ss * t.xx + sc * 2.0 * t.xy + cc * t.yy,
            yy: cc * t.xx - sc * 2.0 * t.xy + ss * t.yy,
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
    pub(super) omega: Vector3<Both>,
    /// Its angular acceleration.
    pub(super) alpha: Vector3<Both>,
    /// Acceleration of O, less gravity.
    pub(super) origin: Vector3<Both>,
}

impl Motion {
    /// `omega` of the chassis and `origin` in group axes; yaw rate and its bias.
    #[inline]
    pub(super) fn new(omega: Vector3<Both>, origin: Vector3<Both>, rate: Both, bias: Both) -> Self {
        Self {
            // ω × (rate z)
            alpha: Vector3::new(rate * omega.y, -rate * omega.x, bias),
            omega: Vector3::new(omega.x, omega.y, omega.z + rate),
            origin,
        }
    }

    /// α × r + Ω × (Ω × r).
    #[inline]
    pub(super) fn carry(&self, r: &Vector3<Both>) -> Vector3<Both> {
        self.alpha.cross(r) + self.omega.cross(&self.omega.cross(r))
    }

    /// Moment about O that the composite as a rigid body needs.
    #[inline]
    pub(super) fn moment(&self, h: &Vector3<Both>, j: &Sym3<Both>) -> Vector3<Both> {
        h.cross(&self.origin) + j.times(&self.alpha) + self.omega.cross(&j.times(&self.omega))
    }
}
