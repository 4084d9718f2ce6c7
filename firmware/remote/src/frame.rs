//! Frames as a board reads and writes them.
//!
//! The format is that of `wheeleg-remote-link`, `COBS(index, postcard(message), CRC-32C) 0x00`. The
//! simulator's side uses libraries for COBS and checksum. They have index checks that can panic, and a second
//! checksum table; an image may have neither. So the board's side decodes COBS byte by byte and uses the bus
//! protocol's checksum; tests check that the two sides agree.

use serde::{Serialize, de::DeserializeOwned};
use wheeleg_protocol::frame::checksum;
use wheeleg_remote_link::FrameError;
use wheeleg_remote_link::frame::MAX_FRAME;

/// Longest stretch without a zero in one COBS block.
const BLOCK: u8 = 0xFF;

/// A frame under construction, or as received, without COBS.
type Buffer = [u8; MAX_FRAME];

/// Writes the frame of `message` for the board with this index; `scratch` and
/// `out` are overwritten. Gives the bytes to send.
///
/// # Errors
/// [`FrameError::TooLong`].
pub fn encode<'a, T: Serialize>(
    board: u8,
    message: &T,
    scratch: &mut Buffer,
    out: &'a mut Buffer,
) -> Result<&'a [u8], FrameError> {
    let length = postcard::to_slice(&(board, message), scratch)
        .map_err(|_| FrameError::TooLong)?
        .len();
    let content = scratch.get(..length).ok_or(FrameError::TooLong)?;
    let crc = checksum(content).to_le_bytes();
    let length = cobs(content.iter().chain(&crc), out).ok_or(FrameError::TooLong)?;
    out.get(..length).ok_or(FrameError::TooLong)
}

/// COBS and the delimiter behind it; the length, or `None` if there is no room.
fn cobs<'a>(bytes: impl Iterator<Item = &'a u8>, out: &mut Buffer) -> Option<usize> {
    let mut code_at = 0_usize;
    let mut code = 1_u8;
    let mut at = 1_usize;
    for &byte in bytes {
        // A full block is closed only when something follows it.
        if code == BLOCK {
            *out.get_mut(code_at)? = code;
            code_at = at;
            at = at.saturating_add(1);
            code = 1;
        }
        if byte == 0 {
            *out.get_mut(code_at)? = code;
            code_at = at;
            code = 1;
        } else {
            *out.get_mut(at)? = byte;
            code = code.saturating_add(1);
        }
        at = at.saturating_add(1);
    }
    *out.get_mut(code_at)? = code;
    *out.get_mut(at)? = 0;
    Some(at.saturating_add(1))
}

/// Finds the frames in a stream of bytes.
#[derive(Clone, Debug)]
pub struct Deframer {
    buffer: Buffer,
    length: usize,
    /// Bytes that the present COBS block still owes.
    owed: u8,
    /// A zero follows the present block.
    zero: bool,
    started: bool,
    overlong: bool,
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
            owed: 0,
            zero: false,
            started: false,
            overlong: false,
        }
    }

    /// Takes one byte; returns the index of the board and the message when it completes a frame. Empty frames
    /// are skipped.
    pub fn push<T: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<(u8, T), FrameError>> {
        if byte == 0 {
            return self.finish();
        }
        if self.owed > 0 {
            self.owed = self.owed.saturating_sub(1);
            self.keep(byte);
        } else {
            if self.started && self.zero {
                self.keep(0);
            }
            self.started = true;
            self.owed = byte.saturating_sub(1);
            self.zero = byte != BLOCK;
        }
        None
    }

    fn keep(&mut self, byte: u8) {
        match self.buffer.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length = self.length.saturating_add(1);
            }
            None => self.overlong = true,
        }
    }

    fn finish<T: DeserializeOwned>(&mut self) -> Option<Result<(u8, T), FrameError>> {
        let (length, cut_off, overlong) = (self.length, self.owed > 0, self.overlong);
        let started = self.started;
        self.length = 0;
        self.owed = 0;
        self.started = false;
        self.overlong = false;
        if !started {
            return None;
        }
        if overlong {
            return Some(Err(FrameError::TooLong));
        }
        let frame = self.buffer.get(..length).filter(|_| !cut_off);
        Some(frame.and_then(read).ok_or(FrameError::Damaged))
    }
}

