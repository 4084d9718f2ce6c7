//! The interface definition as text, and its 64-bit hash.
//!
//! The text lists everything that changes the meaning of bytes: message numbers, field names, types, sizes,
//! Q-formats and units, enumeration values, bits, fault and limit numbers, parameters with their formats and
//! limits. And the timing that lets boards share the line: its speed, the cycle, the times of the slots.
//! Sentences for people are not part of it: correcting a word does not separate boards. The hash is FNV-1a
//! (64 bit) over exactly this text, computed at compile time, and compared when a board is identified and
//! armed.

use crate::fault::{FAULTS, FaultSchema, LIMITS};
use crate::fields::{
    BoardKind, Correction, DisarmReason, InputBits, LogEvent, NackReason, NodeMode, OpenMode,
    ResetCause, WheelControlMode,
};
use crate::frame::VERSION;
use crate::link::{
    ADVANCE_MOST, BAUD, CYCLE_US, DISCOVERY_SLOTS, GAP_US, SETTING_US, TURNAROUND_US,
};
use crate::message::MESSAGES;
use crate::param::{JOINT_PARAMS, ParamInfo, WHEEL_PARAMS};
use crate::sync::{LinkLossAction, SYNC_SLOT_FIELDS, SyncFlags};
use crate::wire::{EnumSchema, FieldSchema, MessageSchema};

/// Hash of the interface definition of this build.
pub const SCHEMA_HASH: u64 = INTERFACE.hash();

/// Everything that gives bytes their meaning.
#[derive(Clone, Copy, Debug)]
pub struct Interface<'a> {
    /// Protocol version.
    pub version: u8,
    /// Messages in ascending order.
    pub messages: &'a [MessageSchema],
    /// Fields of a SYNC slot.
    pub slot: &'a [FieldSchema],
    /// Enumerations and bit sets.
    pub enums: &'a [EnumSchema],
    /// Latched faults.
    pub faults: &'a [FaultSchema],
    /// Limit indications.
    pub limits: &'a [FaultSchema],
    /// Parameter tables, board by board.
    pub parameters: &'a [&'a [ParamInfo]],
    /// Times of the line, by name.
    pub timing: &'a [(&'a str, u32)],
}

/// The interface of this build.
pub const INTERFACE: Interface<'static> = Interface {
    version: VERSION,
    messages: MESSAGES,
    slot: SYNC_SLOT_FIELDS,
    enums: &[
        SyncFlags::SCHEMA,
        LinkLossAction::SCHEMA,
        NodeMode::SCHEMA,
        BoardKind::SCHEMA,
        OpenMode::SCHEMA,
        Correction::SCHEMA,
        WheelControlMode::SCHEMA,
        DisarmReason::SCHEMA,
        ResetCause::SCHEMA,
        LogEvent::SCHEMA,
        NackReason::SCHEMA,
        InputBits::SCHEMA,
    ],
    faults: FAULTS,
    limits: LIMITS,
    parameters: &[JOINT_PARAMS, WHEEL_PARAMS],
    timing: &[
        ("baud", BAUD),
        ("cycle_us", CYCLE_US),
        ("turnaround_us", TURNAROUND_US),
        ("setting_us", SETTING_US),
        ("gap_us", GAP_US),
        ("discovery_slots", DISCOVERY_SLOTS),
        ("advance_most", ADVANCE_MOST as u32),
    ],
};

/// FNV-1a, 64 bit, in a form that constants can use.
#[derive(Clone, Copy)]
struct Fnv(u64);

impl Fnv {
    const OFFSET: Self = Self(0xCBF2_9CE4_8422_2325);
    const PRIME: u64 = 0x0000_0100_0000_01B3;

    const fn byte(self, byte: u8) -> Self {
        Self((self.0 ^ byte as u64).wrapping_mul(Self::PRIME))
    }

    const fn text(self, text: &str) -> Self {
        let mut hash = self;
        let mut rest = text.as_bytes();
        while let [first, tail @ ..] = rest {
            hash = hash.byte(*first);
            rest = tail;
        }
        hash
    }

    const fn word(self, text: &str) -> Self {
        self.byte(b' ').text(text)
    }

    /// A space and the number in decimal.
    const fn number(self, value: i64) -> Self {
        let mut hash = self.byte(b' ');
        if value < 0 {
            hash = hash.byte(b'-');
        }
        let magnitude = value.unsigned_abs();
        let mut divisor: u64 = 10_000_000_000_000_000_000;
        while divisor > 1 && magnitude < divisor {
            divisor = divisor.wrapping_div(10);
        }
        // Ends when the divisor reaches zero.
        while let Some(quotient) = magnitude.checked_div(divisor) {
            hash = hash.byte(b'0'.wrapping_add(quotient.wrapping_rem(10) as u8));
            divisor = divisor.wrapping_div(10);
        }
        hash
    }

