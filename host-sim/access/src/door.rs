//! The door of a session: lets in frames that are authentic, each once and in order.

use std::time::Instant;

use crate::mac::Key;
use crate::rate::Bucket;
use crate::request::{Body, parse};

/// Checks and admits the frames of one session.
#[derive(Debug, Clone)]
pub struct Door {
    key: Key,
    /// Number that the next frame must have.
    next: u64,
    bucket: Bucket,
}

/// An admitted frame.
#[derive(Debug)]
pub struct Entered {
    /// Its number.
    pub n: u64,
    /// Its request.
    pub body: Body,
    /// Its client asks too often.
    pub limited: bool,
}

impl Door {
    /// The door of a session with this key, from now on.
    #[must_use]
    pub fn new(key: Key, now: Instant) -> Self {
        Self {
            key,
            next: 1,
            bucket: Bucket::new(now),
        }
    }

    /// The request of a frame; `None`: it is not authentic, not the next, or malformed, and the session is
    /// over.
    pub fn open(&mut self, frame: &[u8], now: Instant) -> Option<Entered> {
        let json = self.key.open(frame)?;
        let frame = parse(json).ok()?;
        if frame.n != self.next {
            return None;
        }
        self.next += 1;
        let exempt = matches!(frame.body, Body::Stop | Body::Beat { .. });
        let limited = !exempt && !self.bucket.take(now);
        Some(Entered {
            n: frame.n,
            body: frame.body,
            limited,
        })
    }
}
