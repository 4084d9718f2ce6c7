//! Chains on a fixed and on a floating base.

use super::factor::{Ancestors, BASE, System, Top};
use super::finite;
use super::link::{BodyMoments, LinkParams};
use super::num::Num;
use super::spatial::{Mass, Pose, Vec3};
use super::tree::{Columns, Motion, Positions, Rates, Tree, set_base};
use wheeleg_plant::dynamics::DynamicsError;

/// Largest deviation of |quaternion|² from 1 that is accepted.
const UNIT_TOLERANCE: f64 = 1e-6;

/// Sum that is not finite if one of the values is not. It may also overflow; the caller then checks each
/// value.
#[inline(always)]
fn sum<const N: usize>(values: &[f64; N]) -> f64 {
    // The recursions' way to unroll would be a type more; N is small and the optimiser unrolls.
    values.iter().sum()
}

/// Arguments and result, or the first value that is not finite.
#[inline(always)]
fn checked<const N: usize>(
    result: (&'static str, [f64; N]),
    parts: f64,
    closer: impl FnOnce() -> Result<(), DynamicsError>,
) -> Result<[f64; N], DynamicsError> {
    let (name, values) = result;
    if (sum(&values) + parts).is_finite() {
        return Ok(values);
    }
    closer()?;
    finite(name, &values)?;
    Ok(values)
}

#[cold]
#[inline(never)]
fn look<const J: usize, const N: usize>(
    q: &[f64; J],
    v: &[f64; N],
    third: (&'static str, &[f64; N]),
    gravity: &[f64; 3],
) -> Result<(), DynamicsError> {
    finite("position", q)?;
    finite("velocity", v)?;
    finite(third.0, third.1)?;
    finite("gravity", gravity)
}

/// Both triangles of a mass matrix; refuses one that overflowed.
fn mirrored<const N: usize>(h: &[[Num; N]; N]) -> Result<[[f64; N]; N], DynamicsError> {
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| h[i.max(j)][i.min(j)].get()));
    for row in &rows {
        finite("mass matrix", row)?;
    }
    Ok(rows)
}

/// A tree of N joints on an unmoved base.
///
/// Positions, rates and forces are rad, rad/s, N m for revolute and m, m/s, N for prismatic joints,
/// in depth-first order. Gravity (m/s²) is given in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fixed<T, const N: usize> {
    tree: T,
}

impl<T: Tree, const N: usize> Fixed<T, N> {
    /// The tree on its base.
    #[must_use]
    pub const fn new(tree: T) -> Self {
        const { assert!(T::JOINTS == N, "N is the number of joints") };
        Self { tree }
    }

    #[inline(always)]
    pub(super) fn poses(&self, q: &impl Positions) -> [Pose; N] {
        let mut poses = [Pose::HOME; N];
        self.tree.place(0, q, &mut poses);
        poses
    }

    #[inline(always)]
    pub(super) fn forces(
        &self,
        poses: &[Pose; N],
        rates: &Rates<'_, N>,
        gravity: &[f64; 3],
    ) -> [Num; N] {
        let [x, y, z] = *gravity;
        let base = Motion::new(Vec3::ZERO, Vec3::ZERO, Vec3::any([-x, -y, -z]));
        let mut tau = [Num::ZERO; N];
        self.tree.inverse(0, poses, &base, rates, &mut tau);
        tau
    }

    #[inline(always)]
    pub(super) fn matrix(&self, poses: &[Pose; N]) -> [[Num; N]; N] {
        let mut columns = Columns::<N, N>::ZERO;
        self.tree.mass(0, poses, &mut columns);
        columns.h
    }

    /// Joint forces for positions, rates, accelerations and gravity: recursive Newton–Euler.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] for an argument or, after overflow, a force.
    #[inline(always)]
    pub fn inverse(
        &self,
        q: &[f64; N],
        v: &[f64; N],
        a: &[f64; N],
        gravity_m_s2: &[f64; 3],
    ) -> Result<[f64; N], DynamicsError> {
        let rates = Rates { v, a: Some(a) };
        let tau = self.forces(&self.poses(q), &rates, gravity_m_s2);
        let parts = sum(q) + sum(v) + sum(a) + sum(gravity_m_s2);
        checked(("force", floats(&tau)), parts, || {
            look(q, v, ("acceleration", a), gravity_m_s2)
        })
    }

    /// Mass matrix: composite rigid bodies.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] for a position or, after overflow, an entry (with its column).
    #[inline(always)]
    pub fn mass_matrix(&self, q: &[f64; N]) -> Result<[[f64; N]; N], DynamicsError> {
        finite("position", q)?;
        mirrored(&self.matrix(&self.poses(q)))
    }

