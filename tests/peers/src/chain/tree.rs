//! The recursions over a tree of links, unrolled by the compiler.
//!
//! A tree is a type, so each recursion becomes straight-line code for that one robot. Joints are
//! numbered depth first: a link's number i, its first child i + 1. Coordinates of a floating base
//! come before the joints', so joint i of J has coordinate i + N − J of N.

use super::factor::{Ancestors, Path, System};
use super::link::{End, Link};
use super::num::Num;
use super::spatial::{Mass, Pose, Spin, Vec3, Wrench};
use super::trig::sin_cos;

/// Motion of a link: of its frame's origin and of its body, in its own axes.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    pub w: Vec3,
    pub dw: Vec3,
    /// Acceleration of the origin less gravity.
    pub a: Vec3,
    pub spin: Spin,
}

impl Motion {
    /// A frame with given angular velocity and acceleration, and acceleration less gravity.
    #[inline(always)]
    pub fn new(w: Vec3, dw: Vec3, a: Vec3) -> Self {
        Self {
            w,
            dw,
            a,
            spin: Spin::of(w, dw),
        }
    }
}

/// Where the joints are.
pub trait Positions {
    /// Sine and cosine of revolute joint i.
    fn turn(&self, i: usize) -> (f64, f64);
    /// Displacement of prismatic joint i (m).
    fn slide(&self, i: usize) -> f64;
}

/// Angles and displacements.
impl<const J: usize> Positions for [f64; J] {
    #[inline(always)]
    fn turn(&self, i: usize) -> (f64, f64) {
        sin_cos(self[i])
    }

    #[inline(always)]
    fn slide(&self, i: usize) -> f64 {
        self[i]
    }
}

/// For callers that have the directions already: (sine, cosine) of a revolute joint, (displacement, any) of a
/// prismatic one.
impl<const J: usize> Positions for [(f64, f64); J] {
    #[inline(always)]
    fn turn(&self, i: usize) -> (f64, f64) {
        self[i]
    }

    #[inline(always)]
    fn slide(&self, i: usize) -> f64 {
        self[i].0
    }
}

/// Rates and accelerations of all coordinates; no accelerations means zero.
#[derive(Debug, Clone, Copy)]
pub struct Rates<'a, const N: usize> {
    pub v: &'a [f64; N],
    pub a: Option<&'a [f64; N]>,
}

impl<const N: usize> Rates<'_, N> {
    #[inline(always)]
    pub fn acceleration(&self, i: usize) -> Num {
        match self.a {
            Some(a) => Num::any(a[i]),
            None => Num::ZERO,
        }
    }
}

/// Poses of joints, force columns and mass matrix under way.
#[derive(Debug, Clone, Copy)]
pub struct Columns<const J: usize, const N: usize> {
    pub wrench: [Wrench; J],
    pub h: [[Num; N]; N],
}

impl<const J: usize, const N: usize> Columns<J, N> {
    pub const ZERO: Self = Self {
        wrench: [Wrench::ZERO; J],
        h: [[Num::ZERO; N]; N],
    };
}

/// Force and moment on the base's six coordinates.
#[inline(always)]
pub(super) fn set_base<const N: usize>(row: &mut [Num; N], wrench: &Wrench) {
    let Wrench { moment, force } = wrench;
    row[0] = force.x;
    row[1] = force.y;
    row[2] = force.z;
    row[3] = moment.x;
    row[4] = moment.y;
    row[5] = moment.z;
}

/// A link, a tuple of links, or [`End`].
pub trait Tree: Recursion {}

impl<T: Recursion> Tree for T {}

/// Operations of every kind of tree; not for use outside.
pub trait Recursion: Copy {
    /// Number of joints.
    const JOINTS: usize;

    /// Cosines, sines and places of all joints.
    fn place<const J: usize>(&self, i: usize, q: &impl Positions, poses: &mut [Pose; J]);

    /// Newton–Euler: writes the joint forces, returns the wrench on the parent.
    fn inverse<const J: usize, const N: usize>(
        &self,
        i: usize,
        poses: &[Pose; J],
        parent: &Motion,
        rates: &Rates<'_, N>,
        tau: &mut [Num; N],
    ) -> Wrench;

    /// Composite bodies: writes the joints' rows of the mass matrix (lower triangle) and their
    /// force columns in the parent's frame; returns what the parent carries.
    fn mass<const J: usize, const N: usize>(
        &self,
        i: usize,
        poses: &[Pose; J],
        columns: &mut Columns<J, N>,
    ) -> Option<Mass>;

