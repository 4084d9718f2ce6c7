//! The socket for Foxglove and Lichtblick, by their published protocol: viewers see every channel, the robot
//! and its parameters, and may stop. Commands that move the robot are given only at the console.

mod channels;
mod outbox;
mod request;
mod session;
mod touching;
mod viewers;
mod write;

pub use request::{
    Call, ITEMS_MAX, MESSAGE_MAX, Malformed, Request, Setting, Subscription, parse_binary,
    parse_text,
};

pub(crate) use outbox::{Outbox, status};
pub(crate) use session::{Viewing, serve};
pub(crate) use touching::{ContactSink, contacts};
pub(crate) use viewers::{ViewerId, Viewers};
pub(crate) use write::write;

/// Number of the one service, a stop.
pub(crate) const STOP_SERVICE: u32 = 1;
/// Address of the one file.
pub(crate) const URDF: &str = "package://wheeleg/wheeleg.urdf";

/// Names of the protocol, newest first: they mean the same.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
