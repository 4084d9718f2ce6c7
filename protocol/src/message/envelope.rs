//! Sender and receiver of a message.

use crate::address::Address;
use crate::frame::Header;

/// Sender and receiver of a message, and its sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Envelope {
    /// Sender; never broadcast.
    pub source: Address,
    /// Receiver.
    pub destination: Address,
    /// Sequence of the request; answers repeat it; 0 in cyclic messages.
    pub sequence: u16,
}

impl Envelope {
    /// The envelope of the answer: source and destination swapped.
    #[must_use]
    pub const fn reply(self, own: Address) -> Self {
        Self {
            source: own,
            destination: self.source,
            sequence: self.sequence,
        }
    }
}

impl From<Header> for Envelope {
    fn from(header: Header) -> Self {
        Self {
            source: header.source,
            destination: header.destination,
            sequence: header.sequence,
        }
    }
}
