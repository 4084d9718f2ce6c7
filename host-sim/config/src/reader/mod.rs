//! Reads a TOML file with positions, and collects all errors.

mod control;
mod entry;
mod kind;
mod plain;
mod quantities;

use std::ops::Range;
use std::sync::Arc;

use toml_edit::{Document, DocumentMut, Item};

use super::error::{ConfigError, Lines, Problem};
use super::overlay;
use super::params::{FieldSpec, ParameterInfo, Params};
use super::quantity::{Dimension, suffix};
use super::relations::Advised;
use super::suggest::closest;

pub(crate) use entry::Entry;
use entry::{Field, fields};
pub(crate) use kind::FileKind;
pub(crate) use plain::NAME_LENGTH;
pub(crate) use quantities::range;

/// A parsed file and the problems found so far.
pub(crate) struct Reader {
    file: String,
    text: Arc<str>,
    lines: Lines,
    document: Document<String>,
    problems: Vec<Problem>,
    parameters: Vec<ParameterInfo>,
    /// Whether every quantity must name its source.
    source_required: bool,
}

/// Whether a text is a whole number too large for TOML.
fn is_long_number(text: &str) -> bool {
    let digits = text.chars().all(|c| c.is_ascii_digit());
    digits && !text.is_empty() && text.parse::<i64>().is_err()
}

