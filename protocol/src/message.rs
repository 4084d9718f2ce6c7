//! Messages: typed structs, one exact payload size each.
//!
//! Bytes become a checked [`Frame`], a frame becomes a
//! [`Message`]; only messages reach logic. [`Message::parse`] can fail for an
//! unknown type, a wrong size or a value outside its range, and says which, so
//! that a node can answer with the matching [`NackReason`]. After a successful
//! parse every accessor is total. Nothing here panics.

use crate::address::Address;
use crate::fault::{FaultBits, FaultCode, LimitBits};
use crate::fields::{
    Acceleration8p8, BoardKind, Correction, Count24, DisarmReason, InputBits, NackReason, NodeMode,
    OpenMode, ResetCause, Speed7, WheelControlMode,
};
use crate::frame::MAX_PAYLOAD;
use crate::le;
use crate::sync::{SyncFlags, SyncSlots};
use crate::wire::{FieldSchema, MessageSchema, WireSize};
use serde::{Deserialize, Serialize};
use wheeleg_units::{Duty, PositionMm, VelocityMmS, WheelCount, WireDuty, WireVelocity};

mod codec;
mod envelope;

pub use codec::ParseError;
pub use envelope::Envelope;

/// Purpose of a message type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Part of every bus cycle; never acknowledged.
    Cyclic,
    /// From the master to one node; answered.
    Request,
    /// From a node to the master, with the sequence of the request.
    Answer,
}

