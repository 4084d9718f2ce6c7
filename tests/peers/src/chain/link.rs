//! A joint with its body and its child links.

use super::num::Num;
use super::spatial::{Mass, Sym3, Vec3};
use wheeleg_plant::dynamics::DynamicsError;

/// Bits of a pattern: which parameters of a link may differ from zero.
const ORIGIN: [u16; 3] = [1, 2, 4];
const COM: [u16; 3] = [8, 16, 32];
const PRODUCTS: [u16; 3] = [64, 128, 256];

/// Pattern of a link without known zeros.
pub const DENSE: u16 = 0x1FF;

/// A rigid body and the joint that carries it. Plain SI data.
///
/// All frames are parallel at q = 0. A link's frame stands at its joint and moves with the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkParams {
    /// Joint in the parent link's frame (m); for a prismatic joint its place at q = 0.
    pub origin_m: [f64; 3],
    /// Mass (kg).
    pub mass_kg: f64,
    /// Centre of mass in the link frame (m).
    pub com_m: [f64; 3],
    /// Moments of inertia xx, yy, zz about the centre of mass (kg m²).
    pub moments_kg_m2: [f64; 3],
    /// Entries xy, xz, yz of that inertia matrix (kg m²); the negative products of inertia.
    pub products_kg_m2: [f64; 3],
}

impl LinkParams {
    /// Which of origin, centre of mass and products differ from zero here: the narrowest pattern
    /// that [`Link::new`] accepts for these parameters.
    #[must_use]
    pub const fn pattern(&self) -> u16 {
        bits(&self.origin_m, &ORIGIN)
            | bits(&self.com_m, &COM)
            | bits(&self.products_kg_m2, &PRODUCTS)
    }

    const fn check(&self, pattern: u16) -> Result<(), DynamicsError> {
        let named = [
            ("origin_m", &self.origin_m),
            ("com_m", &self.com_m),
            ("moments_kg_m2", &self.moments_kg_m2),
            ("products_kg_m2", &self.products_kg_m2),
        ];
        if !(self.mass_kg >= 0.0 && self.mass_kg.is_finite()) {
            return Err(refused("mass_kg", self.mass_kg));
        }
        let masks = [&ORIGIN, &COM, &[DENSE; 3], &PRODUCTS];
        let mut k = 0;
        while k < named.len() {
            let (name, values) = named[k];
            let mut i = 0;
            while i < 3 {
                let value = values[i];
                // A moment of inertia is not negative; a zero by pattern is zero.
                let kept = pattern & masks[k][i] != 0 || k == 2;
                if !value.is_finite() || (k == 2 && value < 0.0) || (!kept && value != 0.0) {
                    return Err(refused(name, value));
                }
                i += 1;
            }
            k += 1;
        }
        Ok(())
    }
}

const fn refused(name: &'static str, value: f64) -> DynamicsError {
    DynamicsError::Parameter { name, value }
}

const fn bits(values: &[f64; 3], mask: &[u16; 3]) -> u16 {
    let (mut pattern, mut i) = (0, 0);
    while i < 3 {
        if values[i] != 0.0 {
            pattern |= mask[i];
        }
        i += 1;
    }
    pattern
}

/// Numbers of a body about its frame's origin: m, ∫ρ dm, ∫ρρᵀ dm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BodyMoments {
    mass: f64,
    first: [f64; 3],
    /// xx, yy, zz, xy, xz, yz.
    second: [f64; 6],
}

impl BodyMoments {
    pub(super) const fn new(params: &LinkParams, pattern: u16) -> Result<Self, DynamicsError> {
        if let Err(error) = params.check(pattern) {
            return Err(error);
        }
        let (m, [x, y, z]) = (params.mass_kg, params.com_m);
        let [ixx, iyy, izz] = params.moments_kg_m2;
        let [ixy, ixz, iyz] = params.products_kg_m2;
        let half = 0.5 * (ixx + iyy + izz);
        Ok(Self {
            mass: m,
            first: [m * x, m * y, m * z],
            // Second moments about the centre of mass are tr(I)/2 1 − I, then Steiner.
            second: [
                half - ixx + m * x * x,
                half - iyy + m * y * y,
                half - izz + m * z * z,
                m * x * y - ixy,
                m * x * z - ixz,
                m * y * z - iyz,
            ],
        })
    }

