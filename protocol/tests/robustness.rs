//! A bad line and bad neighbours cannot harm the decoder.

mod common;

use common::vectors;
use wheeleg_protocol::{
    Address, Decoder, Envelope, FrameError, HEADER_LEN, MAX_ENCODED, MAX_PAYLOAD, Message,
    MessageType, checksum,
};

/// SplitMix64 (Steele, Lea, Flood 2014): seeded, the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }
}

/// Two hundred frames with every message type among them.
fn two_hundred() -> Vec<Vec<u8>> {
    let frames: Vec<Vec<u8>> = vectors()
        .accepted
        .into_iter()
        .take(200)
        .map(|vector| vector.bytes)
        .collect();
    assert_eq!(frames.len(), 200);
    for message_type in MessageType::ALL {
        assert!(
            frames
                .iter()
                .any(|frame| decode_one(frame).is_some_and(|m| m.1.message_type() == *message_type)),
            "{} is missing",
            message_type.name()
        );
    }
    frames
}

/// Work of a test: the default, or what `cargo xtask deep` asks for by `name`.
fn amount(name: &str, default: usize) -> usize {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

/// Frames of every type, `per_type` of each: the vectors, and then vectors with another sequence and other
/// payload bytes, as long as they are sound.
fn frames_of_every_type(per_type: usize, random: &mut Random) -> Vec<Vec<u8>> {
    let vectors = vectors().accepted;
    let mut frames = Vec::new();
    for message_type in MessageType::ALL {
        let code = message_type.code();
        let seeds: Vec<_> = vectors.iter().filter(|v| v.message_type == code).collect();
        assert!(!seeds.is_empty(), "{}", message_type.name());
        for index in 0..per_type {
            let seed = seeds[index % seeds.len()];
            frames.push(if index < seeds.len() {
                seed.bytes.clone()
            } else {
                variant(&seed.bytes, random)
            });
        }
    }
    frames
}

fn variant(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut made = None;
    Decoder::new().push_slice(bytes, |result| {
        let frame = result.expect("a vector");
        let mut header = frame.header;
        header.sequence = random.next() as u16;
        let mut payload = frame.payload.to_vec();
        for _ in 0..payload.len().min(8) {
            let mut trial = payload.clone();
            let at = random.below(trial.len());
            trial[at] = random.next() as u8;
            let frame = wheeleg_protocol::Frame {
                header,
                payload: &trial,
            };
            if Message::parse(&frame).is_ok() {
                payload = trial;
            }
        }
        let mut room = [0; MAX_ENCODED];
        let line = wheeleg_protocol::encode(&header, &payload, &mut room).expect("it fits");
        made = Some(line.to_vec());
    });
    made.expect("a vector")
}

type Decoded = (Envelope, Message);

fn decode_one(bytes: &[u8]) -> Option<Decoded> {
    let mut found = None;
    Decoder::new().push_slice(bytes, |result| {
        found = result
            .ok()
            .and_then(|frame| Some((frame.header.into(), Message::parse(&frame).ok()?)));
    });
    found
}

#[test]
fn no_one_or_two_bit_flip_makes_another_frame() {
    let mut decoder = Decoder::new();
    let (mut flips, mut same, mut wrong, mut other_type) = (0_u64, 0_u64, 0_u64, 0_u64);
    let per_type = amount("WHEELEG_FLIP_FRAMES_PER_TYPE", 8);
    for frame in frames_of_every_type(per_type, &mut Random(2003)) {
        let original = decode_one(&frame).expect("valid");
        let mut bytes = frame.clone();
        let mut offer = |bytes: &[u8]| {
            flips += 1;
            let mut look = |result: Result<wheeleg_protocol::Frame<'_>, FrameError>| {
                let Ok(frame) = result else { return };
                match Message::parse(&frame) {
                    Ok(message) if (frame.header.into(), message) == original => same += 1,
                    Ok(_) => wrong += 1,
                    // A sound frame of no known kind is a wrong frame, too.
                    Err(_) => other_type += 1,
                }
            };
            decoder.push_slice(bytes, &mut look);
            // The delimiter in front of the next frame.
            decoder.push_slice(&[0], &mut look);
        };
        let bits = frame.len() * 8;
        for first in 0..bits {
            bytes[first / 8] ^= 1 << (first % 8);
            offer(&bytes);
            for second in first + 1..bits {
                bytes[second / 8] ^= 1 << (second % 8);
                offer(&bytes);
                bytes[second / 8] ^= 1 << (second % 8);
            }
            bytes[first / 8] ^= 1 << (first % 8);
        }
        assert_eq!(bytes, frame);
    }
    println!("{flips} flips: {wrong} wrong, {other_type} unknown, {same} unchanged");
    assert!(flips > 1_000_000);
    assert_eq!((wrong, other_type), (0, 0));
    // Only COBS could hide a flip, and it hides none.
    assert_eq!(same, 0);
}

