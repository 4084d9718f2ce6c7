//! Reads a log, message by message. The file may come from anybody: it may break off, be another program's,
//! or be made to do harm.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{BufReader, ErrorKind};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde::de::{Deserializer as _, IgnoredAny, MapAccess, Visitor};

use super::derived::{Derived, derived};
use super::log_file::{begins_as_log, opened};
use super::record::{self, Swelling};
use super::samples::channels;
use crate::LogError;

/// Largest record that is read, bytes: ours have at most 4 MB and a message.
const MAX_RECORD: usize = 64 << 20;
/// Longest topic that is kept, bytes.
const MAX_TOPIC: usize = 256;
/// Largest message that is read, bytes.
const MAX_MESSAGE: usize = 64 * 1024;

/// One message.
#[derive(Debug, Clone, Copy)]
pub struct Logged<'a> {
    /// Index of its channel in [`channels`](crate::channels).
    pub channel: usize,
    /// Simulated time, ns.
    pub t_ns: u64,
    /// Its values, JSON.
    payload: &'a [u8],
}

/// How the reading of a log ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Read {
    /// Messages of channels of this program.
    pub messages: u64,
    /// Messages that are not this program's, or too long.
    pub others: u64,
    /// The log has its end; false where its writer was killed or its disk was full.
    pub whole: bool,
}

/// The path of a part, from 1 on, of the log whose first part is `path`. A long log is split into parts, each
/// a log by itself: `log.mcap`, `log.2.mcap`, `log.3.mcap`.
#[must_use]
pub fn part(path: &Path, number: u32) -> PathBuf {
    match (number, path.file_stem(), path.extension()) {
        (0 | 1, ..) | (_, None, _) => path.to_owned(),
        (_, Some(stem), extension) => {
            let mut name = stem.to_owned();
            name.push(format!(".{number}"));
            if let Some(extension) = extension {
                name.push(".");
                name.push(extension);
            }
            path.with_file_name(name)
        }
    }
}

/// The parts of the log that begins with `path`, which is the first of them whether it is there or not.
pub fn parts(path: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let first = path.to_owned();
    let more = (2..).map(move |number| part(&first, number));
    [path.to_owned()]
        .into_iter()
        .chain(more.take_while(|part| part.is_file()))
}

/// Reads `path` with the parts that follow it, and gives the messages in their order, until `take` breaks.
///
/// # Errors
/// [`LogError::Read`] if a file cannot be read, [`LogError::NotALog`] if `path` is not an MCAP log,
/// [`LogError::Foreign`] if it has messages, but none of a channel of this program, [`LogError::Empty`] if it
/// has none.
pub fn read(
    path: &Path,
    take: &mut dyn FnMut(Logged<'_>) -> ControlFlow<()>,
) -> Result<Read, LogError> {
    let head = channels()
        .iter()
        .position(|channel| channel.topic == "/run");
    let mut all: Option<Read> = None;
    let mut broke = false;
    for part in parts(path) {
        let is_first = all.is_none();
        let read = read_from(BufReader::new(opened(&part)?), &part, &mut |logged| {
            // The messages at the head of every part are given once.
            if !is_first && Some(logged.channel) == head {
                return ControlFlow::Continue(());
            }
            let next = take(logged);
            broke |= next.is_break();
            next
        });
        let read = match read {
            // A part that had just been started when its writer was killed.
            Err(LogError::Empty { .. } | LogError::NotALog { .. }) if !is_first => Read {
                messages: 0,
                others: 0,
                whole: false,
            },
            read => read?,
        };
        let before = all.get_or_insert(Read {
            messages: 0,
            others: 0,
            whole: true,
        });
        before.messages += read.messages;
        before.others += read.others;
        before.whole &= read.whole;
        if broke {
            break;
        }
    }
    all.ok_or_else(|| LogError::Empty { path: path.into() })
}

/// The same from any source; `path` is its name for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(
    mut source: impl std::io::Read,
    path: &Path,
    take: &mut dyn FnMut(Logged<'_>) -> ControlFlow<()>,
) -> Result<Read, LogError> {
    let places: BTreeMap<&str, usize> = channels().iter().map(|c| c.topic).zip(0..).collect();
    let (mut messages, mut others) = (0, 0);
    let whole = each(&mut source, path, &mut |message| {
        let topic = message.topic;
        // Derived channels.
        if derived().iter().any(|def| def.topic == topic) {
            return ControlFlow::Continue(());
        }
        let channel = places.get(topic);
        let Some(channel) = channel.filter(|_| message.data.len() <= MAX_MESSAGE) else {
            others += 1;
            return ControlFlow::Continue(());
        };
        messages += 1;
        take(Logged {
            channel: *channel,
            t_ns: message.log_time,
            payload: message.data,
        })
    })?;
    match (messages, others) {
        (1.., _) => Ok(Read {
            messages,
            others,
            whole,
        }),
        (_, 1..) => Err(LogError::Foreign { path: path.into() }),
        _ => Err(LogError::Empty { path: path.into() }),
    }
}

/// Takes a message of a derived channel: time in ns and JSON.
pub type TakeDerived<'a> = dyn FnMut(Derived, u64, &[u8]) -> ControlFlow<()> + 'a;

/// Reads the derived channels of `path` with the parts that follow it, and gives their messages in
/// their order, until `take` breaks. True: the log has its end.
///
/// # Errors
/// [`LogError::Read`] if the file cannot be read, [`LogError::NotALog`] if it is not an MCAP log.
pub fn read_derived(path: &Path, take: &mut TakeDerived<'_>) -> Result<bool, LogError> {
    let (mut whole, mut broke) = (true, false);
    for part in parts(path) {
        let mut source = BufReader::new(opened(&part)?);
        let read = each(&mut source, &part, &mut |message| {
            let next = match Derived::of_topic(message.topic) {
                Some(channel) => take(channel, message.log_time, message.data),
                None => ControlFlow::Continue(()),
            };
            broke |= next.is_break();
            next
        });
        whole &= match read {
            Err(LogError::NotALog { .. }) if part != path => false,
            read => read?,
        };
        if broke {
            break;
        }
    }
    Ok(whole)
}

/// A message on its way: topic, time and bytes.
struct Passing<'a> {
    topic: &'a str,
    log_time: u64,
    data: &'a [u8],
}

