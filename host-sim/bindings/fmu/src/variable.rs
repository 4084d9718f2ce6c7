//! Variables that an importer sets and reads: one table for the description and for the calls.

use wheeleg_config::{AxisConfig, Dimension, ParameterInfo};
use wheeleg_plant::axis::{LOADS_N, TICK_US};
use wheeleg_studies::axis_sim::{REFERENCES_M, SPEEDS_M_S};

use crate::kind::Kind;
use crate::simulation::Seen;
use crate::value::Value;

/// Role of a variable for an importer.
#[derive(Debug, Clone, Copy)]
pub enum Role {
    /// Time, which an importer knows itself.
    Time,
    /// Seed of the ADC noise; set before the start.
    Seed,
    /// Number of the axis file: index in its listing, component; set before the start.
    Parameter {
        /// Index in [`AxisConfig::parameters`].
        index: usize,
        /// Component, 0 of a scalar.
        component: usize,
    },
    /// Set before each step.
    Input,
    /// Read.
    Output(fn(&Seen) -> Value),
}

/// A variable. Its value reference is its index in the list.
#[derive(Debug, Clone)]
pub struct Variable {
    /// Name, as in the Python package and in axis files.
    pub name: String,
    /// Unit as written, empty of pure numbers.
    pub unit: String,
    /// Dimension of the unit.
    pub dimension: Dimension,
    /// Meaning.
    pub description: String,
    /// Its role for an importer.
    pub role: Role,
    /// Value at the start; of an output only its type counts.
    pub start: Value,
    /// Smallest and largest value allowed.
    pub range: Option<[f64; 2]>,
}

/// An input: name, unit, dimension, range, meaning, value at the start.
type InputRow = (
    &'static str,
    &'static str,
    Dimension,
    [f64; 2],
    &'static str,
    fn(&AxisConfig) -> f64,
);

const ON_TIME_US: [f64; 2] = [0.0, TICK_US as f64];

const LOAD: InputRow = (
    "load_n",
    "N",
    Dimension::Force,
    LOADS_N,
    "Force on the rod, positive extends",
    |axis| axis.axis.load_n,
);

const PLANT_INPUTS: [InputRow; 5] = [
    on_time(
        "fill_a_us",
        "On-time of the fill valve of chamber A in a tick of 1 ms; rounded to µs",
    ),
    on_time("vent_a_us", "On-time of the vent valve of chamber A"),
    on_time("fill_b_us", "On-time of the fill valve of chamber B"),
    on_time("vent_b_us", "On-time of the vent valve of chamber B"),
    LOAD,
];

const CONTROLLED_INPUTS: [InputRow; 3] = [
    (
        "reference_m",
        "m",
        Dimension::Length,
        REFERENCES_M,
        "Stroke set-point; the board takes it every 10 ms",
        |axis| axis.axis.initial_stroke_m,
    ),
    (
        "reference_velocity_m_s",
        "m/s",
        Dimension::Velocity,
        SPEEDS_M_S,
        "Speed of the reference",
        |_| 0.0,
    ),
    LOAD,
];

const fn on_time(name: &'static str, meaning: &'static str) -> InputRow {
    (name, "us", Dimension::Time, ON_TIME_US, meaning, |_| 0.0)
}

fn inputs(kind: Kind) -> &'static [InputRow] {
    match kind {
        Kind::Plant => &PLANT_INPUTS,
        Kind::Controlled => &CONTROLLED_INPUTS,
    }
}

/// An output: name, unit, dimension, meaning, value.
type OutputRow = (
    &'static str,
    &'static str,
    Dimension,
    &'static str,
    fn(&Seen) -> Value,
);

const OUTPUTS: [OutputRow; 10] = [
    (
        "stroke_m",
        "m",
        Dimension::Length,
        "Stroke of the piston",
        |s| Value::Real(s.outputs.stroke_m),
    ),
    (
        "velocity_m_s",
        "m/s",
        Dimension::Velocity,
        "Speed of the piston",
        |s| Value::Real(s.outputs.velocity_m_s),
    ),
    (
        "acceleration_m_s2",
        "m/s2",
        Dimension::Acceleration,
        "Acceleration of the piston",
        |s| Value::Real(s.outputs.acceleration_m_s2),
    ),
    (
        "pressure_a_pa",
        "Pa",
        Dimension::Pressure,
        "Absolute pressure in chamber A",
        |s| Value::Real(s.outputs.pressure_pa[0]),
    ),
    (
        "pressure_b_pa",
        "Pa",
        Dimension::Pressure,
        "Absolute pressure in chamber B",
        |s| Value::Real(s.outputs.pressure_pa[1]),
    ),
    (
        "pressure_force_n",
        "N",
        Dimension::Force,
        "Force of the air on the piston",
        |s| Value::Real(s.outputs.forces.pressure_n),
    ),
    (
        "friction_force_n",
        "N",
        Dimension::Force,
        "Friction at the seals",
        |s| Value::Real(s.outputs.forces.friction_n),
    ),
    (
        "end_stop_force_n",
        "N",
        Dimension::Force,
        "Force of an end stop",
        |s| Value::Real(s.outputs.forces.end_stop_n),
    ),
    (
        "supply_pa",
        "Pa",
        Dimension::Pressure,
        "Absolute pressure in the reservoir",
        |s| Value::Real(s.supply_pa),
    ),
    (
        "air_kg",
        "kg",
        Dimension::Mass,
        "Air taken from the reservoir since the start",
        |s| Value::Real(s.air_kg),
    ),
];

