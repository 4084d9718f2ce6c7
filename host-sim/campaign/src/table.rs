//! A table in memory, stored by column, and its Parquet form.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, Length as _};
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use wheeleg_config::open_file;

use crate::CampaignError;
use crate::columns::{Column, Kind};
use crate::pages::{self, in_words};
use crate::panics::caught;

/// Most bytes of text per byte of file: many rows may share one text. A row has about 40 bytes that do not
/// compress, and its texts are either truncated ([`crate::row::ERROR_MOST`]) or come from a plan
/// ([`crate::pages::NAMES_MOST`]).
const TEXT_PER_BYTE: u64 = 64;

/// Key of the hashes of the row groups, which reveal damaged bytes wherever they are.
pub(crate) const ROWS: &str = "wheeleg.rows";

/// Values of one column; `None` is null.
#[derive(Debug, Clone, PartialEq)]
pub enum Data {
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Numbers.
    Number(Vec<Option<f64>>),
    /// Yes or no.
    Flag(Vec<Option<bool>>),
    /// Texts.
    Text(Vec<Option<String>>),
}

impl Data {
    /// An empty column of a kind.
    #[must_use]
    pub fn empty(kind: Kind) -> Self {
        match kind {
            Kind::Whole => Self::Whole(Vec::new()),
            Kind::Number => Self::Number(Vec::new()),
            Kind::Flag => Self::Flag(Vec::new()),
            Kind::Text => Self::Text(Vec::new()),
        }
    }

    /// Number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Whole(v) => v.len(),
            Self::Number(v) => v.len(),
            Self::Flag(v) => v.len(),
            Self::Text(v) => v.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn append(&mut self, other: Self) {
        match (self, other) {
            (Self::Whole(a), Self::Whole(b)) => a.extend(b),
            (Self::Number(a), Self::Number(b)) => a.extend(b),
            (Self::Flag(a), Self::Flag(b)) => a.extend(b),
            (Self::Text(a), Self::Text(b)) => a.extend(b),
            _ => unreachable!("columns of one table have their kind"),
        }
    }
}

