//! Part files: the rows of a block, and beside them a record of who computed them and how long it took.

use std::fs::File;
use std::path::Path;

use wheeleg_config::{open_file, word};

use crate::columns::{Column, Columns, FACT, Kind};
use crate::pages::in_words;
use crate::row::{self, Row};
use crate::table::{Data, ROWS, Table, TableReader, TableWriter};
use crate::{host, program};

/// Keys of a part's metadata, beside its columns.
pub(crate) const PLAN: &str = "wheeleg.plan";
pub(crate) const PROGRAM: &str = "wheeleg.program";

/// Why a table is not one of rows.
pub(crate) const NO_ROWS: &str = "rows that are none";

/// The effort of computing a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Effort {
    /// Place in the plan.
    pub(crate) index: u64,
    /// Elapsed time, s.
    pub(crate) wall_s: f64,
    /// How many processes had begun it before without finishing.
    pub(crate) ends: u32,
}

/// The bytes of a part, identical for every program built from the same sources.
pub(crate) fn bytes(columns: &Columns, plan: &str, rows: &[Row]) -> Vec<u8> {
    encode(&row::table(columns, rows), plan)
}

/// The bytes of the record beside a part.
pub(crate) fn run_bytes(plan: &str, efforts: &[Effort]) -> Vec<u8> {
    let column =
        |name: &str, kind, unit: &str, meaning: &str| Column::new(name, kind, unit, meaning);
    let columns = vec![
        column("index", Kind::Whole, "", "place in the plan"),
        column("wall_s", Kind::Number, "s", "time that the case took"),
        column("ends", Kind::Whole, "", "processes that ended in it before"),
        column("host", Kind::Text, "", "computer"),
        column("process", Kind::Whole, "", "process"),
        column(
            "processor",
            Kind::Text,
            "",
            "what of it mathematics depends on",
        ),
    ];
    let mut table = Table::empty(columns);
    let (name, processor) = (host::name(), host::processor());
    for (at, data) in table.data.iter_mut().enumerate() {
        let each = efforts.iter();
        *data = match at {
            0 => Data::Whole(each.map(|e| i64::try_from(e.index).ok()).collect()),
            1 => Data::Number(each.map(|e| Some(e.wall_s)).collect()),
            2 => Data::Whole(each.map(|e| Some(i64::from(e.ends))).collect()),
            3 => Data::Text(each.map(|_| Some(name.clone())).collect()),
            4 => Data::Whole(each.map(|_| Some(i64::from(std::process::id()))).collect()),
            _ => Data::Text(each.map(|_| Some(processor.clone())).collect()),
        };
    }
    encode(&table, plan)
}

fn encode(table: &Table, plan: &str) -> Vec<u8> {
    let columns = serde_json::to_string(&table.columns).expect("columns are JSON");
    let program = program();
    let facts = [(FACT, columns.as_str()), (PLAN, plan), (PROGRAM, &program)];
    let write = || {
        let mut writer = TableWriter::new(Vec::new(), &table.columns, &facts)?;
        writer.write(table)?;
        writer.finish()
    };
    write().expect("a table in memory can be written")
}

/// Why a file is not a valid part.
#[derive(Debug)]
pub(crate) enum NotAPart {
    /// There is no file.
    Missing,
    /// It cannot be read: it is truncated, or not a part at all.
    Torn(String),
    /// It belongs to another plan or program.
    Foreign(String),
}

/// Rows of a part, if it belongs to this plan and program.
pub(crate) fn read(path: &Path, plan: &str) -> Result<(Vec<Row>, Vec<Column>), NotAPart> {
    let table = read_table(path, plan)?;
    let rows = row::rows(&table);
    let rows = rows.ok_or_else(|| NotAPart::Torn(NO_ROWS.to_owned()))?;
    Ok((rows, table.columns))
}

/// Table of a part, if it belongs to this plan and program.
pub(crate) fn read_table(path: &Path, plan: &str) -> Result<Table, NotAPart> {
    let file = open(path)?;
    let torn = |e: parquet::errors::ParquetError| NotAPart::Torn(in_words(&e));
    let reader = TableReader::new(file).map_err(torn)?;
    of(&reader, plan)?;
    if reader.fact(ROWS).is_none() {
        return Err(NotAPart::Torn(
            "it does not say what its rows are".to_owned(),
        ));
    }
    reader.read().map_err(torn)
}

fn open(path: &Path) -> Result<File, NotAPart> {
    open_file(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => NotAPart::Missing,
        _ => NotAPart::Torn(e.to_string()),
    })
}

fn of(reader: &TableReader, plan: &str) -> Result<(), NotAPart> {
    let own = program();
    for (key, own) in [(PLAN, plan), (PROGRAM, own.as_str())] {
        let found = reader.fact(key).unwrap_or("nothing");
        if found != own {
            // A merged table has the whole plan there.
            let what = format!("its {key} is {}, not {own}", word(found));
            return Err(NotAPart::Foreign(what));
        }
    }
    Ok(())
}
