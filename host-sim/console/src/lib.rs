//! The operator's console: a robot that runs live, and the server through which people see and drive it.
//! `PROTOCOL.md` beside this crate is the contract with clients.
//!
//! # Glossary
//!
//! * **robot thread**: owns the simulated robot and its clock, and waits for nobody
//! * **hub**: takes samples and events from the robot thread, encodes them once, and hands them to all
//!   clients
//! * **session**: one client's connection, from handshake to close
//! * **control**: the right to give commands; a lease of the master, held by one client
//! * **beat**: message that keeps control: the holder has seen the robot's state of a given master time
//! * **outbox**: messages that wait for one client
//! * **viewer**: a client with the protocol of Foxglove and Lichtblick: watches, and may stop
//! * **recording**: a folder with the log of a live robot and all its inputs, from which `replay` repeats it

mod api;
mod catalogue;
pub mod client;
mod close;
mod error;
pub mod foxglove;
mod guard;
mod hub;
pub mod keys;
mod live;
mod mailbox;
mod messages;
mod notices;
mod outbox;
mod page;
mod parameters;
mod progress;
mod record;
pub mod replay;
mod server;
mod session;
mod table;
mod tls;
pub mod unpack;

pub use api::SUBPROTOCOL;
pub use catalogue::{command_list, usual};
pub use error::ConsoleError;
pub use hub::EVENTS;
pub use live::{Live, Port, SlowAdapter};
pub use record::{FOLDER, Summary};
pub use server::{ADDRESS, Options, Prepared, Protection, Server};
pub use tls::{Files, Fingerprint};
