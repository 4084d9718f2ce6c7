//! Structure-aware streams: frames with the CRC fixed up, so that what lies
//! behind the CRC is reached; frames with a wrong CRC, length, version or
//! address; damaged and cut frames; garbage between them. Nothing arrives that
//! the reference does not find, no frame with a wrong CRC at all, and every sound
//! frame goes through parse → emit → parse (P2–P5).

use arbitrary::{Arbitrary, Unstructured};
use wheeleg_protocol::MessageType;

use crate::reference::{self, Sound};
use crate::{decoder, parse};

/// One piece of a stream.
#[derive(Clone, Debug, Arbitrary)]
pub enum Piece {
    /// A frame and what is wrong with it.
    Frame(AnyFrame, Damage),
    /// Bytes.
    Garbage(Vec<u8>),
}

/// What is wrong with a frame.
#[derive(Clone, Copy, Debug, Arbitrary)]
pub enum Damage {
    /// Nothing.
    None,
    /// The CRC is xored with this.
    Crc(u32),
    /// The length field, with the CRC right for it.
    Length(u16),
    /// One byte of the line is xored with this.
    Byte(u8, u8),
    /// The end is missing.
    Cut(u8),
}

/// A frame of a known type more often than not, of the right size more often
/// than not.
#[derive(Clone, Debug)]
pub struct AnyFrame(pub Sound);

impl<'a> Arbitrary<'a> for AnyFrame {
    fn arbitrary(u: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let shape: u8 = u.arbitrary()?;
        let message_type = if shape & 3 == 0 {
            u.arbitrary()?
        } else {
            u.choose(MessageType::ALL)?.code()
        };
        let size = match MessageType::from_code(message_type) {
            Some(known) if shape & 0xC != 0 => known.payload_len(),
            _ => usize::from(u.int_in_range(0..=190_u8)?).min(185),
        };
        let mut payload = vec![0; size];
        u.fill_buffer(&mut payload)?;
        let (source, destination) = match (shape & 0x30, message_type) {
            (0, _) => (u.arbitrary()?, u.arbitrary()?),
            (_, 0x01) => (0, 255),
            (_, 0x02 | 0x80..) => (u.int_in_range(1..=8)?, 0),
            _ => (0, u.int_in_range(1..=8)?),
        };
        let version = if shape & 0xC0 == 0 { u.arbitrary()? } else { 1 };
        Ok(Self(Sound {
            version,
            message_type,
            source,
            destination,
            sequence: u.arbitrary()?,
            payload,
        }))
    }
}

/// A list of pieces and the sizes of the chunks.
pub fn run(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let Ok(sizes) = u.arbitrary::<[u8; 3]>() else {
        return;
    };
    let mut stream = Vec::new();
    let mut forbidden = Vec::new();
    while !u.is_empty()
        && stream.len() < 4000
        && let Ok(piece) = u.arbitrary::<Piece>()
    {
        match piece {
            Piece::Garbage(bytes) => stream.extend(bytes.iter().take(300)),
            Piece::Frame(AnyFrame(sound), damage) => match damage {
                Damage::None => stream.extend(reference::frame(&sound, None, 0)),
                Damage::Crc(error) => {
                    stream.extend(reference::frame(&sound, None, error));
                    if error != 0 {
                        forbidden.push(sound);
                    }
                }
                Damage::Length(length) => {
                    stream.extend(reference::frame(&sound, Some(length), 0));
                }
                Damage::Byte(at, error) => {
                    let mut line = reference::frame(&sound, None, 0);
                    let at = usize::from(at) % line.len();
                    line[at] ^= error;
                    stream.extend(line);
                }
                Damage::Cut(left) => {
                    let line = reference::frame(&sound, None, 0);
                    stream.extend(line.iter().take(usize::from(left)));
                }
            },
        }
    }
    let arrived = decoder::check(&stream, &sizes);
    for sound in arrived.iter().flatten() {
        let _ = parse::check(sound);
        if forbidden.contains(sound) {
            // The same frame may have been sent whole, too.
            let line = reference::frame(sound, None, 0);
            let whole = stream.windows(line.len()).any(|window| window == line);
            assert!(whole, "a frame with a wrong CRC: {sound:?}");
        }
    }
}
