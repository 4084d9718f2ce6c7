//! Errors of a measurement's file.

use std::fmt::Write as _;

use miette::Diagnostic;
use thiserror::Error;
use wheeleg_report::number::counted;

/// Most errors that are listed.
const LISTED: usize = 10;

/// A wrong cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongCell {
    /// Line of the file, from 1.
    pub line: u64,
    /// Name of its column.
    pub column: String,
    /// What is wrong.
    pub what: String,
    /// What is expected.
    pub help: String,
}

/// Wrong cells of a file: the first ones, and the number of the others.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WrongCells {
    first: Vec<WrongCell>,
    more: usize,
}

impl WrongCells {
    /// Adds one.
    pub(super) fn add(&mut self, wrong: WrongCell) {
        if self.first.len() < LISTED {
            self.first.push(wrong);
        } else {
            self.more += 1;
        }
    }

    /// An error if there is any.
    pub(super) fn none_in(self, file: &str) -> Result<(), LabError> {
        match self.first.is_empty() {
            true => Ok(()),
            false => Err(LabError::Cells {
                file: file.to_owned(),
                wrong: self,
            }),
        }
    }

    /// In words.
    fn told(&self, file: &str) -> String {
        if let (
            [
                WrongCell {
                    line, column, what, ..
                },
            ],
            0,
        ) = (&self.first[..], self.more)
        {
            return format!("{file}, line {line}, column `{column}`: {what}");
        }
        let count = counted(self.first.len() + self.more, "value", "values");
        let mut text = format!("{file}: {count} wrong");
        for WrongCell {
            line, column, what, ..
        } in &self.first
        {
            let _ = write!(text, "\n  line {line}, column `{column}`: {what}");
        }
        if self.more > 0 {
            let _ = write!(text, "\n  and {} more", self.more);
        }
        text
    }

    /// Each remedy, once.
    fn remedies(&self) -> String {
        let mut all: Vec<&str> = Vec::new();
        for WrongCell { help, .. } in &self.first {
            if !all.contains(&&**help) {
                all.push(help);
            }
        }
        all.join("; ")
    }
}

/// Why a measurement cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error, Diagnostic)]
pub enum LabError {
    /// There is nothing in it.
    #[error("{file} is empty")]
    #[diagnostic(
        code(wheeleg::measurement),
        help("its first line has the names of the columns, and every other line is a row")
    )]
    Empty {
        /// Its file.
        file: String,
    },

    /// Some of its values are wrong.
    #[error("{}", wrong.told(file))]
    #[diagnostic(code(wheeleg::measurement), help("{}", wrong.remedies()))]
    Cells {
        /// Its file.
        file: String,
        /// The values.
        wrong: WrongCells,
    },
}
