//! One registry of signals, and everything that is generated from it.
//!
//! [`samples`] declares every signal once (name, unit, type, resolution, rate,
//! layer, meaning). From that declaration come the sample structs, the MCAP
//! channels with their JSON schemas, the CSV headers, the plots' labels and
//! `wheeleg channels`.
//!
//! [`event`] says what happened as data, [`messages`] makes text of it.

mod csv_out;
mod difference;
mod encode;
mod error;
pub mod event;
mod filter;
mod hash;
pub mod messages;
mod recorder;
mod registry;
pub mod samples;

pub use csv_out::write_csv;
pub use difference::first_difference;
pub use encode::push_fixed;
pub use error::LogError;
pub use event::{Cause, Event, EventKind};
pub use filter::LowPass2;
pub use hash::TelemetryHash;
pub use recorder::{PLOT_CUTOFF_HZ, Recorder, Recording, Row};
pub use registry::{ChannelDef, FieldDef, FieldType, Layer, Sample, json_schema};
pub use samples::{
    BodySample, BusSample, EventSample, FootSample, JointSample, LinkSample, MasterSample,
    ProvenanceSample, StateSample, SupplySample, WheelSample, channels,
};
