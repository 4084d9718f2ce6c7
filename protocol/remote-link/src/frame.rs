//! Frames on any byte stream: pipe, FIFO, socket or serial line.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc, Digest, Table};
use postcard::ser_flavors::crc::CrcModifier;
use postcard::ser_flavors::{Cobs, Flavor as _, Slice};
use serde::{Serialize, de::DeserializeOwned};

/// Longest frame with its delimiter, bytes.
pub const MAX_FRAME: usize = 640;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// Why a frame could not be written or read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// Longer than [`MAX_FRAME`], or than the buffer.
    TooLong,
    /// No valid COBS, wrong checksum, or no message of this interface.
    Damaged,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is too long",
            Self::Damaged => "the frame is damaged",
        })
    }
}

impl core::error::Error for FrameError {}

/// Writes the frame of `message` for the board with index `board` into `buffer`; returns the bytes to send.
///
/// # Errors
/// [`FrameError::TooLong`] if the buffer is too short ([`MAX_FRAME`] is enough).
pub fn encode<'a, T: Serialize>(
    board: u8,
    message: &T,
    buffer: &'a mut [u8],
) -> Result<&'a [u8], FrameError> {
    let digest: Digest<'_, u32, Table<1>> = CRC.digest();
    let written = Cobs::try_new(Slice::new(buffer))
        .and_then(|cobs| {
            let mut serializer = postcard::Serializer {
                output: CrcModifier::new(cobs, digest),
            };
            (board, message).serialize(&mut serializer)?;
            serializer.output.finalize()
        })
        .map_err(|_| FrameError::TooLong)?;
    Ok(written)
}

/// Reads a frame without its delimiter, in place: the board's index and the message.
///
/// # Errors
/// [`FrameError::Damaged`].
pub fn decode<T: DeserializeOwned>(frame: &mut [u8]) -> Result<(u8, T), FrameError> {
    let length = cobs::decode_in_place(frame).map_err(|_| FrameError::Damaged)?;
    let content = frame.get(..length).ok_or(FrameError::Damaged)?;
    match postcard::take_from_bytes_crc32(content, CRC.digest()) {
        // Nothing may follow the checksum, which would not cover it.
        Ok((message, [])) => Ok(message),
        _ => Err(FrameError::Damaged),
    }
}

