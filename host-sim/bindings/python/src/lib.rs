//! The Python package `wheeleg`: the simulator's plant and the boards' firmware, from the same
//! source, with numpy arrays in and out.
//!
//! Nothing is modelled here. A class wraps a type of a crate below, checks its inputs, and turns rows into
//! arrays. The interpreter lock is released during a simulation.
//!
//! # Glossary
//!
//! * **axis**: the file of one cylinder with its valves, mass and sensor
//! * **cylinder**: the plant of an axis; its inputs are the valves' on-times
//! * **board**: the application of a joint board; its inputs are readings and references
//! * **axis simulation**: both in closed loop; its inputs are references
//! * **robot**: the whole robot in a scenario; its inputs are commands of the master
//! * **state**: everything that decides how it goes on, taken and put back bit for bit

mod axis;
mod axis_sim;
mod board;
mod columns;
mod cylinder;
mod error;
mod input;
mod robot;

use pyo3::prelude::*;

#[pymodule(gil_used = false)]
fn _wheeleg(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add_class::<axis::Axis>()?;
    module.add_class::<cylinder::Cylinder>()?;
    module.add_class::<board::Board>()?;
    module.add_class::<board::BoardState>()?;
    module.add_class::<axis_sim::AxisSim>()?;
    module.add_class::<axis_sim::AxisSimState>()?;
    module.add_class::<robot::Robot>()?;
    module.add("ConfigError", py.get_type::<error::ConfigError>())?;
    module.add("SimulationError", py.get_type::<error::SimulationError>())?;
    module.add("LAWS", error::laws())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
