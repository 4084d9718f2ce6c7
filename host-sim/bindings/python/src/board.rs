//! The application of a joint board.

use std::collections::HashMap;

use numpy::{IntoPyArray as _, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use wheeleg_config::raw_of;
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::Fault;
use wheeleg_protocol::param::JointParam;
use wheeleg_studies::axis_sim::commission::{commission, value};
use wheeleg_studies::axis_sim::suite::AxisSimError;
use wheeleg_studies::axis_sim::{
    Action, Board as _, Kind, Node, REFERENCES_M, SPEEDS_M_S, Sample, design,
};
use wheeleg_units::{AdcCode, PositionMm, VelocityMmS};

use crate::axis::AxisLike;
use crate::error;
use crate::input::{self, Series};

/// Parameters of a board by name, in the unit of the protocol's table.
pub(crate) type Parameters = HashMap<String, f64>;

/// A board for an axis and its commissioned values, by name.
pub(crate) fn built(
    sheet: &AxisParams,
    law: &str,
    parameters: Option<Parameters>,
) -> PyResult<(Node, Vec<(JointParam, i32)>)> {
    let kind = Kind::of_name(law).ok_or_else(|| {
        let laws = error::laws().join(", ");
        error::value(format!("law = {law:?}; allowed: {laws}"))
    })?;
    let mut given: Vec<_> = parameters.unwrap_or_default().into_iter().collect();
    given.sort_by(|a, b| a.0.cmp(&b.0));
    let others = given
        .iter()
        .map(|(name, value)| parameter(name, *value))
        .collect::<PyResult<Vec<_>>>()?;
    let design = design(sheet, kind);
    let node = Node::with(&design, &others).map_err(|e| error::config(&e))?;
    let mut commissioned = commission(&design).map_err(|e| error::config(&e))?;
    commissioned.retain(|(one, _)| others.iter().all(|(other, _)| other != one));
    commissioned.extend(others);
    commissioned.sort_by_key(|(parameter, _)| parameter.id());
    Ok((node, commissioned))
}

fn parameter(name: &str, given: f64) -> PyResult<(JointParam, i32)> {
    let found = JointParam::ALL.iter().find(|p| p.info().name == name);
    let Some(found) = found else {
        let names = JointParam::ALL.iter().map(|p| p.info().name);
        let near = wheeleg_config::closest(name, names)
            .map_or_else(String::new, |near| format!("; did you mean {near:?}?"));
        let message = format!("a joint board has no parameter {name:?}{near}");
        return Err(error::value(message));
    };
    let row = found.info();
    let raw = raw_of(row, given);
    // Also check the number itself: a raw one saturates.
    let [min, max] = [row.min, row.max].map(|raw| value(row, raw));
    if row.permits(raw) && given >= min && given <= max {
        Ok((*found, raw))
    } else {
        Err(error::config(&AxisSimError::Parameter {
            name: row.name,
            value: given,
            min,
            max,
            unit: row.unit,
        }))
    }
}

/// The commissioned values, as numbers by name.
pub(crate) fn listed<'py>(
    py: Python<'py>,
    commissioned: &[(JointParam, i32)],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (parameter, raw) in commissioned {
        let row = parameter.info();
        dict.set_item(row.name, value(row, *raw))?;
    }
    Ok(dict)
}

/// State of a board after a tick.
pub(crate) fn report<'py>(
    py: Python<'py>,
    node: &Node,
    action: &Action,
) -> PyResult<Bound<'py, PyDict>> {
    let snapshot = node.snapshot();
    let dict = PyDict::new(py);
    dict.set_item("measured_m", action.measured_mm * 1e-3)?;
    dict.set_item("velocity_m_s", snapshot.velocity.to_f64() * 1e-3)?;
    dict.set_item("reference_m", snapshot.reference.to_f64() * 1e-3)?;
    dict.set_item("duty", snapshot.duty.to_f64())?;
    dict.set_item("settled", action.settled)?;
    dict.set_item("driving", action.driving)?;
    let faults = Fault::ALL.iter().filter(|f| action.faults.contains(**f));
    let faults: Vec<&str> = faults.map(|fault| fault.name()).collect();
    dict.set_item("faults", faults)?;
    Ok(dict)
}

/// Sample of a tick.
fn sample(code: u16, reference_m: f64, velocity_m_s: f64) -> Sample {
    Sample {
        code: AdcCode::new(code),
        reference: PositionMm::from_f64(reference_m * 1e3),
        reference_velocity: VelocityMmS::from_f64(velocity_m_s * 1e3),
        announced: None,
    }
}

