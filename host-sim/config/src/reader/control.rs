//! Control characters in the texts of a file.

use std::ops::Range;

use toml_edit::{Item, Value};

/// A path, its first control character, and the position of that.
pub(super) type Found = (String, char, Option<Range<usize>>);

/// The first character of a text that cannot be shown in a page or another file.
fn first(text: &str) -> Option<char> {
    let mut all = text.chars();
    all.find(|c| c.is_control() && !matches!(c, '\n' | '\r' | '\t'))
}

/// Finds every text and every name below an item that has a control character.
pub(super) fn find(path: &str, item: &Item, found: &mut Vec<Found>) {
    if let Some(table) = item.as_table_like() {
        for (name, below) in table.iter() {
            // Leave out characters that cannot be shown.
            let shown: String = name.chars().filter(|c| !c.is_control()).collect();
            let path = match path {
                "" => shown,
                above => format!("{above}.{shown}"),
            };
            if let Some(c) = first(name) {
                let span = table.key(name).and_then(toml_edit::Key::span);
                found.push((path.clone(), c, span));
            }
            find(&path, below, found);
        }
    } else if let Some(tables) = item.as_array_of_tables() {
        for (i, table) in tables.iter().enumerate() {
            find(&format!("{path}[{i}]"), &Item::Table(table.clone()), found);
        }
    } else if let Some(value) = item.as_value() {
        of_value(path, value, found);
    }
}

fn of_value(path: &str, value: &Value, found: &mut Vec<Found>) {
    if let Some(c) = value.as_str().and_then(first) {
        found.push((path.to_owned(), c, value.span()));
    }
    for (i, element) in value.as_array().into_iter().flatten().enumerate() {
        let path = format!("{path}[{i}]");
        match element.as_inline_table() {
            Some(table) => {
                let table = Item::Value(Value::InlineTable(table.clone()));
                find(&path, &table, found);
            }
            None => of_value(&path, element, found),
        }
    }
}