/// A table: its columns and their values.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names, kinds and meanings.
    pub columns: Vec<Column>,
    /// Values, one list for each column.
    pub data: Vec<Data>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn empty(columns: Vec<Column>) -> Self {
        let data = columns.iter().map(|c| Data::empty(c.kind)).collect();
        Self { columns, data }
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.data.first().map_or(0, Data::len)
    }

    /// The column with this name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&Data> {
        let at = self.columns.iter().position(|c| c.name == name)?;
        self.data.get(at)
    }

    /// Whole numbers of a column; empty if there is no such column.
    #[must_use]
    pub fn wholes(&self, name: &str) -> &[Option<i64>] {
        match self.column(name) {
            Some(Data::Whole(v)) => v,
            _ => &[],
        }
    }

    /// Numbers of a column; empty if there is no such column.
    #[must_use]
    pub fn numbers(&self, name: &str) -> &[Option<f64>] {
        match self.column(name) {
            Some(Data::Number(v)) => v,
            _ => &[],
        }
    }

    /// Flags of a column; empty if there is no such column.
    #[must_use]
    pub fn flags(&self, name: &str) -> &[Option<bool>] {
        match self.column(name) {
            Some(Data::Flag(v)) => v,
            _ => &[],
        }
    }

    /// Texts of a column; empty if there is no such column.
    #[must_use]
    pub fn texts(&self, name: &str) -> &[Option<String>] {
        match self.column(name) {
            Some(Data::Text(v)) => v,
            _ => &[],
        }
    }

    /// Writes the table to a new file, with `facts` as metadata besides its columns. For tests. If this
    /// fails, no file remains.
    ///
    /// # Errors
    /// The error of the operating system or of the library.
    #[doc(hidden)]
    pub fn write_to(&self, path: &Path, facts: &[(&str, &str)]) -> std::io::Result<()> {
        let columns = serde_json::to_string(&self.columns)?;
        let mut all = vec![(crate::columns::FACT, columns.as_str())];
        all.extend(facts);
        let file = File::create_new(path)?;
        let write = || {
            let mut writer = TableWriter::new(file, &self.columns, &all)?;
            writer.write(self)?;
            writer.finish().map(drop)
        };
        write().map_err(|e: ParquetError| {
            let _ = std::fs::remove_file(path);
            std::io::Error::other(in_words(&e))
        })
    }

    /// Reads a file, and the values of these keys in its metadata. For tests.
    ///
    /// # Errors
    /// [`CampaignError::Unreadable`] for a file that is not a table, is damaged, or only pretends to be one.
    #[doc(hidden)]
    pub fn read_from(
        path: &Path,
        keys: &[&str],
    ) -> Result<(Self, Vec<Option<String>>), CampaignError> {
        let file = open_file(path).map_err(|e| CampaignError::unreadable(path, e))?;
        let read = || {
            let reader = TableReader::new(file)?;
            let facts = keys.iter().map(|key| reader.fact(key).map(str::to_owned));
            Ok((reader.read()?, facts.collect()))
        };
        read().map_err(|e: ParquetError| CampaignError::unreadable(path, in_words(&e)))
    }

    /// Hash of all columns and values, in hexadecimal.
    pub(crate) fn digest(&self) -> String {
        // Hashed in one call: a call for each value takes longer than the hash itself.
        let mut all = serde_json::to_vec(&self.columns).expect("columns are JSON");
        all.extend((self.rows() as u64).to_le_bytes());
        for data in &self.data {
            match data {
                Data::Whole(list) => add_all(&mut all, list, i64::to_le_bytes),
                Data::Number(list) => add_all(&mut all, list, |v| v.to_bits().to_le_bytes()),
                // 2 is null.
                Data::Flag(list) => all.extend(list.iter().map(|v| v.map_or(2, u8::from))),
                Data::Text(list) => {
                    for text in list {
                        let bytes = text.as_deref().unwrap_or("").as_bytes();
                        all.push(u8::from(text.is_some()));
                        all.extend((bytes.len() as u64).to_le_bytes());
                        all.extend(bytes);
                    }
                }
            }
        }
        blake3::hash(&all).to_hex()[..32].to_owned()
    }

    /// Appends the rows of a table with the same columns.
    pub(crate) fn append(&mut self, other: Self) {
        for (own, other) in self.data.iter_mut().zip(other.data) {
            own.append(other);
        }
    }
}

/// Adds to `all`, for each value, whether there is one, and its bytes.
fn add_all<T: Copy + Default>(all: &mut Vec<u8>, list: &[Option<T>], bytes: impl Fn(T) -> [u8; 8]) {
    all.reserve(9 * list.len());
    for value in list {
        all.push(u8::from(value.is_some()));
        all.extend_from_slice(&bytes(value.unwrap_or_default()));
    }
}

/// Writes one table, one row group after another.
pub(crate) struct TableWriter<W: std::io::Write + Send> {
    file: SerializedFileWriter<W>,
    /// Hash of each group so far.
    hashes: Vec<String>,
}

