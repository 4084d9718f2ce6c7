//! Arguments of the user's commands: name, kind, unit and range of each.
//!
//! This is the only place of these ranges. The table of commands lists them, the layers check them, scenario and robot
//! files are read with them, and `docs/reference/commands.md` is generated from them.

use core::fmt;

use fixed::types::I16F16;

/// Smallest and largest allowed value, both inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits<T> {
    /// Smallest.
    pub min: T,
    /// Largest.
    pub max: T,
}

impl<T: PartialOrd> Limits<T> {
    /// Whether `value` is allowed.
    pub fn contains(&self, value: &T) -> bool {
        *value >= self.min && *value <= self.max
    }
}

/// Kind of an argument, with its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArgumentKind {
    /// A whole number.
    Whole(Limits<i32>),
    /// A length, mm.
    Length(Limits<I16F16>),
    /// A speed, mm/s.
    Velocity(Limits<I16F16>),
    /// An acceleration, mm/s².
    Acceleration(Limits<I16F16>),
    /// An angular rate, rad/s.
    Rate(Limits<I16F16>),
    /// A time, in µs inside the master, in s for people.
    Time(Limits<u32>),
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Yes or no.
    Flag,
    /// A parameter of the board that the command names: its number or, for people, its name.
    Parameter,
    /// A value of that parameter: inside the master the raw number in its format, for people in the unit of the
    /// parameter. The board checks it.
    Raw,
}

impl ArgumentKind {
    /// Unit for people; `1` if there is none.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Length(_) => "mm",
            Self::Velocity(_) => "mm/s",
            Self::Acceleration(_) => "mm/s2",
            Self::Rate(_) => "rad/s",
            Self::Time(_) => "s",
            Self::Raw => "that of the parameter",
            Self::Whole(_) | Self::Choice(_) | Self::Flag | Self::Parameter => "1",
        }
    }

    /// Name of the kind, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Whole(_) => "whole number",
            Self::Length(_) => "length",
            Self::Velocity(_) => "speed",
            Self::Acceleration(_) => "acceleration",
            Self::Rate(_) => "angular rate",
            Self::Time(_) => "time",
            Self::Choice(_) => "choice",
            Self::Flag => "flag",
            Self::Parameter => "parameter",
            Self::Raw => "value of the parameter",
        }
    }

    /// Whether `value` is in the range; `None` if it is of another kind.
    #[must_use]
    pub fn admits(self, value: Value) -> Option<bool> {
        match (self, value) {
            (Self::Whole(limits), Value::Whole(v)) => Some(limits.contains(&v)),
            (
                Self::Length(limits)
                | Self::Velocity(limits)
                | Self::Acceleration(limits)
                | Self::Rate(limits),
                Value::Fixed(v),
            ) => Some(limits.contains(&v)),
            (Self::Time(limits), Value::Micros(v)) => Some(limits.contains(&v)),
            (Self::Choice(words), Value::Choice(v)) => Some(usize::from(v) < words.len()),
            (Self::Parameter, Value::Whole(v)) => Some(u16::try_from(v).is_ok()),
            (Self::Flag, Value::Flag(_)) | (Self::Raw, Value::Whole(_)) => Some(true),
            _ => None,
        }
    }
}

/// A value for an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// Whole number, number of a parameter, raw value.
    Whole(i32),
    /// Length, speed, acceleration or rate in the unit of its kind. Its step is 1/65 536.
    Fixed(I16F16),
    /// Time, µs.
    Micros(u32),
    /// Index in the list of words, from 0.
    Choice(u8),
    /// Yes or no.
    Flag(bool),
}

/// An argument of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Argument {
    /// Name, as a key of a scenario file.
    pub name: &'static str,
    /// Kind, with its range.
    pub kind: ArgumentKind,
    /// Meaning.
    pub doc: &'static str,
}

