//! Quantities: a value with unit and source.

use std::ops::Range;

use toml_edit::Item;

use super::entry::{fields, number, short, with_point};
use super::{Entry, Reader};
use crate::params::{FieldSpec, ParameterInfo};
use crate::quantity::{Dimension, pretty, suffix};

/// The allowed range, in words.
pub(crate) fn range(min: f64, max: f64, unit: &str) -> String {
    format!("{} to {}{}", pretty(min), pretty(max), suffix(unit))
}

impl Reader {
    /// Reads one quantity `{ value, unit, source }` in SI.
    pub(crate) fn quantity(&mut self, entry: &Entry, spec: &FieldSpec) -> Option<Vec<f64>> {
        let path = entry.field_path(spec.key);
        let example = self.example(spec);
        let (key_span, item) = entry.get(spec.key)?;
        let bare = item.as_bool().is_none() && !item.is_table_like();
        if spec.dimension == Dimension::Flag && !self.source_required && bare {
            let message = format!(
                "`{path}` = {} must be true or false",
                item.to_string().trim()
            );
            self.problem(
                item.span().or(Some(key_span)),
                message,
                "wrong type",
                Some(example),
            );
            return None;
        }
        let inner = match self.bare_number(entry, spec) {
            Some(number) => number,
            None => self.stated(entry, spec.key, &spec.dimension.unit_names(), &example)?,
        };
        let source = self.source(&inner);
        let (factor, unit) = self.unit(&inner, spec, &example)?;
        let Some((value_key, value)) = inner.get("value") else {
            self.problem(
                Some(inner.span.clone()),
                format!("`{path}` has no value"),
                "expected `value = …`",
                Some(example),
            );
            return None;
        };
        let span = value.span().unwrap_or(value_key);
        let range = range(spec.min / factor, spec.max / factor, &unit);
        let written = self.numbers(&path, spec, value, span.clone(), &range)?;
        let mut ok = true;
        for v in &written {
            let si = self.si(*v, factor);
            // Half an ulp of slack: 20 * 1e-3 may round above a limit of 0.02.
            let slack = 4.0 * f64::EPSILON * si.abs();
            if !(si >= spec.min - slack && si <= spec.max + slack) {
                ok = false;
                self.problem(
                    Some(span.clone()),
                    format!(
                        "`{path}` = {}{} is out of range: allowed {range}",
                        pretty(*v),
                        suffix(&unit)
                    ),
                    "out of range",
                    Some(format!("{path}: {}", spec.doc)),
                );
                break;
            }
            if spec.integer && v.fract() != 0.0 {
                ok = false;
                self.problem(
                    Some(span.clone()),
                    format!(
                        "`{path}` = {} must be a whole number from {range}",
                        pretty(*v)
                    ),
                    "not whole",
                    None,
                );
                break;
            }
        }
        if !ok {
            return None;
        }
        self.parameters.push(ParameterInfo {
            path,
            value: written.clone(),
            unit,
            min: spec.min / factor,
            max: spec.max / factor,
            source,
            dimension: Some(spec.dimension),
            whole: spec.integer,
            doc: spec.doc,
        });
        Some(written.into_iter().map(|v| self.si(v, factor)).collect())
    }

    /// A value in SI. In a scenario `57 mm` is `0.057 m` to the last bit, which a product with 0.001 is not.
    /// In robots and axes the unit is part of their identity.
    fn si(&self, value: f64, factor: f64) -> f64 {
        let shift = factor.log10().round() as i32;
        let is_decimal = shift < 0 && format!("1e{shift}").parse() == Ok(factor);
        if self.source_required || !is_decimal {
            return value * factor;
        }
        // Keep the digits, and move the point.
        let written = format!("{value:e}");
        let moved = written.split_once('e').and_then(|(digits, exponent)| {
            let exponent = exponent.parse::<i32>().ok()? + shift;
            format!("{digits}e{exponent}").parse().ok()
        });
        moved.unwrap_or(value * factor)
    }

    /// A pure number needs no unit if no source is required.
    fn bare_number(&self, entry: &Entry, spec: &FieldSpec) -> Option<Entry> {
        let (key, item) = entry.get(spec.key)?;
        let bare = item.is_integer() || item.is_float() || item.is_array();
        (spec.dimension == Dimension::Number && !self.source_required && bare).then(|| {
            let span = item.span().unwrap_or(key);
            Entry {
                path: entry.field_path(spec.key),
                fields: vec![("value".to_owned(), span.clone(), item.clone())],
                span,
            }
        })
    }

    /// Reads a required quantity.
    pub(crate) fn required(&mut self, entry: &Entry, spec: &FieldSpec) -> Option<f64> {
        if entry.has(spec.key) {
            return self.quantity(entry, spec).and_then(|v| v.first().copied());
        }
        let place = if entry.path.is_empty() {
            "at the top of the file".to_owned()
        } else {
            format!("in [{}]", entry.path)
        };
        let example = self.example(spec);
        self.problem(
            Some(entry.span.clone()),
            format!("`{}` is missing {place}", spec.key),
            "expected here",
            Some(example),
        );
        None
    }

