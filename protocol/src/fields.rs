//! Field types of messages: enumerations and checked numbers.

use crate::le;
use crate::wire::{WireSize, wire_bits, wire_enum};
use serde::{Deserialize, Serialize};
use wheeleg_units::WheelCount;

wire_enum! {
    /// Mode of a board.
    NodeMode {
        Boot = 0, "Starting; sensors not yet trusted.";
        Idle = 1, "Disarmed; nothing energised.";
        Armed = 2, "Precharge, if one is set, then closed loop on the position found when arming.";
        Tracking = 3, "Closed loop on the reference of the SYNC slot.";
        Hold = 4, "Latched stop: air trapped, or wheel ramped to standstill.";
        Exhaust = 5, "Inlets shut, outlets open.";
        Fault = 6, "Latched stop of a board that cannot trust itself.";
    }
}

wire_enum! {
    /// Kind of board.
    BoardKind {
        Joint = 1, "Joint board: one pneumatic cylinder.";
        Wheel = 2, "Wheel board: one motor with encoder.";
    }
}

wire_enum! {
    /// What "open all valves" means.
    OpenMode {
        Exhaust = 0, "Inlets shut, outlets open.";
        BlowThrough = 1, "All four valves open; maintenance, refused unless disarmed.";
    }
}

wire_enum! {
    /// Fuzzy correction added to the proportional law.
    Correction {
        Pd = 0, "PD type: inputs are error and its rate.";
        Id = 1, "ID type: inputs are the integral of the error and the rate of the error.";
    }
}

wire_enum! {
    /// Mode of the wheel controller.
    WheelControlMode {
        Idle = 0, "Motor command zero, filter cleared.";
        Position = 1, "Position control without profile.";
        ProportionalVelocity = 2, "Velocity control by gain alone.";
        Trapezoidal = 3, "Position control along a trapezoidal profile.";
        IntegralVelocity = 4, "Velocity control by a moving position.";
    }
}

wire_enum! {
    /// Why a board was last disarmed or stopped.
    DisarmReason {
        None = 0, "Not disarmed since start-up.";
        Reset = 1, "The board was started.";
        Command = 2, "The master disarmed it.";
        LinkLost = 3, "The link was lost.";
        Fault = 4, "A fault of the board or its axis.";
        EmergencyStop = 5, "Emergency stop.";
        EmergencyBrake = 6, "The master asked for the emergency brake.";
        OpenAllValves = 7, "The master asked to open all valves.";
    }
}

wire_enum! {
    /// Why a processor started.
    ///
    /// 3 to 6 are faults of a board in operation, as is 2; the others are how
    /// boards start.
    ResetCause {
        Unknown = 0, "The board does not report it.";
        PowerUp = 1, "The supply came up, or had fallen below the level at which the processor stops.";
        Watchdog = 2, "The program did not feed the hardware watchdog.";
        BrownOut = 3, "The supply sagged below its warning level and came back.";
        ProcessorFault = 4, "A processor fault or an unexpected interrupt.";
        Panic = 5, "The program found itself in an impossible state.";
        ClockLoss = 6, "The crystal oscillator stopped.";
        Software = 7, "Asked for by software or by a debugger.";
        Pin = 8, "The reset pin.";
        OptionBytes = 9, "The option bytes were loaded.";
    }
}

impl ResetCause {
    /// What to do about it.
    #[must_use]
    pub const fn remedy(self) -> &'static str {
        match self {
            Self::Unknown => "Read the board's log.",
            Self::PowerUp => {
                "If nobody switched it off, this was a brown-out: check the supply of this board, its fuse and its plug."
            }
            Self::Watchdog => {
                "The watchdog has stopped a program that hung: report this with the firmware version and the log."
            }
            Self::BrownOut => {
                "This was a brown-out: check the supply of this board, its fuse and its plug."
            }
            Self::ProcessorFault | Self::Panic => {
                "Report this with the firmware version and the log; if it returns, replace the board."
            }
            Self::ClockLoss => "Replace the board: its crystal is damaged.",
            Self::Software | Self::OptionBytes => {
                "Nothing to do: somebody is working on the board."
            }
            Self::Pin => "Check the reset pin of this board, if nobody pressed it.",
        }
    }

    /// Whether something failed in operation, so that the board latches a fault.
    #[must_use]
    pub const fn is_fault(self) -> bool {
        matches!(self.code(), 2..=6)
    }
}

wire_enum! {
    /// What a record of the log stream says; its text is put together by the
    /// reader from this table and the two arguments.
    LogEvent {
        None = 0, "No record.";
        Mode = 1, "The mode changed from {a} to {b}.";
        Fault = 2, "Fault {a} was latched in mode {b}.";
        Parameter = 3, "Parameter {b} was set.";
        Saved = 4, "The parameters were stored; 1 if it went well: {a}.";
        Cleared = 5, "Faults were cleared: bits {b}.";
        Precharged = 6, "Both chambers were precharged, in {b} ms.";
        PrechargeMoved = 7, "The precharge ended after {b} ms because the piston moved: check the load of this axis; its law drives on.";
        PrechargeLate = 8, "The precharge ended after {b} ms without its pressure: these valves take longer to fill these chambers; lower the parameter precharge. The law drives on.";
    }
}