#[test]
fn a_million_random_streams_give_no_wrong_frame() {
    let frames = two_hundred();
    let originals: Vec<Decoded> = frames
        .iter()
        .map(|frame| decode_one(frame).expect("valid"))
        .collect();
    let mut random = Random(2003);
    let mut decoder = Decoder::new();
    let (mut delivered, mut errors, mut planted) = (0_u64, 0_u64, 0_u64);
    let mut stream = Vec::with_capacity(512);
    let mut allowed = Vec::with_capacity(2);
    let streams = amount("WHEELEG_RANDOM_STREAMS", 1_000_000);
    for _ in 0..streams {
        stream.clear();
        allowed.clear();
        let mut must_arrive = false;
        match random.below(5) {
            // Noise of every value; short and long streams.
            0 => {
                let longest = [4, 40, 300][random.below(3)];
                let len = random.below(longest);
                stream.extend((0..len).map(|_| random.next() as u8));
            }
            // Noise of the values that matter to COBS.
            1 => {
                let len = random.below(120);
                stream.extend((0..len).map(|_| [0, 0, 1, 2, 3, 12, 0xFE, 0xFF][random.below(8)]));
            }
            // A frame with a few bytes changed, lost or inserted.
            2 => {
                let which = random.below(frames.len());
                allowed.push(which);
                stream.extend(&frames[which]);
                for _ in 0..=random.below(4) {
                    let at = random.below(stream.len());
                    match random.below(3) {
                        0 => stream[at] = random.next() as u8,
                        1 if stream.len() > 1 => {
                            stream.remove(at);
                        }
                        _ => stream.insert(at, random.next() as u8),
                    }
                }
            }
            // The head of one frame and the tail of another.
            3 => {
                let (head, tail) = (random.below(frames.len()), random.below(frames.len()));
                allowed.extend([head, tail]);
                stream.extend(&frames[head][..random.below(frames[head].len())]);
                stream.extend(&frames[tail][random.below(frames[tail].len())..]);
            }
            // Garbage, then a whole frame: its leading delimiter ends the garbage.
            _ => {
                let len = random.below(250);
                stream.extend((0..len).map(|_| random.next() as u8));
                let which = random.below(frames.len());
                allowed.push(which);
                stream.extend(&frames[which]);
                must_arrive = true;
                planted += 1;
            }
        }
        // The line falls idle between streams, except now and then.
        if random.below(8) > 0 {
            stream.push(0);
        }
        let mut arrived = false;
        let mut rest = stream.as_slice();
        while !rest.is_empty() {
            let (chunk, tail) = rest.split_at(1 + random.below(rest.len()));
            decoder.push_slice(chunk, |result| match result {
                Ok(frame) => {
                    delivered += 1;
                    let message = Message::parse(&frame).expect("only whole frames get here");
                    let found = (frame.header.into(), message);
                    assert!(
                        allowed.iter().any(|which| originals[*which] == found),
                        "a frame that nobody sent: {found:?}"
                    );
                    arrived = true;
                }
                Err(_) => errors += 1,
            });
            rest = tail;
        }
        assert!(arrived || !must_arrive, "a whole frame was lost");
        if random.below(64) == 0 {
            decoder.reset();
        }
        if stream.last() != Some(&0) {
            // Leftover bytes must not count for the next stream.
            decoder.push_slice(&[0], |result| {
                assert!(result.is_err() || !allowed.is_empty())
            });
        }
    }
    println!(
        "{streams} streams: {delivered} frames, {planted} planted, {errors} errors, 0 phantoms"
    );
    let (planted_min, errors_min) = (streams as u64 * 15 / 100, streams as u64 / 2);
    assert!(delivered >= planted && planted > planted_min && errors > errors_min);
}

