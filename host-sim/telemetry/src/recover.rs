//! Makes a complete log from one whose writer was killed.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Seek as _};
use std::path::Path;

use mcap::McapError;
use mcap::io::MessageReader;
use mcap::records::{MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::attachments::attachments;
use super::log_file::{attach, begins_as_log, opened, options};
use super::read::uninterrupted;
use super::record::{self, Swelling};
use crate::LogError;

/// The result of [`recover`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recovered {
    /// Messages in the new file.
    pub messages: u64,
    /// Time of the last, ns.
    pub last_ns: u64,
    /// Whether the old file was complete already.
    pub was_whole: bool,
    /// Bytes of the old file behind the end of its log, such as another log; they are not copied.
    pub behind: u64,
}

/// Largest accepted chunk, bytes: where a file breaks off, its lengths can be anything.
const MAX_CHUNK: usize = 1 << 30;

/// Every chunk is checked before a message of it is given.
fn checked() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_CHUNK)
}

/// Copies everything that can be read from `from`, a log that has no end because its writer was killed or its
/// disk was full, to the new file `to`, and reads that once more with all checks. Memory is bounded by a
/// chunk. `None` if `stop` asked for it before the end; `to` is not left behind then, either.
///
/// # Errors
/// [`LogError::Output`] if `to` exists or cannot be written, [`LogError::Read`] if `from` cannot be read;
/// [`LogError::NotALog`] if `from` is not a log, [`LogError::Empty`] if it has no whole chunk;
/// [`LogError::Made`] if the new file cannot be written, [`LogError::Unreadable`] and [`LogError::Unsound`]
/// if it cannot be read back. `to` is not left behind then, and `from` is never changed.
pub fn recover(
    from: &Path,
    to: &Path,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Recovered>, LogError> {
    let unreadable = |e| LogError::read(from, e);
    let mut source = opened(from)?;
    begins_as_log(&mut source, from)?;
    source.rewind().map_err(unreadable)?;
    let target =
        File::create_new(to).map_err(|e| LogError::output("create the recovered log", to, e))?;
    let recovered = copy(source, target, [from, to], stop).and_then(|recovered| {
        let Some(recovered) = recovered else {
            return Ok(None);
        };
        let found = count(to)?;
        if found == recovered.messages {
            Ok(Some(recovered))
        } else {
            Err(LogError::Unsound {
                path: to.into(),
                written: recovered.messages,
                found,
            })
        }
    });
    if !matches!(recovered, Ok(Some(_))) {
        let _ = fs::remove_file(to);
    }
    recovered
}

fn copy(
    source: File,
    target: File,
    [from, to]: [&Path; 2],
    stop: &dyn Fn() -> bool,
) -> Result<Option<Recovered>, LogError> {
    let failed = |e| LogError::made(to, e);
    let mut log = options().create(BufWriter::new(target)).map_err(failed)?;
    for file in attachments(from)? {
        attach(&mut log, file).map_err(failed)?;
    }
    let mut copy = Copy {
        log,
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        recovered: Recovered {
            messages: 0,
            last_ns: 0,
            was_whole: true,
            behind: 0,
        },
    };
    let length = source
        .metadata()
        .map_err(|e| LogError::read(from, e))?
        .len();
    let mut source = BufReader::new(source);
    let mut reader = LinearReader::new_with_options(checked());
    let mut swelling = Swelling::default();
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let read = uninterrupted(&mut source, reader.insert(need));
                let read = read.map_err(|e| LogError::read(from, e))?;
                swelling.read(read);
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { data, .. }) if !swelling.give(data.len()) => {
                copy.recovered.was_whole = false;
                break;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                copy.take(opcode, data).map_err(failed)?;
                if stop() {
                    return Ok(None);
                }
            }
            // The place where it breaks off.
            Err(_) => {
                copy.recovered.was_whole = false;
                break;
            }
        }
    }
    if copy.recovered.was_whole {
        let end = source.stream_position();
        let end = end.map_err(|e| LogError::read(from, e))?;
        copy.recovered.behind = length.saturating_sub(end);
    }
    let Copy {
        mut log, recovered, ..
    } = copy;
    if recovered.messages == 0 {
        return Err(LogError::Empty { path: from.into() });
    }
    log.finish().map_err(failed)?;
    let file = log
        .into_inner()
        .into_inner()
        .map_err(|e| failed(McapError::Io(e.into_error())))?;
    file.sync_all().map_err(|e| failed(McapError::Io(e)))?;
    Ok(Some(recovered))
}

/// A rewritten log.
struct Copy {
    log: mcap::Writer<BufWriter<File>>,
    /// Numbers of schemas and channels there, by those of the old log.
    schemas: BTreeMap<u16, u16>,
    channels: BTreeMap<u16, u16>,
    recovered: Recovered,
}

impl Copy {
    /// Takes a record of the old log. If one is damaged, such as a picture, only that one is lost.
    fn take(&mut self, opcode: u8, data: &[u8]) -> Result<(), McapError> {
        match record::parse(opcode, data) {
            Some(Record::Schema { header, data }) => {
                let id = self.log.add_schema(&header.name, &header.encoding, &data)?;
                self.schemas.insert(header.id, id);
            }
            Some(Record::Channel(channel)) => {
                let schema = self.schemas.get(&channel.schema_id).copied();
                self.recovered.was_whole &= channel.schema_id == 0 || schema.is_some();
                let id = self.log.add_channel(
                    schema.unwrap_or(0),
                    &channel.topic,
                    &channel.message_encoding,
                    &channel.metadata,
                )?;
                self.channels.insert(channel.id, id);
            }
            Some(Record::Message { header, data }) => {
                let Some(channel_id) = self.channels.get(&header.channel_id).copied() else {
                    self.recovered.was_whole = false;
                    return Ok(());
                };
                let header = MessageHeader {
                    channel_id,
                    ..header
                };
                self.log.write_to_known_channel(&header, &data)?;
                self.recovered.messages += 1;
                self.recovered.last_ns = self.recovered.last_ns.max(header.log_time);
            }
            Some(_) => {}
            None => self.recovered.was_whole = false,
        }
        Ok(())
    }
}

/// Messages of a whole log; a log with any defect is an error.
fn count(path: &Path) -> Result<u64, LogError> {
    let file = opened(path)?;
    let strict = checked()
        .with_check_finishes_after_end_magic(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let messages = MessageReader::new_with_options(BufReader::new(file), strict);
    let mut count = 0;
    for message in messages {
        message.map_err(|reason| LogError::Unreadable {
            path: path.into(),
            reason,
        })?;
        count += 1;
    }
    Ok(count)
}