    /// Reads a quantity that has exactly one unit, with its `range` for help: value, position of the value,
    /// source.
    pub(crate) fn table_quantity(
        &mut self,
        entry: &Entry,
        key: &str,
        (unit, range): (&str, &str),
        doc: &str,
    ) -> Option<(f64, Range<usize>, String)> {
        let path = entry.field_path(key);
        let example = format!("write `{key} = {{ value = …, unit = \"{unit}\", source = \"…\" }}`");
        let inner = self.stated(entry, key, &format!("\"{unit}\""), &example)?;
        let source = self.source(&inner);
        let value = inner.get("value");
        let number_found = value.as_ref().and_then(|(_, v)| number(v.as_value()));
        let found = value.as_ref().map_or_else(
            || "nothing".to_owned(),
            |(_, v)| v.to_string().trim().to_owned(),
        );
        let Some((value, number_found)) = value.zip(number_found) else {
            let message =
                format!("`{path}` needs a finite number from {range} as its value, not {found}");
            self.problem(
                Some(inner.span.clone()),
                message,
                "no number",
                Some(example),
            );
            return None;
        };
        let written = inner.get("unit");
        if written.as_ref().and_then(|(_, u)| u.as_str()) != Some(unit) {
            let span = written
                .and_then(|(k, i)| i.span().or(Some(k)))
                .unwrap_or(inner.span);
            let message = format!(
                "`{path}` (value {}) is in another unit; accepted: \"{unit}\"",
                pretty(number_found)
            );
            self.problem(
                Some(span),
                message,
                "wrong unit",
                Some(format!("{path}: {doc}")),
            );
            return None;
        }
        let span = value.1.span().unwrap_or(value.0);
        Some((number_found, span, source))
    }

    /// Example of a quantity.
    fn example(&self, spec: &FieldSpec) -> String {
        let key = spec.key;
        let unit = spec.dimension.units()[0].0;
        let value = match spec.components {
            1 => "…".to_owned(),
            several => format!("[{}]", vec!["…"; several].join(", ")),
        };
        match (self.source_required, spec.dimension) {
            (true, _) => {
                format!("write `{key} = {{ value = {value}, unit = \"{unit}\", source = \"…\" }}`")
            }
            (false, Dimension::Number) => format!("write `{key} = {value}`, without unit"),
            (false, Dimension::Flag) => format!("write `{key} = true` or `{key} = false`"),
            // The short form has one number.
            (false, _) if spec.components > 1 => {
                format!("write `{key} = {{ value = {value}, unit = \"{unit}\" }}`")
            }
            (false, _) => format!(
                "write `{key} = {{ value = …, unit = \"{unit}\" }}`, or `{key} = \"… {unit}\"`"
            ),
        }
    }

    /// The table `{ value, unit, source }` of `key`, if it is there. If no source is required, a text such as
    /// `"10 s"` means the same.
    fn stated(&mut self, entry: &Entry, key: &str, units: &str, example: &str) -> Option<Entry> {
        let path = entry.field_path(key);
        let (key_span, item) = entry.get(key)?;
        let span = item.span().unwrap_or(key_span);
        if let Some((text, point)) = item.as_str().and_then(|t| Some((t, with_point(t.trim())?))) {
            self.decimal_comma(&path, span, text, &point);
            return None;
        }
        if let (false, Some(fields)) = (self.source_required, short(item, &span)) {
            return Some(Entry { path, fields, span });
        }
        let Some(table) = item.as_table_like() else {
            let (message, label) = match item.as_str() {
                Some(text) if !self.source_required => (
                    format!("`{path}` = \"{text}\" does not begin with a number; units: {units}"),
                    "a bare value",
                ),
                // The short form, which cannot hold a source.
                Some(text) if short(item, &span).is_some() => {
                    (format!("`{path}` = \"{text}\" has no source"), "no source")
                }
                _ => (
                    format!("`{path}` has no unit; accepted: {units}"),
                    "a bare value",
                ),
            };
            self.problem(Some(span), message, label, Some(example.to_owned()));
            return None;
        };
        let inner = Entry {
            path,
            fields: fields(table),
            span,
        };
        self.reject_unknown(&inner, &["value", "unit", "source"]);
        Some(inner)
    }

    /// Many countries write numbers with a comma; TOML and this program need a point.
    fn decimal_comma(&mut self, path: &str, span: Range<usize>, text: &str, point: &str) {
        self.problem(
            Some(span),
            format!("`{path}` = \"{text}\" has a decimal comma"),
            "a comma",
            Some(format!("numbers have a decimal point: write \"{point}\"")),
        );
    }

