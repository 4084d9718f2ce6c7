//! How a connection ends.

use axum::extract::ws::{CloseFrame, Message, Utf8Bytes};

/// Why a connection is closed, as in the table of PROTOCOL.md.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Close {
    /// The key is wrong, or the answer to `hello` is malformed.
    WrongKey,
    /// The key is wrong again.
    Wait,
    /// The client wants to drive over a line on which others could read and change its messages.
    LookOnly,
    /// The client has loaded other lists.
    OtherHash,
    /// A frame is not authentic, not the next, or malformed.
    BadFrame,
    /// The client does not read its messages.
    TooSlow,
    /// The client does not answer `hello`.
    Timeout,
    /// The server ends.
    Ended,
}

impl Close {
    /// Code of the close frame.
    pub(crate) const fn code(self) -> u16 {
        match self {
            Self::WrongKey | Self::Wait | Self::LookOnly => 4001,
            Self::OtherHash => 4002,
            Self::BadFrame => 4003,
            Self::TooSlow => 4004,
            Self::Timeout => 4005,
            Self::Ended => 4006,
        }
    }

    /// Stable name.
    pub(crate) const fn reason(self) -> &'static str {
        match self {
            Self::WrongKey => "wrong_key",
            Self::Wait => "wait",
            Self::LookOnly => "look_only",
            Self::OtherHash => "other_hash",
            Self::BadFrame => "bad_frame",
            Self::TooSlow => "too_slow",
            Self::Timeout => "timeout",
            Self::Ended => "ended",
        }
    }

    pub(crate) fn message(self) -> Message {
        Message::Close(Some(CloseFrame {
            code: self.code(),
            reason: Utf8Bytes::from_static(self.reason()),
        }))
    }
}
