//! Reads a TOML file with positions, and collects everything that is wrong.

use std::ops::Range;
use std::sync::Arc;

use toml_edit::{Document, Item, TableLike, Value};

use super::error::{ConfigError, Problem};
use super::params::{FieldSpec, ParameterInfo, Params};
use super::quantity::{Dimension, pretty};
use super::suggest::closest;

/// A parsed file and the problems found so far.
pub(crate) struct Reader {
    file: String,
    text: Arc<str>,
    document: Document<String>,
    problems: Vec<Problem>,
    parameters: Vec<ParameterInfo>,
    /// Whether every quantity must name its source.
    source_required: bool,
}

impl Reader {
    /// Parses `text`; `file` is the name shown in messages.
    pub(crate) fn parse(
        what: &str,
        file: &str,
        text: &str,
        source_required: bool,
    ) -> Result<Self, ConfigError> {
        let shared: Arc<str> = Arc::from(text);
        match Document::parse(text.to_owned()) {
            Ok(document) => Ok(Self {
                file: file.to_owned(),
                text: shared,
                document,
                problems: Vec::new(),
                parameters: Vec::new(),
                source_required,
            }),
            Err(e) => {
                let span = e.span().unwrap_or(0..0);
                let message = format!("not valid TOML: {}", e.message());
                let problem = Problem::at(file, &shared, span, message, "here", None);
                Err(ConfigError::new(what, vec![problem]))
            }
        }
    }

    /// The result: what was read, or every problem found.
    pub(crate) fn finish<T>(
        self,
        what: &str,
        value: Option<T>,
    ) -> Result<(T, Vec<ParameterInfo>), ConfigError> {
        match value {
            Some(value) if self.problems.is_empty() => Ok((value, self.parameters)),
            _ => Err(ConfigError::new(what, self.problems)),
        }
    }

    pub(crate) fn problem(
        &mut self,
        span: Option<Range<usize>>,
        message: String,
        label: impl Into<String>,
        help: Option<String>,
    ) {
        let span = span.unwrap_or(0..0);
        self.problems.push(Problem::at(
            &self.file, &self.text, span, message, label, help,
        ));
    }

    fn item(&self, path: &str) -> Option<&Item> {
        let mut item = self.document.as_item();
        if path.is_empty() {
            return Some(item);
        }
        for key in path.split('.') {
            item = item.as_table_like()?.get(key)?;
        }
        Some(item)
    }

    /// Number of entries of the array of tables at `path`; a wrong type is a
    /// problem, absence is zero.
    pub(crate) fn array_len(&mut self, path: &str) -> usize {
        let Some(item) = self.item(path) else {
            return 0;
        };
        match (item.as_array_of_tables(), item.as_array()) {
            (Some(tables), _) => tables.len(),
            (None, Some(array)) => array.len(),
            _ => {
                let span = item.span();
                let message = format!("`{path}` must be a list of tables");
                let help = format!("write each entry under a [[{path}]] heading");
                self.problem(span, message, "not a list", Some(help));
                0
            }
        }
    }

    /// Lifts entry `index` of an array of tables out as its own reader level.
    pub(crate) fn entry(&self, path: &str, index: usize) -> Entry {
        let item = self.item(path);
        let table: Option<(Vec<Field>, Range<usize>)> = item.and_then(|i| {
            if let Some(tables) = i.as_array_of_tables() {
                tables
                    .get(index)
                    .map(|t| (fields(t), t.span().unwrap_or(0..0)))
            } else {
                let value = i.as_array()?.get(index)?;
                let span = value.span().unwrap_or(0..0);
                value.as_inline_table().map(|t| (fields(t), span))
            }
        });
        let (fields, span) = table.unwrap_or((Vec::new(), 0..0));
        Entry {
            path: format!("{path}[{index}]"),
            fields,
            span,
        }
    }

    /// The table at `path` as an entry.
    pub(crate) fn table(&self, path: &str) -> Option<Entry> {
        let item = self.item(path)?;
        let table = item.as_table_like()?;
        Some(Entry {
            path: path.to_owned(),
            fields: fields(table),
            span: item.span().unwrap_or(0..0),
        })
    }

