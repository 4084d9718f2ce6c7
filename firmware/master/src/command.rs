//! User commands and their codes. The high byte of a code names the layer that carries the command out: 0x01xx layer 0
//! (physical level), 0x02xx layer 1 (gait level). [`TABLE`] is the only list of commands; the ranges of their arguments
//! are in [`crate::argument`]. `docs/reference/commands.md` is generated from both.

mod build;
mod reference;

use core::fmt;

use wheeleg_units::{PositionMm, VelocityMmS};

use crate::argument::{
    ACCELERATION, Argument, BEHAVIOURS, BOARD, CORRECTION, FORWARD, GAIN, HEIGHT, HELD_LEG_S5,
    HELD_LEG_S6, JOINT, LEFT, LEG, LIFT, LOWER, NOSE, PARAMETER, PATTERN, PERIOD, POLE, PUSH,
    PUSH_ACCELERATION, PUSH_SPEED, RATE, REACH, SIDE, SPEED, STEP_STROKE, STEPPING_LEG, STEPS,
    STROKE, TOUCHDOWN_REFLEX, TOUCHDOWN_SPEED, TRAVEL, TURN, VALUE, WALK_LIFT, WALK_PATTERN,
    WALK_SPEED, YAW_S2, ZERO,
};
use crate::behaviour::Behaviours;
use crate::contact::Side;
use crate::layer1::foot::FootShape;
use crate::layer1::params::GaitParams;
use crate::layer1::walk::WalkOrder;

pub use build::{ArgumentError, Given};
pub use reference::write_markdown;

/// Layer that carries a command out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Drivers, bus, reflexes.
    Zero,
    /// Gait and trajectory.
    One,
}

impl Layer {
    /// Layer for the range of a command code; `None` outside the ranges.
    #[must_use]
    pub const fn of_code(code: u16) -> Option<Self> {
        match code {
            0x0100..=0x01FF => Some(Self::Zero),
            0x0200..=0x02FF => Some(Self::One),
            _ => None,
        }
    }
}

/// Fuzzy correction of the joint law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CorrectionKind {
    /// Proportional-derivative type: inputs e, ė.
    Pd,
    /// Integral-derivative type: inputs ∫e, ė.
    Id,
}

/// A joint, 1..=6: left yaw, horizontal, vertical, then right.
pub type JointNumber = u8;

/// A user command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Reference of one joint.
    JointReference {
        /// 1..=6.
        joint: JointNumber,
        /// Stroke, mm ([`crate::argument::STROKE`]).
        stroke_mm: PositionMm,
    },
    /// Ask one joint's board for its position; the value is reported in an event.
    TransmitPosition {
        /// 1..=6.
        joint: JointNumber,
    },
    /// Inlets shut, outlets open: the cylinder exhausts.
    OpenAllValves {
        /// 1..=6.
        joint: JointNumber,
    },
    /// All four valves of one joint open, so that the supply blows through.
    BlowThrough {
        /// 1..=6.
        joint: JointNumber,
    },
    /// All valves of one joint shut: air trapped.
    EmergencyBrake {
        /// 1..=6.
        joint: JointNumber,
    },
    /// Fuzzy correction of one joint.
    SelectCorrection {
        /// 1..=6.
        joint: JointNumber,
        /// Which correction.
        correction: CorrectionKind,
    },
    /// Drive both wheels by a distance from the last reference sent to them, or from where they are if there has been
    /// none since the last stop.
    WheelReference {
        /// Distance, mm, positive forward ([`crate::argument::TRAVEL`]), and at most 2^22 − 1 encoder counts from where
        /// the wheels are: the 24-bit counter cannot distinguish more.
        travel_mm: PositionMm,
    },
    /// Highest speed of a wheel move.
    WheelSpeed {
        /// Which wheel.
        side: Side,
        /// Speed at the rim, mm/s ([`crate::argument::SPEED`]).
        speed_mm_s: VelocityMmS,
    },
    /// Acceleration of a wheel move.
    WheelAcceleration {
        /// Which wheel.
        side: Side,
        /// Acceleration at the rim, mm/s² ([`crate::argument::ACCELERATION`]).
        acceleration_mm_s2: fixed::types::I16F16,
    },
    /// Coefficients of the wheel's lead filter D(z) = K(z − A/256)/(4(z + B/256)).
    WheelFilter {
        /// Which wheel.
        side: Side,
        /// Zero.
        a: u8,
        /// Pole.
        b: u8,
        /// Gain.
        k: u8,
    },
    /// Accept the present boards as the commissioned ones.
    Commission,
    /// Ask a board for one of its parameters.
    ReadParameter {
        /// Bus address, 1..=8.
        node: u8,
        /// Number of the parameter.
        id: u16,
    },
    /// Set a parameter of a board. The board checks it against its limits.
    WriteParameter {
        /// Bus address, 1..=8.
        node: u8,
        /// Number of the parameter.
        id: u16,
        /// Raw value in the parameter's format.
        raw: i32,
    },
    /// Store a board's parameters in its memory.
    SaveParameters {
        /// Bus address, 1..=8.
        node: u8,
    },
    /// Energise all axes at their present position.
    Arm,
    /// Valves and motors off.
    Disarm,
    /// Clear latched faults of all nodes and of the master.
    ClearFault,
    /// HOLD everywhere and supply dump, in the next SYNC.
    EmergencyStop,
    /// Take control, which lasts while the operator is known to see the robot.
    TakeControl,
    /// Give control back.
    ReleaseControl,
    /// Choose the behaviours of a walk that may act.
    SetBehaviours(
        /// Those that may.
        Behaviours,
    ),
    /// Move to the start pose of the gait parameters.
    Stand,
    /// Freeze every joint where it is.
    Hold,
    /// Start the gait from the start pose; the gait clock starts now.
    StartGait,
    /// End the gait after the present step.
    StopGait,
    /// Walk, or change the order of the walk under way.
    Walk(
        /// The walk.
        WalkOrder,
    ),
    /// Replace the gait parameters.
    SetGait(
        /// New parameters.
        GaitParams,
    ),
    /// Move one foot along the sinusoid of the paper's §6.
    FootTrajectory {
        /// Which leg.
        side: Side,
        /// Shape and size.
        shape: FootShape,
    },
}

