//! Errors of experiments on one cylinder.

use wheeleg_config::brief;
use wheeleg_control::joint::ConfigError;
use wheeleg_plant::PlantError;

/// An experiment was not possible.
#[derive(Debug, Clone, thiserror::Error, miette::Diagnostic)]
pub enum AxisSimError {
    /// The plant left the range of its model.
    #[error("{what}")]
    #[diagnostic(code(wheeleg::bench::unphysical), help("{help}"))]
    Unphysical {
        /// When and how, and the last values that were sound.
        what: String,
        /// The likely cause.
        help: String,
    },
    /// No air at power-up holds the piston.
    #[error(
        "no air in the chambers between `gas.ambient_pressure` ({} Pa) and `supply.initial_pressure` ({} Pa) holds the piston under {} N",
        brief(*.ambient_pa),
        brief(*.supply_pa),
        brief(*.load_n)
    )]
    #[diagnostic(
        code(wheeleg::bench::start),
        help(
            "raise `supply.initial_pressure`, lower `moving.load`, or take the air from the file"
        )
    )]
    Start {
        /// Atmosphere, absolute \[Pa\].
        ambient_pa: f64,
        /// Supply at power-up, absolute \[Pa\].
        supply_pa: f64,
        /// Force on the rod \[N\].
        load_n: f64,
    },
    /// The plant refused its parameters.
    #[error("the plant of the axis: {0}")]
    #[diagnostic(
        code(wheeleg::bench::plant),
        help("check the axis file against the ranges in its messages")
    )]
    Plant(#[from] PlantError),
    /// The design is not one the board accepts.
    #[error("the board refuses the design for this axis: {}", super::refusal::message(.0))]
    #[diagnostic(
        code(wheeleg::bench::design),
        help(
            "the axis's data lie outside what the joint board supports; see the parameter table in SPEC.md"
        )
    )]
    Design(ConfigError),
    /// A value that the board's parameter table does not hold.
    #[error(
        "the design needs `{name}` = {} {unit}; a joint board allows {} to {} {unit}",
        brief(*.value),
        brief(*.min),
        brief(*.max)
    )]
    #[diagnostic(
        code(wheeleg::bench::parameter),
        help(
            "the axis's data lie outside what the joint board supports; see the parameter table in SPEC.md"
        )
    )]
    Parameter {
        /// Name in the table.
        name: &'static str,
        /// Value that the design needs.
        value: f64,
        /// Smallest value of the table.
        min: f64,
        /// Largest value of the table.
        max: f64,
        /// Unit.
        unit: &'static str,
    },
    /// The board refuses the set of parameters.
    #[error("{0}")]
    #[diagnostic(
        code(wheeleg::bench::board),
        help("please report this with the axis file")
    )]
    Board(String),
}