/// Whether an invalid TOML text has a comma between two digits near a byte.
fn has_decimal_comma(text: &str, at: usize) -> bool {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    let mut commas = (at.saturating_sub(1)..=at).filter(|i| bytes.get(*i) == Some(&b','));
    commas.any(|i| digit(i.wrapping_sub(1)) && digit(i + 1))
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
        let lines = Lines::of(text);
        match Document::parse(text.to_owned()) {
            Ok(document) => {
                let mut found = Vec::new();
                control::find("", document.as_item(), &mut found);
                let problems = found.into_iter().map(|(path, c, span)| {
                    let place = (file, &shared, &lines);
                    let message = format!(
                        "`{path}` has the control character U+{:04X}; allowed are letters, signs, tabs \
                         and line breaks",
                        u32::from(c)
                    );
                    let help = "take it out: pages and other files show this text".to_owned();
                    Problem::at(place, span.unwrap_or(0..0), message, "in this text", Some(help))
                });
                let problems: Vec<Problem> = problems.collect();
                if !problems.is_empty() {
                    return Err(ConfigError::new(what, problems));
                }
                Ok(Self {
                    file: file.to_owned(),
                    text: shared,
                    lines,
                    document,
                    problems,
                    parameters: Vec::new(),
                    source_required,
                })
            }
            Err(e) => {
                let span = e.span().unwrap_or(0..0);
                let message = format!("not valid TOML: {}", e.message());
                let help = match text.get(span.clone()) {
                    Some(number) if is_long_number(number) => {
                        format!("TOML has no number so large; write \"{number}\" in quotes")
                    }
                    _ if e.message().contains("duplicate key") => {
                        "a name may occur only once in its section, and a [section] only once in the file"
                            .to_owned()
                    }
                    _ if has_decimal_comma(text, span.start) => {
                        "numbers have a decimal point: 0.5, not 0,5".to_owned()
                    }
                    _ => "a field is `name = value`, below the [section] that it belongs to; \
                          https://toml.io describes the rest"
                        .to_owned(),
                };
                let place = (file, &shared, &lines);
                let problem = Problem::at(place, span, message, "here", Some(help));
                Err(ConfigError::new(what, vec![problem]))
            }
        }
    }

    /// The same for a file with other values in it. `None` if it cannot have them.
    pub(crate) fn with(file: &str, text: &str, values: &[Advised]) -> Option<Self> {
        let mut document: DocumentMut = text.parse().ok()?;
        for Advised { path, value, unit } in values {
            let value = (*value).into();
            overlay::set_stated(&mut document, path, value, Some(unit), "ADVISED").then_some(())?;
        }
        Self::parse("", file, &document.to_string(), true).ok()
    }

    /// The result: the value, or every problem found.
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

    /// Every problem found.
    pub(crate) fn refusal(self, what: &str) -> ConfigError {
        ConfigError::new(what, self.problems)
    }

    pub(crate) fn problem(
        &mut self,
        span: Option<Range<usize>>,
        message: String,
        label: impl Into<String>,
        help: Option<String>,
    ) {
        let span = span.unwrap_or(0..0);
        let place = (&*self.file, &self.text, &self.lines);
        self.problems
            .push(Problem::at(place, span, message, label, help));
    }

    /// Reports fields that do not fit together though each is within its range: with their values in the
    /// file, their lines, and values that were tried.
    pub(crate) fn contradiction(
        &mut self,
        fields: &[&str],
        why: &str,
        help: &str,
        advice: Vec<Vec<Advised>>,
    ) {
        let shown: Vec<String> = fields.iter().map(|path| self.shown(path)).collect();
        // A board's parameter may be left at its default.
        let first = fields.iter().find_map(|path| self.span_of(path));
        self.contradiction_at(first, &shown, (why, help), advice);
    }

    /// A field with its value and its line, for a message.
    pub(crate) fn shown(&self, path: &str) -> String {
        let listed = self.parameters.iter().rev().find(|p| p.path == *path);
        let value = match (listed, self.item(path)) {
            (Some(p), _) => format!(" = {}{}", p.value_text(), suffix(&p.unit)),
            (None, Some(item)) if item.is_str() => format!(" = {}", item.to_string().trim()),
            _ => String::new(),
        };
        format!("`{path}`{value}{}", self.line_of(path))
    }

    /// The line of a field in brackets, after a space; empty if the file has no such field.
    pub(crate) fn line_of(&self, path: &str) -> String {
        self.span_of(path).map_or(String::new(), |span| {
            format!(" (line {})", self.lines.of_byte(span.start))
        })
    }

    /// The same for fields as they are `shown`, some of which may come from another file.
    pub(crate) fn contradiction_at(
        &mut self,
        first: Option<Range<usize>>,
        shown: &[String],
        (why, help): (&str, &str),
        advice: Vec<Vec<Advised>>,
    ) {
        let (last, others) = match shown.split_last() {
            Some((last, others)) if !others.is_empty() => (last.clone(), others.join(", ")),
            _ => (String::new(), shown.concat()),
        };
        let message = match last.is_empty() {
            true => format!("{others} cannot be: {why}"),
            false => format!("{others} and {last} do not fit together: {why}"),
        };
        self.problem(first, message, "not with the others", Some(help.to_owned()));
        self.advise(advice);
    }

    /// With these values, of which each set does, the last problem would be mended.
    pub(crate) fn advise(&mut self, advice: Vec<Vec<Advised>>) {
        if let Some(problem) = self.problems.last_mut() {
            problem.advise(advice);
        }
    }

    /// Marks the last problem as this broken relation.
    pub(crate) fn breaks(&mut self, relation: &'static str) {
        if let Some(problem) = self.problems.last_mut() {
            problem.breaks(relation);
        }
    }

    /// Path of the parameter at the start of a name of the plant, which is a path with a unit behind it.
    pub(crate) fn listed(&self, name: &str) -> Option<String> {
        let mut paths: Vec<&str> = self.parameters.iter().map(|p| p.path.as_str()).collect();
        paths.retain(|path| name.starts_with(path));
        paths.sort_by_key(|path| path.len());
        paths.last().map(|path| (*path).to_owned())
    }

    /// Unit of a parameter in the file, and its size in SI.
    pub(crate) fn unit_of(&self, path: &str) -> Option<(f64, String)> {
        let info = self.parameters.iter().find(|p| p.path == path)?;
        let factor = info.dimension?.factor(&info.unit)?;
        Some((factor, info.unit.clone()))
    }

    /// Parameters read so far, as written.
    pub(crate) fn parameters(&self) -> &[ParameterInfo] {
        &self.parameters
    }

    /// Whether there is no error so far.
    pub(crate) fn is_clean(&self) -> bool {
        self.problems.is_empty()
    }

    /// Number of problems so far.
    pub(crate) fn problem_count(&self) -> usize {
        self.problems.len()
    }

    /// Position of the field at a dotted path.
    pub(crate) fn span_of(&self, path: &str) -> Option<Range<usize>> {
        let (table, key) = path.rsplit_once('.').unwrap_or(("", path));
        let item = self.item(table)?.as_table_like()?;
        let key = item.key(key)?;
        key.span().or_else(|| self.item(path)?.span())
    }

    fn item(&self, path: &str) -> Option<&Item> {
        let mut item = self.document.as_item();
        if path.is_empty() {
            return Some(item);
        }
        for part in path.split('.') {
            let (key, index) = match overlay::split_index(part) {
                Some((key, index)) => (key, Some(index)),
                None => (part, None),
            };
            item = item.as_table_like()?.get(key)?;
            if let Some(index) = index {
                item = item.get(index)?;
            }
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

    /// Takes entry `index` of an array of tables as a reader level of its own.
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

    /// The table at `path`, which a file may leave out; anything else there is a problem, with the names that
    /// the table `holds` as help.
    pub(crate) fn optional_table(&mut self, path: &str, holds: &[&str]) -> Option<Entry> {
        let item = self.item(path)?;
        let Some(table) = self.table(path) else {
            let span = item.span();
            let found = if item.is_array_of_tables() {
                "a list of tables".to_owned()
            } else {
                item.to_string().trim().to_owned()
            };
            self.problem(
                span,
                format!("`{path}` = {found} must be one section [{path}]"),
                "not a section",
                Some(format!(
                    "write one [{path}] heading; it holds: {}",
                    holds.join(", ")
                )),
            );
            return None;
        };
        Some(table)
    }

    /// Reads the section `[path]` of parameters, which a file may leave out: `Some(None)`.
    pub(crate) fn optional_section<T: Params>(&mut self, path: &str) -> Option<Option<T>> {
        if self.item(path).is_none() {
            return Some(None);
        }
        self.section(path).map(Some)
    }

    /// Reads the section `[path]` of parameters.
    pub(crate) fn section<T: Params>(&mut self, path: &str) -> Option<T> {
        let known: Vec<&str> = T::FIELDS.iter().map(|f| f.key).collect();
        if self.item(path).is_none() {
            self.problem(
                None,
                format!("section [{path}] is missing"),
                "expected somewhere in this file",
                Some(format!("it holds: {}", known.join(", "))),
            );
            return None;
        }
        let entry = self.optional_table(path, &known)?;
        self.reject_unknown(&entry, &known);
        let missing: Vec<&FieldSpec> = T::FIELDS.iter().filter(|f| !entry.has(f.key)).collect();
        if !missing.is_empty() {
            let names: Vec<String> = missing
                .iter()
                .map(|f| match suffix(f.dimension.units()[0].0).trim() {
                    "" => f.key.to_owned(),
                    unit => format!("{} ({unit})", f.key),
                })
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
            .map(|spec| match entry.get(spec.key) {
                Some(_) => self.quantity(&entry, spec),
                // A missing flag is reported above. Relations between the other fields do not depend on a
                // flag, and are reported at the same time.
                None => (spec.dimension == Dimension::Flag).then(|| vec![0.0]),
            })
            .collect();
        let complete: Vec<Vec<f64>> = values.into_iter().collect::<Option<_>>()?;
        let mut values = complete.into_iter();
        Some(T::build(&mut || values.next().unwrap_or_default()))
    }

    /// Reports every field of `entry` that is not in `known`.
    pub(crate) fn reject_unknown(&mut self, entry: &Entry, known: &[&str]) {
        self.reject_misplaced(entry, known, &[]);
    }

    /// The same; for a field that belongs to the `top` of the file, it says so: TOML assigns everything below
    /// a heading to that section.
    pub(crate) fn reject_misplaced(&mut self, entry: &Entry, known: &[&str], top: &[&str]) {
        for (key, span) in entry.keys() {
            if !known.contains(&key) {
                self.reject_field(entry, key, span, known, top);
            }
        }
    }

    /// Reports a field of `entry` that is not in `known`.
    pub(crate) fn reject_field(
        &mut self,
        entry: &Entry,
        key: &str,
        span: Range<usize>,
        known: &[&str],
        top: &[&str],
    ) {
        let place = match entry.path.as_str() {
            "" => "at the top of the file".to_owned(),
            path => format!("in [{path}]"),
        };
        let help = match closest(key, known.iter().copied()) {
            _ if top.contains(&key) => {
                format!("`{key}` belongs to the top of the file, above the first section")
            }
            Some(word) => format!("did you mean `{word}`?"),
            None => format!("known here: {}", known.join(", ")),
        };
        self.problem(
            Some(span),
            format!("unknown field `{key}` {place}"),
            "not known",
            Some(help),
        );
    }

    /// Adds a parameter to the listing.
    pub(crate) fn list(&mut self, info: ParameterInfo) {
        self.parameters.push(info);
    }
}
