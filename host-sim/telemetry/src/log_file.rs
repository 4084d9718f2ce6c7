//! The sink that writes the MCAP log.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Compression, MAGIC};
use wheeleg_config::open_file;

use super::contact::Contact;
use super::derived::{Attached, Derive, derived};
use super::registry::{ChannelDef, json_schema};
use super::samples::channels;
use super::sink::{Sink, Taken};
use crate::LogError;

/// Largest chunk before compression. A quarter of a second has about 0.4 MB.
const CHUNK_BYTES: u64 = 4 * 1024 * 1024;
/// A chunk is closed and handed to the operating system after this much simulated time: a killed process
/// loses no more than that.
const FLUSH_PERIOD_NS: u64 = 250_000_000;

/// How our logs are written. The fastest level of zstd compresses the JSON to a ninth (lz4: a fifth) in 3 ms
/// per simulated second; on this thread, so that the bytes are the same on any computer.
pub(crate) fn options() -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(1)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
        .library(concat!("wheeleg ", env!("CARGO_PKG_VERSION")))
}

/// Opens a log to read it.
///
/// # Errors
/// [`LogError::Read`] if it cannot be opened or is not a file: a pipe may have no writer, a device no end.
pub(crate) fn opened(path: &Path) -> Result<File, LogError> {
    let failed = |e| LogError::read(path, e);
    if path.is_dir() {
        return Err(failed(std::io::ErrorKind::IsADirectory.into()));
    }
    open_file(path).map_err(failed)
}

/// Checks the first bytes of a log.
///
/// # Errors
/// [`LogError::NotALog`] if they are wrong, [`LogError::Read`] if they cannot be read.
pub(crate) fn begins_as_log(source: &mut impl Read, path: &Path) -> Result<(), LogError> {
    let mut magic = Vec::new();
    let mut begin = source.take(MAGIC.len() as u64);
    begin
        .read_to_end(&mut magic)
        .map_err(|e| LogError::read(path, e))?;
    if magic != MAGIC {
        return Err(LogError::NotALog { path: path.into() });
    }
    Ok(())
}

/// Writes an MCAP log in compressed chunks.
pub struct LogFile {
    file: OpenLog,
    derive: Option<Box<dyn Derive + Send>>,
    payload: Vec<u8>,
}

/// The file and the state for writing into it.
struct OpenLog {
    path: PathBuf,
    /// `None` once it has failed.
    log: Option<mcap::Writer<BufWriter<File>>>,
    failed: Option<LogError>,
    headers: Vec<MessageHeader>,
    flushed_ns: u64,
}

/// Removes a log without a complete head: there is nothing in it. A device stays.
fn discard(path: &Path) {
    if path.is_file() {
        let _ = std::fs::remove_file(path);
    }
}

impl LogFile {
    /// Creates the log with all its channels. If its head cannot be written, no file is left.
    ///
    /// # Errors
    /// [`LogError::Output`] if the file cannot be created, [`LogError::Log`] if its header
    /// cannot be written.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let file =
            File::create(path).map_err(|e| LogError::output("create the log file", path, e))?;
        Self::begin(file, path).map_err(|e| {
            discard(path);
            LogError::log(path, e)
        })
    }

    fn begin(file: File, path: &Path) -> Result<Self, mcap::McapError> {
        let mut log = options().create(BufWriter::new(file))?;
        let mut headers = Vec::new();
        for def in channels() {
            let schema = json_schema(def.schema, def.fields);
            let id = add_channel(&mut log, def.topic, (def.schema, &schema), metadata(def))?;
            headers.push(header(id));
        }
        log.flush()?;
        let file = OpenLog {
            path: path.to_owned(),
            log: Some(log),
            failed: None,
            headers,
            flushed_ns: 0,
        };
        Ok(Self {
            file,
            derive: None,
            payload: Vec::with_capacity(1024),
        })
    }

    /// The same with derived channels and the files that belong to them.
    ///
    /// # Errors
    /// [`LogError::Log`] if they cannot be written.
    pub fn with(self, derive: impl Derive + Send + 'static) -> Result<Self, LogError> {
        let path = self.file.path.clone();
        self.with_derived(derive).map_err(|e| {
            discard(&path);
            LogError::log(&path, e)
        })
    }

    fn with_derived(
        mut self,
        derive: impl Derive + Send + 'static,
    ) -> Result<Self, mcap::McapError> {
        let Some(log) = self.file.log.as_mut() else {
            return Ok(self);
        };
        for def in derived() {
            let metadata = BTreeMap::from([
                ("description".into(), def.doc.into()),
                ("rate_hz".into(), rate(def.rate_hz)),
                ("written".into(), def.written().name().into()),
            ]);
            let id = add_channel(log, def.topic, (def.schema, def.json_schema), metadata)?;
            self.file.headers.push(header(id));
        }
        for file in derive.attached() {
            attach(log, file)?;
        }
        log.flush()?;
        self.derive = Some(Box::new(derive));
        Ok(self)
    }

    /// Why writing has stopped, if it has.
    #[must_use]
    pub fn failure(&self) -> Option<&LogError> {
        self.file.failed.as_ref()
    }
}

