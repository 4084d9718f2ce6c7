//! Configuration of the master.

use crate::layer0::odometry::WheelGeometry;
use crate::layer1::homing::HomingConfig;
use crate::layer1::params::GaitParams;

/// Frame in which the foot switches of the right leg are reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SwitchFrame {
    /// The leg's own frame: on the right leg, switch "left" is the outer one,
    /// on the robot's right. Same board, mounted mirrored.
    #[default]
    Leg,
    /// The robot's frame on both legs.
    Robot,
}

/// How the wheels are led.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WheelDrive {
    /// The slot holds the end of the motion; the wheel board makes its own
    /// trapezoid with the speed and acceleration it was given.
    #[default]
    Profile,
    /// The slot holds the position of the master's trapezoid at this instant.
    Stream,
}

/// Everything that can be set before the master starts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MasterConfig {
    /// Gait parameters.
    pub gait: GaitParams,
    /// Move to the start pose.
    pub homing: HomingConfig,
    /// Wheels and encoders.
    pub wheels: WheelGeometry,
    /// How the wheels are led.
    pub wheel_drive: WheelDrive,
    /// Frame of the right foot's switches.
    pub switch_frame: SwitchFrame,
}
