//! Masses and dimensions of the robot.

use serde::{Deserialize, Serialize};
use wheeleg_kinematics::LegParameters;

use super::error::DynamicsError;

/// A rigid body in its link frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BodyParams {
    /// Mass (kg).
    pub mass_kg: f64,
    /// Centre of mass in the link frame (m).
    pub com_m: [f64; 3],
    /// Principal inertias at the centre of mass, axes of the link frame (kg m²).
    pub inertia_kg_m2: [f64; 3],
}

/// The six bodies of a leg: yaw barrel (frame F2), yaw rod (F3), crank (F4′), yaw carriage with
/// horizontal barrel (F5), horizontal carriage with vertical barrel (F6), vertical rod with foot
/// (F7).
pub type LegBodies = [BodyParams; 6];

/// Every parameter of the whole robot's dynamics. Plain SI data.
///
/// The right leg is the left one mirrored in Y.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotDynamicsParams {
    /// Crank ℓ from O3 to O4 (m). PAPER Table 2.
    pub crank_m: f64,
    /// O4 − O1, forward and left (m). PAPER (20).
    pub p4_m: [f64; 2],
    /// Smallest cos θ3 accepted (moment arm of the yaw cylinder over ℓ).
    pub min_cos_theta3: f64,
    /// Bodies of a leg.
    pub leg_bodies: LegBodies,
    /// Chassis mass (kg), without wheels and legs.
    pub chassis_mass_kg: f64,
    /// Chassis centre of mass from the wheel axle: forward, up (m).
    pub chassis_com_m: [f64; 2],
    /// Chassis inertia about its centre of mass, pitch axis (kg m²).
    pub chassis_pitch_inertia_kg_m2: f64,
    /// O4 of the left leg from the middle of the wheel axle: forward, left, up (m).
    pub o4_m: [f64; 3],
    /// Sole below the foot point P (m).
    pub foot_pad_m: f64,
    /// Mass of one wheel (kg), centred on the axle.
    pub wheel_mass_kg: f64,
    /// Wheel radius r_w (m).
    pub wheel_radius_m: f64,
    /// Inertia of one wheel about its axle J_w (kg m²).
    pub wheel_inertia_kg_m2: f64,
    /// Inertia of one motor's rotor (kg m²).
    pub rotor_inertia_kg_m2: f64,
    /// Motor turns per wheel turn, gear times chain.
    pub gear_ratio: f64,
    /// Viscous friction of each coordinate (N s/m; N m s/rad for pitch). Cylinder friction belongs
    /// to the pneumatic model and is then zero here.
    pub viscous: [f64; 8],
    /// Gravity (m/s²) in ground axes: X along the travel, Y left, Z normal to the ground.
    pub gravity_m_s2: [f64; 3],
}

