//! Vectors, rotations about one axis, wrenches and mass distributions of [`Num`]s.
//!
//! An axis A is 0, 1 or 2 for x, y or z. Components are named cyclically: `a` along the axis, then
//! `b` and `c`, so that one formula serves the three axes.

use std::ops::Add;

use super::num::Num;

/// A vector.
#[derive(Debug, Clone, Copy)]
pub struct Vec3 {
    pub x: Num,
    pub y: Num,
    pub z: Num,
}

impl Vec3 {
    pub const ZERO: Self = Self {
        x: Num::ZERO,
        y: Num::ZERO,
        z: Num::ZERO,
    };

    #[inline(always)]
    pub const fn any(v: [f64; 3]) -> Self {
        Self {
            x: Num::any(v[0]),
            y: Num::any(v[1]),
            z: Num::any(v[2]),
        }
    }

    /// `value` along axis A.
    #[inline(always)]
    pub fn along<const A: usize>(value: Num) -> Self {
        Self::cyclic::<A>(value, Num::ZERO, Num::ZERO)
    }

    /// From cyclic components.
    #[inline(always)]
    pub fn cyclic<const A: usize>(a: Num, b: Num, c: Num) -> Self {
        match A {
            0 => Self { x: a, y: b, z: c },
            1 => Self { y: a, z: b, x: c },
            _ => Self { z: a, x: b, y: c },
        }
    }

    /// Cyclic components.
    #[inline(always)]
    pub fn abc<const A: usize>(self) -> (Num, Num, Num) {
        match A {
            0 => (self.x, self.y, self.z),
            1 => (self.y, self.z, self.x),
            _ => (self.z, self.x, self.y),
        }
    }

    /// Component along axis A.
    #[inline(always)]
    pub fn at<const A: usize>(self) -> Num {
        self.abc::<A>().0
    }

    #[inline(always)]
    pub fn scale(self, k: Num) -> Self {
        Self {
            x: self.x * k,
            y: self.y * k,
            z: self.z * k,
        }
    }

    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self {
            x: self.y * o.z - self.z * o.y,
            y: self.z * o.x - self.x * o.z,
            z: self.x * o.y - self.y * o.x,
        }
    }

    /// self × e, with e the unit vector of axis A.
    #[inline(always)]
    pub fn cross_axis<const A: usize>(self) -> Self {
        let (_, b, c) = self.abc::<A>();
        Self::cyclic::<A>(Num::ZERO, c, -b)
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            x: self.x + o.x,
            y: self.y + o.y,
            z: self.z + o.z,
        }
    }
}

/// Where a child frame is in its parent: turned about the joint's axis, then displaced by r.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Cosine and sine; only for revolute joints.
    pub cos: Num,
    pub sin: Num,
    /// Origin of the child in the parent's frame.
    pub r: Vec3,
}

impl Pose {
    pub const HOME: Self = Self {
        cos: Num::ZERO,
        sin: Num::ZERO,
        r: Vec3::ZERO,
    };

    /// Child's components to the parent's.
    #[inline(always)]
    pub fn raise<const A: usize, const TURNS: bool>(&self, v: Vec3) -> Vec3 {
        if !TURNS {
            return v;
        }
        let (a, b, c) = v.abc::<A>();
        Vec3::cyclic::<A>(a, self.cos * b - self.sin * c, self.sin * b + self.cos * c)
    }

    /// Parent's components to the child's.
    #[inline(always)]
    pub fn lower<const A: usize, const TURNS: bool>(&self, v: Vec3) -> Vec3 {
        if !TURNS {
            return v;
        }
        let (a, b, c) = v.abc::<A>();
        Vec3::cyclic::<A>(a, self.cos * b + self.sin * c, self.cos * c - self.sin * b)
    }

