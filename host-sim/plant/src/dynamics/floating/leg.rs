//! One leg's share of the equations of motion, in chassis axes (mirrored for the right leg).
//!
//! Two composites: bodies 1 and 2 about O1, bodies 3 to 6 about O4. Within a composite everything
//! has one angular velocity, so its inertial forces are those of a rigid body plus the Coriolis
//! forces 2 Ω × ṡ of the slides.

use nalgebra::Vector3;
use wheeleg_kinematics::LegPosture;

use super::group::{AXES, GroupBody, Motion, Sym3, Yaw};
use crate::dynamics::params::RobotDynamicsParams;

/// The constant data.
#[derive(Debug, Clone)]
pub(super) struct LegModel {
    barrel: (Vector3<f64>, Sym3),
    rod: GroupBody,
    crank_and_carriage: (f64, Vector3<f64>, Sym3),
    horizontal: GroupBody,
    vertical: GroupBody,
    barrel_mass: f64,
    o1: Vector3<f64>,
    o4: Vector3<f64>,
    pad: f64,
    /// Masses that move with b5 and with b6: the constant part of the leg's mass matrix.
    pub(super) m56: f64,
    pub(super) m6: f64,
}

/// The leg's share at one state, about the origin of B.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegTerms {
    /// First moment and inertia less the constant parts of [`LegModel::fixed`].
    pub(super) first: Vector3<f64>,
    pub(super) inertia: Sym3,
    /// Angular and linear momentum of the leg for unit rates of b2, b5, b6.
    pub(super) columns: [[f64; 6]; 3],
    /// Mass matrix of the leg: entries (b2, b2) and (b2, b5); the rest is constant.
    pub(super) d22: f64,
    pub(super) d25: f64,
    /// Moment and force that the leg needs at ν̇ = 0, less gravity.
    pub(super) base: [f64; 6],
    /// Forces of b2, b5, b6 at ν̇ = 0, less gravity.
    pub(super) bias: [f64; 3],
}

impl LegModel {
    pub(super) fn new(p: &RobotDynamicsParams) -> Self {
        let [b1, b2, b3, b4, b5, b6]: [GroupBody; 6] =
            std::array::from_fn(|i| GroupBody::new(&p.leg_bodies[i], AXES[i]));
        let o = Vector3::zeros();
        let (h3, j3) = b3.at(&o);
        let (h4, j4) = b4.at(&o);
        let o4 = Vector3::from(p.o4_m);
        Self {
            barrel: b1.at(&o),
            barrel_mass: b1.m,
            rod: b2,
            crank_and_carriage: (b3.m + b4.m, h3 + h4, j3.plus(&j4)),
            horizontal: b5,
            vertical: b6,
            o1: o4 - Vector3::new(p.p4_m[0], p.p4_m[1], 0.0),
            o4,
            pad: p.foot_pad_m,
            m56: b5.m + b6.m,
            m6: b6.m,
        }
    }

