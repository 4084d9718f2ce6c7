//! Boards on mocks, with a master that speaks to them frame by frame.
// The fuzz targets use a part of this.
#![allow(dead_code, unreachable_pub)]

pub mod joint;
pub mod mock;
pub mod wheel;

use wheeleg_node::Transmission;
use wheeleg_protocol::{
    Address, Arm, Decoder, Envelope, MAX_ENCODED, Message, NackReason, SCHEMA_HASH,
};

pub const ARM: Message = Message::Arm(Arm {
    schema_hash: SCHEMA_HASH,
});

/// Bytes of a message from `source`.
pub fn frame_from(
    source: Address,
    destination: Address,
    sequence: u16,
    message: &Message,
) -> Vec<u8> {
    let envelope = Envelope {
        source,
        destination,
        sequence,
    };
    message
        .emit(envelope, &mut [0; MAX_ENCODED])
        .expect("every message fits")
        .to_vec()
}

/// Bytes of a message from the master.
pub fn frame(destination: Address, sequence: u16, message: &Message) -> Vec<u8> {
    frame_from(Address::MASTER, destination, sequence, message)
}

/// The one message in a transmission.
pub fn decode(transmission: &Transmission) -> (Envelope, Message) {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    decoder.push_slice(&transmission.bytes, |result| {
        let frame = result.expect("a board sends sound frames");
        let message = Message::parse(&frame).expect("a board sends known messages");
        found.push((Envelope::from(frame.header), message));
    });
    assert_eq!(found.len(), 1, "one frame per transmission");
    found[0]
}

/// The reason of a refusal, or `None` for any other answer.
pub fn refusal(answer: &Message) -> Option<NackReason> {
    match answer {
        Message::Nack(nack) => Some(nack.reason),
        _ => None,
    }
}
