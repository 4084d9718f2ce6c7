//! A log as Parquet: a file per channel, a row per message.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use wheeleg_telemetry::{ChannelDef, FieldType, Logged, Scalar, channels, read};

use super::folder::Filling;
use super::reading::Reading;
use crate::StudyError;
use crate::study::Progress;

/// Name of the column of simulated time.
const TIME: &str = "t_ns";
/// Rows of a row group: the part of each channel kept in memory.
const GROUP_ROWS: usize = 8_192;

/// Summary of the written files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tables {
    /// Files.
    pub files: usize,
    /// Rows of all files.
    pub rows: u64,
    /// The log has its end.
    pub whole: bool,
}

/// Writes every channel of the registry that has a message in `log` to `folder`, a new one: `/joint/3` to
/// `joint-3.parquet`. `None`: it was stopped, and no folder is there. The files' metadata `wheeleg.columns`
/// has units and meanings.
///
/// # Errors
/// [`StudyError::Log`] if the log cannot be read, [`StudyError::Refused`] if the folder exists,
/// [`StudyError::Report`] if a file cannot be written.
pub fn export(
    log: &Path,
    folder: &Path,
    progress: &Progress,
) -> Result<Option<Tables>, StudyError> {
    let filling = Filling::begin(folder)?;
    let mut tables: Vec<Option<Table>> = channels().iter().map(|_| None).collect();
    let mut reading = Reading::begin(log, progress);
    let end = read(log, &mut |logged| {
        let table = &mut tables[logged.channel];
        let result = match table {
            Some(table) => table.add(&logged),
            None => Table::create(&filling, &channels()[logged.channel])
                .and_then(|new| table.insert(new).add(&logged)),
        };
        reading.after(logged.t_ns, result)
    })?;
    if !reading.end()? {
        return Ok(None);
    }
    let mut files = 0;
    for table in tables.into_iter().flatten() {
        table.finish()?;
        files += 1;
    }
    filling.finish()?;
    Ok(Some(Tables {
        files,
        rows: end.messages,
        whole: end.whole,
    }))
}

/// Values of a column since the last row group.
enum Values {
    Number(Vec<Option<f64>>),
    Whole(Vec<Option<i64>>),
    Flag(Vec<Option<bool>>),
    Text(Vec<Option<ByteArray>>),
}

/// A file under way.
struct Table {
    path: std::path::PathBuf,
    file: SerializedFileWriter<File>,
    names: Vec<&'static str>,
    times: Vec<i64>,
    columns: Vec<Values>,
}

/// Definition levels and the existing values.
fn split<T: Clone>(list: &mut Vec<Option<T>>) -> (Vec<i16>, Vec<T>) {
    let levels = list.iter().map(|v| i16::from(v.is_some())).collect();
    (levels, list.drain(..).flatten().collect())
}

impl Values {
    fn of(ty: FieldType) -> Self {
        match ty {
            FieldType::Number => Self::Number(Vec::new()),
            FieldType::Integer => Self::Whole(Vec::new()),
            FieldType::Boolean => Self::Flag(Vec::new()),
            FieldType::Text => Self::Text(Vec::new()),
        }
    }

    /// Adds a row that has no value yet.
    fn begin(&mut self) {
        match self {
            Self::Number(v) => v.push(None),
            Self::Whole(v) => v.push(None),
            Self::Flag(v) => v.push(None),
            Self::Text(v) => v.push(None),
        }
    }

    /// Sets the value of the newest row.
    fn set(&mut self, value: Scalar) {
        match (self, value) {
            (Self::Number(v), Scalar::Number(n)) => set_last(v, n),
            // Below 2^53 in every channel.
            (Self::Whole(v), Scalar::Number(n)) => set_last(v, n as i64),
            (Self::Flag(v), Scalar::Number(n)) => set_last(v, n != 0.0),
            (Self::Text(v), Scalar::Text(text)) => set_last(v, text.into_bytes().into()),
            // Of another type than in the registry: no value.
            _ => {}
        }
    }

