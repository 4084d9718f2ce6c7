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

/// Distance between the seeds of two fields of rocks in one scenario: farther than seeds are counted.
const NEXT_FIELD: u64 = 1 << 56;

/// Replaces the seed of each of a scenario's fields of rocks. The first gets this seed; each of the others one of
/// its own, or all fields would have the same rocks.
pub(crate) fn set_ground_seed(document: &mut DocumentMut, seed: u64) {
    // TOML has no whole number above 2^63: such a seed is quoted.
    let value = |seed: u64| -> Value {
        match i64::try_from(seed) {
            Ok(number) => number.into(),
            Err(_) => seed.to_string().into(),
        }
    };
    let fields = (0_u64..).map(|field| value(seed.wrapping_add(field.wrapping_mul(NEXT_FIELD))));
    match document.get_mut("terrain") {
        Some(Item::ArrayOfTables(parts)) => {
            let parts = parts.iter_mut().filter_map(|part| part.get_mut("seed"));
            for (part, seed) in parts.zip(fields) {
                *part = Item::Value(seed);
            }
        }
        Some(Item::Value(Value::Array(parts))) => {
            let parts = parts.iter_mut().filter_map(Value::as_inline_table_mut);
            for (part, seed) in parts.filter_map(|part| part.get_mut("seed")).zip(fields) {
                *part = seed;
            }
        }
        _ => {}
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The seeds of a terrain's parts, as a number or as a text.
    fn seeds(document: &DocumentMut) -> Vec<(Option<i64>, Option<&str>)> {
        let seeds: Vec<&Value> = match &document["terrain"] {
            Item::ArrayOfTables(parts) => {
                let seeds = parts.iter().filter_map(|part| part.get("seed"));
                seeds.filter_map(Item::as_value).collect()
            }
            Item::Value(Value::Array(parts)) => {
                let parts = parts.iter().filter_map(Value::as_inline_table);
                parts.filter_map(|part| part.get("seed")).collect()
            }
            _ => Vec::new(),
        };
        let kinds = seeds.into_iter();
        kinds
            .map(|seed| (seed.as_integer(), seed.as_str()))
            .collect()
    }

    /// Parts of a terrain may be sections or a list.
    #[test]
    fn the_seed_of_rocks_is_replaced_however_a_terrain_is_written() {
        for text in [
            "[[terrain]]\nkind = \"plane\"\n[[terrain]]\nkind = \"rocks\"\nseed = 1\n",
            "terrain = [{ kind = \"plane\" }, { kind = \"rocks\", seed = 1 }]\n",
        ] {
            for (seed, written) in [
                (7, (Some(7), None)),
                (u64::MAX, (None, Some("18446744073709551615"))),
            ] {
                let mut document: DocumentMut = text.parse().expect("TOML");
                assert_eq!(seeds(&document), [(Some(1), None)]);
                set_ground_seed(&mut document, seed);
                assert_eq!(seeds(&document), [written]);
            }
        }
    }

    /// Two fields of one scenario have rocks of their own.
    #[test]
    fn every_field_of_rocks_gets_a_seed_of_its_own() {
        let text = "[[terrain]]\nseed = 1\n[[terrain]]\nkind = \"plane\"\n[[terrain]]\nseed = 2\n";
        let mut document: DocumentMut = text.parse().expect("TOML");
        set_ground_seed(&mut document, 5);
        let next = 5 + (1 << 56);
        assert_eq!(seeds(&document), [(Some(5), None), (Some(next), None)]);
    }
}
