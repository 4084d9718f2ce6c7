//! Sole centres in ground axes.

use wheeleg_kinematics::LegPosture;

use super::dynamics::RobotDynamics;

/// Position, velocity and Jacobian of a sole's centre in ground axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FootKin {
    /// Sole centre (m); z = 0 is the ground under the wheels.
    pub(crate) position_m: [f64; 3],
    /// Its velocity (m/s).
    pub(crate) velocity_m_s: [f64; 3],
    /// Its Jacobian, one column for each of s, p and this leg's b2, b5, b6.
    pub(crate) jacobian: [[f64; 3]; 5],
    /// Unit vector from the sole's centre to its front (along the leg).
    pub(crate) forward: [f64; 3],
    /// Unit vector from the sole's centre to its left side, on both legs.
    pub(crate) left: [f64; 3],
}

impl RobotDynamics {
    pub(super) fn foot(
        &self,
        leg: usize,
        posture: &LegPosture<f64>,
        q: &[f64; 8],
        qd: &[f64; 8],
        sin_p: f64,
        cos_p: f64,
    ) -> FootKin {
        let p = &self.params;
        // Mirrored axes of the right leg back to the robot's.
        let mirror = if leg == 0 { 1.0 } else { -1.0 };
        let (s4, c4) = (posture.sin4, posture.cos4);
        let b5 = posture.lengths.b5_m;
        let x = p.o4_m[0] + b5 * s4;
        let y = mirror * (p.o4_m[1] - b5 * c4);
        let z = p.o4_m[2] - posture.lengths.b6_m - p.foot_pad_m;
        let arm = b5 * posture.phi_prime;
        let world = |v: [f64; 2]| [cos_p * v[0], mirror * v[1], sin_p * v[0]];
        let forward = world([s4, -c4]);
        let n = world([c4, s4]);
        let yaw = world([arm * c4, arm * s4]);
        let jacobian = [
            [1.0, 0.0, 0.0],
            [-sin_p * x - cos_p * z, 0.0, cos_p * x - sin_p * z],
            yaw,
            forward,
            [sin_p, 0.0, -cos_p],
        ];
        let i = 2 + 3 * leg;
        let rates = [qd[0], qd[1], qd[i], qd[i + 1], qd[i + 2]];
        FootKin {
            position_m: [
                q[0] + cos_p * x - sin_p * z,
                y,
                p.wheel_radius_m + sin_p * x + cos_p * z,
            ],
            velocity_m_s: std::array::from_fn(|axis| {
                jacobian
                    .iter()
                    .zip(rates)
                    .map(|(column, rate)| column[axis] * rate)
                    .sum()
            }),
            jacobian,
            forward,
            left: n.map(|v| mirror * v),
        }
    }
}
