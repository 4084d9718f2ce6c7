//! One registry of signals, and everything that is generated from it.
//!
//! [`samples`] declares every signal once (name, unit, type, resolution, rate,
//! layer, meaning). From that declaration come the sample structs, the MCAP
//! channels with their JSON schemas, the CSV headers, the plots' labels and
//! `wheeleg channels`.
//!
//! [`event`] represents events as data, [`messages`] turns them into text.
//!
//! A [`Recorder`] takes the samples of a run and hands them to [`Sink`]s: a log file
//! ([`LogFile`]), tables ([`Tables`]), and memory ([`Keep`]).
//!
//! # Glossary
//!
//! * **channel**: a named stream of samples of one kind, such as `/joint/3`
//! * **sample**: the values of a channel at one instant
//! * **event**: something that happened, with cause and time
//! * **sink**: a destination of samples
//! * **provenance**: origin of a run: program, robot, scenario, seed
//! * **derived channel**: a channel of the log that is computed from others, in a format that other programs
//!   know
//! * **hash**: BLAKE3 over channel, time and value of all samples at full rate, except `/server`,
//!   `/session` and the texts of the terrain in `/run`

mod attachments;
mod contact;
mod csv_out;
mod derived;
mod difference;
mod encode;
mod error;
pub mod event;
mod filter;
mod hash;
mod log_file;
mod memory;
pub mod messages;
pub mod phase;
mod place;
mod read;
mod record;
mod recorder;
mod recover;
mod registry;
pub mod samples;
mod sink;

pub use attachments::attachments;
pub use contact::{Contact, ContactBody};
pub use csv_out::Tables;
pub use derived::{Attached, CONTACTS_HZ, DERIVED_HZ, Derive, Derived, DerivedDef, Put, derived};
pub use difference::first_difference;
pub use encode::push_fixed;
pub use error::LogError;
pub use event::{Cause, Event, EventCode, EventKind, finding_of_name};
pub use filter::LowPass2;
pub use hash::TelemetryHash;
pub use log_file::LogFile;
pub use memory::{Keep, Memory, Recording, Row};
pub use place::{PLACES, SWITCHES, listed, placed};
pub use read::{Logged, Read, Scalar, TakeDerived, part, parts, read, read_derived, read_from};
pub use recorder::{PLOT_CUTOFF_HZ, Recorder};
pub use recover::{Recovered, recover};
pub use registry::{ChannelDef, FieldDef, FieldType, Layer, Sample, Wire, Written, json_schema};
pub use samples::{
    BehaviourSample, BodySample, BusSample, EventSample, FootSample, JointSample, LinkSample,
    MasterSample, ProvenanceSample, ServerSample, SessionSample, StateSample, SupplySample,
    WheelSample, channel_index, channels,
};
pub use sink::{OwnedSample, SampleRef, Sink, Taken};
