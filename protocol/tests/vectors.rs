//! Conformance vectors made by an independent implementation (Python, see
//! `vectors/make_vectors.py`): every one is decoded, and every accepted one is
//! encoded again.

mod common;

use common::{envelope_text, vectors};
use wheeleg_protocol::{Decoder, Message, MessageType, checksum};

/// The crate's result for the bytes: the only frame, or why there is none.
fn judge(bytes: &[u8]) -> Result<(u8, String, Message), String> {
    let mut decoder = Decoder::new();
    let mut results = Vec::new();
    decoder.push_slice(bytes, |result| {
        results.push(match result {
            Err(error) => Err(format!("{error:?}")),
            Ok(frame) => match Message::parse(&frame) {
                Ok(message) => Ok((
                    frame.header.version,
                    envelope_text(frame.header.into()),
                    message,
                )),
                Err(error) => Err(format!("{error:?}")),
            },
        });
    });
    assert_eq!(results.len(), 1, "one result for one frame");
    results.pop().expect("just counted")
}

#[test]
fn the_checksum_is_crc_32c() {
    assert_eq!(checksum(b"123456789"), 0xE306_9283);
    assert_eq!(checksum(b""), 0);
    // RFC 3720 (iSCSI), section B.4.
    assert_eq!(checksum(&[0; 32]), 0x8A91_36AA);
    assert_eq!(checksum(&[0xFF; 32]), 0x62A8_AB43);
}

#[test]
fn accepted_vectors_decode_and_encode() {
    let vectors = vectors();
    assert!(vectors.accepted.len() + vectors.rejected.len() >= 200);
    for vector in &vectors.accepted {
        let (version, envelope, message) =
            judge(&vector.bytes).unwrap_or_else(|error| panic!("{}: {error}", vector.text));
        assert_eq!(format!("{message:?}"), vector.text);
        assert_eq!(version, vector.version);
        assert_eq!(envelope, envelope_text(vector.envelope));
        assert_eq!(message.message_type().code(), vector.message_type);
        let mut buffer = [0xAA; 200];
        let encoded = message
            .emit_as(version, vector.envelope, &mut buffer)
            .expect("200 bytes are enough");
        assert_eq!(encoded, vector.bytes, "{}", vector.text);
        assert_eq!(encoded.len(), Message::encoded_len(message.message_type()));
    }
    for message_type in MessageType::ALL {
        assert!(
            vectors
                .accepted
                .iter()
                .any(|v| v.message_type == message_type.code()),
            "no vector for {}",
            message_type.name()
        );
    }
}

#[test]
fn rejected_vectors_give_their_reason() {
    let vectors = vectors();
    for (bytes, reason, what) in &vectors.rejected {
        match judge(bytes) {
            Ok((_, _, message)) => panic!("{what}: accepted as {message:?}"),
            Err(found) => assert_eq!(&found, reason, "{what}"),
        }
    }
    for kind in [
        "Overflow",
        "Truncated",
        "Short",
        "Crc",
        "Version",
        "Length",
        "Address",
        "UnknownType",
        "Route",
        "Value",
    ] {
        assert!(
            vectors.rejected.iter().any(|(_, r, _)| r.starts_with(kind)),
            "no vector for {kind}"
        );
    }
}

#[test]
fn the_quality_counters_count_each_kind() {
    let vectors = vectors();
    let mut decoder = Decoder::new();
    for (bytes, ..) in &vectors.rejected {
        decoder.push_slice(bytes, |_| {});
    }
    let count = |kind: &str| {
        vectors
            .rejected
            .iter()
            .filter(|(_, reason, _)| {
                reason == kind || (kind == "Version" && reason.starts_with(kind))
            })
            .count() as u32
    };
    let quality = *decoder.quality();
    assert_eq!(quality.overflow, count("Overflow"));
    assert_eq!(quality.truncated, count("Truncated"));
    assert_eq!(quality.short, count("Short"));
    assert_eq!(quality.crc, count("Crc"));
    assert_eq!(quality.version, count("Version"));
    assert_eq!(quality.length, count("Length"));
    assert_eq!(quality.address, count("Address"));
    assert_eq!(
        quality.errors() + quality.frames,
        vectors.rejected.len() as u32,
        "frames here are sound ones with an unknown type or a bad payload"
    );
    decoder.clear_quality();
    assert_eq!(decoder.quality().errors(), 0);
}
