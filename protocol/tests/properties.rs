//! Properties that hold for every frame and every chunking.

mod common;

use common::vectors;
use proptest::prelude::*;
use wheeleg_protocol::{
    Address, Decoder, Envelope, Frame, FrameError, Header, MAX_ENCODED, MAX_PAYLOAD, Message,
    VERSION, encode,
};

type Seen = Vec<Result<(Header, Vec<u8>), FrameError>>;

fn keep(result: Result<Frame<'_>, FrameError>) -> Result<(Header, Vec<u8>), FrameError> {
    result.map(|frame| (frame.header, frame.payload.to_vec()))
}

fn header() -> impl Strategy<Value = Header> {
    (any::<u8>(), 0..=8_u8, 0..=9_u8, any::<u16>()).prop_map(
        |(message_type, source, destination, sequence)| Header {
            version: VERSION,
            message_type,
            source: Address::new(source).expect("0-8"),
            destination: Address::new(destination).unwrap_or(Address::BROADCAST),
            sequence,
        },
    )
}

/// Payloads with many zeros and long runs without any.
fn payload() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        prop::collection::vec(any::<u8>(), 0..=MAX_PAYLOAD),
        prop::collection::vec(0..3_u8, 0..=MAX_PAYLOAD),
        prop::collection::vec(1..=255_u8, 0..=MAX_PAYLOAD),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn frames_round_trip_with_any_payload(header in header(), payload in payload()) {
        let mut buffer = [0; MAX_ENCODED];
        let bytes = encode(&header, &payload, &mut buffer).expect("fits");
        prop_assert_eq!(bytes.len(), wheeleg_protocol::encoded_len(payload.len()));
        let inside = &bytes[1..bytes.len() - 1];
        prop_assert!(bytes[0] == 0 && bytes[bytes.len() - 1] == 0 && !inside.contains(&0));
        let mut seen: Seen = Vec::new();
        Decoder::new().push_slice(bytes, |result| seen.push(keep(result)));
        prop_assert_eq!(seen, vec![Ok((header, payload))]);
    }

    #[test]
    fn chunking_does_not_matter(
        stretches in prop::collection::vec((header(), payload(), prop::collection::vec(any::<u8>(), 0..30)), 1..6),
        cuts in prop::collection::vec(1..50_usize, 1..40),
    ) {
        let mut stream = Vec::new();
        for (header, payload, garbage) in &stretches {
            let mut buffer = [0; MAX_ENCODED];
            stream.extend(encode(header, payload, &mut buffer).expect("fits"));
            stream.extend(garbage);
        }
        let mut by_byte: Seen = Vec::new();
        let mut decoder = Decoder::new();
        for &byte in &stream {
            if let Some(result) = decoder.push(byte) {
                by_byte.push(keep(result));
            }
        }
        let mut in_chunks: Seen = Vec::new();
        let mut chunked = Decoder::new();
        let mut rest = stream.as_slice();
        for cut in cuts.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (chunk, tail) = rest.split_at((*cut).min(rest.len()));
            chunked.push_slice(chunk, |result| in_chunks.push(keep(result)));
            rest = tail;
        }
        prop_assert_eq!(&by_byte, &in_chunks);
        prop_assert_eq!(decoder.quality(), chunked.quality());
        // Every frame is there, in order, whatever came between them.
        let frames: Vec<_> = by_byte.into_iter().filter_map(Result::ok).collect();
        let sent: Vec<_> = stretches.into_iter().map(|(header, payload, _)| (header, payload)).collect();
        prop_assert_eq!(frames, sent);
    }

    /// Any payload of the right size: parse fails, or gives exactly these bytes back.
    #[test]
    fn parse_and_emit_are_inverse(which in 0..1000_usize, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6)) {
        let vectors = vectors();
        let original = &vectors.accepted[which % vectors.accepted.len()];
        let mut kept = None;
        Decoder::new().push_slice(&original.bytes, |result| kept = keep(result).ok());
        let (header, mut payload) = kept.expect("valid");
        for (index, value) in changes {
            if !payload.is_empty() {
                let at = index.index(payload.len());
                payload[at] = value;
            }
        }
        let frame = Frame { header, payload: &payload };
        if let Ok(message) = Message::parse(&frame) {
            let mut expected = [0; MAX_ENCODED];
            let expected = encode(&header, &payload, &mut expected).expect("fits");
            let mut again = [0; MAX_ENCODED];
            let again = message.emit_as(header.version, Envelope::from(header), &mut again).expect("fits");
            prop_assert_eq!(again, expected);
        }
    }

    #[test]
    fn any_payload_parses_or_fails_without_panic(header in header(), payload in payload()) {
        let frame = Frame { header, payload: &payload };
        if let Err(error) = Message::parse(&frame) {
            prop_assert!(!error.to_string().is_empty());
            prop_assert!(!error.nack_reason().text().is_empty());
        }
    }
}
