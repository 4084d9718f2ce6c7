//! The loop of an image: frames in, session, frames out.

use wheeleg_remote_link::frame::MAX_FRAME;
use wheeleg_remote_link::{FrameError, Reply, Request, text};

use crate::board::Board;
use crate::frame::{Deframer, encode};
use crate::session::{Session, Stopwatch};

/// A stream of bytes to the simulator.
pub trait Stream {
    /// Waits for bytes and returns their number; 0 when the simulator has gone.
    fn read(&mut self, buffer: &mut [u8]) -> usize;

    /// Sends all bytes; false when the simulator has gone.
    fn write(&mut self, bytes: &[u8]) -> bool;
}

/// Answers requests until the simulator says goodbye or goes away.
pub fn serve<'p, B: Board<'p>>(
    session: &mut Session<'p, B>,
    stream: &mut impl Stream,
    stopwatch: &mut impl Stopwatch,
) {
    let mut deframer = Deframer::new();
    let mut incoming = [0; MAX_FRAME];
    let mut scratch = [0; MAX_FRAME];
    let mut outgoing = [0; MAX_FRAME];
    loop {
        let count = stream.read(&mut incoming);
        let Some(bytes) = incoming.get(..count).filter(|bytes| !bytes.is_empty()) else {
            return;
        };
        for byte in bytes {
            let (index, reply) = match deframer.push::<Request>(*byte) {
                None => continue,
                Some(Ok((index, request))) => (index, session.answer(&request, stopwatch)),
                Some(Err(FrameError::TooLong)) => refuse("the request is too long for a frame"),
                Some(Err(FrameError::Damaged)) => refuse("the request arrived damaged"),
            };
            // A frame of `MAX_FRAME` bytes holds any reply (tested with the link).
            let Ok(frame) = encode(index, &reply, &mut scratch, &mut outgoing) else {
                return;
            };
            if !stream.write(frame) || session.is_over() {
                return;
            }
        }
    }
}

/// A request that could not be read has no known board.
fn refuse(why: &str) -> (u8, Reply) {
    (0, Reply::Refused(text(why)))
}