/// Gives every message until `take` breaks, or until the log breaks off: false then. Of a channel only its
/// topic is kept, which bounds the memory that a log can take.
fn each(
    source: &mut dyn std::io::Read,
    path: &Path,
    take: &mut dyn FnMut(&Passing<'_>) -> ControlFlow<()>,
) -> Result<bool, LogError> {
    begins_as_log(&mut &mut *source, path)?;
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut swelling = Swelling::default();
    let mut topics: BTreeMap<u16, String> = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        let (opcode, data) = match event {
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let read = uninterrupted(source, reader.insert(need));
                let read = read.map_err(|e| LogError::read(path, e))?;
                swelling.read(read);
                reader.notify_read(read);
                continue;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => (opcode, data),
            // The place where it breaks off.
            Err(_) => return Ok(false),
        };
        if !swelling.give(data.len()) {
            return Ok(false);
        }
        if opcode != op::CHANNEL && opcode != op::MESSAGE {
            continue;
        }
        match record::parse(opcode, data) {
            Some(Record::Channel(channel)) => {
                // No channel of this program has a longer one.
                let topic = Some(channel.topic).filter(|topic| topic.len() <= MAX_TOPIC);
                topics.insert(channel.id, topic.unwrap_or_default());
            }
            Some(Record::Message { header, data }) => {
                // A message without its channel is no message.
                let Some(topic) = topics.get(&header.channel_id) else {
                    return Ok(false);
                };
                let passing = Passing {
                    topic,
                    log_time: header.log_time,
                    data: &data,
                };
                if take(&passing).is_break() {
                    break;
                }
            }
            Some(_) => {}
            None => return Ok(false),
        }
    }
    Ok(true)
}

/// Reads once, retrying after signals.
pub(super) fn uninterrupted(
    source: &mut dyn std::io::Read,
    buffer: &mut [u8],
) -> std::io::Result<usize> {
    loop {
        match source.read(buffer) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

/// A value of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// Number; a flag is 0 or 1.
    Number(f64),
    /// Text.
    Text(String),
}

impl Logged<'_> {
    /// Gives the fields named in `wanted`, with their place in it. Skips all other fields of the message, and
    /// the rest of a message that is not JSON.
    pub fn fields(&self, wanted: &[&str], take: &mut dyn FnMut(usize, Scalar)) {
        let mut json = serde_json::Deserializer::from_slice(self.payload);
        let _ = json.deserialize_map(Fields { wanted, take });
    }

    /// The number of a field; `None` if it has none.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<f64> {
        let mut found = None;
        self.fields(&[name], &mut |_, value| {
            if let Scalar::Number(number) = value {
                found = Some(number);
            }
        });
        found
    }
}

struct Fields<'a> {
    wanted: &'a [&'a str],
    take: &'a mut dyn FnMut(usize, Scalar),
}

