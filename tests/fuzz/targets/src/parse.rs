//! Any payload below any header: parsing fails with a reason, or gives a
//! message whose bytes are exactly those that came in (P2, P8).

use wheeleg_protocol::{
    Address, Envelope, Frame, Header, MAX_ENCODED, MAX_PAYLOAD, Message, MessageType, ParseError,
    VERSION, encode, encoded_len,
};

use crate::reference::Sound;

/// Parses a sound frame and checks what parsing promises.
pub(crate) fn check(sound: &Sound) -> Result<Message, ParseError> {
    let header = Header {
        version: sound.version,
        message_type: sound.message_type,
        source: Address::new(sound.source).expect("a sound frame"),
        destination: Address::new(sound.destination).expect("a sound frame"),
        sequence: sound.sequence,
    };
    let payload = sound.payload.as_slice();
    let parsed = Message::parse(&Frame { header, payload });
    let code = sound.message_type;
    match (&parsed, MessageType::from_code(code)) {
        (Ok(message), Some(message_type)) => {
            assert_eq!(message.message_type(), message_type);
            assert_eq!(payload.len(), message_type.payload_len());
            assert!(message_type.may_go(header.source, header.destination));
            let mut room = [0; MAX_ENCODED];
            let expected = encode(&header, payload, &mut room).expect("it fits");
            assert_eq!(expected.len(), encoded_len(payload.len()));
            let mut room = [0; MAX_ENCODED];
            let again = message
                .emit_as(header.version, Envelope::from(header), &mut room)
                .expect("it fits");
            assert_eq!(again, expected, "other bytes for {message:?}");
        }
        (Ok(message), None) => panic!("{message:?} has the unknown type {code:#x}"),
        (Err(ParseError::UnknownType { .. }), found) => assert_eq!(found, None),
        (Err(error), found) => {
            let message_type = found.expect("known, or UnknownType");
            let length = payload.len() != message_type.payload_len();
            let route = !message_type.may_go(header.source, header.destination);
            let expected = match (length, route) {
                (true, _) => ParseError::Length {
                    message_type,
                    found: payload.len(),
                },
                (false, true) => ParseError::Route { message_type },
                (false, false) => ParseError::Value { message_type },
            };
            assert_eq!(*error, expected);
        }
    }
    if let Err(error) = &parsed {
        assert!(!error.to_string().is_empty());
        assert!(!error.nack_reason().text().is_empty());
    }
    parsed
}

/// Byte 0 is the type, byte 1 the source, byte 2 the destination; the rest is
/// the payload, cut or filled to the type's size unless byte 3 is odd.
pub fn run(data: &[u8]) {
    let Some((&[code, source, destination, free], payload)) = data.split_first_chunk() else {
        return;
    };
    let mut payload = payload[..payload.len().min(MAX_PAYLOAD)].to_vec();
    if free & 1 == 0
        && let Some(message_type) = MessageType::from_code(code)
    {
        payload.resize(message_type.payload_len(), 0);
    }
    let destination = if destination > 8 { 255 } else { destination };
    // The right way for three quarters of the inputs.
    let (source, destination) = match (free & 6, code) {
        (0, _) => (source % 9, destination),
        (_, 0x01) => (0, 255),
        (_, 0x02 | 0x80..) => (1 + source % 8, 0),
        _ => (0, 1 + destination % 8),
    };
    let sound = Sound {
        version: VERSION,
        message_type: code,
        source,
        destination,
        sequence: u16::from(free),
        payload,
    };
    if let Ok(message) = check(&sound) {
        assert!(!format!("{message:?}").is_empty());
    }
}