    /// Reads the section `[path]` of parameters.
    pub(crate) fn section<T: Params>(&mut self, path: &str) -> Option<T> {
        let Some(entry) = self.table(path) else {
            let keys: Vec<&str> = T::FIELDS.iter().map(|f| f.key).collect();
            self.problem(
                None,
                format!("section [{path}] is missing"),
                "expected somewhere in this file",
                Some(format!("it holds: {}", keys.join(", "))),
            );
            return None;
        };
        let known: Vec<&str> = T::FIELDS.iter().map(|f| f.key).collect();
        self.reject_unknown(&entry, &known);
        let missing: Vec<&FieldSpec> = T::FIELDS
            .iter()
            .filter(|f| entry.get(f.key).is_none())
            .collect();
        if !missing.is_empty() {
            let names: Vec<String> = missing
                .iter()
                .map(|f| format!("{} ({})", f.key, f.dimension.units()[0].0))
                .collect();
            self.problem(
                Some(entry.span.clone()),
                format!("[{path}] lacks {}", names.join(", ")),
                "in this section",
                Some("every parameter must be given: there are no hidden defaults".into()),
            );
        }
        let values: Vec<Option<Vec<f64>>> = T::FIELDS
            .iter()
            .map(|spec| {
                entry
                    .get(spec.key)
                    .and_then(|_| self.quantity(&entry, spec))
            })
            .collect();
        let complete: Vec<Vec<f64>> = values.into_iter().collect::<Option<_>>()?;
        let mut values = complete.into_iter();
        Some(T::build(&mut || values.next().unwrap_or_default()))
    }

    /// Reports every field of `entry` that is not in `known`.
    pub(crate) fn reject_unknown(&mut self, entry: &Entry, known: &[&str]) {
        for (key, span, _) in &entry.fields {
            if known.contains(&key.as_str()) {
                continue;
            }
            let place = match entry.path.as_str() {
                "" => "at the top of the file".to_owned(),
                path => format!("in [{path}]"),
            };
            let help = match closest(key, known.iter().copied()) {
                Some(word) => format!("did you mean `{word}`?"),
                None => format!("known here: {}", known.join(", ")),
            };
            self.problem(
                Some(span.clone()),
                format!("unknown field `{key}` {place}"),
                "not known",
                Some(help),
            );
        }
    }