impl<'de> Visitor<'de> for Fields<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(name) = map.next_key::<std::borrow::Cow<'de, str>>()? {
            let Some(place) = self.wanted.iter().position(|wanted| *wanted == name) else {
                map.next_value::<IgnoredAny>()?;
                continue;
            };
            match map.next_value::<serde_json::Value>()? {
                serde_json::Value::Bool(flag) => {
                    (self.take)(place, Scalar::Number(f64::from(u8::from(flag))));
                }
                serde_json::Value::Number(number) => {
                    if let Some(number) = number.as_f64().filter(|n| n.is_finite()) {
                        (self.take)(place, Scalar::Number(number));
                    }
                }
                serde_json::Value::String(text) => (self.take)(place, Scalar::Text(text)),
                _ => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BodySample, FootSample, Recorder};
    use mcap::MAGIC;
    use std::fs::File;

    fn log(path: &Path) {
        let mut recorder = Recorder::create(path).expect("created");
        for ms in 0..1_000_u64 {
            let body = BodySample {
                x_mm: ms as f64,
                ..BodySample::default()
            };
            recorder.body(ms * 1_000_000, body);
            recorder.foot(ms * 1_000_000, 1, FootSample::default());
        }
        drop(recorder.finish().expect("finished"));
    }

    fn bodies(path: &Path) -> Result<(Vec<f64>, Read), LogError> {
        let mut values = Vec::new();
        let end = read(path, &mut |logged| {
            if channels()[logged.channel].topic == "/body" {
                values.extend(logged.number("x_mm"));
            }
            ControlFlow::Continue(())
        })?;
        Ok((values, end))
    }

    #[test]
    fn messages_come_with_their_values_whole_or_broken_off() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        log(&path);
        let (values, end) = bodies(&path).expect("a log");
        assert!(end.whole && values.len() == 100, "{end:?} {}", values.len());
        assert_eq!((values[0], values[99]), (0.0, 990.0));
        let bytes = std::fs::read(&path).expect("read");
        let mut last = 0;
        for cut in (0..bytes.len()).step_by(bytes.len() / 40) {
            std::fs::write(&path, &bytes[..cut]).expect("written");
            match bodies(&path) {
                Ok((values, end)) => {
                    assert!(values.len() >= last && !end.whole || values.len() == 100);
                    last = values.len();
                }
                Err(LogError::NotALog { .. }) => assert!(cut < 8),
                Err(LogError::Empty { .. }) => assert_eq!(last, 0),
                Err(other) => panic!("{other}"),
            }
        }
        assert!(last > 20, "{last}");
    }

    #[test]
    fn rubbish_is_an_answer_and_nothing_grows() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        log(&path);
        let sound = std::fs::read(&path).expect("read");
        let mut seed = 1_u64;
        let mut random = |below: usize| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as usize % below
        };
        for _ in 0..300 {
            let mut bytes = sound.clone();
            for _ in 0..=random(8) {
                let at = MAGIC.len() + random(bytes.len() - MAGIC.len());
                bytes[at] = random(256) as u8;
            }
            std::fs::write(&path, &bytes).expect("written");
            let _ = bodies(&path);
        }
        std::fs::write(&path, "no log").expect("written");
        assert!(matches!(bodies(&path), Err(LogError::NotALog { .. })));
        assert!(matches!(
            bodies(&folder.path().join("none")),
            Err(LogError::Read { .. })
        ));
    }

    #[test]
    fn a_log_of_another_program_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.mcap");
        let file = std::io::BufWriter::new(File::create(&path).expect("created"));
        let mut log = mcap::Writer::new(file).expect("a log");
        let id = log.add_channel(0, "/camera", "json", &BTreeMap::new());
        let header = mcap::records::MessageHeader {
            channel_id: id.expect("a channel"),
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        log.write_to_known_channel(&header, b"{}").expect("written");
        log.finish().expect("finished");
        drop(log);
        let told = bodies(&path).expect_err("foreign").to_string();
        assert!(told.contains("no message of a channel"), "{told}");
    }

    #[test]
    fn fields_are_numbers_flags_and_texts_and_the_rest_is_passed_over() {
        let logged = Logged {
            channel: 0,
            t_ns: 0,
            payload: br#"{"a":[1,{"b":2}],"b":-2.5,"c":true,"d":"x","e":1e999,"f":null}"#,
        };
        assert_eq!(logged.number("b"), Some(-2.5));
        assert_eq!(logged.number("c"), Some(1.0));
        for none in ["a", "d", "e", "f", "g"] {
            assert_eq!(logged.number(none), None, "{none}");
        }
        let mut text = None;
        logged.fields(&["d"], &mut |_, value| text = Some(value));
        assert_eq!(text, Some(Scalar::Text("x".to_owned())));
        let broken = Logged {
            payload: br#"{"b":1,"c"#,
            ..logged
        };
        assert_eq!(broken.number("b"), Some(1.0));
    }
}
