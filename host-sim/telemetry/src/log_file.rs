//! The sink that writes the MCAP log.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, Write};
use std::path::Path;

use mcap::records::MessageHeader;
use mcap::{Compression, MAGIC};

use super::registry::{ChannelDef, json_schema};
use super::samples::channels;
use super::sink::{Sink, Taken};
use crate::LogError;

/// Largest chunk before compression. A quarter of a second has about 0.4 MB.
const CHUNK_BYTES: u64 = 4 * 1024 * 1024;
/// A chunk is closed and handed to the operating system after this much simulated time: no more
/// is lost with a killed process.
const FLUSH_PERIOD_NS: u64 = 250_000_000;

/// How our logs are written. The fastest level of zstd makes a ninth of the JSON (lz4: a fifth)
/// in 3 ms per simulated second, here and not in threads, for the same bytes on any computer.
pub(crate) fn options() -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(1)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
        .library(concat!("wheeleg ", env!("CARGO_PKG_VERSION")))
}

/// Takes the first bytes of a log.
///
/// # Errors
/// [`LogError::NotALog`] if they are others, [`LogError::Output`] if they cannot be read.
pub(crate) fn begins_as_log(source: &mut impl Read, path: &Path) -> Result<(), LogError> {
    let mut magic = Vec::new();
    let mut begin = source.take(MAGIC.len() as u64);
    begin
        .read_to_end(&mut magic)
        .map_err(|e| LogError::output("read the log", path, e))?;
    if magic != MAGIC {
        return Err(LogError::NotALog { path: path.into() });
    }
    Ok(())
}

/// Writes an MCAP log in compressed chunks.
pub struct LogFile {
    /// `None` once it has failed.
    log: Option<mcap::Writer<BufWriter<File>>>,
    failed: Option<LogError>,
    headers: Vec<MessageHeader>,
    payload: Vec<u8>,
    flushed_ns: u64,
}

impl LogFile {
    /// Creates the log with all its channels.
    ///
    /// # Errors
    /// [`LogError::Output`] if the file cannot be created, [`LogError::Log`] if its header
    /// cannot be written.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let file =
            File::create(path).map_err(|e| LogError::output("create the log file", path, e))?;
        let mut log = options().create(BufWriter::new(file))?;
        let mut headers = Vec::new();
        for def in channels() {
            headers.push(MessageHeader {
                channel_id: add_channel(&mut log, def)?,
                sequence: 0,
                log_time: 0,
                publish_time: 0,
            });
        }
        log.flush()?;
        Ok(Self {
            log: Some(log),
            failed: None,
            headers,
            payload: Vec::with_capacity(1024),
            flushed_ns: 0,
        })
    }

    /// Why nothing more is written, as soon as that is so.
    #[must_use]
    pub fn failure(&self) -> Option<&LogError> {
        self.failed.as_ref()
    }
}

impl Sink for LogFile {
    fn take(&mut self, taken: &Taken<'_>) {
        if !taken.due {
            return;
        }
        let header = &mut self.headers[taken.channel];
        header.sequence += 1;
        let Some(log) = self.log.as_mut().filter(|_| !taken.lost) else {
            return;
        };
        (header.log_time, header.publish_time) = (taken.t_ns, taken.t_ns);
        self.payload.clear();
        taken.sample.encode_json(&mut self.payload);
        let mut result = log.write_to_known_channel(header, &self.payload);
        if taken.t_ns >= self.flushed_ns + FLUSH_PERIOD_NS {
            self.flushed_ns = taken.t_ns;
            result = result.and_then(|()| log.flush());
        }
        if let Err(e) = result {
            self.failed = Some(LogError::Log(e));
            self.log = None;
        }
    }

    fn finish(&mut self) -> Result<(), LogError> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        if let Some(mut log) = self.log.take() {
            log.finish()?;
            log.into_inner().flush().map_err(mcap::McapError::Io)?;
        }
        Ok(())
    }
}

fn add_channel<W: Write + Seek>(
    log: &mut mcap::Writer<W>,
    def: &ChannelDef,
) -> Result<u16, LogError> {
    let schema = json_schema(def.schema, def.fields);
    let schema_id = log.add_schema(def.schema, "jsonschema", schema.as_bytes())?;
    Ok(log.add_channel(schema_id, def.topic, "json", &metadata(def))?)
}

/// Channel metadata: the units at a glance and per field, rate and meaning.
fn metadata(def: &ChannelDef) -> BTreeMap<String, String> {
    let mut metadata = BTreeMap::new();
    let units: Vec<String> = def
        .fields
        .iter()
        .map(|f| format!("{} [{}]", f.name, f.unit))
        .collect();
    metadata.insert("unit".into(), units.join(", "));
    for f in def.fields {
        metadata.insert(format!("unit.{}", f.name), f.unit.into());
    }
    metadata.insert("description".into(), def.doc.into());
    let rate = match def.rate_hz {
        0 => "on change".to_owned(),
        rate => rate.to_string(),
    };
    metadata.insert("rate_hz".into(), rate);
    metadata
}