#[test]
fn overflow_discards_up_to_the_delimiter() {
    let frames = two_hundred();
    let mut decoder = Decoder::new();
    let mut seen = Vec::new();
    // A frame without its delimiters inside a stretch that is too long.
    let mut stream = vec![3_u8; 400];
    stream.extend(&frames[0][1..frames[0].len() - 1]);
    stream.extend([5; 100]);
    stream.extend(&frames[1]);
    decoder.push_slice(&stream, |result| {
        seen.push(result.map(|frame| Message::parse(&frame).expect("valid")));
    });
    let (_, expected) = decode_one(&frames[1]).expect("valid");
    assert_eq!(seen, vec![Err(FrameError::Overflow), Ok(expected)]);
    assert_eq!(decoder.quality().overflow, 1);
    assert_eq!(decoder.quality().frames, 1);
}

#[test]
fn the_longest_frame_fits_and_one_byte_more_does_not() {
    let header = wheeleg_protocol::Header {
        version: wheeleg_protocol::VERSION,
        message_type: 0x7E,
        source: Address::MASTER,
        destination: Address::BROADCAST,
        sequence: 0xFFFF,
    };
    let payload = [0x5A; MAX_PAYLOAD + 1];
    let mut buffer = [0; MAX_ENCODED];
    let bytes = wheeleg_protocol::encode(&header, &payload[..MAX_PAYLOAD], &mut buffer)
        .expect("fits")
        .to_vec();
    assert_eq!(bytes.len(), MAX_ENCODED);
    let mut delivered = 0;
    Decoder::new().push_slice(&bytes, |result| {
        let frame = result.expect("valid");
        assert_eq!(
            (frame.header, frame.payload),
            (header, &payload[..MAX_PAYLOAD])
        );
        delivered += 1;
    });
    assert_eq!(delivered, 1);
    let encode = wheeleg_protocol::encode;
    assert_eq!(
        encode(&header, &payload, &mut [0; 300]),
        Err(wheeleg_protocol::EncodeError::PayloadTooLong)
    );
    assert_eq!(
        encode(&header, &payload[..10], &mut [0; 24]),
        Err(wheeleg_protocol::EncodeError::BufferTooSmall)
    );
    let from_all = wheeleg_protocol::Header {
        source: Address::BROADCAST,
        ..header
    };
    assert_eq!(
        encode(&from_all, &[], &mut buffer),
        Err(wheeleg_protocol::EncodeError::Source)
    );
}

/// The known hole of COBS with a plain CRC: the last CRC byte is zero, its code byte 01 becomes the delimiter
/// by one flipped bit, and the frame is one byte short. The test makes frames with that tail on purpose.
#[test]
fn the_one_bit_hole_of_cobs_is_closed() {
    let mut tried = 0;
    let mut buffer = [0; MAX_ENCODED];
    for sequence in 0..=u16::MAX {
        let envelope = Envelope {
            source: Address::MASTER,
            destination: Address::joint(1).expect("joint"),
            sequence,
        };
        let message = Message::Disarm(wheeleg_protocol::Disarm {});
        let mut bytes = message.emit(envelope, &mut buffer).expect("fits").to_vec();
        let code_at = bytes.len() - 2;
        if bytes[code_at] != 1 {
            continue;
        }
        tried += 1;
        bytes[code_at] ^= 1;
        Decoder::new().push_slice(&bytes, |result| {
            assert!(result.is_err(), "sequence {sequence}");
        });
    }
    // The CRC is affine in the sequence: a power of two of them end in zero.
    assert!(tried >= 128, "{tried}");
}

#[test]
fn a_changed_length_with_a_right_checksum_is_rejected() {
    for frame in two_hundred() {
        let mut decoded = Vec::new();
        let mut rest = &frame[1..frame.len() - 1];
        while let [code, tail @ ..] = rest {
            let (data, tail) = tail.split_at(usize::from(*code) - 1);
            decoded.extend(data);
            if !tail.is_empty() {
                decoded.push(0);
            }
            rest = tail;
        }
        let body_len = decoded.len() - 4;
        let true_len = u16::from_le_bytes([decoded[6], decoded[7]]);
        assert_eq!(usize::from(true_len), body_len - HEADER_LEN);
        for len in (0..300).chain([0xFF00, 0xFFFF]) {
            decoded[6..8].copy_from_slice(&u16::to_le_bytes(len));
            let crc = checksum(&decoded[..body_len]).to_le_bytes();
            decoded[body_len..].copy_from_slice(&crc);
            let result = wheeleg_protocol::Frame::check(&decoded);
            if len == true_len {
                assert!(result.is_ok());
            } else {
                assert_eq!(result, Err(FrameError::Length));
            }
        }
    }
}
