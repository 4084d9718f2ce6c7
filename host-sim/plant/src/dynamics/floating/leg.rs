//! The legs' share of the equations of motion, in chassis axes (mirrored for the right leg), both legs side by side.
//!
//! Two composites: bodies 1 and 2 about O1, bodies 3 to 6 about O4. Within a composite everything
//! has one angular velocity, so its inertial forces are those of a rigid body plus the Coriolis
//! forces 2 Ω × ṡ of the slides.

use nalgebra::Vector3;
use wheeleg_kinematics::LegPosture;

use super::group::{AXES, GroupBody, Motion, Sym3, Yaw};
use crate::both::{Both, Number, same};
use crate::dynamics::params::RobotDynamicsParams;

/// The constant data, the same for both legs.
#[derive(Debug, Clone)]
pub(super) struct LegModel {
    barrel: (Vector3<Both>, Sym3<Both>),
    rod: GroupBody<Both>,
    crank_and_carriage: (Both, Vector3<Both>, Sym3<Both>),
    horizontal: GroupBody<Both>,
    vertical: GroupBody<Both>,
    barrel_mass: Both,
    o1: Vector3<f64>,
    o4: Vector3<f64>,
    pad: f64,
    /// Mass of bodies 1 and 2, and of bodies 3 to 6.
    composites: [f64; 2],
    /// Masses that move with b5 and with b6: the constant part of a leg's mass matrix.
    pub(super) m56: f64,
    pub(super) m6: f64,
}

/// The legs' shares at one state, about the origin of B.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegTerms {
    /// First moment and inertia less the constant parts of [`LegModel::fixed`].
    pub(super) first: Vector3<Both>,
    pub(super) inertia: Sym3<Both>,
    /// Angular and linear momentum of a leg for unit rates of b2, b5, b6.
    pub(super) columns: [[Both; 6]; 3],
    /// Mass matrix of a leg: entries (b2, b2) and (b2, b5); the rest is constant.
    pub(super) d22: Both,
    pub(super) d25: Both,
    /// Moment and force that a leg needs at ν̇ = 0, less gravity.
    pub(super) base: [Both; 6],
    /// Forces of b2, b5, b6 at ν̇ = 0, less gravity.
    pub(super) bias: [Both; 3],
}

impl LegModel {
    pub(super) fn new(p: &RobotDynamicsParams) -> Self {
        let [b1, b2, b3, b4, b5, b6]: [GroupBody; 6] =
            std::array::from_fn(|i| GroupBody::new(&p.leg_bodies[i], AXES[i]));
        let o = Vector3::zeros();
        let (h1, j1) = b1.at(&o);
        let (h3, j3) = b3.at(&o);
        let (h4, j4) = b4.at(&o);
        let o4 = Vector3::from(p.o4_m);
        let (m34, m56) = (b3.m + b4.m, b5.m + b6.m);
        Self {
            barrel: (same(&h1), j1.map(Both::splat)),
            barrel_mass: Both::splat(b1.m),
            rod: b2.twice(),
            crank_and_carriage: (
                Both::splat(m34),
                same(&(h3 + h4)),
                j3.plus(&j4).map(Both::splat),
            ),
            horizontal: b5.twice(),
            vertical: b6.twice(),
            o1: o4 - Vector3::new(p.p4_m[0], p.p4_m[1], 0.0),
            o4,
            pad: p.foot_pad_m,
            composites: [b1.m + b2.m, m34 + m56],
            m56,
            m6: b6.m,
        }
    }

    /// Mass, first moment and inertia of one leg's two composites as if they were in O1 and O4.
    pub(super) fn fixed(&self) -> (f64, Vector3<f64>, Sym3) {
        let [ma, mb] = self.composites;
        let none = Vector3::zeros();
        let at = |m, r: &Vector3<f64>| Sym3::of_body(m, r, &none);
        (
            ma + mb,
            ma * self.o1 + mb * self.o4,
            at(ma, &self.o1).plus(&at(mb, &self.o4)),
        )
    }

    /// Sole centre from the origin of B.
    pub(super) fn sole(&self, leg: &LegPosture<f64>) -> Vector3<f64> {
        let q = &leg.lengths;
        self.o4 + Vector3::new(q.b5_m * leg.sin4, -q.b5_m * leg.cos4, -q.b6_m - self.pad)
    }

