//! Checks values from Python: a wrong one is reported with its place and its range.

use std::fmt::Display;

use numpy::{AllowTypeChange, PyArrayLike1, PyArrayLike2};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use wheeleg_plant::axis::TICK_US;

use crate::error;

/// Ticks between two looks at the signals of the interpreter.
const CHUNK: usize = 2000;

/// Longest number that a message shows, digits.
const SHOWN: usize = 40;

/// Numbers one a tick.
pub(crate) type Series<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;
/// Four numbers a tick.
pub(crate) type Series4<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

/// A number within a range; `what` names it.
pub(crate) fn within(what: &dyn Display, value: f64, [min, max]: [f64; 2]) -> PyResult<f64> {
    if value >= min && value <= max {
        Ok(value)
    } else {
        Err(error::value(format!(
            "{what} = {value} is outside {min} to {max}"
        )))
    }
}

/// A whole number of Python, of any length, from 0 to `most`: a seed, the place of a case.
pub(crate) fn number(what: &str, value: &Bound<'_, PyAny>, most: u64) -> PyResult<u64> {
    match value.extract::<u64>() {
        Ok(number) if number <= most => return Ok(number),
        // Another type.
        Err(e) if !e.is_instance_of::<PyOverflowError>(value.py()) => return Err(e),
        _ => {}
    }
    // Python writes no number of more than some thousand digits.
    let shown = value
        .str()
        .map_or_else(|_| String::new(), |text| text.to_string());
    let shown = if (1..=SHOWN).contains(&shown.len()) {
        shown
    } else {
        "a number of very many digits".to_owned()
    };
    Err(error::value(format!(
        "{what} = {shown} is outside 0 to {most}"
    )))
}

/// A whole number within a range.
pub(crate) fn whole(what: &dyn Display, value: f64, max: u16) -> PyResult<u16> {
    let value = within(what, value, [0.0, f64::from(max)])?;
    if value.fract() == 0.0 {
        Ok(value as u16)
    } else {
        Err(error::value(format!(
            "{what} = {value} is not a whole number"
        )))
    }
}

/// On-times of the four valves, µs.
pub(crate) fn on_times(what: &str, values: &[f64]) -> PyResult<[u16; 4]> {
    if values.len() != 4 {
        return Err(error::value(format!(
            "{what} has {} values, not 4: fill A, vent A, fill B, vent B",
            values.len()
        )));
    }
    let mut on_us = [0; 4];
    for (i, (to, value)) in on_us.iter_mut().zip(values).enumerate() {
        *to = whole(&format_args!("{what}[{i}]"), *value, TICK_US)?;
    }
    Ok(on_us)
}

/// A series entirely within a range.
pub(crate) fn series(what: &str, values: &Series<'_>, range: [f64; 2]) -> PyResult<Vec<f64>> {
    let values = values.as_array();
    let checked = values.iter().enumerate();
    checked
        .map(|(i, v)| within(&format_args!("{what}[{i}]"), *v, range))
        .collect()
}

/// A series beside another one, of the same length.
pub(crate) fn beside(
    what: &str,
    values: Option<&Series<'_>>,
    range: [f64; 2],
    length: usize,
) -> PyResult<Option<Vec<f64>>> {
    let Some(values) = values else {
        return Ok(None);
    };
    let values = series(what, values, range)?;
    if values.len() == length {
        Ok(Some(values))
    } else {
        Err(error::value(format!(
            "{what} has {} values, not {length} as the ticks",
            values.len()
        )))
    }
}

/// Simulates `ticks` ticks without the interpreter lock. Ctrl-C ends it between two chunks.
pub(crate) fn unlocked<E: Send>(
    py: Python<'_>,
    ticks: usize,
    mut tick: impl FnMut(usize) -> Result<(), E> + Send,
    failed: impl Fn(&E) -> PyErr,
) -> PyResult<()> {
    let mut begin = 0;
    while begin < ticks {
        let end = ticks.min(begin + CHUNK);
        py.detach(|| (begin..end).try_for_each(&mut tick))
            .map_err(|e| failed(&e))?;
        py.check_signals()?;
        begin = end;
    }
    Ok(())
}
