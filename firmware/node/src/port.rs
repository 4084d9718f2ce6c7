//! The bus side of a board: bytes in, messages out, answers queued.
//!
//! The receiver is off while the board's own driver is on, so the board never hears itself: a frame with its own
//! address as the source comes from another board with the same straps.

use crate::transmission::Transmission;
use heapless::Vec;
use wheeleg_protocol::{
    Address, Decoder, Envelope, LinkQuality, MAX_ENCODED, Message, ParseError, Sync,
};
use wheeleg_units::Micros;

/// What a frame means to this board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Incoming {
    /// The set-points of all nodes.
    Sync(Sync),
    /// A frame from the master to this board, whatever its payload.
    Addressed(Envelope, u8, Result<Message, ParseError>),
    /// A frame that claims to come from this board.
    AddressConflict,
}

/// Decoder and transmit queue of one board.
#[derive(Clone, Debug)]
pub struct BusPort {
    address: Address,
    decoder: Decoder,
    slot_reply: Option<Transmission>,
    answer: Option<Transmission>,
    unsent: u32,
}

impl BusPort {
    /// The port of the board at `address`.
    pub const fn new(address: Address) -> Self {
        Self {
            address,
            decoder: Decoder::new(),
            slot_reply: None,
            answer: None,
            unsent: 0,
        }
    }

    /// Takes bytes from the front of `bytes`, which is shortened by what was taken, up to the end of the next frame for
    /// this board. Returns what that frame means to the board.
    pub fn receive(&mut self, bytes: &mut &[u8]) -> Option<Incoming> {
        while !bytes.is_empty() {
            let incoming = self.receive_one(bytes);
            if incoming.is_some() {
                return incoming;
            }
        }
        None
    }

    /// As [`Self::receive`], up to the end of the next frame for any board.
    fn receive_one(&mut self, bytes: &mut &[u8]) -> Option<Incoming> {
        let frame = self.decoder.next(bytes)?.ok()?;
        let envelope = Envelope::from(frame.header);
        if envelope.source == self.address {
            return Some(Incoming::AddressConflict);
        }
        // Only the master makes requests; an answer to anybody else would disturb the line.
        if envelope.source != Address::MASTER {
            return None;
        }
        if envelope.destination == self.address {
            let message = Message::parse_to_node(&frame);
            return Some(Incoming::Addressed(
                envelope,
                frame.header.message_type,
                message,
            ));
        }
        if envelope.destination == Address::BROADCAST
            && let Ok(Message::Sync(sync)) = Message::parse_to_node(&frame)
        {
            return Some(Incoming::Sync(sync));
        }
        None
    }

    /// Queues the slot reply of this cycle; an older unsent one is dropped and counted.
    pub fn queue_slot_reply(&mut self, message: &Message, start_at: Micros) {
        let envelope = Envelope {
            source: self.address,
            destination: Address::MASTER,
            sequence: 0,
        };
        let replaced = self.slot_reply.is_some();
        self.unsent = self.unsent.saturating_add(u32::from(replaced));
        encode(&mut self.slot_reply, message, envelope, start_at, true);
    }

    /// Queues the answer to a request. The bus has one requester, so an older unsent answer is dropped and counted.
    pub fn queue_answer(&mut self, message: &Message, request: Envelope, start_at: Micros) {
        let replaced = self.answer.is_some();
        self.unsent = self.unsent.saturating_add(u32::from(replaced));
        let envelope = request.reply(self.address);
        encode(&mut self.answer, message, envelope, start_at, false);
    }

    /// The next frame to send. An answer goes before a slot reply, because it is due at once.
    #[inline]
    pub fn take(&mut self) -> Option<Transmission> {
        // Called in every turn of the main loop: nothing is copied if there is no frame.
        if self.answer.is_none() && self.slot_reply.is_none() {
            return None;
        }
        self.take_waiting()
    }

    #[inline(never)]
    fn take_waiting(&mut self) -> Option<Transmission> {
        self.answer.take().or_else(|| self.slot_reply.take())
    }

    /// A frame was taken but not sent, because its time had passed.
    pub(crate) fn missed(&mut self) {
        self.unsent = self.unsent.saturating_add(1);
    }

    /// Own address.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// Frames and errors seen so far.
    pub const fn quality(&self) -> &LinkQuality {
        self.decoder.quality()
    }

    /// Frames that were replaced before the board took them, or were taken too late to be sent.
    pub const fn unsent(&self) -> u32 {
        self.unsent
    }
}

/// Encodes the frame directly into its place, without copying the buffer.
fn encode(
    place: &mut Option<Transmission>,
    message: &Message,
    envelope: Envelope,
    start_at: Micros,
    in_slot: bool,
) {
    let transmission = place.insert(Transmission {
        start_at,
        in_slot,
        bytes: Vec::new(),
    });
    let bytes = &mut transmission.bytes;
    let room = bytes.resize_default(MAX_ENCODED);
    match (
        room,
        message.emit_from_node(envelope, bytes).map(<[u8]>::len),
    ) {
        (Ok(()), Ok(length)) => bytes.truncate(length),
        _ => *place = None,
    }
}
