//! LᵀDL factorisation along the branches of a tree: no fill-in, no work on zeros.
//!
//! A coordinate is coupled with its ancestors and descendants alone. Eliminating from the leaves
//! on keeps that so (Featherstone, "Efficient factorization of the joint-space inertia matrix for
//! branched kinematic trees", 2005).

use super::num::Num;
use wheeleg_plant::dynamics::DynamicsError;

/// H x = b under elimination; of H the lower triangle.
#[derive(Debug, Clone, Copy)]
pub struct System<const N: usize> {
    pub h: [[Num; N]; N],
    pub x: [Num; N],
    /// Reciprocal pivots.
    inverse: [Num; N],
    /// A pivot that is not positive, or 1.
    pivot: f64,
}

impl<const N: usize> System<N> {
    #[inline(always)]
    pub fn new(h: [[Num; N]; N], x: [Num; N]) -> Self {
        Self {
            h,
            x,
            inverse: [Num::ZERO; N],
            pivot: 1.0,
        }
    }

    /// Eliminates coordinate i, which hangs on `path`.
    #[inline(always)]
    pub fn eliminate(&mut self, i: usize, path: impl Ancestors) {
        let d = self.h[i][i];
        // NaN counts as not positive.
        self.pivot = if d.get() > 0.0 { self.pivot } else { d.get() };
        self.inverse[i] = d.recip();
        path.reduce(i, self);
        self.x[i] = self.x[i] * self.inverse[i];
    }

    /// The solution.
    #[inline(always)]
    pub fn solution(&self) -> Result<&[Num; N], DynamicsError> {
        if self.pivot > 0.0 {
            Ok(&self.x)
        } else {
            Err(DynamicsError::Singular { pivot: self.pivot })
        }
    }
}

/// The coordinates between one and the root, nearest first.
pub trait Ancestors: Copy {
    /// Subtracts row i's part from the ancestors' rows and right-hand sides; leaves row i of L.
    fn reduce<const N: usize>(self, i: usize, system: &mut System<N>);
    /// h\[j\]\[k\] -= l h\[i\]\[k\] for all k here.
    fn subtract<const N: usize>(self, j: usize, l: Num, i: usize, system: &mut System<N>);
    /// x\[i\] -= Σ L\[i\]\[j\] x\[j\].
    fn gather<const N: usize>(self, i: usize, system: &mut System<N>);
    /// Eliminates all of these themselves, the nearest first.
    fn eliminate_all<const N: usize>(self, system: &mut System<N>);
    /// Substitutes into all of these themselves, the farthest first.
    fn resolve_all<const N: usize>(self, system: &mut System<N>);
}

/// Above the root.
#[derive(Debug, Clone, Copy)]
pub(super) struct Top;

/// A coordinate and those above it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path<R>(pub usize, pub R);

impl Ancestors for Top {
    #[inline(always)]
    fn reduce<const N: usize>(self, _: usize, _: &mut System<N>) {}
    #[inline(always)]
    fn subtract<const N: usize>(self, _: usize, _: Num, _: usize, _: &mut System<N>) {}
    #[inline(always)]
    fn gather<const N: usize>(self, _: usize, _: &mut System<N>) {}
    #[inline(always)]
    fn eliminate_all<const N: usize>(self, _: &mut System<N>) {}
    #[inline(always)]
    fn resolve_all<const N: usize>(self, _: &mut System<N>) {}
}

impl<R: Ancestors> Ancestors for Path<R> {
    #[inline(always)]
    fn reduce<const N: usize>(self, i: usize, system: &mut System<N>) {
        let Self(j, above) = self;
        let l = system.h[i][j] * system.inverse[i];
        self.subtract(j, l, i, system);
        let x = system.x[i];
        system.x[j] -= l * x;
        // Row i is no longer needed at j: the following rows lie above j.
        system.h[i][j] = l;
        above.reduce(i, system);
    }

    #[inline(always)]
    fn subtract<const N: usize>(self, j: usize, l: Num, i: usize, system: &mut System<N>) {
        let Self(k, above) = self;
        let h = system.h[i][k];
        system.h[j][k] -= l * h;
        above.subtract(j, l, i, system);
    }

    #[inline(always)]
    fn gather<const N: usize>(self, i: usize, system: &mut System<N>) {
        let Self(j, above) = self;
        let x = system.x[j];
        system.x[i] -= system.h[i][j] * x;
        above.gather(i, system);
    }

    #[inline(always)]
    fn eliminate_all<const N: usize>(self, system: &mut System<N>) {
        let Self(i, above) = self;
        system.eliminate(i, above);
        above.eliminate_all(system);
    }

    #[inline(always)]
    fn resolve_all<const N: usize>(self, system: &mut System<N>) {
        let Self(i, above) = self;
        above.resolve_all(system);
        above.gather(i, system);
    }
}

type Three<R> = Path<Path<Path<R>>>;

/// The six coordinates of a floating base.
pub(super) const BASE: Three<Three<Top>> =
    Path(5, Path(4, Path(3, Path(2, Path(1, Path(0, Top))))));
