//! Counts the reasons why cases failed.

use std::collections::BTreeMap;

use crate::columns::{Column, Columns};
use crate::row::{Figure, Row, Status};
use crate::table::Table;

/// Number of distinct kinds that are counted separately; error messages may all differ.
const KINDS: usize = 1000;

/// Why a case failed. Cases without a result come first.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The case has no result.
    NoResult {
        /// How the case ended.
        status: Status,
        /// The message it reported.
        message: String,
    },
    /// A required target lies outside its limits.
    Missed {
        /// Name of the target.
        target: String,
    },
    /// A required target could not be measured, which counts as missed.
    NotMeasured {
        /// Name of the target.
        target: String,
    },
}

/// Number of failed cases by cause. A case that missed two targets is counted under both.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Causes {
    required: Vec<Column>,
    counts: BTreeMap<Cause, u64>,
    /// Failures of kinds beyond the number counted separately.
    others: u64,
}

/// A target with its values and verdicts.
type Judged<'a> = (&'a str, &'a [Option<f64>], &'a [Option<bool>]);

/// The columns of a table that show why a case failed.
pub(crate) struct Seen<'a> {
    passed: &'a [Option<bool>],
    statuses: &'a [Option<String>],
    errors: &'a [Option<String>],
    targets: Vec<Judged<'a>>,
}

impl Causes {
    /// Counts a row.
    pub(crate) fn add(&mut self, columns: &Columns, row: &Row) {
        self.know(&columns.all);
        if !row.is_failed() {
            return;
        }
        let figures = columns.targets.iter().zip(&row.figures);
        let figures = figures.map(|(target, figure)| (target.as_str(), *figure));
        self.count(row.status, row.error.as_deref(), figures);
    }

    /// Prepares a table for counting.
    pub(crate) fn see<'a>(&mut self, table: &'a Table) -> Seen<'a> {
        self.know(&table.columns);
        let required = table.columns.iter().filter(|column| column.required);
        let targets = required.map(|column| {
            let verdicts = table.flags(&format!("{}.pass", column.name));
            let name = column.name.as_str();
            (name, table.numbers(name), verdicts)
        });
        Seen {
            passed: table.flags("passed"),
            statuses: table.texts("status"),
            errors: table.texts("error"),
            targets: targets.collect(),
        }
    }

    /// Counts one row of a table.
    pub(crate) fn add_seen(&mut self, seen: &Seen<'_>, at: usize) {
        if seen.passed[at] == Some(true) {
            return;
        }
        let status = seen.statuses[at].as_deref().and_then(Status::named);
        let figures = seen.targets.iter().map(|(name, values, verdicts)| {
            let (value, pass) = (values[at], verdicts[at]);
            (*name, Figure { value, pass })
        });
        let error = seen.errors[at].as_deref();
        self.count(status.unwrap_or(Status::Error), error, figures);
    }

    /// The first `most` causes with their counts. Causes without a result come first; within each group they
    /// are sorted by count.
    #[must_use]
    pub fn first(&self, most: usize) -> Vec<(&Cause, u64)> {
        let mut all: Vec<(&Cause, u64)> = self.counts.iter().map(|(c, n)| (c, *n)).collect();
        let is_result = |cause: &Cause| !matches!(cause, Cause::NoResult { .. });
        all.sort_by(|(a, n), (b, m)| is_result(a).cmp(&is_result(b)).then(m.cmp(n)));
        all.truncate(most);
        all
    }

    /// Number of kinds.
    #[must_use]
    pub fn kinds(&self) -> usize {
        self.counts.len() + usize::from(self.others > 0)
    }

    /// The cause in words, including what the target requires.
    #[must_use]
    pub fn message(&self, cause: &Cause) -> String {
        match cause {
            Cause::NoResult { status, message } => format!("{}: {message}", status.name()),
            Cause::Missed { target } => format!("{target} missed{}", self.asked(target)),
            Cause::NotMeasured { target } => {
                format!("{target} not measured{}", self.asked(target))
            }
        }
    }

    fn asked(&self, target: &str) -> String {
        let column = self.required.iter().find(|column| column.name == target);
        column.map_or_else(String::new, |column| {
            format!(": {}{}", column.meaning, column.limits())
        })
    }

    fn know(&mut self, columns: &[Column]) {
        if self.required.is_empty() {
            let required = columns.iter().filter(|column| column.required);
            self.required = required.cloned().collect();
        }
    }

    fn count<'a>(
        &mut self,
        status: Status,
        error: Option<&str>,
        figures: impl Iterator<Item = (&'a str, Figure)>,
    ) {
        if status != Status::Ok {
            let message = error.unwrap_or_default().to_owned();
            return self.one(Cause::NoResult { status, message });
        }
        for (target, figure) in figures {
            let required = self.required.iter().any(|column| column.name == target);
            if !required || figure.pass != Some(false) {
                continue;
            }
            let target = target.to_owned();
            self.one(match figure.value {
                Some(_) => Cause::Missed { target },
                None => Cause::NotMeasured { target },
            });
        }
    }

    fn one(&mut self, cause: Cause) {
        if self.counts.len() < KINDS || self.counts.contains_key(&cause) {
            *self.counts.entry(cause).or_default() += 1;
        } else {
            self.others += 1;
        }
    }
}
