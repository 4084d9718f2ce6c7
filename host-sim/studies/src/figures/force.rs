//! Fig. 9: the force on the vertical cylinder over three steps, by the inverse dynamics.

use nalgebra::Vector3;
use wheeleg_kinematics::LegParameters;
use wheeleg_plant::dynamics::noc::Leg;
use wheeleg_plant::dynamics::{DynamicsError, RobotDynamicsParams};

use super::section6::AxisCheck;
use crate::analysis::ReferenceModel;
use wheeleg_config::RobotConfig;

/// One instant. SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Time (s).
    pub t_s: f64,
    /// F6 by the inverse dynamics of the leg, row 3 of (54) (N).
    pub f6_n: f64,
    /// Load of the ground on the foot (N).
    pub load_n: f64,
}

/// The record of Fig. 9.
#[derive(Debug, Clone, PartialEq)]
pub struct Force {
    /// Instants over 10 s.
    pub instants: Vec<Instant>,
    /// Largest difference between the inverse dynamics and m6 (b̈6 − g) + d6 ḃ6 + N (N).
    pub worst_difference_n: f64,
    /// Time of the largest value (s).
    pub maximum_at_s: f64,
}

/// Length of the record (s). PAPER Fig. 9.
const DURATION_S: f64 = 10.0;
/// Yaw cylinder at home (m). DERIVED, MODEL.md §3.
const B2_HOME_M: f64 = 0.40;

impl Force {
    /// The record with `n` + 1 instants. The motion is the reference model of the robot's
    /// parameters, the masses are those of MODEL.md §9.2.
    ///
    /// # Errors
    /// [`DynamicsError`]; not with strokes inside the range.
    pub fn new(robot: &RobotConfig, n: usize) -> Result<Self, DynamicsError> {
        let model = ReferenceModel::new(robot.reference, robot.gait);
        let dimensions = LegParameters::<f64>::wheeleg_2003();
        let [_, zero5, zero6] = dimensions.stroke_zero_m;
        let bodies = RobotDynamicsParams::wheeleg_2003().leg_bodies;
        let leg = Leg::new(dimensions, &bodies, [0.0, 0.0, robot.reference.d6_n_s_m])?;
        let gravity = Vector3::new(0.0, 0.0, -robot.reference.gravity_m_s2);
        let (mut worst, mut instants) = (0.0_f64, Vec::with_capacity(n + 1));
        for i in 0..=n {
            let p = model.at(DURATION_S * i as f64 / n as f64);
            let q = Vector3::new(B2_HOME_M, zero5 + p.s5_m, zero6 + p.s6_m);
            let rates = Vector3::new(0.0, p.v5_m_s, p.v6_m_s);
            let accelerations = Vector3::new(0.0, p.a5_m_s2, p.a6_m_s2);
            let contact = Vector3::new(0.0, 0.0, p.load_n);
            let force = leg
                .at(&q, &rates)?
                .inverse(&accelerations, &gravity, &contact)?;
            worst = worst.max((force.z - p.f6_n).abs());
            instants.push(Instant {
                t_s: p.t_s,
                f6_n: force.z,
                load_n: p.load_n,
            });
        }
        let largest = instants.iter().max_by(|a, b| a.f6_n.total_cmp(&b.f6_n));
        Ok(Self {
            maximum_at_s: largest.map_or(0.0, |i| i.t_s),
            worst_difference_n: worst,
            instants,
        })
    }

    /// The axis of Fig. 9.
    #[must_use]
    pub fn check(&self) -> AxisCheck {
        let values = self.instants.iter().map(|i| i.f6_n);
        AxisCheck::new(("A13", 9, "F6"), "model", "N", (-30.0, 30.0), values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    #[test]
    fn the_force_is_that_of_the_text() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let force = Force::new(&robot, 2000).expect("inside the strokes");
        // A13, A14: inside the axis, positive maximum at the start (MODEL.md §6.2: 25.78 N).
        let check = force.check();
        assert!(check.fits, "{check:?}");
        // The later steps begin with a small remaining motion, unlike the first.
        let first = force.instants[0].f6_n;
        assert!((first - 25.78).abs() < 0.01, "{first}");
        assert!(
            check.max - first < 0.05,
            "{} at {} s",
            check.max,
            force.maximum_at_s
        );
        assert!((check.min + 13.97).abs() < 0.05, "{check:?}");
        // A15: it changes sign in the first second.
        assert!(force.instants.iter().any(|i| i.t_s < 1.0 && i.f6_n < 0.0));
        assert!(
            force.worst_difference_n < 1e-10,
            "{}",
            force.worst_difference_n
        );
    }
}
