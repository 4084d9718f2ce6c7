//! Permanent fault and limit numbers, with the sentence and the remedy of each.
//!
//! Numbers are wire values and are never reused: 1–31 transport, 32–95 hard faults of a board, 96–127 limit
//! indications, 128–159 warnings of the master, which never travel on the bus. Transport and hard faults are
//! latched until an explicit clear and have one bit each in the 16-bit set of every cyclic reply. Limits are
//! indications that come and go: they say which limit shaped the output in this tick, and never stop
//! anything.

use crate::le;
use crate::wire::{UnknownValue, WireSize};
use serde::{Deserialize, Serialize};

/// Class of a number, by its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultClass {
    /// 1–31: the link. Latched.
    Transport,
    /// 32–95: the board or its axis. Latched.
    Hard,
    /// 96–127: a limit shaped the output. An indication, not latched.
    Limit,
    /// 128–159: something is wrong that the motion does not depend on.
    Warning,
}

impl FaultClass {
    /// The class whose range holds the number; `None` outside all ranges.
    #[must_use]
    pub const fn of(code: u8) -> Option<Self> {
        match code {
            1..=31 => Some(Self::Transport),
            32..=95 => Some(Self::Hard),
            96..=127 => Some(Self::Limit),
            128..=159 => Some(Self::Warning),
            _ => None,
        }
    }
}

/// One row of the fault or limit table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultSchema {
    /// Permanent number.
    pub code: u8,
    /// Bit in the set of active faults (16 bits) or limits (8 bits).
    pub bit: u8,
    /// Name.
    pub name: &'static str,
    /// What happened, for a person.
    pub sentence: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
}

macro_rules! fault_table {
    ($(#[$meta:meta])* $name:ident, $table:ident, $set:ident: $raw:ty, {
        $( $variant:ident = $code:literal, bit $bit:literal, $sentence:literal, $remedy:literal; )*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum $name { $( #[doc = $sentence] $variant = $code, )* }

        /// The table, in ascending order of number.
        pub const $table: &[FaultSchema] = &[ $( FaultSchema {
            code: $code, bit: $bit, name: stringify!($variant), sentence: $sentence, remedy: $remedy,
        } ),* ];

        impl $name {
            /// All rows, in ascending order of number.
            pub const ALL: &'static [Self] = &[ $( Self::$variant ),* ];

            /// Permanent number.
            #[must_use]
            pub const fn code(self) -> u8 {
                self as u8
            }

            /// From the permanent number.
            #[must_use]
            pub const fn from_code(code: u8) -> Option<Self> {
                match code { $( $code => Some(Self::$variant), )* _ => None }
            }

            /// Bit number in the set.
            #[must_use]
            pub const fn bit(self) -> u8 {
                match self { $( Self::$variant => $bit ),* }
            }

            /// Its place in the set: one bit.
            #[must_use]
            pub const fn mask(self) -> $set {
                $set(1 << self.bit())
            }

            /// Name as in the interface definition.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Self::$variant => stringify!($variant) ),* }
            }

            /// What happened, for a person.
            #[must_use]
            pub const fn sentence(self) -> &'static str {
                match self { $( Self::$variant => $sentence ),* }
            }

            /// What to do about it.
            #[must_use]
            pub const fn remedy(self) -> &'static str {
                match self { $( Self::$variant => $remedy ),* }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "{} ({}) {}", self.sentence(), self.code(), self.remedy())
            }
        }

        impl $set {
            /// Empty set.
            pub const NONE: Self = Self(0);
            /// Every bit with a meaning.
            pub const MASK: $raw = 0 $( | (1 << $bit) )*;

            /// The bits on the wire.
            #[must_use]
            pub const fn raw(self) -> $raw {
                self.0
            }

            /// Whether the set is empty.
            #[must_use]
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }

            /// Whether `item` is in the set.
            #[must_use]
            pub const fn contains(self, item: $name) -> bool {
                self.0 & item.mask().0 != 0
            }

            /// The set with `item`.
            #[must_use]
            pub const fn with(self, item: $name) -> Self {
                Self(self.0 | item.mask().0)
            }

            /// The set without `item`.
            #[must_use]
            pub const fn without(self, item: $name) -> Self {
                Self(self.0 & !item.mask().0)
            }

            /// Union.
            #[must_use]
            pub const fn union(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }

            /// Adds `item`.
            pub fn insert(&mut self, item: $name) {
                *self = self.with(item);
            }

            /// Members in ascending order of number.
            pub fn iter(self) -> impl Iterator<Item = $name> {
                $name::ALL.iter().copied().filter(move |item| self.contains(*item))
            }
        }

        impl From<$name> for $set {
            fn from(item: $name) -> Self {
                item.mask()
            }
        }

        impl WireSize for $set {
            const SIZE: usize = core::mem::size_of::<$raw>();
        }
    };
}