/// Board and message of a frame without COBS; `None` if it is damaged.
fn read<T: DeserializeOwned>(frame: &[u8]) -> Option<(u8, T)> {
    let (content, crc) = frame.split_last_chunk::<4>()?;
    if checksum(content) != u32::from_le_bytes(*crc) {
        return None;
    }
    match postcard::take_from_bytes(content) {
        // The message is all there is.
        Ok((message, [])) => Some(message),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use wheeleg_remote_link::{self as link, Inputs, Nonvolatile, Ran, Reply, Request, Run, Sent};

    fn request(received: &[u8], until_ns: u64, edge: bool) -> Request {
        Request::Run(Run {
            until_ns,
            edge: edge.then_some(Inputs {
                adc: 0x1200,
                ..Inputs::default()
            }),
            received: heapless::Vec::from_slice(received).expect("fits"),
            ..Run::default()
        })
    }

    fn push_all<T: DeserializeOwned>(bytes: &[u8]) -> Vec<Result<(u8, T), FrameError>> {
        let mut deframer = Deframer::new();
        bytes.iter().filter_map(|b| deframer.push(*b)).collect()
    }

    proptest! {
        #[test]
        fn both_sides_write_the_same_frame_and_read_each_other(
            received in prop::collection::vec(any::<u8>(), 0..=link::MAX_RECEIVED),
            until_ns in any::<u64>(),
            edge in any::<bool>(),
            index in any::<u8>(),
        ) {
            let message = request(&received, until_ns, edge);
            let (mut scratch, mut out) = ([0; MAX_FRAME], [0; MAX_FRAME]);
            let ours = encode(index, &message, &mut scratch, &mut out).expect("fits").to_vec();
            let mut buffer = [0; MAX_FRAME];
            let theirs = link::encode(index, &message, &mut buffer).expect("fits").to_vec();
            prop_assert_eq!(push_all::<Request>(&theirs), vec![Ok((index, message.clone()))]);
            let mut input = ours.as_slice();
            let read = link::Deframer::new().next::<Request>(&mut input);
            prop_assert_eq!(read, Ok(Some((index, message))));
        }

        #[test]
        fn rubbish_is_never_a_message_and_the_next_frame_is_read(
            rubbish in prop::collection::vec(any::<u8>(), 0..2000),
        ) {
            let mut stream = rubbish;
            stream.push(0);
            let (mut scratch, mut out) = ([0; MAX_FRAME], [0; MAX_FRAME]);
            let frame = encode(5, &Request::Bye, &mut scratch, &mut out).expect("fits");
            stream.extend_from_slice(frame);
            let found = push_all::<Request>(&stream);
            prop_assert_eq!(found.iter().filter(|f| f.is_ok()).count(), 1);
            prop_assert_eq!(found.last(), Some(&Ok((5, Request::Bye))));
        }
    }

    #[test]
    fn the_longest_reply_crosses_the_boundary_of_a_block_both_ways() {
        // Blocks of exactly 254 bytes without a zero are where COBS implementations fail.
        for fill in [0x00, 0x55] {
            let sent = Sent {
                start_ns: u64::MAX,
                bytes: heapless::Vec::from_slice(&[fill; link::MAX_SENT]).expect("fits"),
            };
            let reply = Reply::Ran(Ran {
                sent: heapless::Vec::from_slice(&[sent.clone(), sent]).expect("fits"),
                ..Ran::default()
            });
            let (mut scratch, mut out) = ([0; MAX_FRAME], [0; MAX_FRAME]);
            let ours = encode(1, &reply, &mut scratch, &mut out)
                .expect("fits")
                .to_vec();
            let mut input = ours.as_slice();
            let read = link::Deframer::new().next::<Reply>(&mut input);
            assert_eq!(read, Ok(Some((1, reply.clone()))));
            assert_eq!(push_all::<Reply>(&ours), vec![Ok((1, reply))]);
        }
        let stretch = Request::Store(Nonvolatile {
            offset: 0,
            bytes: heapless::Vec::from_slice(&[7; link::MAX_NONVOLATILE]).expect("fits"),
        });
        let mut buffer = [0; MAX_FRAME];
        let theirs = link::encode(2, &stretch, &mut buffer)
            .expect("fits")
            .to_vec();
        assert_eq!(push_all::<Request>(&theirs), vec![Ok((2, stretch))]);
    }

    /// Found by the fuzz target `remote`: each side passed over bytes behind the
    /// message in a way of its own.
    #[test]
    fn bytes_behind_the_message_are_no_part_of_a_frame_for_either_side() {
        let mut room = [0; 8];
        let message = postcard::to_slice(&(3_u8, Request::Bye), &mut room).expect("fits");
        let crc = |bytes: &[u8]| checksum(bytes).to_le_bytes();
        let sound = [&*message, &crc(message)].concat();
        let within = [&*message, &[0]].concat();
        let within = [within.as_slice(), &crc(&within)].concat();
        let behind = [sound.as_slice(), &[0, 7]].concat();
        for (content, good) in [(sound, true), (within, false), (behind, false)] {
            let mut out = [0; MAX_FRAME];
            let length = cobs(content.iter(), &mut out).expect("fits");
            let stream = out.get(..length).expect("in the buffer");
            let expected = good.then_some((3, Request::Bye));
            let board = push_all::<Request>(stream).pop().expect("a frame");
            assert_eq!(board.ok(), expected);
            let host = link::Deframer::new().next::<Request>(&mut &*stream);
            assert_eq!(host.ok().flatten(), expected);
        }
    }

    #[test]
    fn every_single_bit_flip_is_refused() {
        let (mut scratch, mut out) = ([0; MAX_FRAME], [0; MAX_FRAME]);
        let frame = encode(3, &request(b"abc", 1, true), &mut scratch, &mut out)
            .expect("fits")
            .to_vec();
        for bit in 0..(frame.len() - 1) * 8 {
            let mut damaged = frame.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let found = push_all::<Request>(&damaged);
            assert!(found.iter().all(Result::is_err), "bit {bit}: {found:?}");
        }
    }
}
