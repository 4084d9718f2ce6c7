//! Writes another value into the text of a file, which the file's own reader then checks.

use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value};

use crate::params::ParameterInfo;
use crate::quantity::Dimension;

/// Splits a path into keys, each with its index if the key holds a list.
fn parts(path: &str) -> Vec<(&str, Option<usize>)> {
    path.split('.')
        .map(|part| match split_index(part) {
            Some((key, index)) => (key, Some(index)),
            None => (part, None),
        })
        .collect()
}

/// `events[0]` as `events` and 0.
pub(crate) fn split_index(part: &str) -> Option<(&str, usize)> {
    let (key, index) = part.strip_suffix(']')?.rsplit_once('[')?;
    Some((key, index.parse().ok()?))
}

/// The table that holds the last part of a path, created if missing.
fn holder<'a>(document: &'a mut DocumentMut, path: &str) -> Option<&'a mut Item> {
    let mut item = document.as_item_mut();
    let parts = parts(path);
    let (_, above) = parts.split_last()?;
    for (key, index) in above {
        let table = item.as_table_like_mut()?;
        if !table.contains_key(key) {
            table.insert(key, Item::Table(Table::new()));
        }
        item = table.get_mut(key)?;
        if let Some(index) = index {
            item = match item {
                Item::ArrayOfTables(list) => {
                    // An item of its own kind is needed below.
                    let _ = list.get(*index)?;
                    item.get_mut(*index)?
                }
                _ => item.get_mut(*index)?,
            };
        }
    }
    Some(item)
}

/// Replaces the seed of each of a scenario's fields of rocks.
pub(crate) fn set_ground_seed(document: &mut DocumentMut, seed: u64) {
    let parts = document
        .get_mut("terrain")
        .and_then(Item::as_array_of_tables_mut);
    for part in parts.into_iter().flat_map(ArrayOfTables::iter_mut) {
        if let Some(value) = part.get_mut("seed") {
            // TOML has no whole number above 2^63: such a seed is quoted.
            *value = match i64::try_from(seed) {
                Ok(number) => toml_edit::value(number),
                Err(_) => toml_edit::value(seed.to_string()),
            };
        }
    }
}

fn last(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// Writes a quantity; false if the path leads nowhere.
pub(crate) fn set_quantity(
    document: &mut DocumentMut,
    info: &ParameterInfo,
    values: &[f64],
    unit: &str,
    source: &str,
) -> bool {
    let flag = info.dimension == Some(Dimension::Flag);
    let number = |v: f64| -> Value {
        if flag {
            (v != 0.0).into()
        } else if info.whole && v.fract() == 0.0 && v.abs() < 9e15 {
            (v as i64).into()
        } else {
            v.into()
        }
    };
    let value = match values {
        [one] => number(*one),
        many => Value::Array(many.iter().map(|v| number(*v)).collect()),
    };
    let unit = (!flag).then_some(unit);
    set_stated(document, &info.path, value, unit, source)
}

/// Writes a value with its unit and source; false if the path leads nowhere.
pub(crate) fn set_stated(
    document: &mut DocumentMut,
    path: &str,
    value: Value,
    unit: Option<&str>,
    source: &str,
) -> bool {
    let mut table = InlineTable::new();
    table.insert("value", value);
    if let Some(unit) = unit {
        table.insert("unit", unit.into());
    }
    table.insert("source", source.into());
    set(document, path, Value::InlineTable(table))
}

/// Writes a plain value; false if the path leads nowhere.
pub(crate) fn set(document: &mut DocumentMut, path: &str, value: Value) -> bool {
    let Some(table) = holder(document, path).and_then(Item::as_table_like_mut) else {
        return false;
    };
    table.insert(last(path), Item::Value(value));
    true
}

/// The text at a path of a file, if there is one.
pub(crate) fn text<'a>(document: &'a DocumentMut, path: &str) -> Option<&'a str> {
    let mut item = document.as_item();
    for (key, index) in parts(path) {
        item = item.get(key)?;
        if let Some(index) = index {
            item = item.get(index)?;
        }
    }
    item.as_str()
}

/// Replaces the bars of a scenario.
pub(crate) fn set_bars(document: &mut DocumentMut, bars: &ArrayOfTables) {
    // Tables remember their position, and would land among those of the other file.
    let mut bars = bars.clone();
    for table in bars.iter_mut() {
        table.set_position(None);
    }
    document.insert("bars", Item::ArrayOfTables(bars));
}

/// Adds a fault to a scenario.
pub(crate) fn add_fault(document: &mut DocumentMut, fault: &str) {
    let table = document.as_table_mut();
    match table.get_mut("faults").and_then(Item::as_array_mut) {
        Some(list) => list.push(fault),
        None => {
            let list: toml_edit::Array = [fault].into_iter().collect();
            table.insert("faults", Item::Value(Value::Array(list)));
        }
    }
}