    /// Writes entry k of every joint's row of the mass matrix and takes the force columns over the
    /// joint about (TURNS) or along axis A, which has that coordinate and pose.
    fn raise<const A: usize, const TURNS: bool, const J: usize, const N: usize>(
        i: usize,
        k: usize,
        pose: &Pose,
        columns: &mut Columns<J, N>,
    );

    /// Writes the base's part of every joint's row of the mass matrix.
    fn to_base<const J: usize, const N: usize>(i: usize, columns: &mut Columns<J, N>);

    /// Factorises from the leaves on and substitutes on the way.
    fn eliminate<const N: usize>(i: usize, path: impl Ancestors, system: &mut System<N>);

    /// Substitutes from the root on.
    fn resolve<const N: usize>(i: usize, path: impl Ancestors, system: &mut System<N>);
}

impl Recursion for End {
    const JOINTS: usize = 0;

    #[inline(always)]
    fn place<const J: usize>(&self, _: usize, _: &impl Positions, _: &mut [Pose; J]) {}

    #[inline(always)]
    fn inverse<const J: usize, const N: usize>(
        &self,
        _: usize,
        _: &[Pose; J],
        _: &Motion,
        _: &Rates<'_, N>,
        _: &mut [Num; N],
    ) -> Wrench {
        Wrench::ZERO
    }

    #[inline(always)]
    fn mass<const J: usize, const N: usize>(
        &self,
        _: usize,
        _: &[Pose; J],
        _: &mut Columns<J, N>,
    ) -> Option<Mass> {
        None
    }

    #[inline(always)]
    fn raise<const A: usize, const TURNS: bool, const J: usize, const N: usize>(
        _: usize,
        _: usize,
        _: &Pose,
        _: &mut Columns<J, N>,
    ) {
    }

    #[inline(always)]
    fn to_base<const J: usize, const N: usize>(_: usize, _: &mut Columns<J, N>) {}

    #[inline(always)]
    fn eliminate<const N: usize>(_: usize, _: impl Ancestors, _: &mut System<N>) {}

    #[inline(always)]
    fn resolve<const N: usize>(_: usize, _: impl Ancestors, _: &mut System<N>) {}
}

impl<const A: usize, const TURNS: bool, const P: u16, K: Recursion> Recursion
    for Link<A, TURNS, P, K>
{
    const JOINTS: usize = 1 + K::JOINTS;

    #[inline(always)]
    fn place<const J: usize>(&self, i: usize, q: &impl Positions, poses: &mut [Pose; J]) {
        let origin = self.origin();
        poses[i] = if TURNS {
            let (sin, cos) = q.turn(i);
            Pose {
                cos: Num::any(cos),
                sin: Num::any(sin),
                r: origin,
            }
        } else {
            Pose {
                r: origin + Vec3::along::<A>(Num::any(q.slide(i))),
                ..Pose::HOME
            }
        };
        self.children.place(i + 1, q, poses);
    }

    #[inline(always)]
    fn inverse<const J: usize, const N: usize>(
        &self,
        i: usize,
        poses: &[Pose; J],
        parent: &Motion,
        rates: &Rates<'_, N>,
        tau: &mut [Num; N],
    ) -> Wrench {
        let (pose, k) = (&poses[i], i + (N - J));
        let (v, acc) = (Num::any(rates.v[k]), rates.acceleration(k));
        let a = parent.a + parent.spin.times(pose.r);
        let motion = if TURNS {
            let lower = |vector| pose.lower::<A, TURNS>(vector);
            let (w, dw) = (lower(parent.w), lower(parent.dw));
            Motion::new(
                w + Vec3::along::<A>(v),
                dw + w.cross_axis::<A>().scale(v) + Vec3::along::<A>(acc),
                lower(a),
            )
        } else {
            let coriolis = parent.w.cross_axis::<A>().scale(v.twice());
            Motion {
                a: a + coriolis + Vec3::along::<A>(acc),
                ..*parent
            }
        };
        let own = self.mass().wrench(motion.a, &motion.spin);
        let total = own + self.children.inverse(i + 1, poses, &motion, rates, tau);
        tau[k] = total.at::<A, TURNS>();
        pose.raise_wrench::<A, TURNS>(total)
    }

    #[inline(always)]
    fn mass<const J: usize, const N: usize>(
        &self,
        i: usize,
        poses: &[Pose; J],
        columns: &mut Columns<J, N>,
    ) -> Option<Mass> {
        let (pose, k) = (&poses[i], i + (N - J));
        let own = self.mass();
        let total = match self.children.mass(i + 1, poses, columns) {
            Some(carried) => own + carried,
            None => own,
        };
        columns.wrench[i] = total.column::<A, TURNS>();
        Self::raise::<A, TURNS, J, N>(i, k, pose, columns);
        Some(pose.raise_mass::<A, TURNS>(total))
    }

    // The parameters of the raising joint, not of this one.
    #[inline(always)]
    fn raise<const B: usize, const BY_TURN: bool, const J: usize, const N: usize>(
        i: usize,
        k: usize,
        pose: &Pose,
        columns: &mut Columns<J, N>,
    ) {
        let column = columns.wrench[i];
        columns.h[i + (N - J)][k] = column.at::<B, BY_TURN>();
        columns.wrench[i] = pose.raise_wrench::<B, BY_TURN>(column);
        K::raise::<B, BY_TURN, J, N>(i + 1, k, pose, columns);
    }

    #[inline(always)]
    fn to_base<const J: usize, const N: usize>(i: usize, columns: &mut Columns<J, N>) {
        set_base(&mut columns.h[i + (N - J)], &columns.wrench[i]);
        K::to_base(i + 1, columns);
    }

    #[inline(always)]
    fn eliminate<const N: usize>(i: usize, path: impl Ancestors, system: &mut System<N>) {
        K::eliminate(i + 1, Path(i, path), system);
        system.eliminate(i, path);
    }

    #[inline(always)]
    fn resolve<const N: usize>(i: usize, path: impl Ancestors, system: &mut System<N>) {
        path.gather(i, system);
        K::resolve(i + 1, Path(i, path), system);
    }
}