    /// Accelerations for positions, rates, joint forces and gravity.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] for an argument or, after overflow, an acceleration;
    /// [`DynamicsError::Singular`] for a joint that moves no mass.
    #[inline(always)]
    pub fn forward(
        &self,
        q: &[f64; N],
        v: &[f64; N],
        tau: &[f64; N],
        gravity_m_s2: &[f64; 3],
    ) -> Result<[f64; N], DynamicsError> {
        let poses = self.poses(q);
        let bias = self.forces(&poses, &Rates { v, a: None }, gravity_m_s2);
        let mut system = System::new(self.matrix(&poses), net(tau, &bias));
        T::eliminate(0, Top, &mut system);
        T::resolve(0, Top, &mut system);
        let closer = || look(q, v, ("force", tau), gravity_m_s2);
        let parts = sum(q) + sum(v) + sum(tau) + sum(gravity_m_s2);
        if !parts.is_finite() {
            closer()?;
        }
        checked(("acceleration", floats(system.solution()?)), parts, closer)
    }
}

/// τ − bias.
#[inline(always)]
fn net<const N: usize>(tau: &[f64; N], bias: &[Num; N]) -> [Num; N] {
    // A loop and not `from_fn`, whose closure is not always inlined.
    let mut net = *bias;
    for i in 0..N {
        net[i] = Num::any(tau[i]) - net[i];
    }
    net
}

#[inline(always)]
pub(super) fn floats<const N: usize>(numbers: &[Num; N]) -> [f64; N] {
    let mut floats = [0.0; N];
    for i in 0..N {
        floats[i] = numbers[i].get();
    }
    floats
}

/// Orientation of a floating base, joint positions, and all rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloatingState<const J: usize, const N: usize> {
    /// Unit quaternion x, y, z, w that turns base axes into world axes.
    pub quaternion: [f64; 4],
    /// Joint positions (rad, m).
    pub joints: [f64; J],
    /// Velocity of the base's origin in base axes (m/s), its angular velocity in base axes
    /// (rad/s), joint rates.
    pub rates: [f64; N],
}

/// A tree of J joints on a body that moves freely: N = J + 6 coordinates.
///
/// Rates are quasi-velocities in base axes: linear, angular, joints. Accelerations are the time
/// derivatives of those numbers (so the linear ones differ from the classical acceleration by
/// ω × v), and forces do work on them: the first six are a force on the base's origin (N) and a
/// moment (N m), in base axes. Gravity (m/s²) is given in world axes. Where the base is does not
/// matter. `P` is the base body's pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floating<const P: u16, T, const J: usize, const N: usize> {
    base: BodyMoments,
    tree: T,
}

impl<const P: u16, T: Tree, const J: usize, const N: usize> Floating<P, T, J, N> {
    /// The tree on its base; the base's `origin_m` must be zero.
    ///
    /// # Errors
    /// As [`super::Link::new`].
    pub const fn new(base: &LinkParams, tree: T) -> Result<Self, DynamicsError> {
        const {
            assert!(
                T::JOINTS == J && N == J + 6,
                "J joints and six coordinates of the base"
            );
        }
        match BodyMoments::new(base, P & !7) {
            Ok(base) => Ok(Self { base, tree }),
            Err(error) => Err(error),
        }
    }

    #[inline(always)]
    fn poses(&self, state: &FloatingState<J, N>) -> [Pose; J] {
        let mut poses = [Pose::HOME; J];
        self.tree.place(0, &state.joints, &mut poses);
        poses
    }

    #[inline(always)]
    fn forces(
        &self,
        poses: &[Pose; J],
        state: &FloatingState<J, N>,
        a: Option<&[f64; N]>,
        gravity: &[f64; 3],
    ) -> [Num; N] {
        let rates = Rates { v: &state.rates, a };
        let v = |i: usize| Num::any(state.rates[i]);
        let vector = |x, y, z| Vec3 { x, y, z };
        let acceleration = |i| rates.acceleration(i);
        let linear = vector(v(0), v(1), v(2));
        let w = vector(v(3), v(4), v(5));
        let down = to_base(&state.quaternion, gravity);
        // Classical acceleration of the origin less gravity.
        let a = vector(acceleration(0), acceleration(1), acceleration(2))
            + w.cross(linear)
            + down.scale(Num::any(-1.0));
        let dw = vector(acceleration(3), acceleration(4), acceleration(5));
        let motion = Motion::new(w, dw, a);
        let mut tau = [Num::ZERO; N];
        let own = self.base.mass::<P>().wrench(motion.a, &motion.spin);
        let total = own + self.tree.inverse(0, poses, &motion, &rates, &mut tau);
        set_base(&mut tau, &total);
        tau
    }