const PLANT_OUTPUTS: [OutputRow; 1] = [(
    "code",
    "",
    Dimension::Number,
    "Reading of the position converter, 16 bits left-aligned",
    |s| Value::Integer(i32::from(s.code)),
)];

const BOARD_OUTPUTS: [OutputRow; 8] = [
    (
        "measured_m",
        "m",
        Dimension::Length,
        "Stroke as the board reads it",
        |s| Value::Real(s.board.measured_mm * 1e-3),
    ),
    (
        "fill_a_us",
        "us",
        Dimension::Time,
        "On-time of the fill valve of chamber A in the next tick",
        |s| Value::Real(f64::from(s.board.on_us[0])),
    ),
    (
        "vent_a_us",
        "us",
        Dimension::Time,
        "On-time of the vent valve of chamber A",
        |s| Value::Real(f64::from(s.board.on_us[1])),
    ),
    (
        "fill_b_us",
        "us",
        Dimension::Time,
        "On-time of the fill valve of chamber B",
        |s| Value::Real(f64::from(s.board.on_us[2])),
    ),
    (
        "vent_b_us",
        "us",
        Dimension::Time,
        "On-time of the vent valve of chamber B",
        |s| Value::Real(f64::from(s.board.on_us[3])),
    ),
    (
        "settled",
        "",
        Dimension::Flag,
        "The board holds the valves shut, at rest at its target",
        |s| Value::Boolean(s.board.settled),
    ),
    (
        "driving",
        "",
        Dimension::Flag,
        "The board is armed, and its law drives the valves",
        |s| Value::Boolean(s.board.driving),
    ),
    (
        "faults",
        "",
        Dimension::Number,
        "Latched faults, one bit each; docs/reference/faults.md",
        |s| Value::Integer(i32::from(s.board.faults.raw())),
    ),
];

/// Every variable of a unit: time, seed, inputs, outputs, parameters.
pub(crate) fn list(kind: Kind, axis: &AxisConfig) -> Vec<Variable> {
    let mut list = vec![
        Variable {
            name: "time".into(),
            unit: "s".into(),
            dimension: Dimension::Time,
            description: "Time".into(),
            role: Role::Time,
            start: Value::Real(0.0),
            range: None,
        },
        Variable {
            name: "seed".into(),
            unit: String::new(),
            dimension: Dimension::Number,
            description: "Seed of the ADC noise".into(),
            role: Role::Seed,
            start: Value::Integer(1),
            range: Some([0.0, f64::from(i32::MAX)]),
        },
    ];
    let rows = inputs(kind).iter();
    list.extend(
        rows.map(|(name, unit, dimension, range, meaning, start)| Variable {
            name: (*name).into(),
            unit: (*unit).into(),
            dimension: *dimension,
            description: (*meaning).into(),
            role: Role::Input,
            start: Value::Real(start(axis)),
            range: Some(*range),
        }),
    );
    let own: &[OutputRow] = match kind {
        Kind::Plant => &PLANT_OUTPUTS,
        Kind::Controlled => &BOARD_OUTPUTS,
    };
    let rows = OUTPUTS.iter().chain(own);
    list.extend(
        rows.map(|(name, unit, dimension, meaning, value)| Variable {
            name: (*name).into(),
            unit: (*unit).into(),
            dimension: *dimension,
            description: (*meaning).into(),
            role: Role::Output(*value),
            start: value(&Seen::default()),
            range: None,
        }),
    );
    for (index, info) in axis.parameters.iter().enumerate() {
        // The load is an input; two variables for one thing would conflict.
        if info.path != "moving.load" {
            list.extend((0..info.value.len()).map(|component| parameter(index, component, info)));
        }
    }
    list
}

fn parameter(index: usize, component: usize, info: &ParameterInfo) -> Variable {
    let number = info.value[component];
    let dimension = info.dimension.unwrap_or(Dimension::Number);
    // A number that the file's reader accepts as whole is well within 32 bits.
    let start = match dimension {
        Dimension::Flag => Value::Boolean(number != 0.0),
        _ if info.whole => Value::Integer(number as i32),
        _ => Value::Real(number),
    };
    let name = match info.value.len() {
        1 => info.path.clone(),
        // FMI's structured names count from 1, as axis files' lists are read.
        _ => format!("{}[{}]", info.path, component + 1),
    };
    let unit = match info.unit.as_str() {
        "1" | "flag" => String::new(),
        unit => unit.to_owned(),
    };
    Variable {
        name,
        unit,
        dimension,
        description: info.doc.trim().to_owned(),
        role: Role::Parameter { index, component },
        start,
        range: (dimension != Dimension::Flag).then_some([info.min, info.max]),
    }
}
