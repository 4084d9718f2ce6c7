//! Errors that keep a unit from being made, or from going on.

use std::path::PathBuf;

use miette::Diagnostic;
use wheeleg_config::ConfigError;
use wheeleg_plant::PlantError;
use wheeleg_studies::axis_sim::suite::AxisSimError;

use crate::value::{Value, ValueType};

/// An error of a unit.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum FmuError {
    /// The axis file is wrong, unchanged or with the set parameters.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] ConfigError),
    /// The plant cannot be built, or has left the range of its model.
    #[error("the plant cannot go on: {0}")]
    #[diagnostic(
        code(wheeleg::fmu::plant),
        help("look at the inputs before that time: load, on-times, moving mass")
    )]
    Plant(#[from] PlantError),
    /// The same for the plant with its board.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Axis(#[from] AxisSimError),
    /// Resources that are not there or cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::fmu::resources),
        help(
            "unpack the whole unit, and let the importer pass the location of its resources folder"
        )
    )]
    Resources {
        /// File.
        path: PathBuf,
        /// Reason of the system or the reader.
        reason: String,
    },
    /// Another description than the library's.
    #[error("the token {given} is not that of this unit, {expected}")]
    #[diagnostic(
        code(wheeleg::fmu::token),
        help("the description was changed or belongs to another unit: export it again")
    )]
    Token {
        /// Input of the importer.
        given: String,
        /// The unit's own.
        expected: String,
    },
    /// A kind of unit that this one is not.
    #[error("this unit is for co-simulation; {0} is not supported")]
    #[diagnostic(
        code(wheeleg::fmu::interface),
        help("choose co-simulation in the importer")
    )]
    Interface(&'static str),
    /// A value reference that no variable of the type has.
    #[error("there is no {expected} variable with the value reference {reference}")]
    #[diagnostic(
        code(wheeleg::fmu::reference),
        help("value references stand in modelDescription.xml")
    )]
    Reference {
        /// The reference.
        reference: u32,
        /// Requested type.
        expected: ValueType,
    },
    /// As many values as references were wanted.
    #[error("{references} value references, but {values} values")]
    #[diagnostic(code(wheeleg::fmu::count), help("every variable here is a scalar"))]
    Count {
        /// Number of references.
        references: usize,
        /// Number of values.
        values: usize,
    },
    /// A value outside its range.
    #[error("{name} = {value} is outside {min} to {max} {unit}")]
    #[diagnostic(
        code(wheeleg::fmu::range),
        help("ranges stand in modelDescription.xml")
    )]
    Range {
        /// Variable.
        name: String,
        /// Given value.
        value: Value,
        /// Smallest allowed.
        min: f64,
        /// Largest allowed.
        max: f64,
        /// Unit.
        unit: String,
    },
    /// A variable that is never set, or not any more.
    #[error("{name} cannot be set{when}")]
    #[diagnostic(
        code(wheeleg::fmu::fixed),
        help("set parameters before the initialization ends; outputs are read only")
    )]
    Fixed {
        /// Variable.
        name: String,
        /// When not.
        when: &'static str,
    },
    /// A call out of turn.
    #[error("{call} is not allowed {when}")]
    #[diagnostic(
        code(wheeleg::fmu::order),
        help("instantiate, enter and exit the initialization mode, step, terminate")
    )]
    Order {
        /// The call.
        call: &'static str,
        /// State of the unit.
        when: &'static str,
    },
    /// A step that is no whole number of ticks.
    #[error("a step of {step_s} s is not a multiple of 1 ms")]
    #[diagnostic(
        code(wheeleg::fmu::step),
        help("the boards work in ticks of 1 ms: choose a step of 1 ms, 2 ms, … up to an hour")
    )]
    Step {
        /// The step \[s\].
        step_s: f64,
    },
    /// A step from another time than the unit's own.
    #[error("a step begins at {given_s} s, but the unit is at {own_s} s")]
    #[diagnostic(
        code(wheeleg::fmu::time),
        help("to go back in time, put a state back that was taken then")
    )]
    Time {
        /// The importer's time \[s\].
        given_s: f64,
        /// The unit's time \[s\].
        own_s: f64,
    },
    /// Bytes that are no state of this unit.
    #[error("these bytes are no state of this unit: {0}")]
    #[diagnostic(
        code(wheeleg::fmu::state),
        help("give the bytes that the same unit wrote")
    )]
    State(String),
    /// Something that FMI has and this unit has not.
    #[error("{0} is not supported")]
    #[diagnostic(
        code(wheeleg::fmu::absent),
        help("modelDescription.xml says what a unit supports")
    )]
    Absent(&'static str),
    /// The archive cannot be written.
    #[error("cannot write the unit {}: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::fmu::archive),
        help("choose another place with --out, or make room there")
    )]
    Archive {
        /// File.
        path: PathBuf,
        /// The system's reason.
        reason: String,
    },
    /// The shared library is not there, or is another file.
    #[error("{} is not the units' shared library: {reason}", path.display())]
    #[diagnostic(
        code(wheeleg::fmu::library),
        help("build it, `cargo build --release -p wheeleg-fmu`, or name it with --library")
    )]
    Library {
        /// Searched path.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
}
