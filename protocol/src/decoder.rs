//! Streaming decoder and its counters.

use crate::frame::{DELIMITER, Frame, FrameError, MAX_DECODED};

/// Link quality: frames and errors by kind. Counters stop at their maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkQuality {
    /// Valid frames.
    pub frames: u32,
    /// [`FrameError::Overflow`].
    pub overflow: u32,
    /// [`FrameError::Truncated`].
    pub truncated: u32,
    /// [`FrameError::Short`].
    pub short: u32,
    /// [`FrameError::Crc`].
    pub crc: u32,
    /// [`FrameError::Version`].
    pub version: u32,
    /// [`FrameError::Length`].
    pub length: u32,
    /// [`FrameError::Address`].
    pub address: u32,
}

impl LinkQuality {
    fn count(&mut self, result: &Result<Frame<'_>, FrameError>) {
        let counter = match result {
            Ok(_) => &mut self.frames,
            Err(FrameError::Overflow) => &mut self.overflow,
            Err(FrameError::Truncated) => &mut self.truncated,
            Err(FrameError::Short) => &mut self.short,
            Err(FrameError::Crc) => &mut self.crc,
            Err(FrameError::Version { .. }) => &mut self.version,
            Err(FrameError::Length) => &mut self.length,
            Err(FrameError::Address) => &mut self.address,
        };
        *counter = counter.saturating_add(1);
    }

    /// All errors together.
    #[must_use]
    pub const fn errors(&self) -> u32 {
        self.overflow
            .saturating_add(self.truncated)
            .saturating_add(self.short)
            .saturating_add(self.crc)
            .saturating_add(self.version)
            .saturating_add(self.length)
            .saturating_add(self.address)
    }
}

/// Streaming decoder: bytes in, checked frames out.
///
/// Undoes COBS as the bytes come, so one buffer of [`MAX_DECODED`] bytes is all
/// it needs. After an overflow everything up to the next delimiter is discarded,
/// so the tail of a broken frame is never taken for a frame.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: [u8; MAX_DECODED],
    len: usize,
    /// Data bytes that the present COBS block still owes.
    owed: usize,
    /// Whether a byte came since the last delimiter.
    started: bool,
    /// Whether there was no room for a byte: the frame is thrown away.
    discarding: bool,
    quality: LinkQuality,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder that has seen nothing. The first bytes of a stream may belong to a frame whose start was
    /// missed; they are discarded like any broken frame.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            buffer: [0; MAX_DECODED],
            len: 0,
            owed: 0,
            started: false,
            discarding: false,
            quality: LinkQuality {
                frames: 0,
                overflow: 0,
                truncated: 0,
                short: 0,
                crc: 0,
                version: 0,
                length: 0,
                address: 0,
            },
        }
    }

    /// Takes one byte; returns a frame or an error at the delimiter behind it.
    ///
    /// Delimiters without anything between them are idle line and give `None`.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<'_>, FrameError>> {
        self.next(&mut [byte].as_slice())
    }

    /// Takes bytes from the front of `bytes`, which is shortened by them, up to the end of the next frame or
    /// error; `None` when they are used up. Any chunking gives the same result.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame<'_>, FrameError>> {
        // Kept in registers: on a board this loop takes every byte of the line.
        let (mut len, mut owed, mut started) = (self.len, self.owed, self.started);
        if !started {
            // Between two frames no byte is owed. A flipped bit in `owed` could say otherwise, and every
            // delimiter would be taken for idle line from then on.
            (len, owed) = (0, 0);
        }
        let mut ended = false;
        let mut rest = bytes.iter();
        for &byte in rest.by_ref() {
            let data = if byte == DELIMITER {
                if started {
                    ended = true;
                    break;
                }
                continue;
            } else if owed > 0 {
                owed = owed.saturating_sub(1);
                byte
            } else {
                // A code byte. The zero that it represents belongs between two blocks. (Only a block of 254
                // bytes has none, and that is longer than any frame.)
                owed = usize::from(byte).saturating_sub(1);
                if !started {
                    started = true;
                    continue;
                }
                0
            };
            match self.buffer.get_mut(len) {
                Some(place) => {
                    *place = data;
                    len = len.saturating_add(1);
                }
                None => self.discarding = true,
            }
        }
        *bytes = rest.as_slice();
        (self.len, self.owed, self.started) = (len, owed, started);
        if ended { Some(self.finish()) } else { None }
    }

    /// Takes any number of bytes and shows every frame and error to `visit`, in
    /// order.
    pub fn push_slice(
        &mut self,
        mut bytes: &[u8],
        mut visit: impl FnMut(Result<Frame<'_>, FrameError>),
    ) {
        while let Some(result) = self.next(&mut bytes) {
            visit(result);
        }
    }

    /// Frames and errors seen so far.
    #[must_use]
    pub const fn quality(&self) -> &LinkQuality {
        &self.quality
    }

    /// Sets the counters to zero.
    pub fn clear_quality(&mut self) {
        self.quality = LinkQuality::default();
    }

    /// Forgets a partial frame, as after a change of baud rate; counters stay.
    pub fn reset(&mut self) {
        self.len = 0;
        self.owed = 0;
        self.started = false;
        self.discarding = false;
    }

    /// The frame, or its error, at the delimiter behind it.
    fn finish(&mut self) -> Result<Frame<'_>, FrameError> {
        let (len, owed, discarding) = (self.len, self.owed, self.discarding);
        self.reset();
        let result = if discarding {
            Err(FrameError::Overflow)
        } else if owed > 0 {
            Err(FrameError::Truncated)
        } else {
            Frame::check(self.buffer.get(..len).unwrap_or_default())
        };
        self.quality.count(&result);
        result
    }
}
