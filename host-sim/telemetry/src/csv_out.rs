//! The sink that writes CSV files: one per channel, units in the header.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::registry::ChannelDef;
use super::samples::channels;
use super::sink::{Sink, Taken};
use crate::LogError;

/// Channels without a table: those that only the log needs, and those that no complete run has.
const WITHOUT: [&str; 4] = ["/state", "/run", "/server", "/session"];

struct Table {
    path: PathBuf,
    out: csv::Writer<File>,
    /// 0: every row.
    period_ns: u64,
    next_ns: u64,
    failed: Option<std::io::Error>,
}

/// Writes `joint-1.csv` … `events.csv` while the run lasts.
pub struct Tables {
    /// One per channel of the registry.
    tables: Vec<Option<Table>>,
    record: csv::ByteRecord,
    text: Vec<u8>,
}

impl Tables {
    /// Creates the files, with their headers, in `folder`, which must exist. The fast channels
    /// are thinned to `rate_hz` (must divide 1000).
    ///
    /// # Errors
    /// [`LogError::Output`] if a file cannot be written.
    pub fn create(folder: &Path, rate_hz: u32) -> Result<Self, LogError> {
        let period_ns = 1_000_000_000 / u64::from(rate_hz.max(1));
        let tables = channels().iter().map(|def| {
            if WITHOUT.contains(&def.topic) {
                return Ok(None);
            }
            // A channel that is written on change is not thinned.
            let period_ns = if def.rate_hz == 0 { 0 } else { period_ns };
            Table::create(folder, def, period_ns).map(Some)
        });
        Ok(Self {
            tables: tables.collect::<Result<_, _>>()?,
            record: csv::ByteRecord::new(),
            text: Vec::new(),
        })
    }
}

impl Table {
    fn create(folder: &Path, def: &ChannelDef, period_ns: u64) -> Result<Self, LogError> {
        let name = def.topic.trim_start_matches('/').replace('/', "-");
        let path = folder.join(format!("{name}.csv"));
        let failed = |e: csv::Error| LogError::output("write the table", &path, e.into());
        let mut out = csv::Writer::from_path(&path).map_err(failed)?;
        let mut header = vec!["time [s]".to_owned()];
        let fields = def.fields.iter();
        header.extend(fields.map(|f| format!("{} [{}]", f.name, f.unit)));
        out.write_record(&header).map_err(failed)?;
        Ok(Self {
            path,
            out,
            period_ns,
            next_ns: 0,
            failed: None,
        })
    }
}

impl Sink for Tables {
    fn take(&mut self, taken: &Taken<'_>) {
        let Some(table) = &mut self.tables[taken.channel] else {
            return;
        };
        if table.failed.is_some() || taken.t_ns < table.next_ns {
            return;
        }
        // A period of zero keeps every row.
        let tick = taken.t_ns.checked_div(table.period_ns);
        table.next_ns = tick.map_or(0, |n| (n + 1) * table.period_ns);
        let record = &mut self.record;
        record.clear();
        self.text.clear();
        super::push_fixed(&mut self.text, taken.t_ns as f64 * 1e-9, 6);
        record.push_field(&self.text);
        taken.sample.cells(&mut |cell| {
            // Text arrives as JSON; CSV has its own quoting.
            match cell.first() {
                Some(b'"') => {
                    let text = serde_json::from_slice::<String>(cell).unwrap_or_default();
                    record.push_field(text.as_bytes());
                }
                Some(b'n') => record.push_field(b""),
                _ => record.push_field(cell),
            }
        });
        table.failed = table.out.write_byte_record(record).err().map(Into::into);
    }

    fn finish(&mut self) -> Result<(), LogError> {
        let mut failed = Vec::new();
        for table in self.tables.iter_mut().flatten() {
            let error = table.failed.take().or_else(|| table.out.flush().err());
            failed.extend(error.map(|reason| (table.path.clone(), reason)));
        }
        let count = failed.len();
        match failed.into_iter().next() {
            None => Ok(()),
            Some((path, reason)) if count == 1 => {
                Err(LogError::output("write the table", path, reason))
            }
            Some((path, reason)) => Err(LogError::Tables {
                count,
                path,
                reason,
            }),
        }
    }
}
