//! The board bus: frames, messages, link state machines and their tables.
//!
//! Bytes become checked frames ([`Decoder`]), frames become typed messages
//! ([`Message::parse`]), and only messages reach logic. `SPEC.md` beside this
//! crate describes every byte; a test compares it with the code.
//!
//! # Never-panic contract
//!
//! No public function of this crate panics, allocates, recurses or loops more often than its input is long,
//! for any input. Every error is a value: [`FrameError`], [`ParseError`], [`EncodeError`], [`NackReason`].
//!
//! ```
//! use wheeleg_protocol::{Address, Decoder, Disarm, Envelope, MAX_ENCODED, Message};
//!
//! let envelope = Envelope {
//!     source: Address::MASTER,
//!     destination: Address::joint(3).expect("joints are 1 to 6"),
//!     sequence: 7,
//! };
//! let mut buffer = [0; MAX_ENCODED];
//! let bytes = Message::Disarm(Disarm {}).emit(envelope, &mut buffer)?;
//!
//! let mut decoder = Decoder::new();
//! let mut received = None;
//! decoder.push_slice(bytes, |result| {
//!     received = result.ok().and_then(|frame| Message::parse(&frame).ok());
//! });
//! assert_eq!(received, Some(Message::Disarm(Disarm {})));
//! # Ok::<(), wheeleg_protocol::EncodeError>(())
//! ```
//!
//! # Glossary
//!
//! * **frame**: addresses, sequence number, type and body between two delimiters, with a check
//!   sum
//! * **delimiter**: the byte 0: COBS leaves no other zero on the line
//! * **COBS**: consistent overhead byte stuffing: takes the zeros out of a frame
//! * **SYNC**: the frame that begins a bus cycle, with a slot for each node
//! * **acyclic**: messages after the slots: requests and their answers
//! * **Ack, Nack**: done; refused, with a reason
//! * **interface hash**: hash of this definition; nodes of another one are refused
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

pub mod address;
mod checksum;
pub mod decoder;
pub mod fault;
pub mod fields;
pub mod frame;
mod le;
pub mod link;
pub mod log;
pub mod message;
pub mod param;
pub mod schema;
pub mod sync;
pub mod wire;

pub use address::{Address, NODE_NAMES, NODES, Node};
pub use decoder::{Decoder, LinkQuality};
pub use fault::{
    FAULTS, Fault, FaultBits, FaultClass, FaultCode, FaultSchema, LIMITS, Limit, LimitBits,
    WARNINGS, Warning, WarningBits,
};
pub use fields::{
    Acceleration8p8, BoardKind, Correction, Count24, DisarmReason, InputBits, LogEvent, NackReason,
    NodeMode, OpenMode, OutOfRange, ResetCause, Speed7, WheelControlMode,
};
pub use frame::{
    CRC_LEN, DELIMITER, EncodeError, Frame, FrameError, HEADER_LEN, Header, MAX_DECODED,
    MAX_ENCODED, MAX_PAYLOAD, VERSION, checksum, encode, encoded_len,
};
pub use log::{LOG_ENTRIES, LogEntry};
pub use message::*;
pub use schema::{INTERFACE, Interface, SCHEMA_HASH};
pub use sync::{
    BadSlot, JointSetpoint, LinkLossAction, NextReference, SYNC_SLOT_FIELDS, SyncFlags, SyncSlot,
    SyncSlots, WheelSetpoint,
};
pub use wire::{EnumSchema, FieldSchema, MessageSchema, UnknownValue, ValueSchema};
