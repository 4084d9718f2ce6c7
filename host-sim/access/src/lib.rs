//! Permission to command a live robot, and the requests of clients: keys, frames, and the register of the
//! client in control. It opens no socket; the console serves it over the network, and the fault matrix drives
//! it in simulated time. `host-sim/console/PROTOCOL.md` is the contract with clients.
//!
//! # Glossary
//!
//! * **key**: a secret of 32 bytes that permits driving, or watching and stopping
//! * **MAC**: message authentication code, which proves that the sender has the key
//! * **frame**: one message of a client, with its MAC
//! * **door**: check of the frames of one session: authentic, each once, in order, not too many
//! * **session**: one client's connection, from handshake to close
//! * **control**: the right to give commands; a lease of the master, held by one client
//! * **desk**: register of the client that is in control or has asked for it
//! * **host command**: a command that acts on the simulation or on who is in control, not on the robot

pub mod arguments;
pub mod desk;
pub mod door;
pub mod hex;
pub mod host;
pub mod mac;
pub mod rate;
pub mod reason;
pub mod request;

pub use mac::Key;