    /// A wrench about the child's origin, in its axes, to the parent's origin and axes.
    #[inline(always)]
    pub fn raise_wrench<const A: usize, const TURNS: bool>(&self, w: Wrench) -> Wrench {
        let force = self.raise::<A, TURNS>(w.force);
        Wrench {
            moment: self.raise::<A, TURNS>(w.moment) + self.r.cross(force),
            force,
        }
    }

    /// A mass distribution in the child's frame, seen from the parent's.
    #[inline(always)]
    pub fn raise_mass<const A: usize, const TURNS: bool>(&self, m: Mass) -> Mass {
        let h = self.raise::<A, TURNS>(m.h);
        let s = if TURNS {
            m.s.turned::<A>(self.cos, self.sin)
        } else {
            m.s
        };
        let (r, moved) = (self.r, h + self.r.scale(m.m));
        Mass {
            m: m.m,
            h: moved,
            // Σ + r h'ᵀ + h rᵀ with h' = h + m r
            s: Sym3 {
                xx: s.xx + r.x * (moved.x + h.x),
                yy: s.yy + r.y * (moved.y + h.y),
                zz: s.zz + r.z * (moved.z + h.z),
                xy: s.xy + (r.x * moved.y + h.x * r.y),
                xz: s.xz + (r.x * moved.z + h.x * r.z),
                yz: s.yz + (r.y * moved.z + h.y * r.z),
            },
        }
    }
}

/// A symmetric matrix.
#[derive(Debug, Clone, Copy)]
pub struct Sym3 {
    pub xx: Num,
    pub yy: Num,
    pub zz: Num,
    pub xy: Num,
    pub xz: Num,
    pub yz: Num,
}

impl Sym3 {
    /// R S Rᵀ for a turn about axis A.
    #[inline(always)]
    fn turned<const A: usize>(self, cos: Num, sin: Num) -> Self {
        // Cyclic names: the plane b, c turns.
        let (aa, bb, cc, ab, ac, bc) = match A {
            0 => (self.xx, self.yy, self.zz, self.xy, self.xz, self.yz),
            1 => (self.yy, self.zz, self.xx, self.yz, self.xy, self.xz),
            _ => (self.zz, self.xx, self.yy, self.xz, self.yz, self.xy),
        };
        // bb' = c²bb − 2cs bc + s²cc = bb + s (s (cc − bb) − 2c bc), and so on.
        let (d, e) = (cc - bb, bc.twice());
        let shift = sin * (sin * d - cos * e);
        let bc = bc - sin * (cos * d + sin * e);
        let (bb, cc) = (bb + shift, cc - shift);
        let (ab, ac) = (cos * ab - sin * ac, sin * ab + cos * ac);
        match A {
            0 => Self {
                xx: aa,
                yy: bb,
                zz: cc,
                xy: ab,
                xz: ac,
                yz: bc,
            },
            1 => Self {
                yy: aa,
                zz: bb,
                xx: cc,
                yz: ab,
                xy: ac,
                xz: bc,
            },
            _ => Self {
                zz: aa,
                xx: bb,
                yy: cc,
                xz: ab,
                yz: ac,
                xy: bc,
            },
        }
    }
}

impl Add for Sym3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            xx: self.xx + o.xx,
            yy: self.yy + o.yy,
            zz: self.zz + o.zz,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yz: self.yz + o.yz,
        }
    }
}

/// Moment about the frame's origin, and force.
#[derive(Debug, Clone, Copy)]
pub struct Wrench {
    pub moment: Vec3,
    pub force: Vec3,
}

impl Wrench {
    pub const ZERO: Self = Self {
        moment: Vec3::ZERO,
        force: Vec3::ZERO,
    };

    /// Its component at a joint about (TURNS) or along axis A.
    #[inline(always)]
    pub fn at<const A: usize, const TURNS: bool>(&self) -> Num {
        if TURNS {
            self.moment.at::<A>()
        } else {
            self.force.at::<A>()
        }
    }
}

impl Add for Wrench {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            moment: self.moment + o.moment,
            force: self.force + o.force,
        }
    }
}