wire_enum! {
    /// Why a request was refused.
    NackReason {
        UnknownMessage = 1, "This board does not know the message type.";
        BadLength = 2, "The payload does not have the size of its message type.";
        OutOfRange = 3, "A value is outside its permitted range.";
        Busy = 4, "The board is busy with an earlier request; try again.";
        WrongMode = 5, "The request does not apply in the present mode.";
        NotArmed = 6, "The board is not armed.";
        Armed = 7, "The board is armed; disarm it first.";
        Duplicate = 8, "The sequence number was used for a different request.";
        Expired = 9, "The deadline of the command has passed.";
        UnknownParameter = 10, "There is no parameter with this number on this board.";
        ReadOnly = 11, "The parameter cannot be written.";
        VersionMismatch = 12, "Master and board were built from different interface definitions.";
        FaultLatched = 13, "A fault is latched; clear it first.";
        WrongBoard = 14, "The request is for the other kind of board.";
        LinkDown = 15, "No live SYNC stream from the master.";
        NotReady = 16, "The board is still starting.";
        StoreFailed = 17, "The parameters could not be stored; the set stored before is still there.";
    }
}

wire_bits! {
    /// Digital inputs of a board.
    ///
    /// Foot switches are read by the vertical joints' boards (3 and 6), supply
    /// pressure by the first wheel board (7). Bits of absent inputs are 0.
    InputBits {
        FOOT_FRONT = 0, "Foot switch 1 of 4 closed (front).";
        FOOT_LEFT = 1, "Foot switch 2 of 4 closed (left).";
        FOOT_REAR = 2, "Foot switch 3 of 4 closed (rear).";
        FOOT_RIGHT = 3, "Foot switch 4 of 4 closed (right).";
        SUPPLY_PRESSURE = 4, "Supply pressure present.";
        DUMP_OPEN = 5, "The supply dump valve is commanded open.";
    }
}

impl InputBits {
    /// The four foot switches, bits 0–3.
    pub const FOOT: Self = Self::FOOT_FRONT
        .with(Self::FOOT_LEFT)
        .with(Self::FOOT_REAR)
        .with(Self::FOOT_RIGHT);
}

/// A number outside its permitted range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfRange;

impl core::fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("value outside its permitted range")
    }
}

/// Wire form of a checked `i32`: four bytes, little-endian.
#[derive(Serialize, Deserialize)]
struct LeI32(#[serde(with = "le")] i32);

/// Wire form of a checked `u16`: two bytes, little-endian.
#[derive(Serialize, Deserialize)]
struct LeU16(#[serde(with = "le")] u16);

/// Wheel position on the wire: 24-bit counts, sign-extended to four bytes.
///
/// Anything outside −2^23…2^23−1 is rejected, not wrapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "LeI32", into = "LeI32")]
pub struct Count24(WheelCount);

impl Count24 {
    /// From a wheel position.
    #[must_use]
    pub const fn new(count: WheelCount) -> Self {
        Self(count)
    }

    /// The wheel position.
    #[must_use]
    pub const fn get(self) -> WheelCount {
        self.0
    }
}

impl TryFrom<LeI32> for Count24 {
    type Error = OutOfRange;
    fn try_from(raw: LeI32) -> Result<Self, OutOfRange> {
        WheelCount::checked_new(raw.0).map(Self).ok_or(OutOfRange)
    }
}

impl From<Count24> for LeI32 {
    fn from(count: Count24) -> Self {
        Self(count.0.get())
    }
}

impl WireSize for Count24 {
    const SIZE: usize = 4;
}

/// Largest speed of a profile: 0–127 counts per sample (7 bits, as R28H).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct Speed7(u8);

impl Speed7 {
    /// `None` above 127.
    #[must_use]
    pub const fn new(counts_per_sample: u8) -> Option<Self> {
        if counts_per_sample < 128 {
            Some(Self(counts_per_sample))
        } else {
            None
        }
    }

    /// Counts per sample, 0–127.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl TryFrom<u8> for Speed7 {
    type Error = OutOfRange;
    fn try_from(raw: u8) -> Result<Self, OutOfRange> {
        Self::new(raw).ok_or(OutOfRange)
    }
}

impl From<Speed7> for u8 {
    fn from(speed: Speed7) -> u8 {
        speed.0
    }
}

impl WireSize for Speed7 {
    const SIZE: usize = 1;
}

/// Acceleration: 8.8 counts per sample², 0…127 255/256 (as R27H/R26H).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "LeU16", into = "LeU16")]
pub struct Acceleration8p8(u16);

impl Acceleration8p8 {
    /// From the raw number, counts per sample² × 256; `None` above 0x7FFF.
    #[must_use]
    pub const fn new(raw: u16) -> Option<Self> {
        if raw <= 0x7FFF { Some(Self(raw)) } else { None }
    }

    /// The raw number, counts per sample² × 256.
    #[must_use]
    pub const fn raw(self) -> u16 {
        self.0
    }
}

impl TryFrom<LeU16> for Acceleration8p8 {
    type Error = OutOfRange;
    fn try_from(raw: LeU16) -> Result<Self, OutOfRange> {
        Self::new(raw.0).ok_or(OutOfRange)
    }
}

impl From<Acceleration8p8> for LeU16 {
    fn from(acceleration: Acceleration8p8) -> Self {
        Self(acceleration.0)
    }
}

impl WireSize for Acceleration8p8 {
    const SIZE: usize = 2;
}
