//! Tables of a file with the positions of their keys.

use std::ops::Range;

use toml_edit::{Item, TableLike, Value, value};

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
    pub(crate) fn get(&self, key: &str) -> Option<(Range<usize>, &Item)> {
        let mut fields = self.fields.iter();
        let (_, span, item) = fields.find(|(k, ..)| k == key)?;
        Some((span.clone(), item))
    }

    /// Whether there is such a field.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.fields.iter().any(|(k, ..)| k == key)
    }

    /// Names and positions of the keys, in the order of the file.
    pub(crate) fn keys(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let keys = self.fields.iter();
        keys.map(|(key, span, _)| (key.as_str(), span.clone()))
    }

    /// The table that a field holds, if it holds one.
    pub(crate) fn table(&self, key: &str) -> Option<Entry> {
        let (key_span, item) = self.get(key)?;
        let table = item.as_table_like()?;
        Some(Entry {
            path: self.field_path(key),
            fields: fields(table),
            span: item.span().unwrap_or(key_span),
        })
    }

    /// All fields in one line, in the order of the file.
    pub(crate) fn text(&self) -> String {
        let fields = self.fields.iter();
        let all = fields.map(|(key, _, item)| format!("{key} = {}", item.to_string().trim()));
        all.collect::<Vec<_>>().join(", ")
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

/// The number at the start of a text, and the rest.
fn split_number(text: &str) -> Option<(Value, &str)> {
    let number = |text: &str| match text.parse::<i64>() {
        Ok(whole) => Some(Value::from(whole)),
        Err(_) => text.parse::<f64>().ok().map(Value::from),
    };
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    if let Some(value) = number(word) {
        return Some((value, rest));
    }
    // Without a space. A unit may begin with a character that could be part of a number.
    let is_part = |c: char| c.is_ascii_digit() || "+-._eE".contains(c);
    let longest = text.find(|c| !is_part(c)).unwrap_or(text.len());
    (1..=longest).rev().find_map(|end| {
        let (begin, unit) = text.split_at_checked(end)?;
        Some((number(begin)?, unit))
    })
}

/// A number whose decimal comma is replaced by a point: `0,5 s` is `0.5 s`.
pub(super) fn with_point(text: &str) -> Option<String> {
    let (whole, rest) = text.split_once(',')?;
    let digits = |text: &str| !text.is_empty() && text.chars().all(|c| c.is_ascii_digit());
    let behind = rest
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(rest.len());
    let (decimals, unit) = rest.split_at(behind);
    let sign_less = whole.trim_start_matches(['+', '-']);
    // With a second comma, as in 1,234,5, it is something else.
    let one = digits(sign_less) && !decimals.is_empty() && !unit.starts_with([',', '.']);
    one.then(|| format!("{whole}.{rest}"))
}

/// The fields of a quantity in short form, `"10 s"` or `true`: its value, and its unit if it has one. `None`
/// if there is no number in it.
pub(super) fn short(item: &Item, span: &Range<usize>) -> Option<Vec<Field>> {
    let field = |key: &str, item| (key.to_owned(), span.clone(), item);
    if let Some(flag) = item.as_bool() {
        return Some(vec![field("value", value(flag))]);
    }
    let (number, unit) = split_number(item.as_str()?.trim())?;
    let mut fields = vec![field("value", value(number))];
    if !unit.trim().is_empty() {
        fields.push(field("unit", value(unit.trim())));
    }
    Some(fields)
}