macro_rules! messages {
    ($(
        $(#[doc = $doc:literal])*
        $name:ident = $id:literal, $class:ident $(-> $answer:ident)? {
            $( $(#[$fmeta:meta])* $field:ident: $ty:ty = $format:literal; )*
        }
    )*) => {
        /// Message types: the second byte of the header.
        ///
        /// 0x01–0x0F cyclic, 0x10–0x7F requests (0x10 general, 0x20 joint,
        /// 0x30 wheel, 0x40 parameters), 0x80–0xFF answers. Numbers are never
        /// used again for something else.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum MessageType { $( $(#[doc = $doc])* $name = $id, )* }

        impl MessageType {
            /// All types, in ascending order.
            pub const ALL: &'static [Self] = &[ $( Self::$name ),* ];

            /// From the number in the header.
            #[must_use]
            pub const fn from_code(code: u8) -> Option<Self> {
                match code { $( $id => Some(Self::$name), )* _ => None }
            }

            /// Name as in the interface definition.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Self::$name => stringify!($name) ),* }
            }

            /// Its purpose.
            #[must_use]
            pub const fn class(self) -> Class {
                match self { $( Self::$name => Class::$class ),* }
            }

            /// Exact payload size in bytes.
            #[must_use]
            pub const fn payload_len(self) -> usize {
                match self { $( Self::$name => $name::SIZE ),* }
            }

            /// The answer of success to this request; `None` if it is no request.
            /// Every request can also be answered by Nack.
            #[must_use]
            pub const fn answer(self) -> Option<Self> {
                match self {
                    $( Self::$name => messages!(@answer $class $($answer)?), )*
                }
            }
        }

        $(
            $(#[doc = $doc])*
            #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
            pub struct $name { $( $(#[$fmeta])* #[doc = $format] pub $field: $ty, )* }

            impl $name {
                /// Exact payload size in bytes.
                pub const SIZE: usize = {
                    let size: usize = 0;
                    $( let size = size.saturating_add(<$ty as WireSize>::SIZE); )*
                    size
                };
            }

            impl From<$name> for Message {
                fn from(message: $name) -> Self {
                    Self::$name(message)
                }
            }

            const _: () = assert!($name::SIZE <= MAX_PAYLOAD);
        )*

        /// Any message of the bus.
        #[derive(Clone, Copy, PartialEq, Eq)]
        pub enum Message { $( $(#[doc = $doc])* $name($name), )* }

        impl core::fmt::Debug for Message {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self { $( Self::$name(message) => message.fmt(f) ),* }
            }
        }

        impl Message {
            /// Its type.
            #[must_use]
            pub const fn message_type(&self) -> MessageType {
                match self { $( Self::$name(_) => MessageType::$name ),* }
            }

            /// Whether both are the same request, field by field; false for other messages. A board compares
            /// nothing else, and needs no code for more.
            pub(crate) fn is_same_request(&self, other: &Self) -> bool {
                match (self, other) {
                    $( (Self::$name(own), Self::$name(other)) => {
                        let is_request = const { MessageType::$name.answer().is_some() };
                        is_request && own == other
                    } )*
                    _ => false,
                }
            }

            /// `FROM_NODE`: only for messages that a node sends.
            fn write_payload<'a, const FROM_NODE: bool>(
                &self,
                out: &'a mut [u8],
            ) -> postcard::Result<&'a mut [u8]> {
                match self { $(
                    Self::$name(message) => {
                        if FROM_NODE && const { !MessageType::$name.comes_from_nodes() } {
                            return Err(postcard::Error::WontImplement);
                        }
                        postcard::to_slice(message, out)
                    }
                )* }
            }

            /// `TO_NODE`: only for messages that may go from the master to a node, so that the image of a
            /// board needs no code for others.
            fn read_payload<const TO_NODE: bool>(
                message_type: MessageType,
                payload: &[u8],
            ) -> postcard::Result<(Self, &[u8])> {
                match message_type { $(
                    MessageType::$name => {
                        if TO_NODE && const { MessageType::$name.comes_from_nodes() } {
                            return Err(postcard::Error::WontImplement);
                        }
                        postcard::take_from_bytes::<$name>(payload)
                            .map(|(message, rest)| (Self::$name(message), rest))
                    }
                )* }
            }
        }

        /// The message part of the interface definition, in ascending order of type.
        pub const MESSAGES: &[MessageSchema] = &[ $( MessageSchema {
            id: $id,
            name: stringify!($name),
            class: stringify!($class),
            text: concat!($($doc),*),
            fields: &[ $( FieldSchema {
                name: stringify!($field),
                ty: stringify!($ty),
                size: <$ty as WireSize>::SIZE,
                format: $format,
            } ),* ],
        } ),* ];
    };
    (@answer Request) => { Some(Self::Ack) };
    (@answer Request $answer:ident) => { Some(Self::$answer) };
    (@answer $class:ident) => { None };
}

messages! {
    /// Broadcast once per bus cycle: time, E-stop and the set-points of all nodes.
    Sync = 0x01, Cyclic {
        #[serde(with = "le")] cycle: u16 = "bus cycle counter, advances by one per cycle, wraps";
        #[serde(with = "le")] master_time_us: u32 = "master time at the start of this frame, us, wraps after 71 min";
        flags: SyncFlags = "bit 0 emergency stop, others 0";
        slots: SyncSlots = "eight set-point slots, joints 1-6 then wheels 7-8";
    }
    /// A node's reply in its own slot after SYNC; same layout for joints and wheels.
    SlotReply = 0x02, Cyclic {
        #[serde(with = "le")] position_raw: i32 = "joint: stroke, I16F16 mm; wheel: 24-bit counts, sign-extended";
        #[serde(with = "le")] velocity_raw: i16 = "joint: I12F4 mm/s; wheel: 12.4 counts per sample";
        #[serde(with = "le")] effort_raw: i16 = "joint: drive duty, Q1.14; wheel: motor command, -100..100";
        active_faults: FaultBits = "latched faults, one bit each";
        mode: NodeMode = "mode of the board";
        limits: LimitBits = "limits that shaped the output (indications)";
        inputs: InputBits = "digital inputs";
        sync_echo: u8 = "low byte of the cycle counter that was latched";
    }
    /// Who are you? Keeps its layout in every protocol version.
    Identify = 0x10, Request -> Identity {}
    /// Close the loop on the present position. Refused unless the schema hash is the board's own.
    Arm = 0x11, Request {
        #[serde(with = "le")] schema_hash: u64 = "hash of the master's interface definition";
    }
    /// Open the loop: valves shut, motor off.
    Disarm = 0x12, Request {}
    /// Clear latched faults and the link supervision latch.
    ClearFault = 0x13, Request {}
    /// Ask for the fault record.
    FaultReport = 0x14, Request -> FaultRecord {}
    /// Board command: all valves shut (joint), ramp to standstill (wheel). Latched.
    EmergencyBrake = 0x15, Request {}
    /// Board command: transmit the actual position.
    TransmitPosition = 0x16, Request -> Position {}
    /// Who else is at this address? Each board answers in a slot that its unique id and
    /// the newest bus cycle choose, so that two boards at one address hear each other.
    Discover = 0x17, Request -> Identity {}
    /// Ask for the counters of the link.
    LinkReport = 0x18, Request -> LinkRecord {}
    /// Fetch the log stream, and keep it on for a while.
    LogRead = 0x19, Request -> LogRecords {
        #[serde(with = "le")] lease_ms: u16 = "time for which the board goes on recording, ms; 0 ends it";
    }
    /// Board command: receive a position reference.
    PositionReference = 0x20, Request {
        #[serde(with = "le")] reference_raw: i32 = "stroke, I16F16 mm";
        #[serde(with = "le")] deadline_cycle: u16 = "last bus cycle in which the command may take effect";
    }
    /// Board command: open all valves.
    OpenAllValves = 0x21, Request {
        mode: OpenMode = "exhaust, or literal blow-through";
    }
    /// Choose the fuzzy correction.
    SelectCorrection = 0x22, Request {
        correction: Correction = "PD or ID type";
    }
    /// Final position of the wheel.
    WheelReference = 0x30, Request {
        position: Count24 = "24-bit counts, sign-extended";
        #[serde(with = "le")] deadline_cycle: u16 = "last bus cycle in which the command may take effect";
    }
    /// Velocity of the wheel.
    WheelVelocity = 0x31, Request {
        #[serde(with = "le")] velocity_raw: i16 = "12.4 counts per sample; integral velocity mode takes whole counts -128..127 only";
        #[serde(with = "le")] deadline_cycle: u16 = "last bus cycle in which the command may take effect";
    }
    /// Largest speed of the trapezoidal profile.
    WheelMaxSpeed = 0x32, Request {
        speed: Speed7 = "counts per sample, 0..127";
    }
    /// Acceleration of the trapezoidal and integral velocity profile.
    WheelAcceleration = 0x33, Request {
        acceleration: Acceleration8p8 = "8.8 counts per sample^2, 0..0x7FFF raw";
    }
    /// Digital filter D(z) = K (z - A/256) / (4 (z + B/256)).
    WheelFilter = 0x34, Request {
        zero: u8 = "A, 0..255";
        pole: u8 = "B, 0..255";
        gain: u8 = "K, 0..255";
    }
    /// Sample timer: period = 16 (T + 1) / clock.
    WheelSampleTimer = 0x35, Request {
        timer: u8 = "T, minimum by mode";
    }
    /// Mode of the wheel controller.
    WheelMode = 0x36, Request {
        mode: WheelControlMode = "controller mode";
    }
    /// Read a parameter.
    ParamGet = 0x40, Request -> ParamValue {
        #[serde(with = "le")] id: u16 = "parameter number";
    }
    /// Write a parameter; answered with the value now in force.
    ParamSet = 0x41, Request -> ParamValue {
        #[serde(with = "le")] id: u16 = "parameter number";
        #[serde(with = "le")] value: i32 = "raw value in the parameter's format";
    }
    /// Store the parameters in force. Refused while armed; Busy until it is done.
    ParamSave = 0x42, Request {}
    /// The request was carried out or accepted.
    Ack = 0x80, Answer {
        request: u8 = "message type of the request";
    }
    /// The request was refused. Keeps its layout in every protocol version.
    Nack = 0x81, Answer {
        request: u8 = "message type of the request";
        reason: NackReason = "why";
    }
    /// Answer to Identify. Keeps its layout in every protocol version.
    Identity = 0x82, Answer {
        board: BoardKind = "kind of board";
        address: Address = "address read from the straps";
        firmware: [u8; 3] = "firmware version: major, minor, patch";
        #[serde(with = "le")] schema_hash: u64 = "hash of the board's interface definition";
        unique_id: [u8; 12] = "96-bit unique id of the processor";
    }
    /// Answer to TransmitPosition.
    Position = 0x83, Answer {
        #[serde(with = "le")] position_raw: i32 = "joint: stroke, I16F16 mm; wheel: 24-bit counts, sign-extended";
        #[serde(with = "le")] velocity_raw: i16 = "joint: I12F4 mm/s; wheel: 12.4 counts per sample";
        #[serde(with = "le")] cycle: u16 = "bus cycle in which the sample was taken";
        #[serde(with = "le")] age_us: u16 = "time from the latch of that cycle to the sample, us, saturating";
    }
    /// Answer to ParamGet and ParamSet.
    ParamValue = 0x84, Answer {
        #[serde(with = "le")] id: u16 = "parameter number";
        #[serde(with = "le")] value: i32 = "raw value in the parameter's format";
    }
    /// Answer to FaultReport.
    FaultRecord = 0x85, Answer {
        active: FaultBits = "latched faults, one bit each";
        sticky: FaultBits = "faults since start-up, not cleared by ClearFault";
        first_fault: FaultCode = "number of the first fault since the last clear, 0 = none";
        #[serde(with = "le")] first_time_us: u32 = "board time of the first fault, us, wraps; 0 if none";
        disarm_reason: DisarmReason = "why it was last disarmed or stopped";
        limits: LimitBits = "limits that shape the output now";
        reset_cause: ResetCause = "why the processor last started";
        #[serde(with = "le")] clock_offset_us: u32 = "master time less board time, us, wraps; 0 before the first SYNC";
    }
    /// Answer to LinkReport: what the board heard since it started. Counters stop at
    /// their largest value.
    LinkRecord = 0x86, Answer {
        #[serde(with = "le")] frames: u32 = "sound frames";
        #[serde(with = "le")] overflow: u16 = "frames with too many bytes";
        #[serde(with = "le")] truncated: u16 = "frames that end inside a COBS block";
        #[serde(with = "le")] short: u16 = "frames shorter than header and CRC";
        #[serde(with = "le")] crc: u16 = "frames with a wrong CRC";
        #[serde(with = "le")] version: u16 = "frames of another protocol version";
        #[serde(with = "le")] length: u16 = "frames with a wrong length field";
        #[serde(with = "le")] address: u16 = "frames with an address that does not exist";
        #[serde(with = "le")] unsent: u16 = "own frames replaced before they were sent";
        #[serde(with = "le")] drift_ppm: i16 = "board clock less master clock, ppm, over the last second";
        #[serde(with = "le")] parameters: u32 = "sum of the parameters in force (section Parameter sets)";
    }
    /// Answer to LogRead: the oldest records, which are then forgotten.
    LogRecords = 0x87, Answer {
        #[serde(with = "le")] lost: u16 = "records lost to a full buffer since the last answer";
        left: u8 = "records that wait still";
        entries: [u8; 32] = "four records: board time u32 us, LogEvent, a u8, b u16; unused ones 0";
    }
}

impl LinkRecord {
    /// Frames rejected for an error, of every kind.
    #[must_use]
    pub fn errors(&self) -> u32 {
        [
            self.overflow,
            self.truncated,
            self.short,
            self.crc,
            self.version,
            self.length,
            self.address,
        ]
        .map(u32::from)
        .iter()
        .sum()
    }
}

impl MessageType {
    /// The number in the header.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Whether a message of this type may go from `source` to `destination`: no
    /// node can command another, and requests are never broadcast.
    #[must_use]
    pub const fn may_go(self, source: Address, destination: Address) -> bool {
        if self.comes_from_nodes() {
            return source.is_node() && destination.is_master();
        }
        match self {
            Self::Sync => source.is_master() && destination.is_broadcast(),
            _ => source.is_master() && destination.is_node(),
        }
    }

    /// Whether a node sends it; all others come from the master.
    const fn comes_from_nodes(self) -> bool {
        matches!(
            (self, self.class()),
            (Self::SlotReply, _) | (_, Class::Answer)
        )
    }

    /// Whether the type keeps number and layout in every protocol version.
    #[must_use]
    pub const fn is_version_independent(code: u8) -> bool {
        code == Self::Identify.code() || code == Self::Identity.code() || code == Self::Nack.code()
    }
}

impl SlotReply {
    /// A joint's position, I16F16 mm.
    #[must_use]
    pub const fn joint_position(&self) -> PositionMm {
        PositionMm::from_raw(self.position_raw)
    }

    /// A joint's velocity, mm/s.
    #[must_use]
    pub const fn joint_velocity(&self) -> VelocityMmS {
        VelocityMmS::from_wire(WireVelocity::from_bits(self.velocity_raw))
    }

    /// A joint's drive duty, limited to ±1.
    #[must_use]
    pub const fn joint_duty(&self) -> Duty {
        Duty::from_wire(WireDuty::from_bits(self.effort_raw))
    }

    /// A wheel's position; `None` if it does not fit 24 bits.
    #[must_use]
    pub const fn wheel_position(&self) -> Option<WheelCount> {
        WheelCount::checked_new(self.position_raw)
    }
}

impl PositionReference {
    /// The reference, I16F16 mm.
    #[must_use]
    pub const fn reference(&self) -> PositionMm {
        PositionMm::from_raw(self.reference_raw)
    }
}
