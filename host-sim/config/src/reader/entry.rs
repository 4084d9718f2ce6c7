//! Tables of a file with the positions of their keys.

use std::ops::Range;

use toml_edit::{Item, TableLike, Value};

/// Key, position of the key, and item.
pub(super) type Field = (String, Range<usize>, Item);

/// The fields of one table, with the positions of their keys.
pub(crate) struct Entry {
    /// Dotted path of the table.
    pub(crate) path: String,
    pub(super) fields: Vec<Field>,
    /// Position of the table.
    pub(crate) span: Range<usize>,
}

impl Entry {
    /// Position of the key, and the item.
    pub(crate) fn get(&self, key: &str) -> Option<(Range<usize>, Item)> {
        self.fields
            .iter()
            .find(|(k, ..)| k == key)
            .map(|(_, span, item)| (span.clone(), item.clone()))
    }

    pub(crate) fn field_path(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }
}

pub(super) fn fields(table: &dyn TableLike) -> Vec<Field> {
    table
        .iter()
        .map(|(name, item)| {
            let span = table
                .key(name)
                .and_then(toml_edit::Key::span)
                .or_else(|| item.span())
                .unwrap_or(0..0);
            (name.to_owned(), span, item.clone())
        })
        .collect()
}

pub(super) fn number(value: Option<&Value>) -> Option<f64> {
    match value? {
        Value::Integer(i) => Some(*i.value() as f64),
        Value::Float(f) => Some(*f.value()).filter(|f| f.is_finite()),
        _ => None,
    }
}