    /// As numbers that know their zeros.
    #[inline(always)]
    pub(super) const fn mass<const P: u16>(&self) -> Mass {
        Mass {
            m: Num::any(self.mass),
            h: Vec3 {
                x: Num::where_live(P & COM[0] != 0, self.first[0]),
                y: Num::where_live(P & COM[1] != 0, self.first[1]),
                z: Num::where_live(P & COM[2] != 0, self.first[2]),
            },
            s: Sym3 {
                xx: Num::any(self.second[0]),
                yy: Num::any(self.second[1]),
                zz: Num::any(self.second[2]),
                xy: Num::where_live(product(P, 0, 1, PRODUCTS[0]), self.second[3]),
                xz: Num::where_live(product(P, 0, 2, PRODUCTS[1]), self.second[4]),
                yz: Num::where_live(product(P, 1, 2, PRODUCTS[2]), self.second[5]),
            },
        }
    }
}

/// Whether a mixed second moment can differ from zero.
const fn product(pattern: u16, i: usize, j: usize, mask: u16) -> bool {
    pattern & mask != 0 || (pattern & COM[i] != 0 && pattern & COM[j] != 0)
}

/// A joint about (`TURNS`) or along axis `A` (0, 1, 2 for x, y, z), the body behind it, and the
/// joints that this carries.
///
/// Write it with the aliases [`Rx`] to [`Pz`]; `P` is the body's [`LinkParams::pattern`], or
/// [`DENSE`]. `K` is [`End`], a link, or a tuple of up to four of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link<const A: usize, const TURNS: bool, const P: u16, K = End> {
    origin: [f64; 3],
    body: BodyMoments,
    pub(super) children: K,
}

/// Revolute about x.
pub type Rx<const P: u16, K = End> = Link<0, true, P, K>;
/// Revolute about y.
pub type Ry<const P: u16, K = End> = Link<1, true, P, K>;
/// Revolute about z.
pub type Rz<const P: u16, K = End> = Link<2, true, P, K>;
/// Prismatic along x.
pub type Px<const P: u16, K = End> = Link<0, false, P, K>;
/// Prismatic along y.
pub type Py<const P: u16, K = End> = Link<1, false, P, K>;
/// Prismatic along z.
pub type Pz<const P: u16, K = End> = Link<2, false, P, K>;

/// Nothing hangs here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct End;

impl<const A: usize, const TURNS: bool, const P: u16, K: Copy> Link<A, TURNS, P, K> {
    /// A link that carries `children`.
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`] for a value that is not finite, a negative mass or moment of
    /// inertia, or a value other than zero where the pattern has a zero.
    pub const fn new(params: &LinkParams, children: K) -> Result<Self, DynamicsError> {
        const { assert!(A < 3 && P <= DENSE, "axis 0, 1 or 2; pattern of 9 bits") };
        match BodyMoments::new(params, P) {
            Ok(body) => Ok(Self {
                origin: params.origin_m,
                body,
                children,
            }),
            Err(error) => Err(error),
        }
    }

    #[inline(always)]
    pub(super) const fn mass(&self) -> Mass {
        self.body.mass::<P>()
    }

    /// Joint in the parent's frame at q = 0.
    #[inline(always)]
    pub(super) const fn origin(&self) -> Vec3 {
        Vec3 {
            x: Num::where_live(P & ORIGIN[0] != 0, self.origin[0]),
            y: Num::where_live(P & ORIGIN[1] != 0, self.origin[1]),
            z: Num::where_live(P & ORIGIN[2] != 0, self.origin[2]),
        }
    }
}
