//! Errors as Python exceptions, in the words of the program.

use miette::Diagnostic;
use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use wheeleg_config::plain_text;
use wheeleg_plant::PlantError;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::axis_sim::suite::AxisSimError;

create_exception!(
    wheeleg,
    ConfigError,
    PyValueError,
    "A file, a parameter or a command is wrong: names file, field, value and allowed range."
);
create_exception!(
    wheeleg,
    SimulationError,
    PyRuntimeError,
    "The simulation cannot go on: the plant has left its range, or the robot does not get ready."
);

/// Wrong input.
pub(crate) fn config(error: &dyn Diagnostic) -> PyErr {
    ConfigError::new_err(plain_text(error))
}

/// Wrong input that is no file's.
pub(crate) fn value(message: impl Into<String>) -> PyErr {
    ConfigError::new_err(message.into())
}

/// An error that ends a simulation.
pub(crate) fn simulation(error: &dyn Diagnostic) -> PyErr {
    SimulationError::new_err(plain_text(error))
}

/// Of the plant: an input or a parameter out of its range is the caller's.
pub(crate) fn plant(error: &PlantError) -> PyErr {
    match error {
        PlantError::Parameter { .. } | PlantError::Input { .. } => value(error.to_string()),
        _ => SimulationError::new_err(error.to_string()),
    }
}

/// An error of an axis with its board: as [`plant`] for the plant's parameters; otherwise it ended.
pub(crate) fn bench(error: &AxisSimError) -> PyErr {
    match error {
        AxisSimError::Plant(error) => plant(error),
        other => simulation(other),
    }
}

/// Names of the control laws.
pub(crate) fn laws() -> Vec<&'static str> {
    Kind::ALL.map(Kind::name).to_vec()
}