macro_rules! commands {
    ($($name:ident = $code:literal, [$($argument:expr),*], $effect:literal, $pattern:pat => )*) => {
        /// Numbers of the commands.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u16)]
        pub enum CommandCode {
            $(#[doc = $effect] $name = $code,)*
        }

        impl CommandCode {
            /// Row of the table.
            #[must_use]
            pub const fn info(self) -> CommandInfo {
                match self {
                    $(Self::$name => CommandInfo {
                        code: Self::$name,
                        name: stringify!($name),
                        arguments: &[$($argument),*],
                        effect: $effect,
                    },)*
                }
            }
        }

        /// Every command: code, arguments, effect.
        pub const TABLE: &[CommandInfo] = &[$(CommandCode::$name.info(),)*];

        impl Command {
            /// Code of this command.
            #[must_use]
            pub const fn code(&self) -> CommandCode {
                match self { $($pattern => CommandCode::$name,)* }
            }
        }
    };
}

/// One row of the table of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandInfo {
    /// Code.
    pub code: CommandCode,
    /// Name.
    pub name: &'static str,
    /// Arguments, each with its range.
    pub arguments: &'static [Argument],
    /// Its effect.
    pub effect: &'static str,
}

impl CommandInfo {
    /// Its argument with this name.
    #[must_use]
    pub fn argument(&self, name: &str) -> Option<&'static Argument> {
        self.arguments.iter().find(|argument| argument.name == name)
    }

    /// Writes the names of its arguments in code quotes, or `none`.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_names(&self, out: &mut dyn fmt::Write) -> fmt::Result {
        let mut separator = "";
        for argument in self.arguments {
            write!(out, "{separator}`{}`", argument.name)?;
            separator = ", ";
        }
        if self.arguments.is_empty() {
            out.write_str("none")?;
        }
        Ok(())
    }
}

