//! A log as a bag of ROS 2: joint states, frames, robot and clock, in CDR.
//!
//! The bag is a folder with `metadata.yaml` and one MCAP file of the profile `ros2`, for `ros2 bag play`.
//! Times are simulated: play it with `use_sim_time`.

mod cdr;
mod metadata;
mod types;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use quick_xml::Reader;
use quick_xml::events::Event;
use serde::Deserialize;
use wheeleg_telemetry::{Derived, LogError, attachments, read_derived};

use self::cdr::Cdr;
use self::types::{TOPICS, Topic};
use super::folder::Filling;
use super::reading::Reading;
use crate::StudyError;
use crate::study::Progress;

/// Largest chunk before compression, bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// Name of the bag's file without its ending.
const FILE: &str = "bag_0.mcap";

/// Summary of the bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bag {
    /// Messages of each topic.
    pub messages: Vec<(&'static str, u64)>,
    /// Simulated time from the first to the last, ns.
    pub span_ns: u64,
    /// The log has its end.
    pub whole: bool,
}

#[derive(Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Deserialize)]
struct Transform {
    parent_frame_id: String,
    child_frame_id: String,
    translation: Vector,
    rotation: Quaternion,
}

#[derive(Deserialize)]
struct Transforms {
    transforms: Vec<Transform>,
}

#[derive(Deserialize)]
struct JointState {
    name: String,
    position: f64,
    velocity: f64,
    /// Nothing drives a passive joint.
    #[serde(default)]
    effort: f64,
}

#[derive(Deserialize)]
struct JointStates {
    joints: Vec<JointState>,
}

/// Writes the bag of `log` to `folder`, a new one. `None`: it was stopped, and no folder is there.
///
/// # Errors
/// [`StudyError::Log`] if the log cannot be read or the bag not written, [`StudyError::Refused`] if
/// the folder exists or the log has no frames.
pub fn export(log: &Path, folder: &Path, progress: &Progress) -> Result<Option<Bag>, StudyError> {
    let filling = Filling::begin(folder)?;
    let files = attachments(log)?;
    let Some(urdf) = files.into_iter().find(|file| file.name == "robot.urdf") else {
        // If the log breaks off at once, report that instead.
        wheeleg_telemetry::read(log, &mut |_| ControlFlow::Break(()))?;
        return Err(without(log, "the robot's URDF"));
    };
    let urdf = String::from_utf8_lossy(&urdf.data).into_owned();
    let mut bag = Writer::create(&filling.path(FILE), fixed_links(&urdf), urdf)?;
    let mut reading = Reading::begin(log, progress);
    let whole = read_derived(log, &mut |channel, t_ns, payload| {
        reading.after(t_ns, bag.take(channel, t_ns, payload))
    })?;
    if !reading.end()? {
        return Ok(None);
    }
    let Some((first_ns, last_ns)) = bag.times else {
        wheeleg_telemetry::read(log, &mut |_| ControlFlow::Break(()))?;
        return Err(without(log, "the channel /tf"));
    };
    let counts = bag.counts;
    bag.finish()?;
    let path = filling.path("metadata.yaml");
    let text = metadata::write(FILE, &counts, first_ns, last_ns);
    std::fs::write(&path, text).map_err(|e| StudyError::output("write", &path, e))?;
    filling.finish()?;
    Ok(Some(Bag {
        messages: TOPICS.iter().map(|t| t.name).zip(counts).collect(),
        span_ns: last_ns - first_ns,
        whole,
    }))
}

fn without(log: &Path, what: &str) -> StudyError {
    StudyError::refused(
        format!("`{}` has not {what}", log.display()),
        "an earlier version wrote this log: run its scenario again, or `wheeleg replay` its recording",
    )
}

/// Children of the fixed joints of a URDF.
fn fixed_links(urdf: &str) -> BTreeSet<String> {
    let mut reader = Reader::from_str(urdf);
    let (mut fixed, mut links) = (false, BTreeSet::new());
    loop {
        let (Event::Start(tag) | Event::Empty(tag)) = (match reader.read_event() {
            Ok(Event::Eof) | Err(_) => return links,
            Ok(event @ (Event::Start(_) | Event::Empty(_))) => event,
            Ok(_) => continue,
        }) else {
            continue;
        };
        let value = |name: &str| {
            let found = tag.try_get_attribute(name).ok().flatten();
            found.map(|a| a.value.into_owned())
        };
        match tag.name().as_ref() {
            "joint" => fixed = value("type").as_deref() == Some("fixed"),
            "child" if fixed => links.extend(value("link")),
            _ => {}
        }
    }
}

struct Writer {
    path: PathBuf,
    file: mcap::Writer<BufWriter<File>>,
    channels: Vec<u16>,
    counts: [u64; TOPICS.len()],
    fixed: BTreeSet<String>,
    urdf: String,
    /// First and last time, ns.
    times: Option<(u64, u64)>,
}