    fn write(&mut self, to: &mut ColumnWriter<'_>) -> Result<(), ParquetError> {
        match (to, self) {
            (ColumnWriter::DoubleColumnWriter(to), Self::Number(list)) => {
                let (levels, values) = split(list);
                to.write_batch(&values, Some(&levels), None)?;
            }
            (ColumnWriter::Int64ColumnWriter(to), Self::Whole(list)) => {
                let (levels, values) = split(list);
                to.write_batch(&values, Some(&levels), None)?;
            }
            (ColumnWriter::BoolColumnWriter(to), Self::Flag(list)) => {
                let (levels, values) = split(list);
                to.write_batch(&values, Some(&levels), None)?;
            }
            (ColumnWriter::ByteArrayColumnWriter(to), Self::Text(list)) => {
                let (levels, values) = split(list);
                to.write_batch(&values, Some(&levels), None)?;
            }
            _ => {
                return Err(ParquetError::General("a column of another type".to_owned()));
            }
        }
        Ok(())
    }
}

fn set_last<T>(list: &mut [Option<T>], value: T) {
    if let Some(last) = list.last_mut() {
        *last = Some(value);
    }
}

fn schema(def: &ChannelDef) -> Result<Arc<Type>, ParquetError> {
    let field = |name: &str, physical, logical, repetition| {
        Type::primitive_type_builder(name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
            .map(Arc::new)
    };
    let mut fields = vec![field(TIME, Physical::INT64, None, Repetition::REQUIRED)?];
    for f in def.fields {
        let (physical, logical) = match f.ty {
            FieldType::Number => (Physical::DOUBLE, None),
            FieldType::Integer => (Physical::INT64, None),
            FieldType::Boolean => (Physical::BOOLEAN, None),
            FieldType::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        fields.push(field(f.name, physical, logical, Repetition::OPTIONAL)?);
    }
    let whole = Type::group_type_builder("channel").with_fields(fields);
    whole.build().map(Arc::new)
}

/// Description of a file's columns, JSON.
fn columns(def: &ChannelDef) -> String {
    let time = serde_json::json!({
        "name": TIME, "unit": "ns", "layer": "host", "meaning": "Simulated time",
    });
    let fields = def.fields.iter().map(|f| {
        serde_json::json!({
            "name": f.name, "unit": f.unit, "layer": f.layer.name(), "meaning": f.doc,
        })
    });
    let all: Vec<serde_json::Value> = std::iter::once(time).chain(fields).collect();
    serde_json::Value::from(all).to_string()
}

impl Table {
    fn create(filling: &Filling, def: &ChannelDef) -> Result<Self, StudyError> {
        let name = def.topic.trim_start_matches('/').replace('/', "-");
        let name = format!("{name}.parquet");
        let path = filling.shown(&name);
        let file = File::create(filling.path(&name))
            .map_err(|e| StudyError::output("create", &path, e))?;
        let facts = [
            ("wheeleg.channel", def.topic.to_owned()),
            ("wheeleg.meaning", def.doc.to_owned()),
            ("wheeleg.columns", columns(def)),
        ];
        let facts = facts.map(|(key, value)| KeyValue {
            key: key.to_owned(),
            value: Some(value),
        });
        let properties = WriterProperties::builder()
            .set_created_by(concat!("wheeleg ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(facts.into()))
            .build();
        let file = schema(def)
            .and_then(|schema| SerializedFileWriter::new(file, schema, Arc::new(properties)));
        Ok(Self {
            file: file.map_err(|e| unwritten(&path, &e))?,
            path,
            names: def.fields.iter().map(|f| f.name).collect(),
            times: Vec::new(),
            columns: def.fields.iter().map(|f| Values::of(f.ty)).collect(),
        })
    }

    fn add(&mut self, logged: &Logged<'_>) -> Result<(), StudyError> {
        self.times
            .push(i64::try_from(logged.t_ns).unwrap_or(i64::MAX));
        self.columns.iter_mut().for_each(Values::begin);
        let columns = &mut self.columns;
        logged.fields(&self.names, &mut |at, value| columns[at].set(value));
        if self.times.len() >= GROUP_ROWS {
            return self.write();
        }
        Ok(())
    }

    /// Writes a row group.
    fn write(&mut self) -> Result<(), StudyError> {
        let times = std::mem::take(&mut self.times);
        let written = write_group(&mut self.file, &times, &mut self.columns);
        written.map_err(|e| unwritten(&self.path, &e))
    }

    fn finish(mut self) -> Result<(), StudyError> {
        if !self.times.is_empty() {
            self.write()?;
        }
        let closed = self.file.close();
        closed.map(drop).map_err(|e| unwritten(&self.path, &e))
    }
}

fn write_group(
    file: &mut SerializedFileWriter<File>,
    times: &[i64],
    columns: &mut [Values],
) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    let mut columns = columns.iter_mut();
    let mut first = true;
    while let Some(mut column) = group.next_column()? {
        if first {
            if let ColumnWriter::Int64ColumnWriter(to) = column.untyped() {
                to.write_batch(times, None, None)?;
            }
        } else if let Some(values) = columns.next() {
            values.write(column.untyped())?;
        }
        first = false;
        column.close()?;
    }
    group.close().map(drop)
}

fn unwritten(path: &Path, error: &ParquetError) -> StudyError {
    let reason = match error {
        ParquetError::External(reason) => reason.to_string(),
        other => other.to_string(),
    };
    StudyError::output("write", path, std::io::Error::other(reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    use parquet::record::RowAccessor as _;
    use wheeleg_telemetry::{BodySample, FootSample, Recorder};

    #[test]
    fn a_disk_that_is_full_is_told_in_its_own_words() {
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let reason = full.to_string();
        let told = unwritten(Path::new("tables/body.parquet"), &ParquetError::from(full));
        assert_eq!(
            told.to_string(),
            format!("cannot write `tables/body.parquet`: {reason}")
        );
    }

    #[test]
    fn a_file_per_channel_with_every_row_and_its_units() {
        let folder = tempfile::tempdir().expect("a folder");
        let (log, out) = (
            folder.path().join("log.mcap"),
            folder.path().join("parquet"),
        );
        let mut recorder = Recorder::create(&log).expect("created");
        // More than two row groups.
        for cs in 0..20_000_u64 {
            let body = BodySample {
                x_mm: cs as f64 / 8.0,
                z_mm: if cs == 7 { f64::NAN } else { 1.0 },
                ..BodySample::default()
            };
            recorder.body(cs * 10_000_000, body);
        }
        recorder.foot(0, 1, FootSample::default());
        drop(recorder.finish().expect("finished"));
        let made = export(&log, &out, &Progress::silent()).expect("exported");
        let expected = Tables {
            files: 2,
            rows: 20_001,
            whole: true,
        };
        assert_eq!(made, Some(expected));
        let file = File::open(out.join("body.parquet")).expect("a file");
        let reader = SerializedFileReader::new(file).expect("Parquet");
        let facts = reader.metadata().file_metadata().key_value_metadata();
        let units = facts
            .expect("facts")
            .iter()
            .find(|f| f.key == "wheeleg.columns");
        let units = units.and_then(|f| f.value.as_deref()).expect("columns");
        assert!(units.contains(r#""name":"x_mm","unit":"mm""#) || units.contains(r#""unit":"mm""#));
        assert_eq!(reader.num_row_groups(), 3);
        for (i, row) in reader.get_row_iter(None).expect("rows").enumerate() {
            let row = row.expect("a row");
            assert_eq!(row.get_long(0).expect("t_ns"), i as i64 * 10_000_000);
            assert_eq!(row.get_double(1).expect("x_mm"), i as f64 / 8.0);
            // A missing value is null.
            assert_eq!(row.get_double(3).is_err(), i == 7, "row {i}");
        }

        // A second export spoils nothing, and a failed one leaves nothing.
        let again = export(&log, &out, &Progress::silent()).expect_err("refused");
        assert!(again.to_string().contains("is there already"), "{again}");
        let none = folder.path().join("none");
        let missing = export(&none, &folder.path().join("x"), &Progress::silent());
        assert!(missing.expect_err("no log").to_string().contains("none"));
        let left = std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(left, 2, "log and tables");
    }
}
