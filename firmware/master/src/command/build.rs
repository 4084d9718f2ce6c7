//! Commands from named arguments.

use core::fmt;

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use super::{Command, CommandCode, CorrectionKind};
use crate::argument::{self, Argument, OutOfRange, Value};
use crate::behaviour::Behaviours;
use crate::contact::Side;
use crate::layer1::foot::FootShape;
use crate::layer1::params::{GaitParams, ParamError, Pattern};
use crate::layer1::walk::{WalkOrder, WalkPattern};

/// A value for the argument with this name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Given<'a> {
    /// Name of the argument.
    pub name: &'a str,
    /// Value.
    pub value: Value,
}

/// Why the arguments do not make a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArgumentError<'a> {
    /// The command has no argument with this name.
    Unknown {
        /// The command.
        code: CommandCode,
        /// Name given.
        name: &'a str,
    },
    /// An argument is given more than once.
    Twice {
        /// Name given.
        name: &'a str,
    },
    /// An argument is not given.
    Missing(
        /// Which.
        &'static Argument,
    ),
    /// A value is of the wrong kind for its argument.
    WrongKind(
        /// Which.
        &'static Argument,
    ),
    /// A value is out of its range.
    OutOfRange(
        /// Which, and its range.
        OutOfRange,
    ),
    /// Values contradict each other.
    Relation(
        /// Which, and how.
        ParamError,
    ),
}

