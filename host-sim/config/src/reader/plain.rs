//! Texts, choices and whole numbers.

use std::ops::RangeInclusive;

use super::{Entry, Reader};
use crate::suggest::closest;

/// Longest name, in characters.
pub(crate) const NAME_LENGTH: usize = 64;

/// Largest whole number in TOML.
const LARGEST_OF_TOML: u64 = i64::MAX as u64;

/// Whether a name can be used unchanged in a path, in TOML and in a page.
fn is_name(text: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    (1..=NAME_LENGTH).contains(&text.len())
        && text.chars().all(allowed)
        && !text.starts_with(['.', '-'])
}

impl Reader {
    /// Reads the name of a robot, an axis or a scenario. Results go to folders and files of that name, so it
    /// must be a plain name that cannot lead out of its folder.
    pub(crate) fn name(&mut self, entry: &Entry, key: &str) -> Option<String> {
        let text = self.text(entry, key)?;
        if is_name(&text) {
            return Some(text);
        }
        let span = entry.get(key).and_then(|(k, item)| item.span().or(Some(k)));
        // The beginning of a long text is enough.
        let shown: String = text.chars().take(NAME_LENGTH).collect();
        let more = if shown.len() < text.len() { "…" } else { "" };
        self.problem(
            span,
            format!(
                "`{}` = {shown:?}{more} is not a name: allowed are 1 to {NAME_LENGTH} of the \
                 characters A-Z, a-z, 0-9, `.`, `_` and `-`, not beginning with a dot or a minus",
                entry.field_path(key)
            ),
            "not a name",
            Some("files and folders are named after it, for example `bench-1`".to_owned()),
        );
        None
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

    /// Reads an optional list of texts; `parse` turns each into a value or returns its error.
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
        let names: Vec<String> = choices.iter().map(|(n, _)| format!("\"{n}\"")).collect();
        let names = names.join(", ");
        if !entry.has(key) {
            self.problem(
                Some(entry.span.clone()),
                format!("`{}` is missing; accepted: {names}", entry.field_path(key)),
                "expected here",
                Some(format!("write `{key} = \"…\"`")),
            );
            return None;
        }
        let text = self.text(entry, key)?;
        if let Some((_, value)) = choices.iter().find(|(name, _)| *name == text) {
            return Some(*value);
        }
        let span = entry.get(key).and_then(|(k, i)| i.span().or(Some(k)));
        let help = closest(&text, choices.iter().map(|(n, _)| *n))
            .map(|word| format!("did you mean \"{word}\"?"));
        self.problem(
            span,
            format!(
                "`{}` = \"{text}\" is not known; accepted: {names}",
                entry.field_path(key)
            ),
            "not known",
            help,
        );
        None
    }

    /// Reads a finite number without unit, such as a share.
    pub(crate) fn plain_number(&mut self, entry: &Entry, key: &str) -> Option<f64> {
        let (key_span, item) = entry.get(key)?;
        let value = super::entry::number(item.as_value());
        if value.is_none() {
            let message = format!(
                "`{}` = {} must be a finite number",
                entry.field_path(key),
                item.to_string().trim()
            );
            self.problem(
                item.span().or(Some(key_span)),
                message,
                "not a number",
                Some("write a number without quotes and unit, such as 0.5; NaN and infinity are none".into()),
            );
        }
        value
    }

    /// Reads a whole number without unit, such as a seed. Numbers too large for TOML, above 2⁶³ − 1, are
    /// written as text.
    pub(crate) fn whole(
        &mut self,
        entry: &Entry,
        key: &str,
        allowed: RangeInclusive<u64>,
    ) -> Option<u64> {
        let (key_span, item) = entry.get(key)?;
        let long = *allowed.end() > LARGEST_OF_TOML;
        let value = item.as_integer().and_then(|v| u64::try_from(v).ok());
        let text = item.as_str().filter(|_| long);
        match value.or_else(|| text?.parse().ok()) {
            Some(v) if allowed.contains(&v) => Some(v),
            _ => {
                let message = format!(
                    "`{}` = {} must be a whole number from {} to {}",
                    entry.field_path(key),
                    item.to_string().trim(),
                    allowed.start(),
                    allowed.end()
                );
                let help = match item.is_integer() || item.is_float() {
                    true => "a whole number has no sign and no point".to_owned(),
                    false => format!("above {LARGEST_OF_TOML}, write it in quotes"),
                };
                let help = long.then_some(help);
                self.problem(item.span().or(Some(key_span)), message, "not allowed", help);
                None
            }
        }
    }
}