impl OpenLog {
    fn write(&mut self, channel: usize, t_ns: u64, payload: &[u8], lost: bool) {
        let header = &mut self.headers[channel];
        header.sequence += 1;
        let Some(log) = self.log.as_mut().filter(|_| !lost) else {
            return;
        };
        (header.log_time, header.publish_time) = (t_ns, t_ns);
        let mut result = log.write_to_known_channel(header, payload);
        if t_ns >= self.flushed_ns + FLUSH_PERIOD_NS {
            self.flushed_ns = t_ns;
            result = result.and_then(|()| log.flush());
        }
        if let Err(e) = result {
            self.failed = Some(LogError::log(&self.path, e));
            self.log = None;
        }
    }
}

impl Sink for LogFile {
    fn take(&mut self, taken: &Taken<'_>) {
        if !taken.due {
            return;
        }
        let file = &mut self.file;
        self.payload.clear();
        if file.log.is_some() && !taken.lost {
            taken.sample.encode_json(&mut self.payload);
        }
        file.write(taken.channel, taken.t_ns, &self.payload, taken.lost);
        if let Some(derive) = &mut self.derive {
            derive.sample(taken, &mut |channel, t_ns, payload| {
                file.write(
                    channels().len() + channel as usize,
                    t_ns,
                    payload,
                    taken.lost,
                );
            });
        }
    }

    fn wants_contacts(&self) -> bool {
        self.derive.is_some()
    }

    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], lost: bool) {
        let file = &mut self.file;
        if let Some(derive) = &mut self.derive {
            derive.contacts(t_ns, contacts, &mut |channel, t_ns, payload| {
                file.write(channels().len() + channel as usize, t_ns, payload, lost);
            });
        }
    }

    fn finish(&mut self) -> Result<(), LogError> {
        if let Some(error) = self.file.failed.take() {
            return Err(error);
        }
        if let Some(mut log) = self.file.log.take() {
            let failed = |e| LogError::log(&self.file.path, e);
            log.finish().map_err(failed)?;
            let flushed = log.into_inner().flush();
            flushed.map_err(|e| failed(mcap::McapError::Io(e)))?;
        }
        Ok(())
    }
}

/// Puts a file into a log.
pub(crate) fn attach<W: Write + Seek>(
    log: &mut mcap::Writer<W>,
    file: Attached,
) -> Result<(), mcap::McapError> {
    let Attached {
        name,
        media_type,
        data,
    } = file;
    log.attach(&mcap::Attachment {
        log_time: 0,
        create_time: 0,
        name,
        media_type,
        data: data.into(),
    })
}

fn header(channel_id: u16) -> MessageHeader {
    MessageHeader {
        channel_id,
        sequence: 0,
        log_time: 0,
        publish_time: 0,
    }
}

fn add_channel<W: Write + Seek>(
    log: &mut mcap::Writer<W>,
    topic: &str,
    (name, schema): (&str, &str),
    metadata: BTreeMap<String, String>,
) -> Result<u16, mcap::McapError> {
    let schema_id = log.add_schema(name, "jsonschema", schema.as_bytes())?;
    log.add_channel(schema_id, topic, "json", &metadata)
}

/// Rate of a channel in words.
fn rate(rate_hz: u32) -> String {
    match rate_hz {
        0 => "on change".to_owned(),
        rate => rate.to_string(),
    }
}

/// Channel metadata: the units in brief and per field, rate and meaning.
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
    metadata.insert("rate_hz".into(), rate(def.rate_hz));
    metadata.insert("written".into(), def.written.name().into());
    metadata
}