/// Finds the frames in a stream of bytes.
#[derive(Debug, Clone)]
pub struct Deframer {
    buffer: [u8; MAX_FRAME],
    length: usize,
    /// Drop everything up to the next delimiter.
    skip: bool,
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deframer {
    /// Nothing read yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            buffer: [0; MAX_FRAME],
            length: 0,
            skip: false,
        }
    }

    /// Takes bytes from the front of `input`, which is shortened by them; returns the next message once it is
    /// complete, `None` when the input is used up. Empty frames are skipped, so zeros may be sent to
    /// resynchronise a line.
    ///
    /// # Errors
    /// A frame that cannot be read; the next call continues behind it.
    pub fn next<T: DeserializeOwned>(
        &mut self,
        input: &mut &[u8],
    ) -> Result<Option<(u8, T)>, FrameError> {
        while let Some((byte, rest)) = input.split_first() {
            let byte = *byte;
            *input = rest;
            if byte != 0 {
                match self.buffer.get_mut(self.length) {
                    Some(place) if !self.skip => {
                        *place = byte;
                        self.length = self.length.saturating_add(1);
                    }
                    _ => self.skip = true,
                }
                continue;
            }
            let (length, skipped) = (self.length, self.skip);
            self.length = 0;
            self.skip = false;
            if skipped {
                return Err(FrameError::TooLong);
            }
            if length > 0 {
                let frame = self.buffer.get_mut(..length).ok_or(FrameError::Damaged)?;
                return decode(frame).map(Some);
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::*;
    use proptest::prelude::*;

    fn run(bytes: &[u8]) -> Request {
        Request::Run(Run {
            until_ns: 12_345_678_901,
            edge: Some(Inputs {
                adc: 0xABCD,
                switches: Switches::from_foot([true, false, false, true]),
                encoder: -70_000,
            }),
            power: Power::Good,
            received: heapless::Vec::from_slice(bytes).expect("fits"),
            received_end_ns: 12_345_670_000,
            byte_ns: 10_000,
        })
    }

    #[test]
    fn the_longest_messages_fit_a_frame() {
        let mut buffer = [0; MAX_FRAME];
        let request = run(&[0xFF; MAX_RECEIVED]);
        assert!(encode(255, &request, &mut buffer).expect("fits").len() < MAX_FRAME);
        let sent = Sent {
            start_ns: u64::MAX,
            bytes: heapless::Vec::from_slice(&[0; MAX_SENT]).expect("fits"),
        };
        let figures = Figures {
            tick_instructions: u32::MAX,
            longest_awake: u32::MAX,
            instructions: u32::MAX,
            stack_used: u32::MAX,
            stack_size: u32::MAX,
            resets: u16::MAX,
            driver_timeouts: u16::MAX,
            driver_on_us: u32::MAX,
            late_bytes: u32::MAX,
            outputs_low_after: u32::MAX,
        };
        let trip = Trip {
            at_ns: u64::MAX,
            running_ns: u64::MAX,
            cause: u32::MAX,
        };
        let ran = Reply::Ran(Ran {
            outputs: Outputs {
                valve_on_us: [u16::MAX; 4],
                ..Outputs::default()
            },
            seen: Inputs {
                encoder: i32::MIN,
                adc: u16::MAX,
                switches: Switches(255),
            },
            seen_at_ns: u64::MAX,
            period_us: u32::MAX,
            sent: heapless::Vec::from_slice(&[sent.clone(), sent]).expect("fits"),
            figures,
            trip: Some(trip),
        });
        let length = encode(255, &ran, &mut buffer).expect("fits").len();
        assert!((500..MAX_FRAME).contains(&length), "{length}");
    }

    #[test]
    fn every_single_bit_flip_is_refused() {
        let mut buffer = [0; MAX_FRAME];
        let length = encode(3, &run(b"abc"), &mut buffer).expect("fits").len();
        for bit in 0..(length - 1) * 8 {
            let mut damaged = buffer[..length].to_vec();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let mut input = damaged.as_slice();
            let mut deframer = Deframer::new();
            while !input.is_empty() {
                if let Ok(Some((_, message))) = deframer.next::<Request>(&mut input) {
                    panic!("bit {bit} gave {message:?}");
                }
            }
        }
    }

    #[test]
    fn a_line_of_rubbish_is_one_error_and_the_next_frame_is_read() {
        let mut stream = vec![0x55; 3 * MAX_FRAME];
        stream.push(0);
        let mut buffer = [0; MAX_FRAME];
        stream.extend_from_slice(encode(7, &Request::Bye, &mut buffer).expect("fits"));
        let mut input = stream.as_slice();
        let mut deframer = Deframer::new();
        let first = deframer.next::<Request>(&mut input);
        assert_eq!(first, Err(FrameError::TooLong));
        let second = deframer.next::<Request>(&mut input);
        assert_eq!(second, Ok(Some((7, Request::Bye))));
        assert_eq!(deframer.next::<Request>(&mut input), Ok(None));
    }

    proptest! {
        #[test]
        fn any_chunking_gives_the_same_messages(
            bodies in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..MAX_RECEIVED), 1..5),
            chunk in 1_usize..300,
        ) {
            let mut stream = Vec::new();
            for (board, body) in bodies.iter().enumerate() {
                let mut buffer = [0; MAX_FRAME];
                stream.extend_from_slice(encode(board as u8, &run(body), &mut buffer).unwrap());
            }
            let mut deframer = Deframer::new();
            let mut found = Vec::new();
            for mut part in stream.chunks(chunk) {
                while let Some((board, message)) = deframer.next::<Request>(&mut part).unwrap() {
                    found.push((usize::from(board), message));
                }
            }
            let sent: Vec<_> = bodies.iter().map(|body| run(body)).enumerate().collect();
            prop_assert_eq!(found, sent);
        }
    }
}
