//! Records of the log stream: numbers on the wire, text at the reader.

use crate::fault::Fault;
use crate::fields::{LogEvent, NodeMode};
use crate::message::LogRecords;

/// Records of one answer.
pub const LOG_ENTRIES: usize = 4;

/// Bytes of a record.
const ENTRY_LEN: usize = 8;

/// One record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// Board time, µs, wraps.
    pub time_us: u32,
    /// What happened.
    pub event: LogEvent,
    /// First argument.
    pub a: u8,
    /// Second argument.
    pub b: u16,
}

impl LogEntry {
    /// The bytes on the wire.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; ENTRY_LEN] {
        let [t0, t1, t2, t3] = self.time_us.to_le_bytes();
        let [b0, b1] = self.b.to_le_bytes();
        [t0, t1, t2, t3, self.event.code(), self.a, b0, b1]
    }

    /// From the bytes on the wire; `None` for an unused record or an event of
    /// another version.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; ENTRY_LEN]) -> Option<Self> {
        let [t0, t1, t2, t3, event, a, b0, b1] = bytes;
        match LogEvent::from_code(event) {
            None | Some(LogEvent::None) => None,
            Some(event) => Some(Self {
                time_us: u32::from_le_bytes([t0, t1, t2, t3]),
                event,
                a,
                b: u16::from_le_bytes([b0, b1]),
            }),
        }
    }
}

impl core::fmt::Display for LogEntry {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mode = |code: u16| {
            let mode = u8::try_from(code).ok().and_then(NodeMode::from_code);
            mode.map_or("?", NodeMode::name)
        };
        let (a, b) = (self.a, self.b);
        let mut rest = self.event.text();
        while let Some((before, behind)) = rest.split_once('{') {
            f.write_str(before)?;
            let (argument, tail) = behind.split_once('}').unwrap_or((behind, ""));
            match (self.event, argument) {
                (LogEvent::Mode, "a") => f.write_str(mode(u16::from(a)))?,
                (LogEvent::Mode | LogEvent::Fault, "b") => f.write_str(mode(b))?,
                (LogEvent::Fault, "a") => {
                    f.write_str(Fault::from_code(a).map_or("?", Fault::name))?;
                }
                (
                    LogEvent::Precharged | LogEvent::PrechargeMoved | LogEvent::PrechargeLate,
                    "b",
                ) => write!(f, "{b}")?,
                (_, "a") => write!(f, "{a}")?,
                _ => write!(f, "0x{b:04X}")?,
            }
            rest = tail;
        }
        f.write_str(rest)
    }
}

impl LogRecords {
    /// The records, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = LogEntry> {
        let (entries, _) = self.entries.as_chunks::<ENTRY_LEN>();
        entries.iter().copied().filter_map(LogEntry::from_bytes)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn records_are_numbers_on_the_wire_and_sentences_at_the_reader() {
        let said = |event, a, b| {
            let entry = LogEntry {
                time_us: 0x0403_0201,
                event,
                a,
                b,
            };
            assert_eq!(LogEntry::from_bytes(entry.to_bytes()), Some(entry));
            entry.to_string()
        };
        let tracking = u16::from(NodeMode::Tracking.code());
        assert_eq!(
            said(LogEvent::Mode, NodeMode::Armed.code(), tracking),
            "The mode changed from Armed to Tracking."
        );
        assert_eq!(
            said(LogEvent::Fault, Fault::NoMotion.code(), tracking),
            "Fault NoMotion was latched in mode Tracking."
        );
        assert_eq!(
            said(LogEvent::Parameter, 0, 0x0101),
            "Parameter 0x0101 was set."
        );
        assert_eq!(
            said(LogEvent::Mode, 99, 300),
            "The mode changed from ? to ?."
        );
        assert_eq!(LogEntry::from_bytes([0; 8]), None);
        assert_eq!(LogEntry::from_bytes([1, 2, 3, 4, 200, 0, 0, 0]), None);
    }
}