impl Argument {
    /// Checks a value.
    ///
    /// # Errors
    /// [`OutOfRange`], also for a value of another kind.
    pub fn check(&'static self, value: Value) -> Result<(), OutOfRange> {
        match self.kind.admits(value) {
            Some(true) => Ok(()),
            _ => Err(OutOfRange {
                argument: self,
                value,
            }),
        }
    }

    /// The allowed values in words: `0 to 180 mm`.
    #[must_use]
    pub const fn range(&self) -> Range {
        Range(self.kind)
    }
}

/// A value outside the range of its argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfRange {
    /// The argument.
    pub argument: &'static Argument,
    /// Value given.
    pub value: Value,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Argument { name, kind, .. } = self.argument;
        let value = Shown(self.value);
        let unit = Suffix(*kind);
        write!(f, "`{name}` is {value}{unit}, allowed: {}", Range(*kind))
    }
}

/// The allowed values of a kind, in words.
#[derive(Clone, Copy, Debug)]
pub struct Range(ArgumentKind);

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = Suffix(self.0);
        match self.0 {
            ArgumentKind::Whole(Limits { min, max }) => write!(f, "{min} to {max}"),
            ArgumentKind::Length(Limits { min, max })
            | ArgumentKind::Velocity(Limits { min, max })
            | ArgumentKind::Acceleration(Limits { min, max })
            | ArgumentKind::Rate(Limits { min, max }) => write!(f, "{min} to {max}{unit}"),
            ArgumentKind::Time(Limits { min, max }) => {
                write!(f, "{} to {}{unit}", Seconds(min), Seconds(max))
            }
            ArgumentKind::Choice(words) => {
                let mut separator = "";
                for word in words {
                    write!(f, "{separator}{word}")?;
                    separator = ", ";
                }
                Ok(())
            }
            ArgumentKind::Flag => f.write_str("true, false"),
            ArgumentKind::Parameter => f.write_str("a parameter of the board"),
            ArgumentKind::Raw => f.write_str("what the board allows"),
        }
    }
}

/// A unit after a number; empty if there is none.
struct Suffix(ArgumentKind);

impl fmt::Display for Suffix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.unit() {
            "1" => Ok(()),
            unit => write!(f, " {unit}"),
        }
    }
}

/// A value without its unit.
struct Shown(Value);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Value::Whole(v) => write!(f, "{v}"),
            Value::Fixed(v) => write!(f, "{v}"),
            Value::Micros(v) => write!(f, "{}", Seconds(v)),
            Value::Choice(v) => write!(f, "number {v} of the list"),
            Value::Flag(v) => write!(f, "{v}"),
        }
    }
}

/// A time in µs, written in s without trailing zeros.
pub(crate) struct Seconds(pub(crate) u32);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (whole, mut fraction) = (self.0 / 1_000_000, self.0 % 1_000_000);
        write!(f, "{whole}")?;
        if fraction == 0 {
            return Ok(());
        }
        let mut width = 6_usize;
        while fraction.is_multiple_of(10) {
            fraction /= 10;
            width = width.saturating_sub(1);
        }
        write!(f, ".{fraction:0width$}")
    }
}

/// Highest speed and acceleration of a wheel, for its own moves and for a push of the gait.
const RIM_SPEED: ArgumentKind = ArgumentKind::Velocity(Limits {
    min: I16F16::lit("1"),
    max: I16F16::lit("400"),
});
const TOUCHDOWN: ArgumentKind = ArgumentKind::Velocity(Limits {
    min: I16F16::ZERO,
    max: I16F16::lit("400"),
});
const RIM_ACCELERATION: ArgumentKind = ArgumentKind::Acceleration(Limits {
    min: I16F16::lit("10"),
    max: I16F16::lit("5000"),
});
/// From the retracted to the extended cylinder.
const FULL_STROKE: ArgumentKind = ArgumentKind::Length(Limits {
    min: I16F16::ZERO,
    max: I16F16::lit("180"),
});
/// A coefficient in one byte.
const BYTE: ArgumentKind = ArgumentKind::Whole(Limits { min: 0, max: 255 });
/// An instant within a step of the gait. `GaitParams::validate` checks their order.
const INSTANT: ArgumentKind = ArgumentKind::Time(Limits {
    min: 0,
    max: 60_000_000,
});
/// The two legs and wheels, in the order of `Side`.
const SIDES: ArgumentKind = ArgumentKind::Choice(&["left", "right"]);

