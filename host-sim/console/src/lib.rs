//! The operator's console: a robot that runs live, and the server through which people see and
//! drive it. The contract with clients is `PROTOCOL.md` beside this crate.
//!
//! # Glossary
//!
//! * **robot thread**: owns the simulated robot and its clock, and waits for nobody
//! * **hub**: takes what the robot thread tells, encodes it once, and hands it to all clients
//! * **session**: one client's connection, from handshake to close
//! * **control**: the right to give commands; a lease of the master, held by one client
//! * **beat**: what keeps the control: the holder has seen the robot as it was at a master time
//! * **outbox**: what waits for one client
//! * **desk**: who of the clients is in control
//! * **door**: lets in the frames of one session
//! * **viewer**: a client by the protocol of Foxglove and Lichtblick: looks, and may stop
//! * **recording**: a folder with the log of a live robot and all that it was given, in which it can be repeated

mod api;
mod arguments;
mod catalogue;
pub mod client;
mod close;
pub mod desk;
pub mod door;
mod error;
pub mod foxglove;
mod guard;
mod hex;
mod hub;
pub mod keys;
mod live;
mod mac;
mod mailbox;
mod messages;
mod notices;
mod outbox;
mod page;
mod parameters;
mod progress;
mod rate;
pub mod reason;
mod record;
pub mod replay;
pub mod request;
mod server;
mod session;
mod table;
mod tls;
pub mod unpack;

pub use api::SUBPROTOCOL;
pub use catalogue::{
    HOLD_S, HOST_TABLE, HostArgument, HostCode, HostInfo, SPEED, STEP_MAX, command_list, usual,
};
pub use error::ConsoleError;
pub use live::{Live, Port, SlowAdapter};
pub use mac::Key;
pub use record::{FOLDER, Summary};
pub use server::{ADDRESS, Options, Protection, Server};
pub use tls::{Files, Fingerprint};
