//! Configuration of the master.

use crate::behaviour::Behaviours;
use crate::layer0::odometry::WheelGeometry;
use crate::layer1::homing::HomingConfig;
use crate::layer1::params::GaitParams;
use crate::layer1::walk::WalkGeometry;
use crate::setpoint::NODES;

/// Unique id of a board's processor.
pub type UniqueId = [u8; 12];

/// Time without a newer view of the robot after which the operator counts as gone, µs (ASSUMED).
pub const OPERATOR_TIMEOUT_US: u32 = 400_000;
/// Shortest such time, µs: with less, a browser's garbage collection would look like absence.
pub const OPERATOR_TIMEOUT_MIN_US: u32 = 200_000;
/// Longest such time, µs. It cannot be switched off.
pub const OPERATOR_TIMEOUT_MAX_US: u32 = 1_000_000;

/// Frame in which the foot switches of the right leg are reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SwitchFrame {
    /// The leg's own frame: on the right leg, switch "left" is the outer one, on the robot's right. It is the same
    /// board, mounted mirrored.
    #[default]
    Leg,
    /// The robot's frame on both legs.
    Robot,
}

/// How the wheels are commanded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WheelDrive {
    /// The slot holds the end of the motion; the wheel board makes its own trapezoid with its configured speed and
    /// acceleration.
    #[default]
    Profile,
    /// The slot holds the position of the master's trapezoid at this instant.
    Stream,
}

/// Everything that can be set before the master starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MasterConfig {
    /// Gait parameters.
    pub gait: GaitParams,
    /// Move to the start pose.
    pub homing: HomingConfig,
    /// Wheels and encoders.
    pub wheels: WheelGeometry,
    /// Dimensions that a walk needs.
    pub walk: WalkGeometry,
    /// Sample time of the wheel controllers, µs, 128..=2048 (520 is the chip's reset value at 2 MHz).
    pub wheel_sample_us: u32,
    /// How the wheels are commanded.
    pub wheel_drive: WheelDrive,
    /// Behaviours of a walk that may act.
    pub behaviours: Behaviours,
    /// Frame of the right foot's switches.
    pub switch_frame: SwitchFrame,
    /// Sequence number of the first acyclic request. One that differs from run to run keeps nodes from taking the
    /// request for a repetition.
    pub first_sequence: u16,
    /// Boards that were commissioned, by address 1..=8. A different board at such an address bars arming; `None`
    /// accepts any.
    pub commissioned: [Option<UniqueId>; NODES],
    /// Sum of the parameters that each board should have in force (protocol/SPEC.md, Parameter sets), by
    /// address 1..=8; `None` accepts any. Wheels get theirs at every arming.
    pub parameters: [Option<u32>; NODES],
    /// Time without a newer view of the robot after which the operator counts as gone, µs, limited to
    /// [`OPERATOR_TIMEOUT_MIN_US`] and [`OPERATOR_TIMEOUT_MAX_US`].
    pub operator_timeout_us: u32,
}

impl Default for MasterConfig {
    fn default() -> Self {
        Self {
            gait: GaitParams::default(),
            homing: HomingConfig::default(),
            wheels: WheelGeometry::default(),
            walk: WalkGeometry::default(),
            wheel_sample_us: 520,
            wheel_drive: WheelDrive::default(),
            behaviours: Behaviours::ALL,
            switch_frame: SwitchFrame::default(),
            first_sequence: 1,
            commissioned: [None; NODES],
            parameters: [None; NODES],
            operator_timeout_us: OPERATOR_TIMEOUT_US,
        }
    }
}