/// Velocity-dependent matrix \[ω̇ ×\] + \[ω ×\]²: a body point at ρ accelerates with a + Bρ.
#[derive(Debug, Clone, Copy)]
pub struct Spin {
    /// Squares of ω: the diagonal is made of their sums, its differences of their differences.
    x2: Num,
    y2: Num,
    z2: Num,
    xy: Num,
    yx: Num,
    xz: Num,
    zx: Num,
    yz: Num,
    zy: Num,
}

impl Spin {
    #[inline(always)]
    pub fn of(w: Vec3, dw: Vec3) -> Self {
        let (x2, y2, z2) = (w.x * w.x, w.y * w.y, w.z * w.z);
        let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
        Self {
            x2,
            y2,
            z2,
            xy: xy - dw.z,
            yx: xy + dw.z,
            xz: xz + dw.y,
            zx: xz - dw.y,
            yz: yz - dw.x,
            zy: yz + dw.x,
        }
    }

    #[inline(always)]
    pub fn times(&self, v: Vec3) -> Vec3 {
        Vec3 {
            x: self.xy * v.y + self.xz * v.z - (self.y2 + self.z2) * v.x,
            y: self.yx * v.x + self.yz * v.z - (self.x2 + self.z2) * v.y,
            z: self.zx * v.x + self.zy * v.y - (self.x2 + self.y2) * v.z,
        }
    }

    /// ∫ ρ × Bρ dm of a distribution with second moments S: the axial vector of BS.
    #[inline(always)]
    fn moment(&self, s: &Sym3) -> Vec3 {
        Vec3 {
            x: (self.zx * s.xy - self.yx * s.xz)
                + (self.z2 - self.y2) * s.yz
                + (self.zy * s.yy - self.yz * s.zz),
            y: (self.xy * s.yz - self.zy * s.xy)
                + (self.x2 - self.z2) * s.xz
                + (self.xz * s.zz - self.zx * s.xx),
            z: (self.yz * s.xz - self.xz * s.yz)
                + (self.y2 - self.x2) * s.xy
                + (self.yx * s.xx - self.xy * s.yy),
        }
    }
}

/// A mass distribution in a frame: mass, first and second moments about the origin
/// (m, ∫ρ dm, ∫ρρᵀ dm). The inertia is tr(S) 1 − S.
#[derive(Debug, Clone, Copy)]
pub struct Mass {
    pub m: Num,
    pub h: Vec3,
    pub s: Sym3,
}

impl Mass {
    /// d'Alembert wrench of the distribution moving with acceleration a of the origin and B.
    #[inline(always)]
    pub fn wrench(&self, a: Vec3, b: &Spin) -> Wrench {
        Wrench {
            moment: self.h.cross(a) + b.moment(&self.s),
            force: a.scale(self.m) + b.times(self.h),
        }
    }

    /// Wrench of a unit acceleration about (TURNS) or along axis A, at rest.
    #[inline(always)]
    pub fn column<const A: usize, const TURNS: bool>(&self) -> Wrench {
        let (_, b, c) = self.h.abc::<A>();
        if TURNS {
            let (bb, cc, ab, ac) = match A {
                0 => (self.s.yy, self.s.zz, self.s.xy, self.s.xz),
                1 => (self.s.zz, self.s.xx, self.s.yz, self.s.xy),
                _ => (self.s.xx, self.s.yy, self.s.xz, self.s.yz),
            };
            Wrench {
                moment: Vec3::cyclic::<A>(bb + cc, -ab, -ac),
                // e × h
                force: Vec3::cyclic::<A>(Num::ZERO, -c, b),
            }
        } else {
            Wrench {
                // h × e
                moment: Vec3::cyclic::<A>(Num::ZERO, c, -b),
                force: Vec3::along::<A>(self.m),
            }
        }
    }
}

impl Add for Mass {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            m: self.m + o.m,
            h: self.h + o.h,
            s: self.s + o.s,
        }
    }
}