impl Writer {
    fn create(path: &Path, fixed: BTreeSet<String>, urdf: String) -> Result<Self, StudyError> {
        let failed = |e| LogError::made(path, e);
        let file = File::create(path).map_err(|e| StudyError::output("create", path, e))?;
        let mut file = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("wheeleg ", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .compression_level(1)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .create(BufWriter::new(file))
            .map_err(failed)?;
        let mut channels = Vec::new();
        for topic in &TOPICS {
            let definition = topic.kind.definition();
            let added = file
                .add_schema(topic.kind.name(), "ros2msg", definition.as_bytes())
                .and_then(|schema| {
                    let profiles = metadata::profiles(topic.latched);
                    let facts = [("offered_qos_profiles".to_owned(), profiles)];
                    file.add_channel(schema, topic.name, "cdr", &facts.into())
                });
            channels.push(added.map_err(failed)?);
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            channels,
            counts: [0; TOPICS.len()],
            fixed,
            urdf,
            times: None,
        })
    }

    fn put(&mut self, topic: Topic, t_ns: u64, message: Cdr) -> Result<(), StudyError> {
        let at = topic as usize;
        self.counts[at] += 1;
        let header = MessageHeader {
            channel_id: self.channels[at],
            sequence: u32::try_from(self.counts[at]).unwrap_or(u32::MAX),
            log_time: t_ns,
            publish_time: t_ns,
        };
        let written = self.file.write_to_known_channel(&header, &message.bytes());
        Ok(written.map_err(|e| LogError::made(&self.path, e))?)
    }

    fn take(&mut self, channel: Derived, t_ns: u64, payload: &[u8]) -> Result<(), StudyError> {
        match channel {
            Derived::Tf => {
                // A message of another form is not one of ours.
                let Ok(all) = serde_json::from_slice::<Transforms>(payload) else {
                    return Ok(());
                };
                let fixed = |t: &Transform| self.fixed.contains(&t.child_frame_id);
                let (still, moving): (Vec<_>, Vec<_>) = all.transforms.into_iter().partition(fixed);
                if self.times.is_none() {
                    let robot = Cdr::new().text(&self.urdf);
                    self.put(Topic::RobotDescription, t_ns, robot)?;
                    self.put(Topic::TfStatic, t_ns, transforms(t_ns, &still))?;
                }
                self.times = Some((self.times.map_or(t_ns, |(first, _)| first), t_ns));
                self.put(Topic::Clock, t_ns, Cdr::new().time(t_ns))?;
                self.put(Topic::Tf, t_ns, transforms(t_ns, &moving))
            }
            Derived::JointStates => match serde_json::from_slice::<JointStates>(payload) {
                Ok(states) => self.put(Topic::JointStates, t_ns, joints(t_ns, &states.joints)),
                Err(_) => Ok(()),
            },
            Derived::Scene | Derived::Contacts | Derived::Log => Ok(()),
        }
    }

    fn finish(mut self) -> Result<(), StudyError> {
        let failed = |e| LogError::made(&self.path, e);
        self.file.finish().map_err(failed)?;
        let flushed = self.file.into_inner().flush();
        Ok(flushed.map_err(|e| failed(mcap::McapError::Io(e)))?)
    }
}

fn transforms(t_ns: u64, list: &[Transform]) -> Cdr {
    list.iter().fold(Cdr::new().count(list.len()), |cdr, t| {
        let (v, q) = (&t.translation, &t.rotation);
        cdr.time(t_ns)
            .text(&t.parent_frame_id)
            .text(&t.child_frame_id)
            .numbers([v.x, v.y, v.z, q.x, q.y, q.z, q.w])
    })
}

fn joints(t_ns: u64, list: &[JointState]) -> Cdr {
    let named = list.iter().fold(
        Cdr::new().time(t_ns).text("").count(list.len()),
        |cdr, j| cdr.text(&j.name),
    );
    // Never an empty list: not every reader interprets that as "unknown".
    named
        .count(list.len())
        .numbers(list.iter().map(|j| j.position))
        .count(list.len())
        .numbers(list.iter().map(|j| j.velocity))
        .count(list.len())
        .numbers(list.iter().map(|j| j.effort))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log without frames has no bag, and leaves no folder.
    #[test]
    fn a_log_of_an_earlier_version_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = folder.path().join("log.mcap");
        let mut recorder = wheeleg_telemetry::Recorder::create(&log).expect("created");
        recorder.provenance("robot", "x");
        drop(recorder.finish().expect("finished"));
        let refused = export(&log, &folder.path().join("ros2"), &Progress::silent());
        let text = refused.expect_err("refused").to_string();
        assert!(text.contains("has not the robot's URDF"), "{text}");
        assert_eq!(
            std::fs::read_dir(folder.path()).expect("a folder").count(),
            1
        );
    }

    #[test]
    fn fixed_joints_are_known_by_their_type() {
        let urdf = r#"<robot><joint name="a" type="fixed"><origin/><child link="x"/></joint>
            <joint name="b" type="revolute"><child link="y"/></joint></robot>"#;
        assert_eq!(fixed_links(urdf), BTreeSet::from(["x".to_owned()]));
        assert!(fixed_links("<robot").is_empty());
    }
}