impl<W: std::io::Write + Send> TableWriter<W> {
    /// Begins a file with these columns, and with `facts` as metadata.
    pub(crate) fn new(
        to: W,
        columns: &[Column],
        facts: &[(&str, &str)],
    ) -> Result<Self, ParquetError> {
        let facts = facts.iter().map(|(key, value)| KeyValue {
            key: (*key).to_owned(),
            value: Some((*value).to_owned()),
        });
        let properties = WriterProperties::builder()
            // Equal rows give equal bytes, whichever version of the library another program uses.
            .set_created_by("wheeleg".to_owned())
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(facts.collect()))
            .build();
        let file = SerializedFileWriter::new(to, schema(columns)?, Arc::new(properties))?;
        Ok(Self {
            file,
            hashes: Vec::new(),
        })
    }

    /// Writes rows as one group; an empty table makes no group.
    pub(crate) fn write(&mut self, table: &Table) -> Result<(), ParquetError> {
        if table.rows() == 0 {
            return Ok(());
        }
        let mut group = self.file.next_row_group()?;
        for data in &table.data {
            let Some(mut column) = group.next_column()? else {
                break;
            };
            match (column.untyped(), data) {
                (ColumnWriter::Int64ColumnWriter(w), Data::Whole(v)) => {
                    let (values, levels) = split(v, |v| *v);
                    w.write_batch(&values, Some(&levels), None)?;
                }
                (ColumnWriter::DoubleColumnWriter(w), Data::Number(v)) => {
                    let (values, levels) = split(v, |v| *v);
                    w.write_batch(&values, Some(&levels), None)?;
                }
                (ColumnWriter::BoolColumnWriter(w), Data::Flag(v)) => {
                    let (values, levels) = split(v, |v| *v);
                    w.write_batch(&values, Some(&levels), None)?;
                }
                (ColumnWriter::ByteArrayColumnWriter(w), Data::Text(v)) => {
                    let (values, levels) = split(v, |v| ByteArray::from(v.as_str()));
                    w.write_batch(&values, Some(&levels), None)?;
                }
                _ => return Err(ParquetError::General("column of another kind".to_owned())),
            }
            column.close()?;
        }
        group.close()?;
        self.hashes.push(table.digest());
        Ok(())
    }

    /// Writes the footer and returns the underlying writer.
    pub(crate) fn finish(mut self) -> Result<W, ParquetError> {
        self.file.append_key_value_metadata(KeyValue {
            key: ROWS.to_owned(),
            value: Some(self.hashes.join(" ")),
        });
        self.file.into_inner()
    }
}

/// The values that exist, and for each row whether it has one.
fn split<T, U>(values: &[Option<T>], of: impl Fn(&T) -> U) -> (Vec<U>, Vec<i16>) {
    let there = values.iter().flatten().map(of).collect();
    let levels = values.iter().map(|v| i16::from(v.is_some())).collect();
    (there, levels)
}

