//! A cylinder as a Functional Mock-up Unit, for Simulink, Dymola, OpenModelica, FMPy and the
//! other tools that read one: FMI 2.0 and 3.0, co-simulation.
//!
//! Nothing is modelled here. A unit holds the plant of an axis file, or the plant with a joint board's
//! firmware; this crate adds FMI's names, its C interface and its archive. One shared library serves every
//! unit: it reads its contents from the unit's resources.
//!
//! # Glossary
//!
//! * **unit**: a Functional Mock-up Unit, the `.fmu` archive, or an instance of it
//! * **importer**: the tool that runs a unit
//! * **kind**: plant (the importer gives the valves' on-times) or controlled (the importer gives
//!   references, the firmware the on-times)
//! * **model**: contents of a unit: kind, law, axis file, and the variables that follow
//! * **variable**: a value that an importer sets or reads, by its value reference
//! * **model description**: the XML file that lists the variables for an importer
//! * **token**: names the model; an importer hands it back so that library and description match
//! * **tick**: 1 ms, the joint boards' control period; the unit's steps are multiples of it

mod abi;
pub mod archive;
pub mod description;
pub mod error;
mod kind;
pub mod model;
mod simulation;
mod unit;
mod units;
pub mod value;
pub mod variable;

pub use error::FmuError;
pub use kind::Kind;
pub use model::Model;
