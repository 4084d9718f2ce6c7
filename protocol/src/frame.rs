//! Frames: `00 · COBS(header · payload · CRC-32C) · 00`.
//!
//! | offset | bytes | header field |
//! |---|---|---|
//! | 0 | 1 | protocol version, [`VERSION`] |
//! | 1 | 1 | message type |
//! | 2 | 1 | source address |
//! | 3 | 1 | destination address |
//! | 4 | 2 | sequence, little-endian |
//! | 6 | 2 | payload length, little-endian |
//!
//! The CRC-32C (polynomial 0x1EDC6F41, reflected, initial value and final xor
//! of ones, check value 0xE3069283) covers header and payload and is sent
//! little-endian. The decoded length must be exactly header + length field +
//! CRC: together with the complemented CRC this closes the one-bit hole of
//! COBS with a plain CRC.
//!
//! # Never-panic contract
//!
//! No function here panics, allocates or recurses, for any input. [`crate::Decoder::push`]
//! does constant work for a byte inside a frame and at most [`MAX_DECODED`]
//! steps at a delimiter. After any garbage, the first valid frame behind a
//! delimiter is delivered; frames do not depend on how the bytes were chunked.

use crate::address::Address;
pub use crate::checksum::{Checksum, checksum};
use crate::message::MessageType;

/// Protocol version in byte 0 of the header.
///
/// The header layout, and the messages Identify, Identity and Nack, keep their
/// layout in every version, so that boards of different versions can name
/// each other's version instead of looking dead.
pub const VERSION: u8 = 1;
/// Header bytes.
pub const HEADER_LEN: usize = 8;
/// Checksum bytes.
pub const CRC_LEN: usize = 4;
/// Hard maximum of an encoded frame, both delimiters included.
pub const MAX_ENCODED: usize = 200;
/// Longest decoded frame: without two delimiters and one COBS code byte.
pub const MAX_DECODED: usize = MAX_ENCODED - 3;
/// Longest payload.
pub const MAX_PAYLOAD: usize = MAX_DECODED - HEADER_LEN - CRC_LEN;
/// The byte between frames.
pub const DELIMITER: u8 = 0;

// One COBS block holds 254 bytes: the overhead is one byte for every frame, and the encoded length depends
// only on the message type, never on the content.
const _: () = assert!(MAX_DECODED < 254);

/// Bytes on the line of a frame with this payload length, delimiters included.
#[must_use]
pub const fn encoded_len(payload_len: usize) -> usize {
    payload_len.saturating_add(HEADER_LEN + CRC_LEN + 3)
}

/// Contents of the header, without the length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Protocol version of the sender.
    pub version: u8,
    /// Message type, known or not.
    pub message_type: u8,
    /// Sender; never broadcast.
    pub source: Address,
    /// Receiver or broadcast.
    pub destination: Address,
    /// Sequence of a request, repeated by its answer; 0 in cyclic messages.
    pub sequence: u16,
}

/// A frame that passed every check of this layer.
///
/// A value of this type is always correct: known version (or one of the version-independent messages),
/// existing addresses, exact length, right CRC. The payload still has to pass [`crate::Message::parse`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The header.
    pub header: Header,
    /// The payload, of the length in the header.
    pub payload: &'a [u8],
}

/// Why a stretch of bytes between two delimiters is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameError {
    /// Longer than any frame; everything up to the delimiter was discarded.
    Overflow,
    /// The delimiter came inside a COBS block.
    Truncated,
    /// Shorter than header and CRC.
    Short,
    /// The checksum does not match.
    Crc,
    /// Sound frame of another protocol version.
    Version {
        /// Version of the sender.
        found: u8,
    },
    /// The length field does not match the number of bytes.
    Length,
    /// Source or destination is not an address of this bus.
    Address,
}

impl FrameError {
    /// One sentence for a person.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Overflow => "more bytes than a frame can have before the delimiter",
            Self::Truncated => "the delimiter came too early",
            Self::Short => "too few bytes for a frame",
            Self::Crc => "the checksum does not match",
            Self::Version { .. } => "the sender speaks another protocol version",
            Self::Length => "the length field does not match the number of bytes",
            Self::Address => "an address that does not exist on this bus",
        }
    }
}

impl core::fmt::Display for FrameError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.text())?;
        if let Self::Version { found } = self {
            write!(f, ": theirs is {found}, ours is {VERSION}")?;
        }
        Ok(())
    }
}

