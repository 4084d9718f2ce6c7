//! Rows of the simulation as named columns: one row as a dictionary of numbers, many as one of arrays.

use numpy::IntoPyArray as _;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Columns of a kind of row: name with its unit, and the value, SI.
pub(crate) type Columns<R> = [(&'static str, fn(&R) -> f64)];

/// One row as numbers by name.
pub(crate) fn row<'py, R>(
    py: Python<'py>,
    columns: &Columns<R>,
    row: &R,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, value) in columns {
        dict.set_item(name, value(row))?;
    }
    Ok(dict)
}

/// Many rows as arrays by name.
pub(crate) fn rows<'py, R>(
    py: Python<'py>,
    columns: &Columns<R>,
    rows: &[R],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, value) in columns {
        let column: Vec<f64> = rows.iter().map(value).collect();
        dict.set_item(name, column.into_pyarray(py))?;
    }
    Ok(dict)
}