fn schema(columns: &[Column]) -> Result<Arc<Type>, ParquetError> {
    let mut fields = Vec::new();
    for column in columns {
        let (physical, logical) = match column.kind {
            Kind::Whole => (Physical::INT64, None),
            Kind::Number => (Physical::DOUBLE, None),
            Kind::Flag => (Physical::BOOLEAN, None),
            Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build()?;
        fields.push(Arc::new(field));
    }
    let schema = Type::group_type_builder("case")
        .with_fields(fields)
        .build()?;
    Ok(Arc::new(schema))
}

/// Keeps damaged bytes from ending the program, whatever the library does with them.
fn sound<T>(read: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ParquetError> {
    let read = caught(read);
    read.unwrap_or_else(|_| Err(ParquetError::General("its bytes are damaged".to_owned())))
}

/// Reads tables that [`TableWriter`] has written.
pub(crate) struct TableReader {
    file: SerializedFileReader<File>,
    columns: Vec<Column>,
    /// Most bytes of text that the file may have.
    text_most: u64,
}

impl TableReader {
    /// Reads the footer and the columns in it, and checks its claims against the bytes of the file.
    pub(crate) fn new(from: File) -> Result<Self, ParquetError> {
        sound(|| Self::open(from))
    }

    fn open(from: File) -> Result<Self, ParquetError> {
        let file = SerializedFileReader::new(from.try_clone()?)?;
        pages::check(&from, file.metadata())?;
        let mut reader = Self {
            file,
            columns: Vec::new(),
            text_most: from.len().saturating_mul(TEXT_PER_BYTE),
        };
        let columns = reader.fact(crate::columns::FACT).unwrap_or_default();
        reader.columns = serde_json::from_str(columns).map_err(|_| {
            let other = "it is not a table of a campaign: its columns are not described as there";
            ParquetError::General(other.to_owned())
        })?;
        let schema = reader.file.metadata().file_metadata().schema_descr();
        let names = schema.columns().iter().map(|column| column.name());
        if !names.eq(reader.columns.iter().map(|column| column.name.as_str())) {
            let other = "its columns are not those that it says".to_owned();
            return Err(ParquetError::General(other));
        }
        Ok(reader)
    }

    /// A value of the file's metadata.
    pub(crate) fn fact(&self, key: &str) -> Option<&str> {
        let facts = self.file.metadata().file_metadata().key_value_metadata()?;
        let fact = facts.iter().find(|fact| fact.key == key)?;
        fact.value.as_deref()
    }

    /// Number of rows in each row group.
    #[cfg(test)]
    pub(crate) fn groups(&self) -> Vec<i64> {
        let groups = self.file.metadata().row_groups().iter();
        groups.map(|group| group.num_rows()).collect()
    }

    /// Reads all rows, and checks that they are those that were written; tables of earlier versions do not say.
    pub(crate) fn read(&self) -> Result<Table, ParquetError> {
        let mut table = Table::empty(self.columns.clone());
        let mut text_left = self.text_most;
        let mut hashes = self.fact(ROWS).map(|hashes| hashes.split_whitespace());
        for group in 0..self.file.num_row_groups() {
            let rows = sound(|| self.group(group, &mut text_left))?;
            if let Some(hashes) = &mut hashes
                && hashes.next() != Some(rows.digest().as_str())
            {
                return Err(ParquetError::General("its values were changed".to_owned()));
            }
            table.append(rows);
        }
        if hashes.is_some_and(|mut more| more.next().is_some()) {
            return Err(ParquetError::General("rows are missing".to_owned()));
        }
        Ok(table)
    }

    /// Reads one row group. `text_left` is the number of bytes its texts may still have.
    fn group(&self, group: usize, text_left: &mut u64) -> Result<Table, ParquetError> {
        let group = self.file.get_row_group(group)?;
        let rows = usize::try_from(group.metadata().num_rows())
            .map_err(|e| ParquetError::General(e.to_string()))?;
        let mut table = Table::empty(self.columns.clone());
        for (at, column) in self.columns.iter().enumerate() {
            let data = match (group.get_column_reader(at)?, column.kind) {
                (ColumnReader::Int64ColumnReader(mut r), Kind::Whole) => {
                    Data::Whole(read_column(rows, |d, v| {
                        r.read_records(rows, Some(d), None, v)
                    })?)
                }
                (ColumnReader::DoubleColumnReader(mut r), Kind::Number) => {
                    Data::Number(read_column(rows, |d, v| {
                        r.read_records(rows, Some(d), None, v)
                    })?)
                }
                (ColumnReader::BoolColumnReader(mut r), Kind::Flag) => {
                    Data::Flag(read_column(rows, |d, v| {
                        r.read_records(rows, Some(d), None, v)
                    })?)
                }
                (ColumnReader::ByteArrayColumnReader(mut r), Kind::Text) => {
                    let bytes: Vec<Option<ByteArray>> =
                        read_column(rows, |d, v| r.read_records(rows, Some(d), None, v))?;
                    // Many rows may share a long text of a dictionary.
                    let length = bytes.iter().flatten().map(ByteArray::len).sum::<usize>();
                    *text_left = text_left.checked_sub(length as u64).ok_or_else(|| {
                        let most = self.text_most;
                        ParquetError::General(format!("its texts have more than {most} bytes"))
                    })?;
                    let texts = bytes.into_iter().map(|b| match b {
                        Some(b) => String::from_utf8(b.data().to_vec()).map(Some),
                        None => Ok(None),
                    });
                    let texts = texts.collect::<Result<_, _>>();
                    Data::Text(texts.map_err(|e| ParquetError::General(e.to_string()))?)
                }
                _ => return Err(ParquetError::General(format!("column {}", column.name))),
            };
            table.data[at] = data;
        }
        Ok(table)
    }
}

/// Reads a whole column; combines values and levels into optional values.
fn read_column<T>(
    rows: usize,
    read: impl FnOnce(&mut Vec<i16>, &mut Vec<T>) -> Result<(usize, usize, usize), ParquetError>,
) -> Result<Vec<Option<T>>, ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    read(&mut levels, &mut values)?;
    if levels.len() != rows {
        return Err(ParquetError::General("rows are missing".to_owned()));
    }
    let mut values = values.into_iter();
    let present = levels.into_iter().map(|level| match level {
        0 => None,
        _ => values.next(),
    });
    Ok(present.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pages::{MOST_COLUMNS, NAMES_MOST};
    use crate::row::ERROR_MOST;

    /// The widest table with the longest names that a plan may have, and nothing else in its rows: what is
    /// written can be read.
    #[test]
    fn the_widest_table_is_read() {
        const ROWS: u128 = 5_000;
        let column = |i: usize| {
            let kind = if i < 2 { Kind::Text } else { Kind::Number };
            Column::new(&format!("c{i}"), kind, "", "")
        };
        let columns: Vec<Column> = (0..MOST_COLUMNS).map(column).collect();
        let case = |n: u128| {
            let hash = blake3::hash(&n.to_le_bytes()).to_hex();
            Some(hash[..32].to_owned())
        };
        let mut data = vec![Data::Text((0..ROWS).map(case).collect())];
        let text = "n".repeat(NAMES_MOST + ERROR_MOST + 100);
        data.push(Data::Text(vec![Some(text); ROWS as usize]));
        let blank = Data::Number(vec![None; ROWS as usize]);
        data.resize(MOST_COLUMNS, blank);
        let table = Table { columns, data };
        let described = serde_json::to_string(&table.columns).expect("JSON");
        let facts = [(crate::columns::FACT, described.as_str())];
        let file = tempfile::tempfile().expect("a file");
        let mut writer = TableWriter::new(file, &table.columns, &facts).expect("a writer");
        writer.write(&table).expect("written");
        let file = writer.finish().expect("finished");
        let read = TableReader::new(file).and_then(|reader| reader.read());
        assert!(read.expect("a table") == table);
    }

    /// Names, texts and metadata survive a round trip, whatever they contain.
    #[test]
    fn texts_of_any_content_come_back() {
        let texts = [
            "",
            "plain",
            "a\"b'c,d;e\tf\ng",
            "</script><b>&amp;",
            "../../x",
            "\u{0}\u{7f}\u{feff}\u{202e}",
            "ünï 🦿",
            &"x".repeat(100_000),
        ];
        let columns: Vec<Column> = texts
            .iter()
            .enumerate()
            .map(|(i, text)| Column {
                name: format!("{i} {text}"),
                kind: Kind::Text,
                unit: (*text).to_owned(),
                meaning: (*text).to_owned(),
                min: None,
                max: Some(1.5),
                required: true,
            })
            .collect();
        let row = |text: &str| Data::Text(vec![Some(text.to_owned()), None]);
        let table = Table {
            columns: columns.clone(),
            data: texts.iter().map(|text| row(text)).collect(),
        };
        let described = serde_json::to_string(&columns).expect("JSON");
        let fact = texts.concat();
        let facts = [(crate::columns::FACT, described.as_str()), ("plan", &fact)];
        let file = tempfile::tempfile().expect("a file");
        let mut writer = TableWriter::new(file, &columns, &facts).expect("a writer");
        writer.write(&table).expect("written");
        let file = writer.finish().expect("finished");
        let reader = TableReader::new(file).expect("a table");
        assert_eq!(reader.fact("plan"), Some(fact.as_str()));
        assert_eq!(reader.read().expect("read"), table);
    }
}