    fn source(&mut self, inner: &Entry) -> String {
        match inner.get("source") {
            Some((key, item)) => match item.as_str().map(str::trim) {
                Some(text) if !text.is_empty() => return text.to_owned(),
                _ => self.problem(
                    item.span().or(Some(key)),
                    format!("`{}.source` must be a text", inner.path),
                    "not a text",
                    None,
                ),
            },
            None if self.source_required => self.problem(
                Some(inner.span.clone()),
                format!("`{}` has no source", inner.path),
                "expected `source = \"…\"`",
                Some(
                    "say where the value comes from: \"PAPER …\", \"DATASHEET …\", \
                     \"DERIVED …\" or \"ASSUMED …\""
                        .into(),
                ),
            ),
            None => {}
        }
        String::new()
    }

    fn unit(&mut self, inner: &Entry, spec: &FieldSpec, example: &str) -> Option<(f64, String)> {
        let path = &inner.path;
        if spec.dimension == Dimension::Flag && !inner.has("unit") {
            return Some((1.0, "flag".into()));
        }
        let pure = spec.dimension == Dimension::Number && !self.source_required;
        if pure && !inner.has("unit") {
            return Some((1.0, "1".into()));
        }
        let Some((key, item)) = inner.get("unit") else {
            self.problem(
                Some(inner.span.clone()),
                format!(
                    "`{path}` has no unit; accepted: {}",
                    spec.dimension.unit_names()
                ),
                "expected `unit = \"…\"`",
                Some(example.to_owned()),
            );
            return None;
        };
        let span = item.span().or(Some(key));
        let Some(unit) = item.as_str() else {
            let message = format!(
                "`{path}.unit` must be a text; accepted: {}",
                spec.dimension.unit_names()
            );
            self.problem(span, message, "not a text", None);
            return None;
        };
        if let Some(factor) = spec.dimension.factor(unit) {
            return Some((factor, unit.to_owned()));
        }
        let value = inner.get("value").map_or_else(String::new, |(_, v)| {
            format!(" (value {})", v.to_string().trim())
        });
        let message = format!(
            "`{path}`{value} is in \"{unit}\"; accepted: {}",
            spec.dimension.unit_names()
        );
        let mut units = spec.dimension.units().iter().map(|(name, _)| name);
        let help = match units.find(|name| name.eq_ignore_ascii_case(unit)) {
            // The end of a number such as 0,2,1 reads as a unit.
            _ if unit.starts_with(',') => "numbers have a decimal point: 0.2, not 0,2".to_owned(),
            _ if unit.contains(|c: char| c.is_ascii_digit())
                && !unit.starts_with(char::is_alphabetic) =>
            {
                "numbers are written as 1000, 0.5 or 1e3".to_owned()
            }
            _ if unit.starts_with("x") => "numbers are written as 16, 0.5 or 1e3".to_owned(),
            // Both signs for micro; letters that look like other ones.
            _ if unit.starts_with(['µ', 'μ']) => {
                let plain = unit.replacen(['µ', 'μ'], "u", 1);
                format!("units have plain letters: \"{plain}\" for \"{unit}\"")
            }
            _ if !unit.is_ascii() => "units have plain letters, a to z and A to Z".to_owned(),
            Some(meant) => format!("did you mean \"{meant}\"? {path}: {}", spec.doc),
            None => format!("{path}: {}", spec.doc),
        };
        self.problem(span, message, "wrong unit", Some(help));
        None
    }

    fn numbers(
        &mut self,
        path: &str,
        spec: &FieldSpec,
        value: &Item,
        span: Range<usize>,
        range: &str,
    ) -> Option<Vec<f64>> {
        let numbers: Option<Vec<f64>> = if spec.dimension == Dimension::Flag {
            value.as_bool().map(|b| vec![f64::from(u8::from(b))])
        } else if spec.components == 1 {
            number(value.as_value()).map(|n| vec![n])
        } else {
            value
                .as_array()
                .and_then(|a| a.iter().map(|v| number(Some(v))).collect())
        };
        match numbers {
            Some(numbers) if numbers.len() == spec.components => Some(numbers),
            _ if value
                .as_str()
                .is_some_and(|text| with_point(text.trim()).is_some()) =>
            {
                let text = value.as_str().unwrap_or_default().trim();
                let point = with_point(text).unwrap_or_default();
                let help = format!("numbers have a decimal point and no quotes: write {point}");
                let message = format!("`{path}` = \"{text}\" has a decimal comma; allowed {range}");
                self.problem(Some(span), message, "a comma", Some(help));
                None
            }
            _ => {
                let expected = match (spec.dimension, spec.components) {
                    (Dimension::Flag, _) => "true or false".to_owned(),
                    (_, 1) if spec.integer => format!("a whole number from {range}"),
                    (_, 1) => format!("a finite number from {range}"),
                    (_, n) => format!("a list of {n} finite numbers from {range}"),
                };
                self.problem(
                    Some(span),
                    format!("`{path}` = {} must be {expected}", value.to_string().trim()),
                    "wrong type",
                    None,
                );
                None
            }
        }
    }
}