    #[inline(always)]
    fn matrix(&self, poses: &[Pose; J]) -> [[Num; N]; N] {
        let mut columns = Columns::<J, N>::ZERO;
        let own = self.base.mass::<P>();
        let Mass { m, h, s } = match self.tree.mass(0, poses, &mut columns) {
            Some(carried) => own + carried,
            None => own,
        };
        T::to_base(0, &mut columns);
        let mut rows = columns.h;
        rows[0][0] = m;
        rows[1][1] = m;
        rows[2][2] = m;
        // Moment of a linear acceleration: h ×.
        rows[3] = base_row(rows[3], [Num::ZERO, -h.z, h.y]);
        rows[4] = base_row(rows[4], [h.z, Num::ZERO, -h.x]);
        rows[5] = base_row(rows[5], [-h.y, h.x, Num::ZERO]);
        rows[3][3] = s.yy + s.zz;
        rows[4][4] = s.xx + s.zz;
        rows[5][5] = s.xx + s.yy;
        rows[4][3] = -s.xy;
        rows[5][3] = -s.xz;
        rows[5][4] = -s.yz;
        rows
    }

    /// Forces for a state, accelerations and gravity.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`]; [`DynamicsError::NotUnit`].
    #[inline(always)]
    pub fn inverse(
        &self,
        state: &FloatingState<J, N>,
        a: &[f64; N],
        gravity_m_s2: &[f64; 3],
    ) -> Result<[f64; N], DynamicsError> {
        unit(&state.quaternion)?;
        let tau = self.forces(&self.poses(state), state, Some(a), gravity_m_s2);
        let parts = sum(&state.joints) + sum(&state.rates) + sum(a) + sum(gravity_m_s2);
        checked(("force", floats(&tau)), parts, || {
            look(
                &state.joints,
                &state.rates,
                ("acceleration", a),
                gravity_m_s2,
            )
        })
    }

    /// Mass matrix of the quasi-velocities.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] for a joint position or, after overflow, an entry (with its
    /// column).
    #[inline(always)]
    pub fn mass_matrix(&self, joints: &[f64; J]) -> Result<[[f64; N]; N], DynamicsError> {
        finite("position", joints)?;
        let mut poses = [Pose::HOME; J];
        self.tree.place(0, joints, &mut poses);
        mirrored(&self.matrix(&poses))
    }

    /// Accelerations for a state, forces and gravity.
    ///
    /// # Errors
    /// As [`Self::inverse`]; [`DynamicsError::Singular`] for a coordinate that moves no mass.
    #[inline(always)]
    pub fn forward(
        &self,
        state: &FloatingState<J, N>,
        tau: &[f64; N],
        gravity_m_s2: &[f64; 3],
    ) -> Result<[f64; N], DynamicsError> {
        unit(&state.quaternion)?;
        let poses = self.poses(state);
        let bias = self.forces(&poses, state, None, gravity_m_s2);
        let mut system = System::new(self.matrix(&poses), net(tau, &bias));
        T::eliminate(6, BASE, &mut system);
        BASE.eliminate_all(&mut system);
        BASE.resolve_all(&mut system);
        T::resolve(6, BASE, &mut system);
        let closer = || look(&state.joints, &state.rates, ("force", tau), gravity_m_s2);
        let parts = sum(&state.joints) + sum(&state.rates) + sum(tau) + sum(gravity_m_s2);
        if !parts.is_finite() {
            closer()?;
        }
        checked(("acceleration", floats(system.solution()?)), parts, closer)
    }
}

/// Rotates a world vector into base axes.
#[inline(always)]
fn to_base(quaternion: &[f64; 4], world: &[f64; 3]) -> Vec3 {
    let [x, y, z, w] = *quaternion;
    let [gx, gy, gz] = *world;
    // v + 2w (u × v) + 2 u × (u × v) with u negated: the inverse turn.
    let t = [
        2.0 * (z * gy - y * gz),
        2.0 * (x * gz - z * gx),
        2.0 * (y * gx - x * gy),
    ];
    Vec3::any([
        gx + w * t[0] + (z * t[1] - y * t[2]),
        gy + w * t[1] + (x * t[2] - z * t[0]),
        gz + w * t[2] + (y * t[0] - x * t[1]),
    ])
}

#[inline(always)]
fn unit(quaternion: &[f64; 4]) -> Result<(), DynamicsError> {
    let [x, y, z, w] = *quaternion;
    let square = (x * x + y * y) + (z * z + w * w);
    if (square - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(())
    } else {
        finite("quaternion", quaternion)?;
        Err(DynamicsError::NotUnit {
            norm: square.sqrt(),
        })
    }
}

#[inline(always)]
fn base_row<const N: usize>(mut row: [Num; N], first: [Num; 3]) -> [Num; N] {
    [row[0], row[1], row[2]] = first;
    row
}