    const fn line(self) -> Self {
        self.byte(b'\n')
    }

    const fn fields(self, fields: &[FieldSchema]) -> Self {
        let mut hash = self;
        let mut rest = fields;
        while let [field, tail @ ..] = rest {
            hash = hash
                .text("field")
                .word(field.name)
                .word(field.ty)
                .number(field.size as i64)
                .word(field.format)
                .line();
            rest = tail;
        }
        hash
    }

    const fn faults(self, kind: &str, faults: &[FaultSchema]) -> Self {
        let mut hash = self;
        let mut rest = faults;
        while let [fault, tail @ ..] = rest {
            hash = hash
                .text(kind)
                .number(fault.code as i64)
                .number(fault.bit as i64)
                .word(fault.name)
                .line();
            rest = tail;
        }
        hash
    }

    const fn parameters(self, parameters: &[ParamInfo]) -> Self {
        let mut hash = self;
        let mut rest = parameters;
        while let [row, tail @ ..] = rest {
            hash = hash
                .text("parameter")
                .number(row.id as i64)
                .word(row.name)
                .word(row.unit)
                .word(row.format.name())
                .number(row.min as i64)
                .number(row.max as i64)
                .number(row.default as i64)
                .line();
            rest = tail;
        }
        hash
    }
}

impl Interface<'_> {
    /// FNV-1a (64 bit) of the text that [`Self::write_text`] writes.
    #[must_use]
    pub const fn hash(&self) -> u64 {
        let mut hash = Fnv::OFFSET
            .text("protocol")
            .number(self.version as i64)
            .line();
        let mut messages = self.messages;
        while let [message, tail @ ..] = messages {
            hash = hash
                .text("message")
                .number(message.id as i64)
                .word(message.name)
                .word(message.class)
                .line()
                .fields(message.fields);
            messages = tail;
        }
        hash = hash.text("slot").line().fields(self.slot);
        let mut enums = self.enums;
        while let [set, tail @ ..] = enums {
            hash = hash.text("enum").word(set.name).line();
            let mut values = set.values;
            while let [value, rest @ ..] = values {
                hash = hash
                    .text("value")
                    .number(value.value as i64)
                    .word(value.name)
                    .line();
                values = rest;
            }
            enums = tail;
        }
        hash = hash
            .faults("fault", self.faults)
            .faults("limit", self.limits);
        let mut tables = self.parameters;
        while let [table, tail @ ..] = tables {
            hash = hash.parameters(table);
            tables = tail;
        }
        let mut timing = self.timing;
        while let [(name, value), tail @ ..] = timing {
            hash = hash.text("timing").word(name).number(*value as i64).line();
            timing = tail;
        }
        hash.0
    }

    /// Writes the interface definition: one line per item.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_text(&self, out: &mut impl core::fmt::Write) -> core::fmt::Result {
        fn fields(out: &mut impl core::fmt::Write, fields: &[FieldSchema]) -> core::fmt::Result {
            fields.iter().try_for_each(|f| {
                writeln!(out, "field {} {} {} {}", f.name, f.ty, f.size, f.format)
            })
        }
        writeln!(out, "protocol {}", self.version)?;
        for message in self.messages {
            let MessageSchema {
                id, name, class, ..
            } = message;
            writeln!(out, "message {id} {name} {class}")?;
            fields(out, message.fields)?;
        }
        writeln!(out, "slot")?;
        fields(out, self.slot)?;
        for set in self.enums {
            writeln!(out, "enum {}", set.name)?;
            for value in set.values {
                writeln!(out, "value {} {}", value.value, value.name)?;
            }
        }
        for (kind, table) in [("fault", self.faults), ("limit", self.limits)] {
            for row in table {
                writeln!(out, "{kind} {} {} {}", row.code, row.bit, row.name)?;
            }
        }
        for row in self.parameters.iter().copied().flatten() {
            writeln!(
                out,
                "parameter {} {} {} {} {} {} {}",
                row.id,
                row.name,
                row.unit,
                row.format.name(),
                row.min,
                row.max,
                row.default
            )?;
        }
        for (name, value) in self.timing {
            writeln!(out, "timing {name} {value}")?;
        }
        Ok(())
    }
}
