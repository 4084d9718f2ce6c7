//! Board and plant of an axis in closed loop.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use wheeleg_config::MASSES_KG;
use wheeleg_plant::axis::LOADS_N;
use wheeleg_protocol::param::JointParam;
use wheeleg_studies::axis_sim::{Action, AxisSim as Bench, Node, REFERENCES_M, Row, SPEEDS_M_S};

use crate::axis::AxisLike;
use crate::board::{self, Parameters};
use crate::columns::{self, Columns};
use crate::cylinder::hex;
use crate::error;
use crate::input::{self, Series};

/// A row and its time at the tick's start, s.
struct Timed {
    time_s: f64,
    row: Row,
}

const COLUMNS: &Columns<Timed> = &[
    ("time_s", |t| t.time_s),
    ("reference_m", |t| t.row.reference_m),
    ("stroke_m", |t| t.row.stroke_m),
    ("measured_m", |t| t.row.measured_m),
    ("velocity_m_s", |t| t.row.velocity_m_s),
    ("pressure_a_pa", |t| t.row.pressure_pa[0]),
    ("pressure_b_pa", |t| t.row.pressure_pa[1]),
    ("load_n", |t| t.row.load_n),
    ("fill_a_us", |t| f64::from(t.row.on_us[0])),
    ("vent_a_us", |t| f64::from(t.row.on_us[1])),
    ("fill_b_us", |t| f64::from(t.row.on_us[2])),
    ("vent_b_us", |t| f64::from(t.row.on_us[3])),
    ("switches", |t| t.row.switches as f64),
    ("air_kg", |t| t.row.air_kg),
    ("settled", |t| f64::from(u8::from(t.row.settled))),
];

/// A joint board's firmware on its cylinder, tick by tick of 1 ms. What a board reads acts on the
/// valves one tick later, as on the real one.
///
/// AxisSim(axis, *, seed, law="predictive", parameters=None, sheet=None): axis is the cylinder as
/// it is, sheet the axis that the board was designed for (axis itself if none); the seed makes the
/// noise of the converter; law and parameters as for Board.
#[pyclass(module = "wheeleg")]
pub(crate) struct AxisSim {
    bench: Bench<Node>,
    action: Action,
    commissioned: Vec<(JointParam, i32)>,
}

/// The state of an AxisSim, for restore() in the same process.
#[pyclass(frozen, module = "wheeleg")]
pub(crate) struct AxisSimState {
    bench: Bench<Node>,
    action: Action,
    commissioned: Vec<(JointParam, i32)>,
}

impl AxisSim {
    fn step(
        &mut self,
        reference_m: f64,
        speed_m_s: f64,
    ) -> Result<Timed, wheeleg_studies::axis_sim::suite::AxisSimError> {
        let time_s = self.bench.state.core.time_ns as f64 * 1e-9;
        let (action, row) = self.bench.tick(reference_m, speed_m_s)?;
        self.action = action;
        Ok(Timed { time_s, row })
    }
}

#[pymethods]
impl AxisSim {
    #[new]
    #[pyo3(signature = (axis, *, seed, law = "predictive", parameters = None, sheet = None))]
    fn new(
        axis: AxisLike<'_>,
        seed: &Bound<'_, PyAny>,
        law: &str,
        parameters: Option<Parameters>,
        sheet: Option<AxisLike<'_>>,
    ) -> PyResult<Self> {
        let seed = input::number("seed", seed, u64::MAX)?;
        let real = axis.config()?.axis;
        let known = match sheet {
            Some(sheet) => sheet.config()?.axis,
            None => real.clone(),
        };
        let (node, commissioned) = board::built(&known, law, parameters)?;
        Ok(Self {
            bench: Bench::new(&real, seed, node).map_err(|e| error::bench(&e))?,
            action: Action::default(),
            commissioned,
        })
    }

    /// One tick towards a reference (m) that moves at a speed (m/s). Gives the row of the tick's
    /// start by name; the on-times are those in force during it.
    #[pyo3(signature = (reference_m, velocity_m_s = 0.0))]
    fn tick<'py>(
        &mut self,
        py: Python<'py>,
        reference_m: f64,
        velocity_m_s: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let reference_m = input::within(&"reference_m", reference_m, REFERENCES_M)?;
        let speed_m_s = input::within(&"velocity_m_s", velocity_m_s, SPEEDS_M_S)?;
        let row = self.step(reference_m, speed_m_s);
        columns::row(py, COLUMNS, &row.map_err(|e| error::bench(&e))?)
    }

    /// A tick per reference (n, m), with its speed (n, m/s) and the load on the rod (n, N) if they
    /// are given. Gives arrays by name, a row a tick, as tick() does. The interpreter lock is
    /// released.
    #[pyo3(signature = (reference_m, velocity_m_s = None, load_n = None))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        reference_m: Series<'_>,
        velocity_m_s: Option<Series<'_>>,
        load_n: Option<Series<'_>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let references = input::series("reference_m", &reference_m, REFERENCES_M)?;
        let ticks = references.len();
        let speeds = input::beside("velocity_m_s", velocity_m_s.as_ref(), SPEEDS_M_S, ticks)?;
        let loads = input::beside("load_n", load_n.as_ref(), LOADS_N, ticks)?;
        let mut rows = Vec::with_capacity(ticks);
        let tick = |k: usize| {
            if let Some(loads) = &loads {
                self.bench.state.core.motion.load_n = loads[k];
            }
            let speed_m_s = speeds.as_ref().map_or(0.0, |speeds| speeds[k]);
            rows.push(self.step(references[k], speed_m_s)?);
            Ok(())
        };
        input::unlocked(py, ticks, tick, error::bench)?;
        columns::rows(py, COLUMNS, &rows)
    }

    /// What the board says after its last tick, as Board.snapshot().
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        board::report(py, &self.bench.board, &self.action)
    }

    /// What the board was commissioned with, as Board.parameters().
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        board::listed(py, &self.commissioned)
    }

    /// Force on the rod, N, -10000 to 10000, positive extends.
    #[getter]
    fn load_n(&self) -> f64 {
        self.bench.state.core.motion.load_n
    }

    #[setter]
    fn set_load_n(&mut self, load_n: f64) -> PyResult<()> {
        self.bench.state.core.motion.load_n = input::within(&"load_n", load_n, LOADS_N)?;
        Ok(())
    }

    /// Moving mass, kg, 0.02 to 200.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.bench.state.core.motion.mass_kg
    }

    #[setter]
    fn set_mass_kg(&mut self, mass_kg: f64) -> PyResult<()> {
        self.bench.state.core.motion.mass_kg = input::within(&"mass_kg", mass_kg, MASSES_KG)?;
        Ok(())
    }

    /// Everything that decides how it goes on, for restore() in this process.
    fn state(&self) -> AxisSimState {
        AxisSimState {
            bench: self.bench.clone(),
            action: self.action,
            commissioned: self.commissioned.clone(),
        }
    }

    /// Puts a state back, plant and board.
    fn restore(&mut self, state: &AxisSimState) {
        self.bench = state.bench.clone();
        self.action = state.action;
        self.commissioned.clone_from(&state.commissioned);
    }

    /// BLAKE3 of the plant's state, hexadecimal.
    fn state_hash(&self) -> String {
        hex(&self.bench.axis().state_hash(&self.bench.state))
    }
}