impl RobotDynamicsParams {
    /// The robot of the paper with the masses assumed for it, on level ground.
    ///
    /// | value | source |
    /// |---|---|
    /// | crank, p4, gear ratio, total of 25 kg | PAPER |
    /// | masses, centres of mass and inertias of bodies, wheels and rotors | ASSUMED |
    /// | chassis centre 0.133 m behind the axle | ASSUMED, so that the robot's is 0.090 m ahead of it with both legs at b5 = 0.10 m (mid stroke) |
    /// | chassis centre 0.020 m above the axle | DERIVED: robot's centre 0.20 m above the ground with b2 = 0.40, b5 = 0.10, b6 = 0.19 m |
    /// | chassis pitch inertia 0.513 kg m² | ASSUMED: uniform box, 0.60 m long, 0.20 m high, 15.4 kg: m (l² + h²)/12 |
    /// | chassis viscous friction 4 N s/m | ASSUMED, 2 N s/m a side |
    #[must_use]
    pub fn wheeleg_2003() -> Self {
        let body = |mass_kg, com_m, inertia_kg_m2| BodyParams {
            mass_kg,
            com_m,
            inertia_kg_m2,
        };
        let (box_length, box_height, chassis_mass_kg) = (0.60_f64, 0.20_f64, 15.4);
        Self {
            crank_m: 0.29,
            p4_m: [0.29, 0.40],
            min_cos_theta3: 0.05,
            leg_bodies: [
                body(0.40, [0.004, 0.0, 0.120], [1.30e-3, 1.30e-3, 1.0e-4]),
                body(0.20, [0.003, -0.150, 0.0], [1.00e-3, 3.0e-5, 1.00e-3]),
                body(0.30, [-0.120, 0.006, 0.0], [1.0e-4, 2.20e-3, 2.20e-3]),
                body(1.00, [0.010, 0.020, 0.050], [8.0e-3, 8.0e-3, 1.5e-3]),
                body(0.90, [0.008, -0.030, 0.020], [7.0e-3, 7.0e-3, 1.2e-3]),
                body(0.80, [0.0, 0.005, -0.100], [4.5e-3, 4.5e-3, 4.0e-4]),
            ],
            chassis_mass_kg,
            chassis_com_m: [-0.133, 0.020],
            chassis_pitch_inertia_kg_m2: chassis_mass_kg
                * (box_length * box_length + box_height * box_height)
                / 12.0,
            o4_m: [0.60, 0.20, 0.15],
            foot_pad_m: 0.11,
            wheel_mass_kg: 1.20,
            wheel_radius_m: 0.15,
            wheel_inertia_kg_m2: 0.0162,
            rotor_inertia_kg_m2: 2.0e-6,
            gear_ratio: 260.0,
            viscous: [4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            gravity_m_s2: [0.0, 0.0, -9.81],
        }
    }

    /// Total mass (kg).
    #[must_use]
    pub fn total_mass_kg(&self) -> f64 {
        let leg: f64 = self.leg_bodies.iter().map(|b| b.mass_kg).sum();
        self.chassis_mass_kg + 2.0 * (leg + self.wheel_mass_kg)
    }

    /// Dimensions for the leg kinematics. Strokes are not used by the dynamics; the kinematics'
    /// defaults stand in for them.
    #[must_use]
    pub fn leg_parameters(&self) -> LegParameters<f64> {
        leg_parameters(self.crank_m, self.p4_m, self.min_cos_theta3)
    }

    /// Half of the robot: the left leg, half the chassis and its friction, one wheel.
    #[must_use]
    pub fn half(&self) -> HalfRobotParams {
        let [s, _, b2, b5, b6, ..] = self.viscous;
        HalfRobotParams {
            crank_m: self.crank_m,
            p4_m: self.p4_m,
            min_cos_theta3: self.min_cos_theta3,
            leg_bodies: self.leg_bodies,
            chassis_mass_kg: 0.5 * self.chassis_mass_kg,
            wheel_mass_kg: self.wheel_mass_kg,
            wheel_radius_m: self.wheel_radius_m,
            wheel_inertia_kg_m2: self.wheel_inertia_kg_m2,
            rotor_inertia_kg_m2: self.rotor_inertia_kg_m2,
            gear_ratio: self.gear_ratio,
            viscous_n_s_m: [0.5 * s, b2, b5, b6],
        }
    }

    /// Checks signs and finiteness.
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), DynamicsError> {
        let refuse = |name, value| Err(DynamicsError::Parameter { name, value });
        let positive = [
            ("chassis_mass_kg", self.chassis_mass_kg),
            (
                "chassis_pitch_inertia_kg_m2",
                self.chassis_pitch_inertia_kg_m2,
            ),
            ("wheel_mass_kg", self.wheel_mass_kg),
            ("wheel_radius_m", self.wheel_radius_m),
            ("gear_ratio", self.gear_ratio),
        ];
        let not_negative = [
            ("foot_pad_m", self.foot_pad_m),
            ("wheel_inertia_kg_m2", self.wheel_inertia_kg_m2),
            ("rotor_inertia_kg_m2", self.rotor_inertia_kg_m2),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(name, value);
            }
        }
        let viscous = self.viscous.map(|v| ("viscous", v));
        for (name, value) in not_negative.into_iter().chain(viscous) {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(name, value);
            }
        }
        for body in &self.leg_bodies {
            if !(body.mass_kg > 0.0 && body.mass_kg.is_finite()) {
                return refuse("leg_bodies.mass_kg", body.mass_kg);
            }
            for value in body.inertia_kg_m2 {
                if !(value >= 0.0 && value.is_finite()) {
                    return refuse("leg_bodies.inertia_kg_m2", value);
                }
            }
            for value in body.com_m {
                if !value.is_finite() {
                    return refuse("leg_bodies.com_m", value);
                }
            }
        }
        let rest = [
            ("chassis_com_m", &self.chassis_com_m[..]),
            ("o4_m", &self.o4_m[..]),
            ("gravity_m_s2", &self.gravity_m_s2[..]),
        ];
        for (name, values) in rest {
            if let Some(&value) = values.iter().find(|v| !v.is_finite()) {
                return refuse(name, value);
            }
        }
        Ok(())
    }
}

/// One leg, half the chassis, one wheel: the paper's 7.2.3 for [`super::noc::HalfRobot`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HalfRobotParams {
    /// Crank ℓ (m).
    pub crank_m: f64,
    /// O4 − O1, forward and left (m).
    pub p4_m: [f64; 2],
    /// Smallest cos θ3 accepted.
    pub min_cos_theta3: f64,
    /// Bodies of the leg.
    pub leg_bodies: LegBodies,
    /// Half the chassis's mass (kg).
    pub chassis_mass_kg: f64,
    /// Mass of the wheel (kg).
    pub wheel_mass_kg: f64,
    /// Wheel radius r_w (m).
    pub wheel_radius_m: f64,
    /// Inertia of the wheel about its axle (kg m²).
    pub wheel_inertia_kg_m2: f64,
    /// Inertia of the motor's rotor (kg m²).
    pub rotor_inertia_kg_m2: f64,
    /// Motor turns per wheel turn.
    pub gear_ratio: f64,
    /// Viscous friction of s, b2, b5, b6 (N s/m).
    pub viscous_n_s_m: [f64; 4],
}

impl HalfRobotParams {
    /// Dimensions for the leg kinematics, as [`RobotDynamicsParams::leg_parameters`].
    #[must_use]
    pub fn leg_parameters(&self) -> LegParameters<f64> {
        leg_parameters(self.crank_m, self.p4_m, self.min_cos_theta3)
    }
}

fn leg_parameters(crank_m: f64, p4_m: [f64; 2], min_cos_theta3: f64) -> LegParameters<f64> {
    LegParameters {
        crank_m,
        p4_m,
        min_cos_theta3,
        ..LegParameters::wheeleg_2003()
    }
}