    /// Reads one quantity `{ value, unit, source }` in SI.
    pub(crate) fn quantity(&mut self, entry: &Entry, spec: &FieldSpec) -> Option<Vec<f64>> {
        let path = entry.field_path(spec.key);
        let (key_span, item) = entry.get(spec.key)?;
        let example = format!(
            "write `{} = {{ value = …, unit = \"{}\"{} }}`",
            spec.key,
            spec.dimension.units()[0].0,
            if self.source_required {
                ", source = \"…\""
            } else {
                ""
            }
        );
        let Some(table) = item.as_table_like() else {
            self.problem(
                item.span().or(Some(key_span)),
                format!("`{path}` has no unit"),
                "a bare value",
                Some(example),
            );
            return None;
        };
        let inner = Entry {
            path: path.clone(),
            fields: fields(table),
            span: item.span().unwrap_or(key_span),
        };
        self.reject_unknown(&inner, &["value", "unit", "source"]);

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
        let written = self.numbers(&path, spec, &value, span.clone(), &unit)?;
        let mut ok = true;
        for v in &written {
            let si = v * factor;
            // Half an ulp of slack: 20 * 1e-3 may round above a limit of 0.02.
            let slack = 4.0 * f64::EPSILON * si.abs();
            if !(si >= spec.min - slack && si <= spec.max + slack) {
                ok = false;
                self.problem(
                    Some(span.clone()),
                    format!(
                        "`{path}` = {} {unit} is out of range: allowed {} to {} {unit}",
                        pretty(*v),
                        pretty(spec.min / factor),
                        pretty(spec.max / factor)
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
                    format!("`{path}` = {} must be a whole number", pretty(*v)),
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
            doc: spec.doc,
        });
        Some(written.into_iter().map(|v| v * factor).collect())
    }

    /// Reads a quantity that has exactly one unit: value, position of the
    /// value, source.
    pub(crate) fn table_quantity(
        &mut self,
        entry: &Entry,
        key: &str,
        unit: &str,
        doc: &str,
    ) -> Option<(f64, Range<usize>, String)> {
        let path = entry.field_path(key);
        let (key_span, item) = entry.get(key)?;
        let example = format!("write `{key} = {{ value = …, unit = \"{unit}\", source = \"…\" }}`");
        let Some(table) = item.as_table_like() else {
            let span = item.span().or(Some(key_span));
            let message = format!("`{path}` has no unit; accepted: \"{unit}\"");
            self.problem(span, message, "a bare value", Some(example));
            return None;
        };
        let inner = Entry {
            path: path.clone(),
            fields: fields(table),
            span: item.span().unwrap_or(key_span),
        };
        self.reject_unknown(&inner, &["value", "unit", "source"]);
        let source = self.source(&inner);
        let value = inner.get("value");
        let number_found = value.as_ref().and_then(|(_, v)| number(v.as_value()));
        let found = value.as_ref().map_or_else(
            || "nothing".to_owned(),
            |(_, v)| v.to_string().trim().to_owned(),
        );
        let Some((value, number_found)) = value.zip(number_found) else {
            let message =
                format!("`{path}` needs a finite number in {unit} as its value, not {found}");
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

    /// Adds a parameter to the listing.
    pub(crate) fn list(&mut self, info: ParameterInfo) {
        self.parameters.push(info);
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
        if spec.dimension == Dimension::Flag && inner.get("unit").is_none() {
            return Some((1.0, "flag".into()));
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
        self.problem(
            span,
            message,
            "wrong unit",
            Some(format!("{path}: {}", spec.doc)),
        );
        None
    }

    fn numbers(
        &mut self,
        path: &str,
        spec: &FieldSpec,
        value: &Item,
        span: Range<usize>,
        unit: &str,
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
            _ => {
                let expected = match (spec.dimension, spec.components) {
                    (Dimension::Flag, _) => "true or false".to_owned(),
                    (_, 1) => format!("a finite number in {unit}"),
                    (_, n) => format!("a list of {n} finite numbers in {unit}"),
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

    /// Reads a text field; `None` and a problem if it is missing or not a text.
    pub(crate) fn text(&mut self, entry: &Entry, key: &str) -> Option<String> {
        let path = entry.field_path(key);
        let Some((key_span, item)) = entry.get(key) else {
            self.problem(
                Some(entry.span.clone()),
                format!("`{path}` is missing"),
                "expected here",
                Some(format!("write `{key} = \"…\"`")),
            );
            return None;
        };
        match item.as_str() {
            Some(text) => Some(text.to_owned()),
            None => {
                let message = format!("`{path}` = {} must be a text", item.to_string().trim());
                self.problem(item.span().or(Some(key_span)), message, "not a text", None);
                None
            }
        }
    }

    /// Reads an optional list of texts, each of which `parse` turns into a value
    /// or says why not.
    pub(crate) fn texts<T>(
        &mut self,
        entry: &Entry,
        key: &str,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Vec<T> {
        let Some((key_span, item)) = entry.get(key) else {
            return Vec::new();
        };
        let path = entry.field_path(key);
        let Some(list) = item.as_array() else {
            let message = format!("`{path}` = {} must be a list", item.to_string().trim());
            let example = format!("write `{key} = [\"…\", \"…\"]`");
            let span = item.span().or(Some(key_span));
            self.problem(span, message, "not a list", Some(example));
            return Vec::new();
        };
        let mut values = Vec::new();
        for (i, element) in list.iter().enumerate() {
            let parsed = match element.as_str() {
                Some(text) => parse(text),
                None => Err(format!("{} is not a text", element.to_string().trim())),
            };
            match parsed {
                Ok(value) => values.push(value),
                Err(reason) => {
                    let span = element.span().or_else(|| Some(key_span.clone()));
                    self.problem(span, format!("`{path}[{i}]`: {reason}"), "not usable", None);
                }
            }
        }
        values
    }

    /// Reads a text field that must be one of `choices`.
    pub(crate) fn choice<T: Copy>(
        &mut self,
        entry: &Entry,
        key: &str,
        choices: &[(&str, T)],
    ) -> Option<T> {
        let text = self.text(entry, key)?;
        if let Some((_, value)) = choices.iter().find(|(name, _)| *name == text) {
            return Some(*value);
        }
        let names: Vec<String> = choices.iter().map(|(n, _)| format!("\"{n}\"")).collect();
        let span = entry.get(key).and_then(|(k, i)| i.span().or(Some(k)));
        let help = closest(&text, choices.iter().map(|(n, _)| *n))
            .map(|word| format!("did you mean \"{word}\"?"));
        self.problem(
            span,
            format!(
                "`{}` = \"{text}\" is not known; accepted: {}",
                entry.field_path(key),
                names.join(", ")
            ),
            "not known",
            help,
        );
        None
    }

    /// Reads a whole number without unit, such as a seed.
    pub(crate) fn whole(&mut self, entry: &Entry, key: &str, max: u64) -> Option<u64> {
        let (key_span, item) = entry.get(key)?;
        let value = item.as_integer().and_then(|v| u64::try_from(v).ok());
        match value {
            Some(v) if v <= max => Some(v),
            _ => {
                let message = format!(
                    "`{}` = {} must be a whole number from 0 to {max}",
                    entry.field_path(key),
                    item.to_string().trim()
                );
                self.problem(item.span().or(Some(key_span)), message, "not allowed", None);
                None
            }
        }
    }
}

/// Key, position of the key, and item.
type Field = (String, Range<usize>, Item);

/// The fields of one table, with the positions of their keys.
pub(crate) struct Entry {
    /// Dotted path of the table.
    pub(crate) path: String,
    fields: Vec<Field>,
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

    fn field_path(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }
}

fn fields(table: &dyn TableLike) -> Vec<Field> {
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

fn number(value: Option<&Value>) -> Option<f64> {
    match value? {
        Value::Integer(i) => Some(*i.value() as f64),
        Value::Float(f) => Some(*f.value()).filter(|f| f.is_finite()),
        _ => None,
    }
}