macro_rules! arguments {
    ($($constant:ident = $name:literal, $kind:expr, $doc:literal;)*) => {
        $(
            #[doc = $doc]
            pub const $constant: Argument = Argument { name: $name, kind: $kind, doc: $doc };
        )*
    };
}

/// Speeds of a walk, mm/s.
pub(crate) const WALK_SPEEDS: Limits<I16F16> = Limits {
    min: I16F16::lit("-150"),
    max: I16F16::lit("150"),
};
/// Rates of turning of a walk, rad/s.
pub(crate) const TURNS: Limits<I16F16> = Limits {
    min: I16F16::lit("-0.175"),
    max: I16F16::lit("0.175"),
};

arguments! {
    JOINT = "joint", ArgumentKind::Whole(Limits { min: 1, max: 6 }), "Joint: left yaw, horizontal, vertical, then right.";
    STROKE = "stroke", FULL_STROKE, "Stroke of the joint, 0 retracted.";
    CORRECTION = "correction", ArgumentKind::Choice(&["pd", "id"]), "Inputs of the fuzzy correction: pd takes error and its rate, id the sum of the error and its rate.";
    TRAVEL = "travel", ArgumentKind::Length(Limits { min: I16F16::lit("-32000"), max: I16F16::lit("32000") }), "Distance, positive forward; also at most 4194303 encoder counts from where the wheels are.";
    SIDE = "side", SIDES, "Which wheel.";
    SPEED = "speed", RIM_SPEED, "Speed at the rim.";
    ACCELERATION = "acceleration", RIM_ACCELERATION, "Acceleration at the rim.";
    ZERO = "zero", BYTE, "A of the lead filter D(z) = K(z - A/256)/(4(z + B/256)).";
    POLE = "pole", BYTE, "B of the lead filter.";
    GAIN = "gain", BYTE, "K of the lead filter.";
    BOARD = "board", ArgumentKind::Whole(Limits { min: 1, max: 8 }), "Bus address: joint boards 1 to 6, wheel boards 7 and 8.";
    BEHAVIOURS = "mask", ArgumentKind::Whole(Limits { min: 0, max: 2047 }), "Sum of the bits of those that may act: 1 overload, 2 tip-guard, 4 touchdown, 8 search, 16 bump, 32 lost-contact, 64 slip, 128 hook (reserved: does nothing yet), 256 stuck, 512 load-share, 1024 stroke-governor.";
    PARAMETER = "parameter", ArgumentKind::Parameter, "Parameter of the board, by its name in the tables of the boards.";
    VALUE = "value", ArgumentKind::Raw, "Value in the unit of the parameter; the board checks it.";
    STEPS = "steps", ArgumentKind::Whole(Limits { min: 1, max: 10_000 }), "Number of steps.";
    PERIOD = "period", ArgumentKind::Time(Limits { min: 500_000, max: 60_000_000 }), "Duration of one step.";
    LIFT = "lift", INSTANT, "Start of the lift, before reach and lower.";
    REACH = "reach", INSTANT, "Start of the reach, before push.";
    LOWER = "lower", INSTANT, "Start of the lowering, before push.";
    PUSH = "push", INSTANT, "Start of the push; it must end within the period.";
    STEP_STROKE = "stroke", ArgumentKind::Length(Limits { min: I16F16::lit("1"), max: I16F16::lit("180") }), "Stroke of b5 and b6 used by a step.";
    HELD_LEG_S5 = "held_leg_s5", FULL_STROKE, "Stroke of b5 at which the held leg stands.";
    HELD_LEG_S6 = "held_leg_s6", FULL_STROKE, "Stroke of b6 at which the held leg stands.";
    YAW_S2 = "yaw_s2", FULL_STROKE, "Stroke of both yaw cylinders; half is straight ahead.";
    PUSH_SPEED = "push_speed", RIM_SPEED, "Speed of the push.";
    PUSH_ACCELERATION = "push_acceleration", RIM_ACCELERATION, "Acceleration of the push.";
    PATTERN = "pattern", ArgumentKind::Choice(&["single", "alternate"]), "single: one leg steps every time; alternate: the legs step in turn.";
    STEPPING_LEG = "leg", SIDES, "The leg that steps, or steps first.";
    TOUCHDOWN_SPEED = "touchdown_speed", TOUCHDOWN, "Speed at which a foot is lowered from 15 mm above where it last stood; 0: the reference jumps to the full stroke.";
    TOUCHDOWN_REFLEX = "touchdown_reflex", ArgumentKind::Flag, "Stop the lowering of a foot where its switches close.";
    LEG = "leg", SIDES, "Which leg; the one that steps first in the gait.";
    FORWARD = "forward", FULL_STROKE, "Travel of the foot over the whole arch, forward.";
    LEFT = "left", ArgumentKind::Length(Limits { min: I16F16::lit("-60"), max: I16F16::lit("60") }), "Travel of the foot over the whole arch, to the robot's left; 0 in the paper.";
    HEIGHT = "height", FULL_STROKE, "Height of the arch.";
    RATE = "rate", ArgumentKind::Rate(Limits { min: I16F16::lit("0.05"), max: I16F16::lit("2") }), "Rate of the sine's argument; 1/8 rad/s in the paper. The arch takes pi/rate.";
    WALK_SPEED = "speed", ArgumentKind::Velocity(WALK_SPEEDS), "Speed of the walk, positive forward.";
    TURN = "turn", ArgumentKind::Rate(TURNS), "Rate of turning, positive to the left; 0.0873 rad/s are 5 degrees a second.";
    WALK_PATTERN = "pattern", ArgumentKind::Choice(&["alternate", "tandem"]), "alternate: the legs swing half a cycle apart; tandem: one right after the other, then both pull.";
    WALK_LIFT = "lift", ArgumentKind::Length(Limits { min: I16F16::lit("20"), max: I16F16::lit("170") }), "Height of a swing over where the foot stood.";
    NOSE = "nose", ArgumentKind::Length(Limits { min: I16F16::lit("-120"), max: I16F16::ZERO }), "Height of the nose, 0 with the legs fully extended.";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_values_are_written_with_their_units() {
        assert_eq!(STROKE.range().to_string(), "0 to 180 mm");
        assert_eq!(PERIOD.range().to_string(), "0.5 to 60 s");
        assert_eq!(JOINT.range().to_string(), "1 to 6");
        assert_eq!(RATE.range().to_string(), "0.05 to 2 rad/s");
        assert_eq!(LEG.range().to_string(), "left, right");
        assert_eq!(Seconds(3_333_330).to_string(), "3.33333");
        assert_eq!(Seconds(60_000_001).to_string(), "60.000001");
        let far = STROKE.check(Value::Fixed(I16F16::lit("180.5")));
        let text = "`stroke` is 180.5 mm, allowed: 0 to 180 mm";
        assert_eq!(far.map_err(|e| e.to_string()), Err(text.to_owned()));
        let late = PERIOD.check(Value::Micros(60_000_001));
        let text = "`period` is 60.000001 s, allowed: 0.5 to 60 s";
        assert_eq!(late.map_err(|e| e.to_string()), Err(text.to_owned()));
    }

    #[test]
    fn a_value_of_another_kind_is_never_in_range() {
        assert_eq!(JOINT.kind.admits(Value::Fixed(I16F16::lit("1"))), None);
        assert!(JOINT.check(Value::Flag(true)).is_err());
        assert_eq!(LEG.kind.admits(Value::Choice(1)), Some(true));
        assert_eq!(LEG.kind.admits(Value::Choice(2)), Some(false));
        assert_eq!(PARAMETER.kind.admits(Value::Whole(-1)), Some(false));
    }
}
