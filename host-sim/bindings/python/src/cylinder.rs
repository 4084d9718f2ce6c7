//! The plant of an axis.

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use wheeleg_config::MASSES_KG;
use wheeleg_plant::assembly::CylinderOutputs;
use wheeleg_plant::axis::{Axis as Plant, AxisState, LOADS_N};

use crate::axis::AxisLike;
use crate::columns::{self, Columns};
use crate::error;
use crate::input::{self, Series, Series4};

/// Observable values after a tick.
struct Row {
    time_s: f64,
    outputs: CylinderOutputs,
    load_n: f64,
    code: f64,
    supply_pa: f64,
    air_kg: f64,
}

const COLUMNS: &Columns<Row> = &[
    ("time_s", |r| r.time_s),
    ("stroke_m", |r| r.outputs.stroke_m),
    ("velocity_m_s", |r| r.outputs.velocity_m_s),
    ("acceleration_m_s2", |r| r.outputs.acceleration_m_s2),
    ("pressure_a_pa", |r| r.outputs.pressure_pa[0]),
    ("pressure_b_pa", |r| r.outputs.pressure_pa[1]),
    ("pressure_force_n", |r| r.outputs.forces.pressure_n),
    ("friction_force_n", |r| r.outputs.forces.friction_n),
    ("end_stop_force_n", |r| r.outputs.forces.end_stop_n),
    ("load_n", |r| r.load_n),
    ("code", |r| r.code),
    ("supply_pa", |r| r.supply_pa),
    ("air_kg", |r| r.air_kg),
];

/// One cylinder with four on/off valves and a moving mass: the plant alone.
///
/// Cylinder(axis, *, seed): an Axis, or the name or path of one. The seed makes the noise of the
/// position converter; it is at rest at time 0.
#[pyclass(module = "wheeleg")]
pub(crate) struct Cylinder {
    plant: Plant,
    state: AxisState,
    /// Code of the converter at the last tick.
    code: u16,
}

impl Cylinder {
    fn step(&mut self, on_us: [u16; 4]) -> Result<(), wheeleg_plant::PlantError> {
        self.plant.tick(&mut self.state, on_us)?;
        self.code = self.plant.read_position(&mut self.state);
        Ok(())
    }

    fn row(&self) -> Row {
        let core = &self.state.core;
        Row {
            time_s: core.time_ns as f64 * 1e-9,
            outputs: self.plant.outputs(&self.state),
            load_n: core.motion.load_n,
            code: f64::from(self.code),
            supply_pa: self.plant.assembly.supply.pressure_pa(core.supply.mass_kg),
            air_kg: core.cylinders[0].supply_mass_kg,
        }
    }
}

#[pymethods]
impl Cylinder {
    #[new]
    #[pyo3(signature = (axis, *, seed))]
    fn new(axis: AxisLike<'_>, seed: &Bound<'_, PyAny>) -> PyResult<Self> {
        let seed = input::number("seed", seed, u64::MAX)?;
        let plant = Plant::new(&axis.config()?.axis).map_err(|e| error::plant(&e))?;
        let mut state = plant.initial_state(seed);
        let code = plant.read_position(&mut state);
        Ok(Self { plant, state, code })
    }

    /// One tick of 1 ms with the on-times of fill A, vent A, fill B, vent B, whole µs, 0 to 1000.
    fn tick(&mut self, on_us: Vec<f64>) -> PyResult<()> {
        let on_us = input::on_times("on_us", &on_us)?;
        self.step(on_us).map_err(|e| error::plant(&e))
    }

    /// A tick per row of on_us (n x 4, µs), with loads on the rod (n, N, positive extends) if they
    /// are given. Gives arrays by name, each value as it is after its tick. The interpreter lock
    /// is released.
    #[pyo3(signature = (on_us, load_n = None))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        on_us: Series4<'_>,
        load_n: Option<Series<'_>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let given = on_us.as_array();
        let checked = given.rows().into_iter().enumerate();
        let on_us: Vec<[u16; 4]> = checked
            .map(|(k, row)| input::on_times(&format!("on_us[{k}]"), &row.to_vec()))
            .collect::<PyResult<_>>()?;
        let load_n = input::beside("load_n", load_n.as_ref(), LOADS_N, on_us.len())?;
        let mut rows = Vec::with_capacity(on_us.len());
        let tick = |k: usize| {
            if let Some(load_n) = &load_n {
                self.state.core.motion.load_n = load_n[k];
            }
            self.step(on_us[k])?;
            rows.push(self.row());
            Ok(())
        };
        input::unlocked(py, on_us.len(), tick, error::plant)?;
        columns::rows(py, COLUMNS, &rows)
    }

    /// What is seen now, by name; code is the converter's reading, 16 bits left-aligned.
    fn outputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns::row(py, COLUMNS, &self.row())
    }

    /// Force on the rod, N, -10000 to 10000, positive extends.
    #[getter]
    fn load_n(&self) -> f64 {
        self.state.core.motion.load_n
    }

    #[setter]
    fn set_load_n(&mut self, load_n: f64) -> PyResult<()> {
        self.state.core.motion.load_n = input::within(&"load_n", load_n, LOADS_N)?;
        Ok(())
    }

    /// Moving mass, kg, 0.02 to 200.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.state.core.motion.mass_kg
    }

    #[setter]
    fn set_mass_kg(&mut self, mass_kg: f64) -> PyResult<()> {
        self.state.core.motion.mass_kg = input::within(&"mass_kg", mass_kg, MASSES_KG)?;
        Ok(())
    }

    /// Everything that decides how it goes on, as bytes; to be kept with the axis.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let json = serde_json::to_vec(&(&self.state, self.code));
        let json = json.map_err(|e| error::value(format!("the state cannot be written: {e}")))?;
        Ok(PyBytes::new(py, &json))
    }

    /// Puts a state back that was taken of a cylinder of the same axis.
    fn restore(&mut self, state: &[u8]) -> PyResult<()> {
        let (state, code): (AxisState, u16) = serde_json::from_slice(state)
            .map_err(|e| error::value(format!("this is not a state of a cylinder: {e}")))?;
        if state.core.cylinders.len() != 1 {
            return Err(error::value("this is not a state of one cylinder"));
        }
        (self.state, self.code) = (state, code);
        Ok(())
    }

    /// BLAKE3 of the plant's state, hexadecimal.
    fn state_hash(&self) -> String {
        hex(&self.plant.state_hash(&self.state))
    }
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