impl fmt::Display for ArgumentError<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown { code, name } => {
                write!(f, "{} takes no `{name}`; it takes: ", code.name())?;
                code.info().write_names(f)
            }
            Self::Twice { name } => write!(f, "`{name}` is given twice"),
            Self::Missing(which) => {
                write!(f, "`{}` is missing; allowed: {}", which.name, which.range())
            }
            Self::WrongKind(which) => write!(
                f,
                "`{}` must be a {}; allowed: {}",
                which.name,
                which.kind.name(),
                which.range()
            ),
            Self::OutOfRange(error) => error.fmt(f),
            Self::Relation(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ArgumentError<'_> {}

impl Command {
    /// Builds a command from its arguments, in any order.
    ///
    /// # Errors
    /// [`ArgumentError`]: an argument that is unknown, missing, of another kind or out of its
    /// range, or gait parameters that contradict each other.
    pub fn build<'a>(code: CommandCode, given: &'a [Given<'a>]) -> Result<Self, ArgumentError<'a>> {
        let read = Arguments::new(code, given)?;
        Ok(match code {
            CommandCode::JointReference => Self::JointReference {
                joint: read.byte(&argument::JOINT)?,
                stroke_mm: read.length(&argument::STROKE)?,
            },
            CommandCode::TransmitPosition => Self::TransmitPosition {
                joint: read.byte(&argument::JOINT)?,
            },
            CommandCode::OpenAllValves => Self::OpenAllValves {
                joint: read.byte(&argument::JOINT)?,
            },
            CommandCode::EmergencyBrake => Self::EmergencyBrake {
                joint: read.byte(&argument::JOINT)?,
            },
            CommandCode::SelectCorrection => Self::SelectCorrection {
                joint: read.byte(&argument::JOINT)?,
                correction: match read.choice(&argument::CORRECTION)? {
                    0 => CorrectionKind::Pd,
                    _ => CorrectionKind::Id,
                },
            },
            CommandCode::BlowThrough => Self::BlowThrough {
                joint: read.byte(&argument::JOINT)?,
            },
            CommandCode::WheelReference => Self::WheelReference {
                travel_mm: read.length(&argument::TRAVEL)?,
            },
            CommandCode::WheelSpeed => Self::WheelSpeed {
                side: read.side(&argument::SIDE)?,
                speed_mm_s: read.speed(&argument::SPEED)?,
            },
            CommandCode::WheelAcceleration => Self::WheelAcceleration {
                side: read.side(&argument::SIDE)?,
                acceleration_mm_s2: read.fixed(&argument::ACCELERATION)?,
            },
            CommandCode::WheelFilter => Self::WheelFilter {
                side: read.side(&argument::SIDE)?,
                a: read.byte(&argument::ZERO)?,
                b: read.byte(&argument::POLE)?,
                k: read.byte(&argument::GAIN)?,
            },
            CommandCode::Arm => Self::Arm,
            CommandCode::Disarm => Self::Disarm,
            CommandCode::ClearFault => Self::ClearFault,
            CommandCode::EmergencyStop => Self::EmergencyStop,
            CommandCode::TakeControl => Self::TakeControl,
            CommandCode::ReleaseControl => Self::ReleaseControl,
            CommandCode::SetBehaviours => {
                let bits = read.whole::<u16>(&argument::BEHAVIOURS)?;
                Self::SetBehaviours(Behaviours::from_bits(bits))
            }
            CommandCode::Commission => Self::Commission,
            CommandCode::ReadParameter => Self::ReadParameter {
                node: read.byte(&argument::BOARD)?,
                id: read.whole(&argument::PARAMETER)?,
            },
            CommandCode::WriteParameter => Self::WriteParameter {
                node: read.byte(&argument::BOARD)?,
                id: read.whole(&argument::PARAMETER)?,
                raw: read.whole(&argument::VALUE)?,
            },
            CommandCode::SaveParameters => Self::SaveParameters {
                node: read.byte(&argument::BOARD)?,
            },
            CommandCode::Stand => Self::Stand,
            CommandCode::Hold => Self::Hold,
            CommandCode::StartGait => Self::StartGait,
            CommandCode::StopGait => Self::StopGait,
            CommandCode::Walk => Self::Walk(WalkOrder {
                speed_mm_s: read.speed(&argument::WALK_SPEED)?,
                turn_rad_s: read.fixed(&argument::TURN)?,
                pattern: match read.choice(&argument::WALK_PATTERN)? {
                    0 => WalkPattern::Alternate,
                    _ => WalkPattern::Tandem,
                },
                lift_mm: read.length(&argument::WALK_LIFT)?,
                nose_mm: read.length(&argument::NOSE)?,
            }),
            CommandCode::SetGait => Self::SetGait(read.gait()?),
            CommandCode::FootTrajectory => Self::FootTrajectory {
                side: read.side(&argument::LEG)?,
                shape: FootShape::Arch {
                    forward_mm: read.length(&argument::FORWARD)?,
                    left_mm: read.length(&argument::LEFT)?,
                    height_mm: read.length(&argument::HEIGHT)?,
                    rate_rad_s: read.fixed(&argument::RATE)?.to_num::<f32>(),
                },
            },
        })
    }
}

/// The given arguments, checked to belong to the command, each at most once.
struct Arguments<'a>(&'a [Given<'a>]);

impl<'a> Arguments<'a> {
    fn new(code: CommandCode, given: &'a [Given<'a>]) -> Result<Self, ArgumentError<'a>> {
        let info = code.info();
        for (place, Given { name, .. }) in given.iter().enumerate() {
            if info.argument(name).is_none() {
                return Err(ArgumentError::Unknown { code, name });
            }
            if given
                .iter()
                .skip(place.saturating_add(1))
                .any(|other| other.name == *name)
            {
                return Err(ArgumentError::Twice { name });
            }
        }
        Ok(Self(given))
    }

    fn value(&self, argument: &'static Argument) -> Result<Value, ArgumentError<'a>> {
        let found = self.0.iter().find(|one| one.name == argument.name);
        let value = found.ok_or(ArgumentError::Missing(argument))?.value;
        match argument.kind.admits(value) {
            Some(true) => Ok(value),
            Some(false) => Err(ArgumentError::OutOfRange(OutOfRange { argument, value })),
            None => Err(ArgumentError::WrongKind(argument)),
        }
    }

    fn whole<T: TryFrom<i32>>(&self, argument: &'static Argument) -> Result<T, ArgumentError<'a>> {
        match self.value(argument)? {
            Value::Whole(v) => T::try_from(v).map_err(|_| ArgumentError::WrongKind(argument)),
            _ => Err(ArgumentError::WrongKind(argument)),
        }
    }

    fn byte(&self, argument: &'static Argument) -> Result<u8, ArgumentError<'a>> {
        self.whole(argument)
    }

    fn fixed(&self, argument: &'static Argument) -> Result<I16F16, ArgumentError<'a>> {
        match self.value(argument)? {
            Value::Fixed(v) => Ok(v),
            _ => Err(ArgumentError::WrongKind(argument)),
        }
    }

    fn length(&self, argument: &'static Argument) -> Result<PositionMm, ArgumentError<'a>> {
        self.fixed(argument).map(PositionMm::new)
    }

    fn speed(&self, argument: &'static Argument) -> Result<VelocityMmS, ArgumentError<'a>> {
        self.fixed(argument).map(VelocityMmS::new)
    }

    fn micros(&self, argument: &'static Argument) -> Result<u32, ArgumentError<'a>> {
        match self.value(argument)? {
            Value::Micros(v) => Ok(v),
            _ => Err(ArgumentError::WrongKind(argument)),
        }
    }

    fn choice(&self, argument: &'static Argument) -> Result<u8, ArgumentError<'a>> {
        match self.value(argument)? {
            Value::Choice(v) => Ok(v),
            _ => Err(ArgumentError::WrongKind(argument)),
        }
    }

    fn flag(&self, argument: &'static Argument) -> Result<bool, ArgumentError<'a>> {
        match self.value(argument)? {
            Value::Flag(v) => Ok(v),
            _ => Err(ArgumentError::WrongKind(argument)),
        }
    }

    fn side(&self, argument: &'static Argument) -> Result<Side, ArgumentError<'a>> {
        Ok(match self.choice(argument)? {
            0 => Side::Left,
            _ => Side::Right,
        })
    }

    fn gait(&self) -> Result<GaitParams, ArgumentError<'a>> {
        let leg = self.side(&argument::STEPPING_LEG)?;
        let params = GaitParams {
            steps: self.whole(&argument::STEPS)?,
            period_us: self.micros(&argument::PERIOD)?,
            lift_us: self.micros(&argument::LIFT)?,
            reach_us: self.micros(&argument::REACH)?,
            lower_us: self.micros(&argument::LOWER)?,
            push_us: self.micros(&argument::PUSH)?,
            stroke_mm: self.length(&argument::STEP_STROKE)?,
            held_leg_s5_mm: self.length(&argument::HELD_LEG_S5)?,
            held_leg_s6_mm: self.length(&argument::HELD_LEG_S6)?,
            yaw_s2_mm: self.length(&argument::YAW_S2)?,
            push_speed_mm_s: self.speed(&argument::PUSH_SPEED)?,
            push_acceleration_mm_s2: self.fixed(&argument::PUSH_ACCELERATION)?,
            pattern: match self.choice(&argument::PATTERN)? {
                0 => Pattern::Single(leg),
                _ => Pattern::Alternate { first: leg },
            },
            touchdown_speed_mm_s: self.speed(&argument::TOUCHDOWN_SPEED)?,
            touchdown_reflex: self.flag(&argument::TOUCHDOWN_REFLEX)?,
        };
        params.validate().map_err(ArgumentError::Relation)?;
        Ok(params)
    }
}