commands! {
    JointReference = 0x0101, [JOINT, STROKE], "Reference of one joint; refused while layer 1 moves the robot.", Self::JointReference { .. } =>
    TransmitPosition = 0x0102, [JOINT], "Asks one joint's board for its position.", Self::TransmitPosition { .. } =>
    OpenAllValves = 0x0103, [JOINT], "Exhaust: inlets shut, outlets open. Layer 1 is stopped first.", Self::OpenAllValves { .. } =>
    EmergencyBrake = 0x0104, [JOINT], "HOLD of one joint: all four valves shut. Layer 1 is stopped first.", Self::EmergencyBrake { .. } =>
    SelectCorrection = 0x0105, [JOINT, CORRECTION], "Fuzzy correction of one joint.", Self::SelectCorrection { .. } =>
    BlowThrough = 0x0106, [JOINT], "Maintenance: all four valves open, supply blows through. Refused unless disarmed.", Self::BlowThrough { .. } =>
    WheelReference = 0x0110, [TRAVEL], "Drives both wheels by a distance; refused while layer 1 moves the robot.", Self::WheelReference { .. } =>
    WheelSpeed = 0x0111, [SIDE, SPEED], "Highest speed of the wheel's own profile.", Self::WheelSpeed { .. } =>
    WheelAcceleration = 0x0112, [SIDE, ACCELERATION], "Acceleration of the wheel's own profile.", Self::WheelAcceleration { .. } =>
    WheelFilter = 0x0113, [SIDE, ZERO, POLE, GAIN], "Coefficients of the wheel's lead filter.", Self::WheelFilter { .. } =>
    Arm = 0x0120, [], "Energises all axes where they stand; needs every node enumerated, compatible and free of faults, and supply pressure.", Self::Arm =>
    Disarm = 0x0121, [], "Valves and motors off.", Self::Disarm =>
    ClearFault = 0x0122, [], "Clears latched faults of all nodes and the E-stop of the master.", Self::ClearFault =>
    EmergencyStop = 0x0123, [], "E-stop bit in every SYNC from the next on: HOLD and supply dump. Never queued, never refused for lateness.", Self::EmergencyStop =>
    Commission = 0x0124, [], "Takes the boards as they are for the commissioned ones; refused unless disarmed and every board is identified.", Self::Commission =>
    TakeControl = 0x0125, [], "Takes the control for the operator, for as long as they are seen to look; refused to a scenario.", Self::TakeControl =>
    ReleaseControl = 0x0126, [], "Gives the control back; refused while layer 1 moves the robot.", Self::ReleaseControl =>
    SetBehaviours = 0x0127, [BEHAVIOURS], "Chooses the behaviours of a walk that may act, also while it walks.", Self::SetBehaviours(_) =>
    ReadParameter = 0x0130, [BOARD, PARAMETER], "Reads a parameter of a board.", Self::ReadParameter { .. } =>
    WriteParameter = 0x0131, [BOARD, PARAMETER, VALUE], "Sets a parameter of a board, which checks it against its limits.", Self::WriteParameter { .. } =>
    SaveParameters = 0x0132, [BOARD], "Stores a board's parameters in its memory; refused unless disarmed.", Self::SaveParameters { .. } =>
    Stand = 0x0201, [], "Slews all joints to the start pose of the gait.", Self::Stand =>
    Hold = 0x0202, [], "Freezes every joint at its measured stroke and stops the wheels.", Self::Hold =>
    StartGait = 0x0203, [], "Starts the gait from the start pose.", Self::StartGait =>
    StopGait = 0x0204, [], "Ends the gait with the step under way, or a walk with both feet down.", Self::StopGait =>
    SetGait = 0x0205, [STEPS, PERIOD, LIFT, REACH, LOWER, PUSH, STEP_STROKE, HELD_LEG_S5, HELD_LEG_S6, YAW_S2, PUSH_SPEED, PUSH_ACCELERATION, PATTERN, STEPPING_LEG, TOUCHDOWN_SPEED, TOUCHDOWN_REFLEX], "Replaces the gait parameters; refused while a gait runs.", Self::SetGait(_) =>
    FootTrajectory = 0x0206, [LEG, FORWARD, LEFT, HEIGHT, RATE], "Moves one foot along a sinusoid through inverse kinematics.", Self::FootTrajectory { .. } =>
    Walk = 0x0207, [WALK_SPEED, TURN, WALK_PATTERN, WALK_LIFT, NOSE], "Walks, or changes the walk under way; wheels and legs go on together until StopGait or Hold.", Self::Walk(_) =>
}

impl CommandCode {
    /// Layer that carries the command out, from the range of the code.
    #[must_use]
    pub const fn layer(self) -> Layer {
        match Layer::of_code(self as u16) {
            Some(layer) => layer,
            // Excluded by the assertion below.
            None => Layer::Zero,
        }
    }

    /// Name of the command.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.info().name
    }

    /// The command with this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        let row = TABLE.iter().find(|row| row.name == name);
        row.map(|row| row.code)
    }
}

// Every code is in a range that names a layer, and no code appears twice.
const _: () = {
    let mut table = TABLE;
    let mut last = 0;
    while let [row, rest @ ..] = table {
        let code = row.code as u16;
        assert!(Layer::of_code(code).is_some());
        assert!(code > last);
        last = code;
        table = rest;
    }
};