    /// Mass, first moment and inertia of the two composites as if they were in O1 and O4.
    pub(super) fn fixed(&self) -> (f64, Vector3<f64>, Sym3) {
        let (ma, mb) = (
            self.barrel_mass + self.rod.m,
            self.crank_and_carriage.0 + self.m56,
        );
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
        leg: &LegPosture<f64>,
        rates: &[f64; 3],
        omega: &Vector3<f64>,
        origin: &Vector3<f64>,
    ) -> LegTerms {
        let [b2_dot, b5_dot, b6_dot] = *rates;
        let carried = |r: &Vector3<f64>| origin + omega.cross(&omega.cross(r));

        // Bodies 1 and 2 about O1.
        let yaw = Yaw {
            sin: leg.sin1,
            cos: leg.cos1,
        };
        let prime = leg.theta1_prime;
        let (h2, j2) = self.rod.at(&Vector3::new(leg.lengths.b2_m, 0.0, 0.0));
        let (h, j) = (self.barrel.0 + h2, self.barrel.1.plus(&j2));
        let motion = Motion::new(
            yaw.to_group(omega),
            yaw.to_group(&carried(&self.o1)),
            prime * b2_dot,
            leg.theta1_second * b2_dot * b2_dot,
        );
        // Ω × a, the direction of the Coriolis acceleration of a body sliding along a.
        let e = Vector3::new(0.0, motion.omega.z, -motion.omega.y);
        let coriolis = 2.0 * b2_dot;
        let rod_force =
            self.rod.m * motion.origin + motion.carry(&h2) + (coriolis * self.rod.m) * e;
        let rest = self.barrel_mass * motion.origin + motion.carry(&self.barrel.0);
        let force = yaw.to_chassis(&(rod_force + rest));
        let local = motion.moment(&h, &j) + coriolis * h2.cross(&e);
        let moment = yaw.to_chassis(&local) + self.o1.cross(&force);
        let lin_a = Vector3::new(self.rod.m - prime * h.y, prime * h.x, 0.0);
        let ang_a = Vector3::new(prime * j.xz, prime * j.yz + h2.z, prime * j.zz - h2.y);
        let lin_a = yaw.to_chassis(&lin_a);
        let ang_a = yaw.to_chassis(&ang_a) + self.o1.cross(&lin_a);
        let mut d22 = self.rod.m + prime * (prime * j.zz - 2.0 * h2.y);
        let mut bias2 = rod_force.x + prime * local.z;
        let h = yaw.to_chassis(&h);
        let mut first = h;
        let mut inertia = yaw.tensor_to_chassis(&j).shifted(&self.o1, &h);
        let (force_a, moment_a) = (force, moment);

        // Bodies 3 to 6 about O4.
        let yaw = Yaw {
            sin: leg.sin4,
            cos: leg.cos4,
        };
        let prime = leg.phi_prime;
        let q = &leg.lengths;
        let (m34, h34, j34) = &self.crank_and_carriage;
        let (h5, j5) = self.horizontal.at(&Vector3::new(q.b5_m, 0.0, 0.0));
        let (h6, j6) = self.vertical.at(&Vector3::new(q.b5_m, 0.0, -q.b6_m));
        let h56 = h5 + h6;
        let (h, j) = (h34 + h56, j34.plus(&j5).plus(&j6));
        let motion = Motion::new(
            yaw.to_group(omega),
            yaw.to_group(&carried(&self.o4)),
            prime * b2_dot,
            leg.phi_second * b2_dot * b2_dot,
        );
        let e = Vector3::new(0.0, motion.omega.z, -motion.omega.y);
        // Ω × z
        let d = Vector3::new(motion.omega.y, -motion.omega.x, 0.0);
        let (along, down) = (2.0 * b5_dot, 2.0 * b6_dot);
        let slide_force = self.m56 * motion.origin + motion.carry(&h56) + (along * self.m56) * e
            - (down * self.m6) * d;
        let drop_force = self.m6 * (motion.origin.z + along * e.z) + motion.carry(&h6).z;
        let rest = *m34 * motion.origin + motion.carry(h34);
        let force = yaw.to_chassis(&(slide_force + rest));
        let local = motion.moment(&h, &j) + along * h56.cross(&e) - down * h6.cross(&d);
        let moment = yaw.to_chassis(&local) + self.o4.cross(&force);
        let lin_2 = yaw.to_chassis(&Vector3::new(-prime * h.y, prime * h.x, 0.0));
        let ang_2 =
            yaw.to_chassis(&(prime * Vector3::new(j.xz, j.yz, j.zz))) + self.o4.cross(&lin_2);
        let lin_5 = yaw.to_chassis(&Vector3::new(self.m56, 0.0, 0.0));
        let ang_5 = yaw.to_chassis(&Vector3::new(0.0, h56.z, -h56.y)) + self.o4.cross(&lin_5);
        let lin_6 = Vector3::new(0.0, 0.0, -self.m6);
        let ang_6 = yaw.to_chassis(&Vector3::new(-h6.y, h6.x, 0.0)) + self.o4.cross(&lin_6);
        d22 += prime * prime * j.zz;
        bias2 += prime * local.z;
        let h = yaw.to_chassis(&h);
        first += h;
        inertia = inertia.plus(&yaw.tensor_to_chassis(&j).shifted(&self.o4, &h));

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
pub(super) fn joined(angular: &Vector3<f64>, linear: &Vector3<f64>) -> [f64; 6] {
    [
        angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
    ]
}
