//! Parameters of the floating robot beyond those of the robot in eight coordinates.

use serde::{Deserialize, Serialize};

use crate::dynamics::error::DynamicsError;
use crate::dynamics::params::RobotDynamicsParams;

/// Parameters of the floating robot. Plain SI data.
///
/// Gravity is an argument of the dynamics; [`RobotDynamicsParams::gravity_m_s2`] is not used here.
/// The travel friction of the eight-coordinate robot is taken at the wheel bearings: half of it
/// times r_w² for each wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FloatingParams {
    /// Masses and dimensions shared with the robot in eight coordinates.
    pub robot: RobotDynamicsParams,
    /// Chassis inertia about its centre of mass, roll axis X (kg m²).
    pub chassis_roll_inertia_kg_m2: f64,
    /// Chassis inertia about its centre of mass, yaw axis Z (kg m²).
    pub chassis_yaw_inertia_kg_m2: f64,
    /// Inertia of one wheel about a diameter, at its centre (kg m²).
    pub wheel_transverse_inertia_kg_m2: f64,
    /// Distance between the wheels' middle planes (m).
    pub track_m: f64,
}

impl FloatingParams {
    /// The robot of the paper with the masses assumed for it.
    ///
    /// | value | source |
    /// |---|---|
    /// | chassis box 0.60 × 0.40 × 0.20 m, 15.4 kg | ASSUMED; length and height as for the pitch inertia |
    /// | wheel transverse inertia | ASSUMED: half the axial one, plus m w²/12 for a width of 0.05 m |
    /// | track 0.56 m | ASSUMED, `MODEL.md` section 9.2 |
    #[must_use]
    pub fn wheeleg_2003() -> Self {
        let robot = RobotDynamicsParams::wheeleg_2003();
        let (length, width, height) = (0.60_f64, 0.40_f64, 0.20_f64);
        let wheel_width = 0.05_f64;
        Self {
            chassis_roll_inertia_kg_m2: robot.chassis_mass_kg * (width * width + height * height)
                / 12.0,
            chassis_yaw_inertia_kg_m2: robot.chassis_mass_kg * (length * length + width * width)
                / 12.0,
            wheel_transverse_inertia_kg_m2: 0.5 * robot.wheel_inertia_kg_m2
                + robot.wheel_mass_kg * wheel_width * wheel_width / 12.0,
            track_m: 0.56,
            robot,
        }
    }

    /// Viscous friction of one wheel bearing (N m s/rad).
    #[must_use]
    pub fn wheel_viscous_n_m_s(&self) -> f64 {
        let p = &self.robot;
        0.5 * p.viscous[0] * p.wheel_radius_m * p.wheel_radius_m
    }

    /// Viscous friction of every velocity, none on the chassis.
    #[must_use]
    pub fn viscous(&self) -> [f64; 14] {
        let mut d = [0.0; 14];
        for (to, from) in d[6..12].iter_mut().zip(&self.robot.viscous[2..8]) {
            *to = *from;
        }
        d[12] = self.wheel_viscous_n_m_s();
        d[13] = d[12];
        d
    }

    /// Checks signs, finiteness, and that every inertia belongs to some distribution of mass (the
    /// largest principal inertia is at most the sum of the other two).
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), DynamicsError> {
        self.robot.validate()?;
        let refuse = |name, value| Err(DynamicsError::Parameter { name, value });
        for (name, value) in [
            (
                "chassis_roll_inertia_kg_m2",
                self.chassis_roll_inertia_kg_m2,
            ),
            ("chassis_yaw_inertia_kg_m2", self.chassis_yaw_inertia_kg_m2),
            (
                "wheel_transverse_inertia_kg_m2",
                self.wheel_transverse_inertia_kg_m2,
            ),
            ("track_m", self.track_m),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(name, value);
            }
        }
        let p = &self.robot;
        let chassis = [
            self.chassis_roll_inertia_kg_m2,
            p.chassis_pitch_inertia_kg_m2,
            self.chassis_yaw_inertia_kg_m2,
        ];
        if let Some(largest) = impossible(chassis) {
            return refuse("chassis inertia", largest);
        }
        let across = self.wheel_transverse_inertia_kg_m2;
        if let Some(largest) = impossible([across, p.wheel_inertia_kg_m2, across]) {
            return refuse("wheel inertia", largest);
        }
        for body in &p.leg_bodies {
            if let Some(largest) = impossible(body.inertia_kg_m2) {
                return refuse("leg_bodies.inertia_kg_m2", largest);
            }
        }
        Ok(())
    }
}

/// The largest principal inertia if it exceeds the sum of the other two by more than rounding.
fn impossible(inertia: [f64; 3]) -> Option<f64> {
    let sum: f64 = inertia.iter().sum();
    inertia.into_iter().find(|i| *i > 0.5 * sum * (1.0 + 1e-9))
}