/// The firmware of a joint board, commissioned for an axis: bus, modes, supervision, control law
/// and valve timing. It tests itself and is armed before its first tick.
///
/// Board(axis, *, law="predictive", parameters=None): axis is what the designer knows, an Axis or
/// the name or path of one; law one of LAWS; parameters by name, in the unit of the protocol's
/// table.
#[pyclass(module = "wheeleg")]
pub(crate) struct Board {
    node: Node,
    action: Action,
    commissioned: Vec<(JointParam, i32)>,
}

/// The state of a Board, for restore() in the same process.
#[pyclass(frozen, module = "wheeleg")]
pub(crate) struct BoardState {
    node: Node,
    action: Action,
    commissioned: Vec<(JointParam, i32)>,
}

#[pymethods]
impl Board {
    #[new]
    #[pyo3(signature = (axis, *, law = "predictive", parameters = None))]
    fn new(axis: AxisLike<'_>, law: &str, parameters: Option<Parameters>) -> PyResult<Self> {
        let (node, commissioned) = built(&axis.config()?.axis, law, parameters)?;
        Ok(Self {
            node,
            action: Action::default(),
            commissioned,
        })
    }

    /// One tick of 1 ms: the converter's code (16 bits left-aligned), the reference (m) and its
    /// speed (m/s). Gives the on-times of fill A, vent A, fill B, vent B for the next tick, µs.
    #[pyo3(signature = (code, reference_m, velocity_m_s = 0.0))]
    fn tick<'py>(
        &mut self,
        py: Python<'py>,
        code: f64,
        reference_m: f64,
        velocity_m_s: f64,
    ) -> PyResult<Bound<'py, PyArray1<u16>>> {
        let code = input::whole(&"code", code, u16::MAX)?;
        let reference_m = input::within(&"reference_m", reference_m, REFERENCES_M)?;
        let velocity_m_s = input::within(&"velocity_m_s", velocity_m_s, SPEEDS_M_S)?;
        self.action = self.node.tick(&sample(code, reference_m, velocity_m_s));
        Ok(self.action.on_us.to_vec().into_pyarray(py))
    }

    /// A tick per code, with its reference (m) and, if given, its speed (m/s). Gives the on-times
    /// after each tick (n x 4, µs). The interpreter lock is released.
    #[pyo3(signature = (code, reference_m, velocity_m_s = None))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        code: Series<'_>,
        reference_m: Series<'_>,
        velocity_m_s: Option<Series<'_>>,
    ) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let codes = code.as_array();
        let codes: Vec<u16> = codes
            .iter()
            .enumerate()
            .map(|(k, c)| input::whole(&format_args!("code[{k}]"), *c, u16::MAX))
            .collect::<PyResult<_>>()?;
        let references =
            input::beside("reference_m", Some(&reference_m), REFERENCES_M, codes.len())?
                .unwrap_or_default();
        let speeds = input::beside(
            "velocity_m_s",
            velocity_m_s.as_ref(),
            SPEEDS_M_S,
            codes.len(),
        )?;
        let mut on_us = Vec::with_capacity(codes.len());
        let tick = |k: usize| {
            let speed = speeds.as_ref().map_or(0.0, |speeds| speeds[k]);
            self.action = self.node.tick(&sample(codes[k], references[k], speed));
            on_us.push(self.action.on_us.to_vec());
            Ok::<(), std::convert::Infallible>(())
        };
        input::unlocked(py, codes.len(), tick, |never| match *never {})?;
        if on_us.is_empty() {
            return Ok(PyArray2::zeros(py, [0, 4], false));
        }
        PyArray2::from_vec2(py, &on_us).map_err(|e| error::value(e.to_string()))
    }

    /// What the board says after its last tick: measured_m, velocity_m_s, reference_m, duty,
    /// settled, driving, faults (names).
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report(py, &self.node, &self.action)
    }

    /// What it was commissioned with, by name, in the unit of the protocol's table.
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        listed(py, &self.commissioned)
    }

    /// Everything that decides how it goes on, for restore() in this process.
    fn state(&self) -> BoardState {
        BoardState {
            node: self.node.clone(),
            action: self.action,
            commissioned: self.commissioned.clone(),
        }
    }

    /// Puts a state back.
    fn restore(&mut self, state: &BoardState) {
        self.node = state.node.clone();
        self.action = state.action;
        self.commissioned.clone_from(&state.commissioned);
    }
}
