//! Frames to messages and back.

use super::{Envelope, Message, MessageType};
use crate::fields::NackReason;
use crate::frame::{self, EncodeError, Frame, Header, MAX_PAYLOAD, VERSION};

/// Why the payload of a sound frame is not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ParseError {
    /// No such message type in this version.
    UnknownType {
        /// The number in the header.
        code: u8,
    },
    /// The payload does not have the exact size of its type.
    Length {
        /// The type.
        message_type: MessageType,
        /// Bytes found.
        found: usize,
    },
    /// The message may not go this way: SYNC goes from the master to all, a reply
    /// or an answer from a node to the master, a request from the master to a node.
    Route {
        /// The type.
        message_type: MessageType,
    },
    /// A field is outside its range, or a reserved bit is set.
    Value {
        /// The type.
        message_type: MessageType,
    },
}

impl ParseError {
    /// The reason with which a node refuses such a request of the master.
    ///
    /// Only the master is ever answered: two boards could otherwise answer each
    /// other's refusals without end.
    #[must_use]
    pub const fn nack_reason(self) -> NackReason {
        match self {
            // A board knows no request that goes another way than from the master to it.
            Self::UnknownType { .. } | Self::Route { .. } => NackReason::UnknownMessage,
            Self::Length { .. } => NackReason::BadLength,
            Self::Value { .. } => NackReason::OutOfRange,
        }
    }
}

impl core::fmt::Display for ParseError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::UnknownType { code } => write!(f, "message type 0x{code:02X} does not exist"),
            Self::Length {
                message_type,
                found,
            } => write!(
                f,
                "{} has {} payload bytes, found {found}",
                message_type.name(),
                message_type.payload_len()
            ),
            Self::Route { message_type } => write!(
                f,
                "{} may not go from this source to this destination",
                message_type.name()
            ),
            Self::Value { message_type } => {
                write!(f, "{} holds a value outside its range", message_type.name())
            }
        }
    }
}

impl Message {
    /// The message in a checked frame.
    ///
    /// # Errors
    /// [`ParseError`]: unknown type, wrong size, wrong way, or a value outside its
    /// range, in this order. Never panics, for any payload.
    pub fn parse(frame: &Frame<'_>) -> Result<Self, ParseError> {
        Self::parse_for::<false>(frame)
    }

    /// As [`Self::parse`], for a board: a message that no node may receive is
    /// [`ParseError::Route`], whoever sent it.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn parse_to_node(frame: &Frame<'_>) -> Result<Self, ParseError> {
        Self::parse_for::<true>(frame)
    }

    fn parse_for<const TO_NODE: bool>(frame: &Frame<'_>) -> Result<Self, ParseError> {
        let code = frame.header.message_type;
        let message_type = MessageType::from_code(code).ok_or(ParseError::UnknownType { code })?;
        if frame.payload.len() != message_type.payload_len() {
            return Err(ParseError::Length {
                message_type,
                found: frame.payload.len(),
            });
        }
        let to_nobody = TO_NODE && message_type.comes_from_nodes();
        if to_nobody || !message_type.may_go(frame.header.source, frame.header.destination) {
            return Err(ParseError::Route { message_type });
        }
        match Self::read_payload::<TO_NODE>(message_type, frame.payload) {
            Ok((message, [])) => Ok(message),
            _ => Err(ParseError::Value { message_type }),
        }
    }

    /// Writes the message as a frame into `out`; returns the bytes to send.
    ///
    /// [`crate::MAX_ENCODED`] bytes are always enough.
    ///
    /// # Errors
    /// [`EncodeError`]: buffer too small, or broadcast as the source. Never panics.
    pub fn emit<'a>(&self, envelope: Envelope, out: &'a mut [u8]) -> Result<&'a [u8], EncodeError> {
        self.emit_as(VERSION, envelope, out)
    }

    /// As [`Self::emit`], for a board: a message that no node sends is refused.
    ///
    /// # Errors
    /// As [`Self::emit`]; [`EncodeError::Source`] for a message of the master.
    pub fn emit_from_node<'a>(
        &self,
        envelope: Envelope,
        out: &'a mut [u8],
    ) -> Result<&'a [u8], EncodeError> {
        if !self.message_type().comes_from_nodes() {
            return Err(EncodeError::Source);
        }
        self.emit_for::<true>(VERSION, envelope, out)
    }

    /// As [`Self::emit`], with another protocol version in the header. For tests
    /// and tools that play a board of another version.
    ///
    /// # Errors
    /// As [`Self::emit`].
    pub fn emit_as<'a>(
        &self,
        version: u8,
        envelope: Envelope,
        out: &'a mut [u8],
    ) -> Result<&'a [u8], EncodeError> {
        self.emit_for::<false>(version, envelope, out)
    }

    fn emit_for<'a, const FROM_NODE: bool>(
        &self,
        version: u8,
        envelope: Envelope,
        out: &'a mut [u8],
    ) -> Result<&'a [u8], EncodeError> {
        let mut scratch = [0_u8; MAX_PAYLOAD];
        // Every payload fits (const assertions above): the error cannot occur.
        let payload = self
            .write_payload::<FROM_NODE>(&mut scratch)
            .map_err(|_| EncodeError::PayloadTooLong)?;
        let header = Header {
            version,
            message_type: self.message_type().code(),
            source: envelope.source,
            destination: envelope.destination,
            sequence: envelope.sequence,
        };
        frame::encode(&header, payload, out)
    }

    /// Bytes on the line of a message of this type, delimiters included.
    #[must_use]
    pub const fn encoded_len(message_type: MessageType) -> usize {
        frame::encoded_len(message_type.payload_len())
    }
}
