//! The files that a log carries.

use std::io::{BufReader, Read as _};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::derived::Attached;
use super::log_file::{begins_as_log, opened};
use super::record;
use crate::LogError;

/// Largest record that is read, bytes.
const MAX_RECORD: usize = 64 << 20;

/// The files in a log, up to where it breaks off.
///
/// # Errors
/// [`LogError::Read`] if the log cannot be read, [`LogError::NotALog`] if it is none.
pub fn attachments(path: &Path) -> Result<Vec<Attached>, LogError> {
    let unreadable = |e| LogError::read(path, e);
    let mut source = BufReader::new(opened(path)?);
    begins_as_log(&mut source, path)?;
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_emit_chunks(true)
        .with_record_length_limit(MAX_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut found = Vec::new();
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let read = source.read(reader.insert(need)).map_err(unreadable)?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { opcode, data }) if opcode == op::ATTACHMENT => {
                if let Some(Record::Attachment { header, data, .. }) = record::parse(opcode, data) {
                    found.push(Attached {
                        name: header.name,
                        media_type: header.media_type,
                        data: data.into_owned(),
                    });
                }
            }
            Ok(_) => {}
            // The place where it breaks off.
            Err(_) => break,
        }
    }
    Ok(found)
}
