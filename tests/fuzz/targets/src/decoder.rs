//! Any bytes in any chunks: no panic, the same frames and errors for every
//! chunking and as the reference decoder finds (P1, P4), and the next whole frame
//! behind a delimiter is delivered (P3).

use wheeleg_protocol::{Decoder, Frame, FrameError};

use crate::reference::{self, Reason, Sound};

/// The result of the decoder under test, in the types of the reference.
pub(crate) fn said(result: Result<Frame<'_>, FrameError>) -> Result<Sound, Reason> {
    match result {
        Ok(frame) => Ok(Sound {
            version: frame.header.version,
            message_type: frame.header.message_type,
            source: frame.header.source.raw(),
            destination: frame.header.destination.raw(),
            sequence: frame.header.sequence,
            payload: frame.payload.to_vec(),
        }),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            Err(match error {
                FrameError::Overflow => Reason::Overflow,
                FrameError::Truncated => Reason::Truncated,
                FrameError::Short => Reason::Short,
                FrameError::Crc => Reason::Crc,
                FrameError::Version { found } => Reason::Version(found),
                FrameError::Length => Reason::Length,
                FrameError::Address => Reason::Address,
            })
        }
    }
}

/// Passes a stream through a decoder in chunks, with sizes from `sizes`.
pub(crate) fn in_chunks(stream: &[u8], sizes: &[u8]) -> (Vec<Result<Sound, Reason>>, Decoder) {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    let mut rest = stream;
    let mut sizes = sizes.iter().cycle();
    while !rest.is_empty() {
        let size = sizes.next().map_or(usize::MAX, |size| usize::from(*size));
        let (chunk, tail) = rest.split_at(size.clamp(1, rest.len()));
        decoder.push_slice(chunk, |result| found.push(said(result)));
        rest = tail;
    }
    (found, decoder)
}

/// The frames and errors of a stream, after every check that holds for any stream.
pub(crate) fn check(stream: &[u8], sizes: &[u8]) -> Vec<Result<Sound, Reason>> {
    let expected = reference::decode(stream);
    let (found, mut decoder) = in_chunks(stream, sizes);
    assert_eq!(found, expected, "in chunks");
    let mut byte_wise = Decoder::new();
    let mut found = Vec::new();
    for byte in stream {
        found.extend(byte_wise.push(*byte).map(said));
    }
    assert_eq!(found, expected, "byte by byte");
    assert_eq!(byte_wise.quality(), decoder.quality());
    let (frames, errors) = (decoder.quality().frames, decoder.quality().errors());
    let sound = expected.iter().filter(|result| result.is_ok()).count();
    assert_eq!(frames as usize, sound);
    assert_eq!(errors as usize, expected.len() - sound);

    // P3: after any input, a delimiter and a whole frame deliver that frame.
    let next = Sound {
        version: 1,
        message_type: 0x12,
        source: 0,
        destination: 3,
        sequence: 7,
        payload: Vec::new(),
    };
    let mut last = None;
    decoder.push_slice(&reference::frame(&next, None, 0), |result| {
        last = Some(said(result));
    });
    assert_eq!(last, Some(Ok(next)), "the frame behind the garbage");
    expected
}

/// The first bytes are sizes of chunks, the rest is the stream.
pub fn run(data: &[u8]) {
    let (sizes, stream) = data.split_at(data.len().min(4));
    check(stream, sizes);
}
