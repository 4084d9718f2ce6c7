//! Robots and scenarios: TOML files in which every parameter has a value, a
//! unit and a source, checked against one table of allowed units and ranges.
//!
//! # Glossary
//!
//! * **robot**: a file with every parameter of the simulated robot and its boards
//! * **axis**: a file with every parameter of one cylinder on a test bench
//! * **scenario**: a file that defines a run: robot, motion, terrain, events, faults, and the targets and
//!   limits that judge it
//! * **terrain**: the ground of a scenario, in parts, each with a kind and a material
//! * **source**: origin of a value: PAPER, DATASHEET, DERIVED, ASSUMED, IDENTIFIED
//! * **plan**: a file of a campaign: a scenario or an axis, and the differences from case to case
//! * **factor**: one of these differences: a list of values, or a distribution
//! * **fingerprint**: hash of names, values and units of a robot; files that differ only in layout have the
//!   same

pub mod axis;
mod bars;
pub mod bench;
mod board_value;
pub mod builtin;
mod command;
mod commissioned;
mod contradictions;
pub mod derived;
mod drawing;
mod error;
pub mod faults;
mod gait;
pub mod keys;
mod law;
mod node;
mod open_file;
mod otherwise;
mod overlay;
mod params;
pub mod plan;
pub mod plant;
mod quantity;
mod reader;
mod relations;
mod relief;
mod robot;
mod scenario;
mod source;
mod suggest;
pub mod terrain;
pub mod timing;

pub use axis::AxisConfig;
pub use bars::{Bar, Measure};
pub use board_value::{allowed_raw, allowed_values, in_unit, raw_of, stored_raw};
pub use command::{argument_dimension, command};
pub use drawing::Drawing;
pub use error::{ConfigError, Problem, plain_text, word};
pub use gait::GaitParams;
pub use law::LawChoice;
pub use node::NodeParams;
pub use open_file::open_file;
pub use params::{FieldSpec, ParamValue, ParameterInfo, Params};
pub use plant::sections::MASS as MASSES_KG;
pub use quantity::Dimension;
pub use quantity::{brief, pretty};
pub use relations::{Advised, RELATIONS, Relation, SEAT_MM, SENSOR_TRACK, least_mass_kg};
pub use relief::Relief;
pub use robot::{
    BusParams, HomingParams, ReferenceParams, RobotConfig, SpatialParams, StartUpParams,
};
pub use scenario::{
    EventAction, LegChoice, Motion, Origin, Scenario, ScenarioEvent, TARGETS, TargetSet,
};
pub use suggest::closest;
