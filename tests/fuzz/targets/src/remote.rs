//! Bytes on the line between the simulator and a bench board: both sides' readers,
//! which share no code, find the same messages in any stream, for any chunking, and
//! the next whole frame behind garbage (P1, P3, P4, P7, P8).

use std::fmt::Debug;

use arbitrary::Unstructured;
use wheeleg_remote::frame::Deframer as BoardReader;
use wheeleg_remote::store::StoreReader;
use wheeleg_remote_link::frame::MAX_FRAME;
use wheeleg_remote_link::{Deframer as HostReader, Reply, Request, encode};

use crate::reference::{cobs, crc32c};

/// A message of either way.
trait Message: serde::de::DeserializeOwned + serde::Serialize + PartialEq + Debug {}

impl Message for Request {}
impl Message for Reply {}

/// Sound messages as the board's reader finds them; damaged frames as `None`.
fn by_board<T: Message>(stream: &[u8]) -> Vec<Option<(u8, T)>> {
    let mut reader = BoardReader::new();
    let found = stream.iter().filter_map(|byte| reader.push(*byte));
    found.map(Result::ok).collect()
}

/// The same by the simulator's reader, in chunks.
fn by_host<T: Message>(stream: &[u8], chunk: usize) -> Vec<Option<(u8, T)>> {
    let mut reader = HostReader::new();
    let mut found = Vec::new();
    for mut input in stream.chunks(chunk.max(1)) {
        loop {
            match reader.next(&mut input) {
                Ok(None) => break,
                Ok(message) => found.push(message),
                Err(_) => found.push(None),
            }
        }
    }
    found
}

fn check<T: Message>(stream: &[u8], chunk: usize) {
    let board = by_board::<T>(stream);
    let host = by_host::<T>(stream, chunk);
    assert_eq!(host, by_host(stream, usize::MAX), "chunks matter");
    assert_eq!(board, host, "the two sides disagree");
    for (index, message) in board.into_iter().flatten() {
        let mut buffer = [0; MAX_FRAME];
        let bytes = encode(index, &message, &mut buffer).expect("it came in a frame");
        assert_eq!(by_board(bytes), [Some((index, message))]);
    }
}

/// The first bytes say which way and the sizes of the chunks; then come pieces:
/// a frame with the checksum put right, or bytes as they are.
pub fn run(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let Ok([way, chunk]) = u.arbitrary::<[u8; 2]>() else {
        return;
    };
    let mut stream = Vec::new();
    while !u.is_empty() && stream.len() < 4 * MAX_FRAME {
        let Ok((kind, size)) = u.arbitrary::<(u8, u8)>() else {
            break;
        };
        let size = (usize::from(size) * 3).min(u.len());
        let bytes = u.bytes(size).unwrap_or_default();
        if kind & 3 == 0 {
            stream.extend_from_slice(bytes);
        } else {
            let mut content = bytes.to_vec();
            content.extend(crc32c(bytes).to_le_bytes());
            stream.extend(cobs(&content));
            stream.push(0);
        }
    }
    // After any input, a delimiter and a whole frame.
    stream.push(0);
    let mut buffer = [0; MAX_FRAME];
    let last = encode(9, &Request::Bye, &mut buffer).expect("it fits");
    stream.extend_from_slice(last);
    if way & 1 == 0 {
        check::<Request>(&stream, usize::from(chunk));
        assert_eq!(by_board(&stream).last(), Some(&Some((9, Request::Bye))));
    } else {
        check::<Reply>(&stream, usize::from(chunk));
    }
    // Contents of a parameter store, which no checksum guards on this way.
    let mut reader = StoreReader::default();
    for (index, stretch) in data.chunks(128).enumerate() {
        if let Ok(records) = reader.records(128 * index as u32, stretch) {
            assert!(records.count() <= stretch.len() / 8);
        }
    }
}
