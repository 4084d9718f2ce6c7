//! One row of the table: the result of a case.

use wheeleg_config::plan::Value;

use crate::columns::Columns;
use crate::identity::CaseId;
use crate::table::{Data, Table};

/// How a case ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// It ran to its end.
    Ok,
    /// Its files contradict each other, or the simulation failed.
    Error,
    /// The program panicked.
    Panic,
    /// The case crashed its process more than once.
    Crashed,
    /// The case exceeded the limit of simulated time.
    Limit,
}

impl Status {
    /// All variants.
    pub const ALL: [Self; 5] = [
        Self::Ok,
        Self::Error,
        Self::Panic,
        Self::Crashed,
        Self::Limit,
    ];

    /// The status with this name in a table.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|status| status.name() == name)
    }

    /// Name in the table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Error => "error",
            Self::Panic => "panic",
            Self::Crashed => "crashed",
            Self::Limit => "limit",
        }
    }
}

/// A target's value and verdict.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Figure {
    /// The measured value; `None` if it could not be measured.
    pub value: Option<f64>,
    /// Whether the value lies within its limits.
    pub pass: Option<bool>,
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Identity.
    pub case: CaseId,
    /// Place in the plan.
    pub index: u64,
    /// Block.
    pub block: u64,
    /// Sample.
    pub sample: u64,
    /// Replicate.
    pub replicate: u64,
    /// Seed.
    pub seed: u64,
    /// Values of the factors.
    pub factors: Vec<Value>,
    /// How the case ended.
    pub status: Status,
    /// What went wrong.
    pub error: Option<String>,
    /// Hash of the log.
    pub log_hash: Option<String>,
    /// Simulated time, s.
    pub simulated_s: Option<f64>,
    /// Whether all required targets were met.
    pub passed: Option<bool>,
    /// Values and verdicts, in the order of the columns.
    pub figures: Vec<Figure>,
}

impl Row {
    /// Whether the row counts as failed: it missed a required target or has no result.
    #[must_use]
    pub fn is_failed(&self) -> bool {
        is_failed(self.passed)
    }

    /// The figure of a target; an empty one if the table has no such target.
    #[must_use]
    pub fn figure(&self, columns: &Columns, target: &str) -> Figure {
        let at = columns.targets.iter().position(|id| id == target);
        let figure = at.and_then(|at| self.figures.get(at));
        figure.copied().unwrap_or_default()
    }
}

/// Whether a row with this value of `passed` counts as failed. A row without a result does.
pub(crate) fn is_failed(passed: Option<bool>) -> bool {
    passed != Some(true)
}

/// Names of the columns in which two rows of a case differ, to the bit.
pub(crate) fn differing(columns: &Columns, one: &Row, other: &Row) -> Vec<String> {
    let bits = |value: Option<f64>| value.map(f64::to_bits);
    let fixed = [
        ("case", one.case != other.case),
        ("index", one.index != other.index),
        ("block", one.block != other.block),
        ("sample", one.sample != other.sample),
        ("replicate", one.replicate != other.replicate),
        ("seed", one.seed != other.seed),
        ("status", one.status != other.status),
        ("error", one.error != other.error),
        ("log_hash", one.log_hash != other.log_hash),
        (
            "simulated_s",
            bits(one.simulated_s) != bits(other.simulated_s),
        ),
        ("passed", one.passed != other.passed),
    ];
    let fixed = fixed.into_iter().filter(|(_, differs)| *differs);
    let mut names: Vec<String> = fixed.map(|(name, _)| name.to_owned()).collect();
    let factors = one.factors.iter().zip(&other.factors);
    let factors = columns.factors.iter().zip(factors);
    let factors = factors.filter(|(_, (a, b))| a != b);
    names.extend(factors.map(|(name, _)| format!("f.{name}")));
    let figures = one.figures.iter().zip(&other.figures);
    for (name, (a, b)) in columns.targets.iter().zip(figures) {
        if bits(a.value) != bits(b.value) {
            names.push(name.clone());
        }
        if a.pass != b.pass {
            names.push(format!("{name}.pass"));
        }
    }
    let lengths = |row: &Row| (row.factors.len(), row.figures.len());
    if lengths(one) != lengths(other) {
        names.push("the columns themselves".to_owned());
    }
    names
}

/// Most bytes of an error text.
pub(crate) const ERROR_MOST: usize = 400;

/// The error text, truncated if it is too long for a table.
pub(crate) fn shortened(mut error: String) -> String {
    if error.len() > ERROR_MOST {
        let room = ERROR_MOST - '…'.len_utf8();
        let end = (0..=room).rfind(|end| error.is_char_boundary(*end));
        error.truncate(end.unwrap_or(0));
        error.push('…');
    }
    error
}