/// Set of active or sticky faults: the 16 bits of every cyclic reply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct FaultBits(#[serde(with = "le")] u16);

/// Set of limits that shaped the output in this tick (indications).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct LimitBits(u8);

/// Set of warnings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct WarningBits(u8);

fault_table!(
    /// A latched fault: transport (1–31) or hard (32–95).
    Fault, FAULTS, FaultBits: u16, {
    LinkLost = 1, bit 0, "No SYNC arrived for the watchdog time.",
        "Check that the master runs and the bus cable is plugged, then clear the fault.";
    StaleMaster = 2, bit 1, "SYNC arrives but its cycle counter does not advance.",
        "Clear the fault if the master has just been restarted; otherwise restart it: its control loop is stuck while its transmitter repeats.";
    SlotOverrun = 3, bit 2, "The board cannot keep to its slot: its clock runs wrong, or its driver was cut off.",
        "Check the baud rate and the clock of this board, then clear the fault.";
    SensorRange = 32, bit 4, "The position sensor reads outside its range.",
        "Check the potentiometer wiring for an open or short circuit, then clear the fault.";
    SensorRate = 33, bit 5, "The position jumped faster than the axis can move.",
        "Check the potentiometer track and connectors for loose contact, then clear the fault.";
    FollowingError = 34, bit 6, "The axis stayed too far from its reference for too long.",
        "Check valves, tubes, supply and load of this axis, then clear the fault.";
    TickOverrun = 35, bit 7, "A control tick took longer than its period.",
        "Report this with the firmware version: the tick must fit by design. Then clear the fault.";
    ParameterCorrupt = 36, bit 8, "The stored parameters fail their check.",
        "Write the parameter set again, save it, then clear the fault.";
    StateCorrupt = 37, bit 9, "The controller state fails its check.",
        "Clear the fault; if it returns, check the supply voltage and replace the board.";
    SupplyLost = 38, bit 10, "The air supply pressure is gone.",
        "Restore the compressed air supply and the dump valve, then clear the fault.";
    EmergencyStop = 39, bit 11, "Emergency stop.",
        "Remove the cause, then clear the fault: that releases the emergency stop.";
    OverTravel = 40, bit 12, "The axis left its allowed travel.",
        "Move the axis back by hand with the air off, check its calibration, then clear the fault.";
    EncoderFault = 41, bit 13, "The encoder lost or reversed its counts.",
        "Check the encoder cable and its two channels, then clear the fault.";
    UnexpectedReset = 42, bit 14, "The board was reset in operation; the reset cause says by what.",
        "After a brown-out check the supply; otherwise report this with the firmware version. Then clear the fault.";
    DuplicateAddress = 43, bit 15, "Another board answers at this address.",
        "Set the address straps so that every board has its own address, then restart the boards.";
    NoMotion = 44, bit 3, "The valves gave the air for a motion of the axis, and it did not come.",
        "Check the air supply, the potentiometer, valves, tubes and load of this axis, then clear the fault.";
});