/// Branches: each tuple member is a tree of its own, numbered after the one before.
macro_rules! branches {
    ($($name:ident: $field:tt after ($($before:ident)*)),+) => {
        impl<$($name: Recursion),+> Recursion for ($($name,)+) {
            const JOINTS: usize = 0 $(+ $name::JOINTS)+;

            #[inline(always)]
            fn place<const J: usize>(&self, i: usize, q: &impl Positions, poses: &mut [Pose; J]) {
                $(self.$field.place(i $(+ $before::JOINTS)*, q, poses);)+
            }

            #[inline(always)]
            fn inverse<const J: usize, const N: usize>(
                &self,
                i: usize,
                poses: &[Pose; J],
                parent: &Motion,
                rates: &Rates<'_, N>,
                tau: &mut [Num; N],
            ) -> Wrench {
                let mut sum = Wrench::ZERO;
                $(sum = sum + self.$field.inverse(i $(+ $before::JOINTS)*, poses, parent, rates, tau);)+
                sum
            }

            #[inline(always)]
            fn mass<const J: usize, const N: usize>(
                &self,
                i: usize,
                poses: &[Pose; J],
                columns: &mut Columns<J, N>,
            ) -> Option<Mass> {
                let mut sum = None;
                $(sum = match (sum, self.$field.mass(i $(+ $before::JOINTS)*, poses, columns)) {
                    (Some(a), Some(b)) => Some(a + b),
                    (a, b) => a.or(b),
                };)+
                sum
            }

            #[inline(always)]
            fn raise<const A: usize, const TURNS: bool, const J: usize, const N: usize>(
                i: usize,
                k: usize,
                pose: &Pose,
                columns: &mut Columns<J, N>,
            ) {
                $($name::raise::<A, TURNS, J, N>(i $(+ $before::JOINTS)*, k, pose, columns);)+
            }

            #[inline(always)]
            fn to_base<const J: usize, const N: usize>(i: usize, columns: &mut Columns<J, N>) {
                $($name::to_base(i $(+ $before::JOINTS)*, columns);)+
            }

            #[inline(always)]
            fn eliminate<const N: usize>(i: usize, path: impl Ancestors, system: &mut System<N>) {
                $($name::eliminate(i $(+ $before::JOINTS)*, path, system);)+
            }

            #[inline(always)]
            fn resolve<const N: usize>(i: usize, path: impl Ancestors, system: &mut System<N>) {
                $($name::resolve(i $(+ $before::JOINTS)*, path, system);)+
            }
        }
    };
}

branches!(T0: 0 after (), T1: 1 after (T0));
branches!(T0: 0 after (), T1: 1 after (T0), T2: 2 after (T0 T1));
branches!(T0: 0 after (), T1: 1 after (T0), T2: 2 after (T0 T1), T3: 3 after (T0 T1 T2));
