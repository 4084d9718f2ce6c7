//! Reads the vector file; shared by the test programs.
#![allow(dead_code, reason = "each test program uses its part")]

use wheeleg_protocol::{Address, Envelope};

/// A frame that must be accepted, and its contents.
pub(crate) struct Accepted {
    /// Bytes on the line.
    pub(crate) bytes: Vec<u8>,
    /// Version in the header.
    pub(crate) version: u8,
    /// Type in the header.
    pub(crate) message_type: u8,
    /// Source, destination, sequence.
    pub(crate) envelope: Envelope,
    /// Debug text of the message.
    pub(crate) text: String,
}

/// The vector file.
pub(crate) struct Vectors {
    /// Frames that must be accepted.
    pub(crate) accepted: Vec<Accepted>,
    /// Bytes, reason, description of frames that must be rejected.
    pub(crate) rejected: Vec<(Vec<u8>, String, String)>,
}

/// Reads the vector file.
pub(crate) fn vectors() -> Vectors {
    let file: serde_json::Value =
        serde_json::from_str(include_str!("../vectors/frames.json")).expect("valid JSON");
    let text =
        |value: &serde_json::Value, key: &str| value[key].as_str().expect("a text").to_owned();
    let number = |value: &serde_json::Value, key: &str| value[key].as_u64().expect("a number");
    let list = |key: &str| file[key].as_array().expect("a list").clone();
    Vectors {
        accepted: list("accepted")
            .iter()
            .map(|v| Accepted {
                bytes: unhex(&text(v, "hex")),
                version: number(v, "version") as u8,
                message_type: number(v, "type") as u8,
                envelope: Envelope {
                    source: Address::new(number(v, "source") as u8).expect("an address"),
                    destination: Address::new(number(v, "destination") as u8).expect("an address"),
                    sequence: number(v, "sequence") as u16,
                },
                text: text(v, "text"),
            })
            .collect(),
        rejected: list("rejected")
            .iter()
            .map(|v| (unhex(&text(v, "hex")), text(v, "reason"), text(v, "what")))
            .collect(),
    }
}

/// Bytes of a hex text; blanks and bars are skipped.
pub(crate) fn unhex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text
        .chars()
        .filter(|c| !c.is_whitespace() && *c != '|')
        .map(|c| c.to_digit(16).expect("a hex digit") as u8)
        .collect();
    digits
        .chunks(2)
        .map(|pair| pair[0] << 4 | pair[1])
        .collect()
}

/// Hex text, bytes separated by blanks.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let words: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    words.join(" ")
}

/// The way of a message in words.
pub(crate) fn envelope_text(envelope: Envelope) -> String {
    format!(
        "{} to {}, sequence {}",
        envelope.source, envelope.destination, envelope.sequence
    )
}
