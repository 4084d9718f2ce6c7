//! What the user orders of a walk.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::argument::{self, Argument, Value};
use crate::layer1::params::ParamError;

/// Which leg swings when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WalkPattern {
    /// The legs swing half a cycle apart.
    #[default]
    Alternate,
    /// One leg swings right after the other; then both stand and pull together.
    Tandem,
}

/// Order of a walk; may be changed while walking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WalkOrder {
    /// Speed forward ([`argument::WALK_SPEED`]).
    pub speed_mm_s: VelocityMmS,
    /// Rate of turning to the left, rad/s ([`argument::TURN`]).
    pub turn_rad_s: I16F16,
    /// Which leg swings when ([`argument::WALK_PATTERN`]).
    pub pattern: WalkPattern,
    /// Height of a swing above where the foot stood ([`argument::WALK_LIFT`]).
    pub lift_mm: PositionMm,
    /// Height of the nose relative to fully extended legs ([`argument::NOSE`]).
    pub nose_mm: PositionMm,
}

impl Default for WalkOrder {
    /// Standing, 60 mm lift, nose 20 mm down so that a leg can still search for the ground.
    fn default() -> Self {
        Self {
            speed_mm_s: VelocityMmS::ZERO,
            turn_rad_s: I16F16::ZERO,
            pattern: WalkPattern::Alternate,
            lift_mm: PositionMm::from_int(60),
            nose_mm: PositionMm::from_int(-20),
        }
    }
}

impl WalkOrder {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The first violation.
    pub fn validate(&self) -> Result<(), ParamError> {
        let check = |argument: &'static Argument, value: I16F16| {
            let checked = argument.check(Value::Fixed(value));
            checked.map_err(ParamError::OutOfRange)
        };
        check(&argument::WALK_SPEED, self.speed_mm_s.get())?;
        check(&argument::TURN, self.turn_rad_s)?;
        check(&argument::WALK_LIFT, self.lift_mm.get())?;
        check(&argument::NOSE, self.nose_mm.get())
    }
}
