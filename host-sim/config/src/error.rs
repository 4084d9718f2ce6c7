//! Errors in a configuration file, with their places.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource, SourceCode,
};

use crate::relations::Advised;

/// Most problems of a file that are printed; the others are only counted.
const SHOWN: usize = 20;
/// Longest line of a file that is shown, bytes.
const LONGEST_LINE: usize = 2000;
/// Longest message, characters: values are quoted as written in the file.
const LONGEST_MESSAGE: usize = 1500;

/// Width of an error outside a terminal, columns.
const PLAIN_WIDTH: usize = 100;

/// The text of an error as the program prints it, without colours: for other programs' messages.
#[must_use]
pub fn plain_text(error: &dyn Diagnostic) -> String {
    let mut text = String::new();
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_width(PLAIN_WIDTH);
    match handler.render_report(&mut text, error) {
        Ok(()) => text.trim_end().to_owned(),
        Err(_) => error.to_string(),
    }
}

/// Most digits of a number that are shown in full.
const DIGITS: usize = 40;

/// A file's text, for a message: a number with very many digits is cut to its first ones and their count.
fn shown(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
        let digits = &rest[at..];
        let count = digits
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(digits.len());
        out += &rest[..at];
        match count > DIGITS {
            true => out += &format!("{}…[{count} digits]", &digits[..8]),
            false => out += &digits[..count],
        }
        rest = &digits[count..];
    }
    out += rest;
    out
}

/// Longest word of a command line that is quoted, characters.
const LONGEST_WORD: usize = 80;

/// A word of a command line, for a message: one longer than any name is cut to its beginning.
#[must_use]
pub fn word(text: &str) -> std::borrow::Cow<'_, str> {
    match text.char_indices().nth(LONGEST_WORD) {
        Some((end, _)) => format!("{}…", &text[..end]).into(),
        None => text.into(),
    }
}

/// A message without its middle if it is too long.
fn shortened(message: String) -> String {
    let message = shown(&message);
    let count = message.chars().count();
    if count <= LONGEST_MESSAGE {
        return message;
    }
    let half = LONGEST_MESSAGE / 2;
    let begin: String = message.chars().take(half).collect();
    let end: String = message.chars().skip(count - half).collect();
    format!("{begin} … {end}")
}

/// Positions at which the lines of a file begin.
pub(crate) struct Lines(Vec<usize>);

impl Lines {
    pub(crate) fn of(text: &str) -> Self {
        let breaks = text.bytes().enumerate().filter(|(_, b)| *b == b'\n');
        Self(breaks.map(|(at, _)| at + 1).collect())
    }

    /// Line of a byte, from 1.
    pub(crate) fn of_byte(&self, at: usize) -> usize {
        self.0.partition_point(|begin| *begin <= at) + 1
    }
}

/// One error at one place of a file.
#[derive(Debug, Clone)]
pub struct Problem {
    source: Option<NamedSource<Arc<str>>>,
    file: String,
    line: Option<usize>,
    message: String,
    label: String,
    span: Option<Range<usize>>,
    help: Option<String>,
    advice: Vec<Vec<Advised>>,
    relation: Option<&'static str>,
}

impl Problem {
    /// A problem at a byte range of a file.
    pub(crate) fn at(
        (file, text, lines): (&str, &Arc<str>, &Lines),
        span: Range<usize>,
        message: String,
        label: impl Into<String>,
        help: Option<String>,
    ) -> Self {
        // For a line that nobody wrote by hand its number is enough.
        let begin = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
        let length = text[begin..].find('\n').unwrap_or(text.len() - begin);
        let shown = length <= LONGEST_LINE;
        Self {
            source: shown.then(|| NamedSource::new(file, text.clone()).with_language("TOML")),
            file: file.to_owned(),
            line: Some(lines.of_byte(span.start)),
            message: shortened(message),
            label: label.into(),
            span: shown.then_some(span),
            help: help.map(shortened),
            advice: Vec::new(),
            relation: None,
        }
    }

    /// A problem with a file as a whole.
    pub(crate) fn whole(file: &str, message: String, help: Option<String>) -> Self {
        Self {
            source: None,
            file: file.to_owned(),
            line: None,
            message: shortened(message),
            label: String::new(),
            span: None,
            help: help.map(shortened),
            advice: Vec::new(),
            relation: None,
        }
    }

    /// One line: file, line, error.
    #[must_use]
    pub fn summary(&self) -> String {
        match self.line {
            Some(line) => format!("{}:{line}: {}", self.file, self.message),
            None => format!("{}: {}", self.file, self.message),
        }
    }

    /// The advice, if there is any.
    #[must_use]
    pub fn help_text(&self) -> Option<&str> {
        self.help.as_deref()
    }

    /// Sets of values named in the help, each of which mends this without another contradiction.
    #[must_use]
    pub fn advice(&self) -> &[Vec<Advised>] {
        &self.advice
    }

    /// Name of the broken relation ([`RELATIONS`](crate::RELATIONS)), if it is one.
    #[must_use]
    pub fn relation(&self) -> Option<&'static str> {
        self.relation
    }

    pub(crate) fn advise(&mut self, advice: Vec<Vec<Advised>>) {
        self.advice = advice;
    }

    pub(crate) fn breaks(&mut self, relation: &'static str) {
        self.relation = Some(relation);
    }

    pub(crate) fn position(&self) -> usize {
        self.span.as_ref().map_or(usize::MAX, |s| s.start)
    }
}

/// The error; the [`ConfigError`] around it and the lines of the file below it give its place.
impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Problem {}

impl Diagnostic for Problem {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help
            .as_ref()
            .map(|h| Box::new(h) as Box<dyn fmt::Display + 'a>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|s| s as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.span.clone()?;
        let label = LabeledSpan::new_with_span(Some(self.label.clone()), span);
        Some(Box::new(std::iter::once(label)))
    }
}

/// A robot or scenario file was rejected; holds every problem found in it, so that they can be mended all at
/// once.
#[derive(Debug, Clone)]
pub struct ConfigError {
    what: String,
    problems: Vec<Problem>,
}

impl ConfigError {
    pub(crate) fn new(what: impl Into<String>, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(Problem::position);
        Self {
            what: what.into(),
            problems,
        }
    }

    /// The problems, in the order of the file.
    #[must_use]
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.problems.len() {
            1 => write!(f, "{}", self.what),
            n if n <= SHOWN => write!(f, "{} ({n} problems)", self.what),
            n => write!(f, "{} ({n} problems; the first {SHOWN} follow)", self.what),
        }
    }
}

impl std::error::Error for ConfigError {}

impl Diagnostic for ConfigError {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new("wheeleg::config"))
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        let shown = self.problems.iter().take(SHOWN);
        Some(Box::new(shown.map(|p| p as &dyn Diagnostic)))
    }
}