fault_table!(
    /// A limit that shaped the output (96–127): an indication, never a stop.
    Limit, LIMITS, LimitBits: u8, {
    DutySaturated = 96, bit 0, "The command is at full drive.",
        "Expected in fast moves; otherwise reduce load or gain.";
    SlewLimited = 97, bit 1, "The reference was slowed to the slew limit.",
        "Plan slower references or raise the slew parameter.";
    TravelLimited = 98, bit 2, "The reference was held inside the allowed travel.",
        "Keep references within the sensor range parameters.";
    IntegralLimited = 99, bit 3, "The integral of the error is at its limit.",
        "Check for a load the axis cannot carry, or raise the integral limit.";
    PulseTooShort = 100, bit 4, "A pulse shorter than a valve can make was rounded.",
        "Expected near the reference; the dead-zone parameters set the threshold.";
    SettledShut = 101, bit 5, "The axis is settled and all its valves are shut.",
        "Expected at rest.";
    RateLimited = 102, bit 6, "Speed or acceleration is at its limit.",
        "Expected in fast moves; otherwise raise the speed or acceleration parameter.";
    DriveInhibited = 103, bit 7, "The drive waits: a wheel changes direction, or a cylinder that was armed fills its chambers (precharge).",
        "Expected at direction changes of a wheel and for at most two seconds after arming.";
});

fault_table!(
    /// A warning of the master (128–159): the motion goes on.
    Warning, WARNINGS, WarningBits: u8, {
    SwitchStuckClosed = 128, bit 0, "A foot switch stays closed while the foot's other three open and close.",
        "Clean the switch and check its wiring for a short circuit; until then the foot's contact is that of the other three.";
    SwitchStuckOpen = 129, bit 1, "A foot switch stays open while the foot's other three open and close.",
        "Clean the switch and check its wiring for a break; until then the foot's contact is that of the other three.";
});

impl Fault {
    /// Class by the range of the number.
    #[must_use]
    pub const fn class(self) -> FaultClass {
        match self.code() {
            1..=31 => FaultClass::Transport,
            _ => FaultClass::Hard,
        }
    }
}

impl FaultBits {
    /// From the bits on the wire; all 16 have a meaning.
    #[must_use]
    pub const fn from_raw(raw: u16) -> Self {
        Self(raw)
    }
}

impl LimitBits {
    /// From the bits on the wire; all 8 have a meaning.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Self {
        Self(raw)
    }
}

// `from_raw` accepts every value because every bit has a row.
const _: () = assert!(FaultBits::MASK == u16::MAX && LimitBits::MASK == u8::MAX);

/// Number of a fault on the wire, or 0 for "none since the last clear".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct FaultCode(Option<Fault>);

impl FaultCode {
    /// No fault.
    pub const NONE: Self = Self(None);

    /// The number of this fault.
    #[must_use]
    pub const fn new(fault: Fault) -> Self {
        Self(Some(fault))
    }

    /// The fault, if any.
    #[must_use]
    pub const fn fault(self) -> Option<Fault> {
        self.0
    }
}

impl From<Option<Fault>> for FaultCode {
    fn from(fault: Option<Fault>) -> Self {
        Self(fault)
    }
}

impl TryFrom<u8> for FaultCode {
    type Error = UnknownValue;
    fn try_from(value: u8) -> Result<Self, Self::Error> {
        match (value, Fault::from_code(value)) {
            (0, _) => Ok(Self(None)),
            (_, Some(fault)) => Ok(Self(Some(fault))),
            (_, None) => Err(UnknownValue { of: "Fault", value }),
        }
    }
}

impl From<FaultCode> for u8 {
    fn from(code: FaultCode) -> u8 {
        code.0.map_or(0, Fault::code)
    }
}

impl WireSize for FaultCode {
    const SIZE: usize = 1;
}