/// Why a frame could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EncodeError {
    /// The payload is longer than [`MAX_PAYLOAD`].
    PayloadTooLong,
    /// The buffer is too small; [`MAX_ENCODED`] bytes are always enough.
    BufferTooSmall,
    /// The source is the broadcast address.
    Source,
}

impl core::fmt::Display for EncodeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::PayloadTooLong => "the payload is longer than a frame can carry",
            Self::BufferTooSmall => "the buffer is too small for the frame",
            Self::Source => "the broadcast address cannot be a source",
        })
    }
}

/// Writes one frame into `out` and returns the bytes to send.
///
/// # Errors
/// [`EncodeError`]; `out` then holds nothing of use. Never panics.
pub fn encode<'a>(
    header: &Header,
    payload: &[u8],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    if payload.len() > MAX_PAYLOAD {
        return Err(EncodeError::PayloadTooLong);
    }
    if header.source == Address::BROADCAST {
        return Err(EncodeError::Source);
    }
    // MAX_PAYLOAD is far below 2^16: the cast keeps the value.
    let [len_low, len_high] = (payload.len() as u16).to_le_bytes();
    let [seq_low, seq_high] = header.sequence.to_le_bytes();
    let head: [u8; HEADER_LEN] = [
        header.version,
        header.message_type,
        header.source.raw(),
        header.destination.raw(),
        seq_low,
        seq_high,
        len_low,
        len_high,
    ];
    let total = encoded_len(payload.len());
    let out = out.get_mut(..total).ok_or(EncodeError::BufferTooSmall)?;
    // The slice has exactly this length, so the pieces below are always there.
    seal(&head, payload, out).ok_or(EncodeError::BufferTooSmall)?;
    Ok(out)
}

/// Fills `out` with delimiter, COBS code, header, payload, CRC and delimiter;
/// `None` if it is shorter than that.
fn seal(head: &[u8; HEADER_LEN], payload: &[u8], out: &mut [u8]) -> Option<()> {
    let (first, rest) = out.split_first_mut()?;
    let (last, rest) = rest.split_last_mut()?;
    (*first, *last) = (DELIMITER, DELIMITER);
    let (code, frame) = rest.split_first_mut()?;
    let (body, crc) = frame.split_last_chunk_mut::<CRC_LEN>()?;
    let (head_place, payload_place) = body.split_first_chunk_mut::<HEADER_LEN>()?;
    *head_place = *head;
    for (place, byte) in payload_place.iter_mut().zip(payload) {
        *place = *byte;
    }
    *crc = checksum(body).to_le_bytes();
    *code = cobs_in_place(frame);
    Some(())
}

/// COBS in place: every zero becomes the code of the block behind it; returns the code of the first block.
/// The frame is shorter than one COBS block (const assertion above), so no code is added in between.
fn cobs_in_place(frame: &mut [u8]) -> u8 {
    let mut code = 1_u8;
    for byte in frame.iter_mut().rev() {
        if *byte == 0 {
            *byte = code;
            code = 1;
        } else {
            code = code.wrapping_add(1);
        }
    }
    code
}

impl<'a> Frame<'a> {
    /// Checks the decoded bytes of one frame: length, CRC, version, addresses.
    ///
    /// # Errors
    /// [`FrameError`], in that order. Never panics.
    pub fn check(decoded: &'a [u8]) -> Result<Self, FrameError> {
        let (body, crc) = decoded
            .split_last_chunk::<CRC_LEN>()
            .ok_or(FrameError::Short)?;
        let (head, payload) = body
            .split_first_chunk::<HEADER_LEN>()
            .ok_or(FrameError::Short)?;
        if checksum(body) != u32::from_le_bytes(*crc) {
            return Err(FrameError::Crc);
        }
        let &[
            version,
            message_type,
            source,
            destination,
            seq_low,
            seq_high,
            len_low,
            len_high,
        ] = head;
        if version != VERSION && !MessageType::is_version_independent(message_type) {
            return Err(FrameError::Version { found: version });
        }
        if usize::from(u16::from_le_bytes([len_low, len_high])) != payload.len() {
            return Err(FrameError::Length);
        }
        let source = Address::new(source).ok_or(FrameError::Address)?;
        let destination = Address::new(destination).ok_or(FrameError::Address)?;
        if source == Address::BROADCAST {
            return Err(FrameError::Address);
        }
        Ok(Self {
            header: Header {
                version,
                message_type,
                source,
                destination,
                sequence: u16::from_le_bytes([seq_low, seq_high]),
            },
            payload,
        })
    }
}
