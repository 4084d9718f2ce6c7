//! Values of a factor.

use serde::{Deserialize, Serialize};
use toml_edit::Item;

use crate::reader::{Entry, Reader};

/// Longest text, bytes: every row of a table holds it.
const TEXT_MOST: usize = 500;

/// A value of a factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// Yes or no.
    Flag(bool),
    /// A number in the unit of the factor.
    Number(f64),
    /// A name: of a scenario, a robot, a law, or of anything else that files name.
    Text(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Flag(flag) => flag.fmt(f),
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// A list of values, all of one kind, none twice.
pub(super) fn list(r: &mut Reader, entry: &Entry, key: &str) -> Option<Vec<Value>> {
    let path = entry.field_path(key);
    let Some((span, item)) = entry.get(key) else {
        let message = format!("`{path}` is missing");
        let help = Some(format!("write `{key} = [ … ]`"));
        r.problem(Some(entry.span.clone()), message, "expected here", help);
        return None;
    };
    let values: Vec<Value> = one_kind(item).unwrap_or_default();
    let twice = values.iter().enumerate();
    let twice = twice.filter(|(i, v)| values[..*i].contains(v)).count();
    if values.is_empty() || twice > 0 {
        r.problem(
            item.span().or(Some(span)),
            format!(
                "`{path}` = {} must be a non-empty list of numbers, of names (up to {TEXT_MOST} \
                 bytes) or of true and false, none of them twice",
                item.to_string().trim()
            ),
            "not a list of values",
            Some(format!(
                "write `{key} = [0.5, 1.0]` or `{key} = [\"NAME\"]`; NaN and infinity are no values"
            )),
        );
        return None;
    }
    Some(values)
}

fn one_kind(item: &Item) -> Option<Vec<Value>> {
    let list = item.as_array()?;
    let value = |v: &toml_edit::Value| {
        let number = v.as_float().or(v.as_integer().map(|n| n as f64));
        let text = v.as_str().filter(|text| text.len() <= TEXT_MOST);
        let text = text.map(|text| Value::Text(text.to_owned()));
        let flag = v.as_bool().map(Value::Flag);
        number
            .filter(|n| n.is_finite())
            .map(Value::Number)
            .or(text)
            .or(flag)
    };
    let values: Vec<Value> = list.iter().map(value).collect::<Option<_>>()?;
    let kind = values.first().map(std::mem::discriminant);
    let same = values
        .iter()
        .all(|v| Some(std::mem::discriminant(v)) == kind);
    same.then_some(values)
}