    /// `omega` and `origin` (acceleration of the origin of B less gravity) in mirrored chassis
    /// axes.
    #[inline]
    pub(super) fn terms(
        &self,
        legs: &[LegPosture<f64>; 2],
        rates: &[Both; 3],
        omega: &Vector3<Both>,
        origin: &Vector3<Both>,
    ) -> LegTerms {
        let both = |of: fn(&LegPosture<f64>) -> f64| Both::new([of(&legs[0]), of(&legs[1])]);
        let [b2_dot, b5_dot, b6_dot] = *rates;
        let (b2, b5, b6) = (
            both(|leg| leg.lengths.b2_m),
            both(|leg| leg.lengths.b5_m),
            both(|leg| leg.lengths.b6_m),
        );
        let none = Both::splat(0.0);
        let (o1, o4) = (same(&self.o1), same(&self.o4));
        let (m56, m6) = (Both::splat(self.m56), Both::splat(self.m6));
        let carried = |r: &Vector3<Both>| origin + omega.cross(&omega.cross(r));

        // Bodies 1 and 2 about O1.
        let yaw = Yaw {
            sin: both(|leg| leg.sin1),
            cos: both(|leg| leg.cos1),
        };
        let prime = both(|leg| leg.theta1_prime);
        let (h2, j2) = self.rod.at(&Vector3::new(b2, none, none));
        let (h, j) = (self.barrel.0 + h2, self.barrel.1.plus(&j2));
        let motion = Motion::new(
            yaw.to_group(omega),
            yaw.to_group(&carried(&o1)),
            prime * b2_dot,
            both(|leg| leg.theta1_second) * b2_dot * b2_dot,
        );
        // Ω × a, the direction of the Coriolis acceleration of a body sliding along a.
        let e = Vector3::new(none, motion.omega.z, -motion.omega.y);
        let coriolis = b2_dot * 2.0;
        let rod_force =
            motion.origin * self.rod.m + motion.carry(&h2) + e * (coriolis * self.rod.m);
        let rest = motion.origin * self.barrel_mass + motion.carry(&self.barrel.0);
        let force = yaw.to_chassis(&(rod_force + rest));
        let local = motion.moment(&h, &j) + h2.cross(&e) * coriolis;
        let moment = yaw.to_chassis(&local) + o1.cross(&force);
        let lin_a = Vector3::new(self.rod.m - prime * h.y, prime * h.x, none);
        let ang_a = Vector3::new(prime * j.xz, prime * j.yz + h2.z, prime * j.zz - h2.y);
        let lin_a = yaw.to_chassis(&lin_a);
        let ang_a = yaw.to_chassis(&ang_a) + o1.cross(&lin_a);
        let mut d22 = self.rod.m + prime * (prime * j.zz - h2.y * 2.0);
        let mut bias2 = rod_force.x + prime * local.z;
        let h = yaw.to_chassis(&h);
        let mut first = h;
        let mut inertia = yaw.tensor_to_chassis(&j).shifted(&o1, &h);
        let (force_a, moment_a) = (force, moment);

        // Bodies 3 to 6 about O4.
        let yaw = Yaw {
            sin: both(|leg| leg.sin4),
            cos: both(|leg| leg.cos4),
        };
        let prime = both(|leg| leg.phi_prime);
        let (m34, h34, j34) = &self.crank_and_carriage;
        let (h5, j5) = self.horizontal.at(&Vector3::new(b5, none, none));
        let (h6, j6) = self.vertical.at(&Vector3::new(b5, none, -b6));
        let h56 = h5 + h6;
        let (h, j) = (h34 + h56, j34.plus(&j5).plus(&j6));
        let motion = Motion::new(
            yaw.to_group(omega),
            yaw.to_group(&carried(&o4)),
            prime * b2_dot,
            both(|leg| leg.phi_second) * b2_dot * b2_dot,
        );
        let e = Vector3::new(none, motion.omega.z, -motion.omega.y);
        // Ω × z
        let d = Vector3::new(motion.omega.y, -motion.omega.x, none);
        let (along, down) = (b5_dot * 2.0, b6_dot * 2.0);
        let slide_force =
            motion.origin * m56 + motion.carry(&h56) + e * (along * m56) - d * (down * m6);
        let drop_force = m6 * (motion.origin.z + along * e.z) + motion.carry(&h6).z;
        let rest = motion.origin * *m34 + motion.carry(h34);
        let force = yaw.to_chassis(&(slide_force + rest));
        let local = motion.moment(&h, &j) + h56.cross(&e) * along - h6.cross(&d) * down;
        let moment = yaw.to_chassis(&local) + o4.cross(&force);
        let lin_2 = yaw.to_chassis(&Vector3::new(-prime * h.y, prime * h.x, none));
        let ang_2 = yaw.to_chassis(&(Vector3::new(j.xz, j.yz, j.zz) * prime)) + o4.cross(&lin_2);
        let lin_5 = yaw.to_chassis(&Vector3::new(m56, none, none));
        let ang_5 = yaw.to_chassis(&Vector3::new(none, h56.z, -h56.y)) + o4.cross(&lin_5);
        let lin_6 = Vector3::new(none, none, -m6);
        let ang_6 = yaw.to_chassis(&Vector3::new(-h6.y, h6.x, none)) + o4.cross(&lin_6);
        d22 += prime * prime * j.zz;
        bias2 += prime * local.z;
        let h = yaw.to_chassis(&h);
        first += h;
        inertia = inertia.plus(&yaw.tensor_to_chassis(&j).shifted(&o4, &h));

        LegTerms {
            first,
            inertia,
            columns: [
                joined(&(ang_a + ang_2), &(lin_a + lin_2)),
                joined(&ang_5, &lin_5),
                joined(&ang_6, &lin_6),
            ],
            d22,
            d25: -prime * h56.y,
            base: joined(&(moment_a + moment), &(force_a + force)),
            bias: [bias2, slide_force.x, -drop_force],
        }
    }
}

/// \[angular, linear\].
pub(super) fn joined<T: Number>(angular: &Vector3<T>, linear: &Vector3<T>) -> [T; 6] {
    [
        angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
    ]
}
