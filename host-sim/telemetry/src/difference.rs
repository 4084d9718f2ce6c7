//! Finds where two logs first differ.

use std::path::Path;

use mcap::{McapError, MessageStream};
use serde_json::{Map, Value};

use super::derived::Derived;
use super::registry::Written;
use super::samples::channels;
use crate::LogError;

/// One message of a log.
struct Logged {
    topic: String,
    t_ns: u64,
    payload: Vec<u8>,
}

/// The messages of a log in the order in which they were written, without derived channels and without those
/// that only a live robot has.
fn messages<'a>(
    path: &'a Path,
    bytes: &'a [u8],
) -> Result<impl Iterator<Item = Result<Logged, LogError>>, LogError> {
    let broken = move |e: McapError| LogError::read(path, std::io::Error::other(e.to_string()));
    let stream = MessageStream::new(bytes).map_err(broken)?;
    let live = |topic: &str| {
        let mut live = channels().iter().filter(|def| def.written == Written::Live);
        live.any(|def| def.topic == topic)
    };
    let other = move |topic: &str| Derived::of_topic(topic).is_some() || live(topic);
    let own = stream.filter(move |m| !m.as_ref().is_ok_and(|m| other(&m.channel.topic)));
    Ok(own.map(move |message| {
        let message = message.map_err(broken)?;
        Ok(Logged {
            topic: message.channel.topic.clone(),
            t_ns: message.log_time,
            payload: message.data.into_owned(),
        })
    }))
}

/// The first signal of two messages of one channel that differs, in the order of the
/// registry, with both values.
fn field(here: &Logged, there: &Logged) -> Option<(&'static str, Value, Value)> {
    let parse = |m: &Logged| serde_json::from_slice::<Map<String, Value>>(&m.payload).ok();
    let (values, others) = (parse(here)?, parse(there)?);
    let channel = channels().iter().find(|def| def.topic == here.topic)?;
    channel.fields.iter().find_map(|field| {
        let (value, other) = (values.get(field.name)?, others.get(field.name)?);
        (value != other).then(|| (field.name, value.clone(), other.clone()))
    })
}

fn message(here: Option<Logged>, there: Option<Logged>) -> String {
    let at = |m: &Logged| format!("{:.6} s, {}", m.t_ns as f64 * 1e-9, m.topic);
    match (here, there) {
        (Some(here), Some(there)) if (here.t_ns, &here.topic) == (there.t_ns, &there.topic) => {
            match field(&here, &there) {
                Some((name, value, other)) => format!(
                    "{}, {name}: {value} on the host, {other} with the boards",
                    at(&here)
                ),
                None => format!("{}, which is not a message of this program", at(&here)),
            }
        }
        (here, there) => {
            let side = |m: Option<Logged>| {
                m.map_or("the log ends".to_owned(), |m| {
                    format!("{} = {}", at(&m), String::from_utf8_lossy(&m.payload))
                })
            };
            let (here, there) = (side(here), side(there));
            format!("on the host {here}; with the boards {there}")
        }
    }
}

/// The first signal in which the log of a native run, `here`, differs from one with
/// boards outside, `there`: time, channel, signal and both values. `None` if no message
/// differs.
///
/// # Errors
/// [`LogError::Read`] if a log cannot be read, or is none.
pub fn first_difference(here: &Path, there: &Path) -> Result<Option<String>, LogError> {
    let read = |path: &Path| std::fs::read(path).map_err(|e| LogError::read(path, e));
    let bytes = [read(here)?, read(there)?];
    let (mut here, mut there) = (messages(here, &bytes[0])?, messages(there, &bytes[1])?);
    loop {
        let (a, b) = (here.next().transpose()?, there.next().transpose()?);
        match (a, b) {
            (None, None) => return Ok(None),
            (Some(a), Some(b))
                if a.t_ns == b.t_ns && a.topic == b.topic && a.payload == b.payload => {}
            (a, b) => return Ok(Some(message(a, b))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Act, Cause};
    use crate::{BodySample, Recorder};

    #[test]
    fn the_first_signal_that_differs_is_named_with_its_time_and_both_values() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let log = |name: &str, speeds: &[f64]| {
            let path = folder.path().join(name);
            let mut recorder = Recorder::create(&path).expect("created");
            for (t, speed_mm_s) in (0..).zip(speeds) {
                let sample = BodySample {
                    speed_mm_s: *speed_mm_s,
                    ..BodySample::default()
                };
                // At the channel's rate.
                recorder.body(t * 10_000_000, sample);
            }
            recorder.event(90_000_000, Cause::Scenario(Act::EStop));
            recorder.finish().expect("closed");
            path
        };
        let here = log("here", &[1.0, 2.0, 3.0]);
        let same = log("same", &[1.0, 2.0, 3.0]);
        assert_eq!(first_difference(&here, &same).expect("read"), None);
        let other = log("other", &[1.0, 2.5, 7.0]);
        let text = first_difference(&here, &other).expect("read");
        let expected = "0.010000 s, /body, speed_mm_s: 2 on the host, 2.5 with the boards";
        assert_eq!(text.as_deref(), Some(expected));
        let short = log("short", &[1.0, 2.0]);
        let text = first_difference(&here, &short).expect("read");
        let text = text.expect("a message more");
        assert!(
            text.starts_with("on the host 0.020000 s, /body = {"),
            "{text}"
        );
        assert!(
            text.contains("with the boards 0.090000 s, /events"),
            "{text}"
        );
        assert!(first_difference(&here, &folder.path().join("none")).is_err());
    }
}
