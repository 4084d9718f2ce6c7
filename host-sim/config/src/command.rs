//! User commands in scenario files.

use wheeleg_master::command::{Command, CorrectionKind};
use wheeleg_units::PositionMm;

/// A parameter of a board, and a value for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ParameterChoice {
    /// Its number.
    pub(super) id: u16,
    /// Raw value in its format; `None` where none was given.
    pub(super) raw: Option<i32>,
}

/// What an event of a scenario says beside the command's name.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arguments {
    /// Joint 1 to 6.
    pub(super) joint: Option<u8>,
    /// Stroke, m.
    pub(super) stroke_m: Option<f64>,
    /// Wheel travel, m.
    pub(super) travel_m: Option<f64>,
    /// Board 1 to 8.
    pub(super) board: Option<u8>,
    /// A board's parameter and its raw value.
    pub(super) parameter: Option<ParameterChoice>,
}

/// Builds the command `name` of the master's table.
///
/// # Errors
/// Name of the argument that the command needs and the event does not give.
pub(super) fn command(name: &str, given: &Arguments) -> Result<Command, &'static str> {
    let joint = || given.joint.ok_or("joint");
    let node = || given.board.ok_or("board");
    let id = || given.parameter.map(|p| p.id).ok_or("parameter");
    let raw = || given.parameter.and_then(|p| p.raw).ok_or("value");
    let mm = |m: f64| PositionMm::from_f64(m * 1e3);
    Ok(match name {
        "JointReference" => Command::JointReference {
            joint: joint()?,
            stroke_mm: mm(given.stroke_m.ok_or("stroke")?),
        },
        "TransmitPosition" => Command::TransmitPosition { joint: joint()? },
        "OpenAllValves" => Command::OpenAllValves { joint: joint()? },
        "EmergencyBrake" => Command::EmergencyBrake { joint: joint()? },
        // The argument is part of the name: an event has no field for it.
        "SelectCorrectionPd" => Command::SelectCorrection {
            joint: joint()?,
            correction: CorrectionKind::Pd,
        },
        "SelectCorrectionId" => Command::SelectCorrection {
            joint: joint()?,
            correction: CorrectionKind::Id,
        },
        "WheelReference" => Command::WheelReference {
            travel_mm: mm(given.travel_m.ok_or("travel")?),
        },
        "Commission" => Command::Commission,
        "Arm" => Command::Arm,
        "Disarm" => Command::Disarm,
        "ClearFault" => Command::ClearFault,
        "EmergencyStop" => Command::EmergencyStop,
        "Stand" => Command::Stand,
        "Hold" => Command::Hold,
        "StartGait" => Command::StartGait,
        "StopGait" => Command::StopGait,
        "ReadParameter" => Command::ReadParameter {
            node: node()?,
            id: id()?,
        },
        "WriteParameter" => Command::WriteParameter {
            node: node()?,
            id: id()?,
            raw: raw()?,
        },
        "SaveParameters" => Command::SaveParameters { node: node()? },
        _ => return Err("a command that a scenario can give"),
    })
}
