//! A board that was built from another interface definition.

use wheeleg_protocol::{Decoder, Envelope, MAX_ENCODED, Message, SCHEMA_HASH};

use wheeleg_interface::archive;

/// The interface definition of such a board: the newest that is not this program's.
fn other() -> u64 {
    archive::newest_earlier().unwrap_or(!SCHEMA_HASH)
}

/// A frame as such a board sends it: its Identity names another hash.
pub(super) fn of_other(bytes: Vec<u8>) -> Vec<u8> {
    let mut decoder = Decoder::new();
    for byte in &bytes {
        let Some(Ok(frame)) = decoder.push(*byte) else {
            continue;
        };
        let envelope = Envelope::from(frame.header);
        if let Ok(Message::Identity(mut identity)) = Message::parse(&frame) {
            identity.schema_hash = other();
            let mut buffer = [0; MAX_ENCODED];
            let message = Message::from(identity);
            if let Ok(changed) = message.emit(envelope, &mut buffer) {
                return changed.to_vec();
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::{Ack, Address, BoardKind, Identity};

    fn sent(message: impl Into<Message>) -> Vec<u8> {
        let envelope = Envelope {
            source: Address::new(4).expect("a joint"),
            destination: Address::MASTER,
            sequence: 9,
        };
        let mut buffer = [0; MAX_ENCODED];
        message
            .into()
            .emit(envelope, &mut buffer)
            .expect("fits")
            .to_vec()
    }

    #[test]
    fn an_identity_names_another_hash_and_the_rest_is_untouched() {
        let identity = Identity {
            board: BoardKind::Joint,
            address: Address::new(4).expect("a joint"),
            firmware: [1, 2, 3],
            schema_hash: SCHEMA_HASH,
            unique_id: [4; 12],
        };
        let other = Identity {
            schema_hash: other(),
            ..identity
        };
        assert_ne!(other.schema_hash, SCHEMA_HASH);
        assert_eq!(of_other(sent(identity)), sent(other));
        let ack = sent(Ack { request: 0x11 });
        assert_eq!(of_other(ack.clone()), ack);
    }
}