/// Converts rows to a table.
pub(crate) fn table(columns: &Columns, rows: &[Row]) -> Table {
    let mut table = Table::empty(columns.all.clone());
    for row in rows {
        let mut cells = table.data.iter_mut();
        let mut put = |value: Cell<'_>| {
            if let Some(data) = cells.next() {
                value.push(data);
            }
        };
        put(Cell::Text(Some(&row.case.to_string())));
        for number in [row.index, row.block, row.sample, row.replicate, row.seed] {
            put(Cell::Whole(number));
        }
        for value in &row.factors {
            put(match value {
                Value::Flag(flag) => Cell::Flag(Some(*flag)),
                Value::Number(number) => Cell::Number(Some(*number)),
                Value::Text(text) => Cell::Text(Some(text)),
            });
        }
        put(Cell::Text(Some(row.status.name())));
        put(Cell::Text(row.error.as_deref()));
        put(Cell::Text(row.log_hash.as_deref()));
        put(Cell::Number(row.simulated_s));
        put(Cell::Flag(row.passed));
        for figure in &row.figures {
            put(Cell::Number(figure.value));
            put(Cell::Flag(figure.pass));
        }
    }
    table
}

enum Cell<'a> {
    Whole(u64),
    Number(Option<f64>),
    Flag(Option<bool>),
    Text(Option<&'a str>),
}

impl Cell<'_> {
    fn push(self, to: &mut Data) {
        match (to, self) {
            // Indices and seeds have 63 bits at most.
            (Data::Whole(v), Cell::Whole(n)) => v.push(i64::try_from(n).ok()),
            (Data::Number(v), Cell::Number(n)) => v.push(n),
            (Data::Flag(v), Cell::Flag(f)) => v.push(f),
            (Data::Text(v), Cell::Text(t)) => v.push(t.map(str::to_owned)),
            _ => unreachable!("a column has the kind of its values"),
        }
    }
}

/// Converts a table to rows; returns `None` if [`table`] did not make it.
pub(crate) fn rows(table: &Table) -> Option<Vec<Row>> {
    let columns = Columns::read(table.columns.clone());
    let whole = |name: &str, at: usize| -> Option<u64> {
        let value = table.wholes(name).get(at)?;
        u64::try_from((*value)?).ok()
    };
    let text = |name: &str, at: usize| -> Option<String> { table.texts(name).get(at)?.clone() };
    let factor = |name: &String, at: usize| -> Option<Value> {
        let name = format!("f.{name}");
        match table.column(&name)? {
            Data::Number(v) => v.get(at)?.map(Value::Number),
            Data::Flag(v) => v.get(at)?.map(Value::Flag),
            Data::Text(v) => v.get(at)?.clone().map(Value::Text),
            Data::Whole(_) => None,
        }
    };
    let row = |at: usize| -> Option<Row> {
        let status = text("status", at)?;
        let figures = columns.targets.iter().map(|id| Figure {
            value: table.numbers(id).get(at).copied().flatten(),
            pass: table
                .flags(&format!("{id}.pass"))
                .get(at)
                .copied()
                .flatten(),
        });
        Some(Row {
            case: text("case", at)?.parse().ok()?,
            index: whole("index", at)?,
            block: whole("block", at)?,
            sample: whole("sample", at)?,
            replicate: whole("replicate", at)?,
            seed: whole("seed", at)?,
            factors: columns
                .factors
                .iter()
                .map(|name| factor(name, at))
                .collect::<Option<_>>()?,
            status: Status::ALL.into_iter().find(|s| s.name() == status)?,
            error: text("error", at),
            log_hash: text("log_hash", at),
            simulated_s: table.numbers("simulated_s").get(at).copied().flatten(),
            passed: table.flags("passed").get(at).copied().flatten(),
            figures: figures.collect(),
        })
    };
    (0..table.rows()).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::{Column, Kind};

    /// Compares every column, and numbers to the last bit.
    #[test]
    fn rows_that_differ_say_where() {
        let columns = Columns::read(
            ["f.load", "speed", "speed.pass"]
                .map(|name| Column::new(name, Kind::Number, "", ""))
                .to_vec(),
        );
        let row = Row {
            case: "044f1d1a0af2183bb3b31813bface27d".parse().expect("a case"),
            index: 0,
            block: 0,
            sample: 0,
            replicate: 0,
            seed: 1,
            factors: vec![Value::Number(0.5)],
            status: Status::Ok,
            error: None,
            log_hash: Some("a".to_owned()),
            simulated_s: Some(0.1 + 0.2),
            passed: Some(true),
            figures: vec![Figure {
                value: Some(0.0),
                pass: Some(true),
            }],
        };
        assert!(differing(&columns, &row, &row.clone()).is_empty());
        let mut other = row.clone();
        other.simulated_s = Some(0.3);
        other.log_hash = Some("b".to_owned());
        other.factors = vec![Value::Number(0.6)];
        other.figures[0] = Figure {
            value: Some(-0.0),
            pass: Some(false),
        };
        assert_eq!(
            differing(&columns, &row, &other),
            ["log_hash", "simulated_s", "f.load", "speed", "speed.pass"]
        );
        other = row.clone();
        other.figures.clear();
        assert_eq!(
            differing(&columns, &row, &other),
            ["the columns themselves"]
        );
    }

    #[test]
    fn a_long_error_is_cut_between_characters() {
        let whole = "ü".repeat(ERROR_MOST / 2);
        assert_eq!(shortened(whole.clone()), whole);
        let cut = shortened(format!("x{whole}"));
        assert!(
            cut.len() <= ERROR_MOST && cut.starts_with("xü") && cut.ends_with("ü…"),
            "{cut}"
        );
    }
}
