//! An axis file.

use std::collections::HashMap;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use wheeleg_config::AxisConfig;
use wheeleg_config::axis::{AXES, Change};

use crate::error;

/// One cylinder with its valves, mass and sensor, as its file has it.
///
/// Axis(name_or_path) reads a built-in axis (Axis.built_in()) or a TOML file.
#[pyclass(frozen, module = "wheeleg")]
pub(crate) struct Axis {
    file: String,
    text: String,
    pub(crate) config: AxisConfig,
}

/// Value of a parameter from Python.
#[derive(FromPyObject)]
pub(crate) enum Given {
    /// `true`, of a flag.
    Flag(bool),
    /// A number that has no unit.
    Number(f64),
    /// `"2.5 kg"`.
    Text(String),
    /// `([1.0, 1.0, 1.1, 1.0], "1")`.
    List(Vec<f64>, String),
}

impl Axis {
    fn of(file: String, text: String) -> PyResult<Self> {
        let config = AxisConfig::parse(&file, &text).map_err(|e| error::config(&e))?;
        Ok(Self { file, text, config })
    }
}

fn change(path: String, given: Given) -> PyResult<Change> {
    let (values, unit) = match given {
        Given::Flag(flag) => (vec![f64::from(u8::from(flag))], "flag".to_owned()),
        Given::Number(number) => (vec![number], "1".to_owned()),
        Given::List(values, unit) => (values, unit),
        Given::Text(text) => {
            let (number, unit) = text.trim().split_once(' ').unwrap_or((text.trim(), "1"));
            let number = number.parse().map_err(|_| {
                error::value(format!(
                    "`{path}` = \"{text}\": write a number and its unit, as \"2.5 kg\""
                ))
            })?;
            (vec![number], unit.trim().to_owned())
        }
    };
    Ok(Change {
        path,
        values,
        unit,
        source: "ASSUMED: set from Python".to_owned(),
    })
}

#[pymethods]
impl Axis {
    #[new]
    fn new(name_or_path: &str) -> PyResult<Self> {
        let source = AxisConfig::source(name_or_path).map_err(|e| error::config(&e))?;
        Self::of(source.file, source.text)
    }

    /// An axis from TOML text; `file` is its name in messages.
    #[staticmethod]
    #[pyo3(signature = (text, file = "axis.toml"))]
    fn parse(text: String, file: &str) -> PyResult<Self> {
        Self::of(file.to_owned(), text)
    }

    /// Names of the built-in axes.
    #[staticmethod]
    fn built_in() -> Vec<&'static str> {
        AXES.iter().map(|(name, ..)| *name).collect()
    }

    /// The axis with other values, checked as a file is: {"moving.mass": "2.5 kg"}. A list is
    /// given with its unit: ([1.0, 1.0, 1.1, 1.0], "1").
    fn with_values(&self, values: HashMap<String, Given>) -> PyResult<Self> {
        let mut changes = values
            .into_iter()
            .map(|(path, given)| change(path, given))
            .collect::<PyResult<Vec<_>>>()?;
        changes.sort_by(|a, b| a.path.cmp(&b.path));
        let text = AxisConfig::rewritten(&self.file, &self.text, &changes)
            .map_err(|e| error::config(&e))?;
        Self::of(self.file.clone(), text)
    }

    /// Name.
    #[getter]
    fn name(&self) -> &str {
        &self.config.name
    }

    /// One line about it.
    #[getter]
    fn description(&self) -> &str {
        &self.config.description
    }

    /// Text of the file.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// Stroke, m.
    #[getter]
    fn stroke_m(&self) -> f64 {
        self.config.axis.cylinder.stroke_m
    }

    /// Every parameter by its path: value (or values), unit, min, max, source, doc.
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for info in &self.config.parameters {
            let one = PyDict::new(py);
            match info.value.as_slice() {
                [value] => one.set_item("value", value)?,
                values => one.set_item("value", values)?,
            }
            one.set_item("unit", &info.unit)?;
            one.set_item("min", info.min)?;
            one.set_item("max", info.max)?;
            one.set_item("source", &info.source)?;
            one.set_item("doc", info.doc)?;
            all.set_item(&info.path, one)?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        format!("Axis({:?})", self.config.name)
    }
}

/// An axis, or the name or path of one.
#[derive(FromPyObject)]
pub(crate) enum AxisLike<'py> {
    /// Read already.
    Axis(PyRef<'py, Axis>),
    /// To be read.
    Name(String),
}

impl AxisLike<'_> {
    /// Its parameters.
    pub(crate) fn config(&self) -> PyResult<AxisConfig> {
        match self {
            Self::Axis(axis) => Ok(axis.config.clone()),
            Self::Name(name) => AxisConfig::load(name).map_err(|e| error::config(&e)),
        }
    }
}
