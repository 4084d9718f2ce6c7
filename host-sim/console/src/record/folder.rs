//! The folder of a recording: `log.mcap`, `inputs.jsonl`, the robot's and the scenario's file, and
//! `recording.json`, which says what was recorded and how it ended. A long log is split into parts.

use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use wheeleg_config::open_file;
use wheeleg_scene::Scene;
use wheeleg_telemetry::{LogFile, OwnedSample, Sink as _, Taken, part, parts};

use super::inputs::Line;
use super::{About, Touching};
use crate::live::Moving;

/// The log.
pub(crate) const LOG: &str = "log.mcap";
/// The robot's inputs.
pub(crate) const INPUTS: &str = "inputs.jsonl";
/// The robot's file.
pub(crate) const ROBOT: &str = "robot.toml";
/// The scenario's file.
pub(crate) const SCENARIO: &str = "scenario.toml";
/// Summary: what was recorded, and how it ended.
pub(crate) const SUMMARY: &str = "recording.json";

/// Length of a part of the log, ns: some 100 MB.
pub(super) const PART_NS: u64 = 600_000_000_000;

/// Most recordings in one folder.
const MOST: u32 = 9_999;

/// Contents of `recording.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Summary {
    /// Name of its folder.
    pub id: String,
    /// Program that recorded it.
    pub program: String,
    /// Robot.
    pub robot: String,
    /// Scenario: ground and pose.
    pub scenario: String,
    /// Seed of all noise; text in the file, since many JSON readers cannot hold numbers above 2^53.
    #[serde(with = "seed_text")]
    pub seed: u64,
    /// Master time of its begin, µs.
    pub begin_us: u64,
    /// Master time of its end, µs; none while it is under way, or if it was cut short.
    pub end_us: Option<u64>,
    /// Hash of everything from power-up to its end.
    pub hash: Option<String>,
    /// Messages missing in the log.
    pub dropped: u64,
    /// It holds all inputs since power-up.
    pub repeatable: bool,
    /// Why it ended early.
    pub failure: Option<String>,
}

/// A seed as text; older recordings have a number.
mod seed_text {
    use serde::{Deserialize, Deserializer, Serializer, de};

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Seed {
        Text(String),
        Number(u64),
    }

    pub(super) fn serialize<S: Serializer>(seed: &u64, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(seed)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        match Seed::deserialize(from)? {
            Seed::Text(text) => text.parse().map_err(de::Error::custom),
            Seed::Number(number) => Ok(number),
        }
    }
}

/// A recording under way.
pub(super) struct Folder {
    path: PathBuf,
    /// The newest part of the log.
    log: LogFile,
    parts: u32,
    part_ns: u64,
    /// Time at which the next part begins, ns.
    next_ns: u64,
    /// Messages at the head of every part.
    head: Vec<(u16, OwnedSample)>,
    scene: Scene,
    inputs: BufWriter<File>,
    line: Vec<u8>,
    /// Messages that were deliberately not written.
    lost: u64,
    /// Contents of the later `recording.json`.
    pub(super) summary: Summary,
}

/// A failure of a file, for a person.
fn said(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}

fn log_file(path: &Path, scene: &Scene) -> Result<LogFile, String> {
    let log = LogFile::create(path).and_then(|log| log.with(scene.clone()));
    log.map_err(|e| e.to_string())
}

/// A folder of the next free number.
fn numbered(root: &Path) -> Result<(String, PathBuf), String> {
    fs::create_dir_all(root).map_err(|e| said(root, &e))?;
    let taken = fs::read_dir(root).map_err(|e| said(root, &e))?;
    let taken = taken.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<u32>().ok());
    let next = taken.filter(|n| *n <= MOST).max().unwrap_or(0) + 1;
    for number in next..=MOST {
        let id = format!("{number:04}");
        let path = root.join(&id);
        match fs::create_dir(&path) {
            Ok(()) => return Ok((id, path)),
            // Another server has just taken it.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => return Err(said(&path, &e)),
        }
    }
    Err(format!(
        "{}: there are {MOST} recordings already",
        root.display()
    ))
}

impl Folder {
    /// Makes a new folder; `before` are the inputs since power-up.
    pub(super) fn create(
        root: &Path,
        about: &About,
        begin_us: u64,
        head: &[(u16, OwnedSample)],
        before: Option<&[u8]>,
    ) -> Result<Self, String> {
        let (id, path) = numbered(root)?;
        let made = Self::begin(id, path.clone(), (about, begin_us), head, before);
        made.inspect_err(|_| {
            // Half a recording is useless.
            let _ = fs::remove_dir_all(&path);
        })
    }

    fn begin(
        id: String,
        path: PathBuf,
        (about, begin_us): (&About, u64),
        head: &[(u16, OwnedSample)],
        before: Option<&[u8]>,
    ) -> Result<Self, String> {
        for (name, text) in [(ROBOT, &about.robot_toml), (SCENARIO, &about.scenario_toml)] {
            let file = path.join(name);
            fs::write(&file, text).map_err(|e| said(&file, &e))?;
        }
        let file = path.join(INPUTS);
        let inputs = File::create_new(&file).map_err(|e| said(&file, &e))?;
        let mut folder = Self {
            log: log_file(&path.join(LOG), &about.scene)?,
            parts: 1,
            part_ns: about.part_ns,
            next_ns: begin_us * 1_000 + about.part_ns,
            head: head.to_vec(),
            scene: about.scene.clone(),
            inputs: BufWriter::new(inputs),
            line: Vec::with_capacity(256),
            lost: 0,
            summary: Summary {
                id,
                program: concat!("wheeleg ", env!("CARGO_PKG_VERSION")).to_owned(),
                robot: about.robot.clone(),
                scenario: about.scenario.clone(),
                seed: about.seed,
                begin_us,
                end_us: None,
                hash: None,
                dropped: 0,
                repeatable: about.repeatable && before.is_some(),
                failure: None,
            },
            path,
        };
        folder.put_head();
        let written = folder.inputs.write_all(before.unwrap_or_default());
        written.map_err(|e| said(&file, &e))?;
        folder.flush()?;
        folder.save()?;
        Ok(folder)
    }

    /// Adds a sample to the log.
    pub(super) fn sample(&mut self, moving: &Moving, lost: bool) -> Result<(), String> {
        self.cut(moving.t_ns)?;
        if let OwnedSample::Provenance(_) = &moving.sample {
            self.head.push((moving.channel, moving.sample.clone()));
        }
        self.put(moving.channel, moving.t_ns, &moving.sample, lost);
        self.log
            .failure()
            .map_or(Ok(()), |why| Err(why.to_string()))
    }

    /// Draws the contacts into the log.
    pub(super) fn contacts(&mut self, touching: &Touching) -> Result<(), String> {
        let Touching {
            t_ns,
            contacts,
            lost,
        } = touching;
        self.log.contacts(*t_ns, contacts, *lost);
        self.log
            .failure()
            .map_or(Ok(()), |why| Err(why.to_string()))
    }

    /// Begins the next part of the log when it is due: each file of a long recording stays small enough to
    /// open and send, and if the last one is damaged, the others are whole.
    fn cut(&mut self, t_ns: u64) -> Result<(), String> {
        if t_ns < self.next_ns {
            return Ok(());
        }
        self.log.finish().map_err(|e| e.to_string())?;
        self.parts += 1;
        self.log = log_file(&part(&self.path.join(LOG), self.parts), &self.scene)?;
        self.next_ns = t_ns + self.part_ns;
        self.put_head();
        Ok(())
    }

    fn put_head(&mut self) {
        for (channel, sample) in std::mem::take(&mut self.head) {
            self.put(channel, 0, &sample, false);
            self.head.push((channel, sample));
        }
    }

    fn put(&mut self, channel: u16, t_ns: u64, sample: &OwnedSample, lost: bool) {
        self.lost += u64::from(lost);
        self.log.take(&Taken {
            channel: channel.into(),
            number: 0,
            t_ns,
            sample: sample.as_ref(),
            due: true,
            lost,
        });
    }

    /// Adds an input.
    pub(super) fn input(&mut self, line: &Line) -> Result<(), String> {
        self.line.clear();
        line.push_to(&mut self.line);
        let written = self.inputs.write_all(&self.line);
        written.map_err(|e| said(&self.path.join(INPUTS), &e))
    }

    /// Hands the inputs to the operating system: a killed program loses no more than those since then.
    pub(super) fn flush(&mut self) -> Result<(), String> {
        let flushed = self.inputs.flush();
        flushed.map_err(|e| said(&self.path.join(INPUTS), &e))
    }

    /// Ends the recording. Writes as much as it can, whatever fails.
    pub(super) fn finish(&mut self) -> Result<(), String> {
        let log = self.log.finish().map_err(|e| e.to_string());
        let inputs = self.flush();
        self.summary.dropped += self.lost;
        let failure = log.err().or(inputs.err());
        self.summary.failure = self.summary.failure.take().or(failure);
        let saved = self.save();
        self.summary.failure.clone().map_or(saved, Err)
    }

    fn save(&self) -> Result<(), String> {
        let path = self.path.join(SUMMARY);
        // A part of the file would be worse than none.
        let beside = self.path.join("recording.json.new");
        let text = serde_json::to_string_pretty(&self.summary).map_err(|e| e.to_string())?;
        fs::write(&beside, text + "\n")
            .and_then(|()| fs::rename(&beside, &path))
            .map_err(|e| {
                let _ = fs::remove_file(&beside);
                said(&path, &e)
            })
    }
}

/// Largest `recording.json`.
const SUMMARY_MAX: u64 = 64 * 1024;

/// Opens a file of a recording, which may come from anybody: a pipe may have no writer, a device no end.
///
/// # Errors
/// What is wrong, with the path.
pub(crate) fn opened(path: &Path) -> Result<File, String> {
    open_file(path).map_err(|e| said(path, &e))
}

/// Reads the `recording.json` of a folder.
pub(crate) fn summary(folder: &Path) -> Result<Summary, String> {
    let path = folder.join(SUMMARY);
    let file = opened(&path)?;
    let size = file.metadata().map_err(|e| said(&path, &e))?.len();
    if size > SUMMARY_MAX {
        return Err(format!(
            "{}: it has {size} bytes, which is too large",
            path.display()
        ));
    }
    let mut text = String::new();
    let read = file.take(SUMMARY_MAX).read_to_string(&mut text);
    read.map_err(|e| said(&path, &e))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The recordings of a folder, newest first, with the bytes of their logs.
pub(crate) fn list(root: &Path, most: usize) -> Vec<(Summary, u64)> {
    let Ok(entries) = fs::read_dir(root) else {
        return Vec::new();
    };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.parse::<u32>().is_ok()).collect();
    names.sort_unstable_by(|a, b| b.cmp(a));
    let read = names.iter().filter_map(|name| {
        let folder = root.join(name);
        // A link does not lead to a recording of this server.
        let is_folder = fs::symlink_metadata(&folder).is_ok_and(|about| about.is_dir());
        let summary = is_folder.then(|| summary(&folder).ok())??;
        let bytes = parts(&folder.join(LOG)).map(|part| fs::metadata(part).map_or(0, |m| m.len()));
        // The folder's name counts, whatever the file says.
        let id = name.clone();
        Some((Summary { id, ..summary }, bytes.sum()))
    });
    read.take(most).collect()
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use wheeleg_config::builtin;
    use wheeleg_telemetry::{BodySample, ProvenanceSample, Scalar, channel_index, channels, read};

    use super::*;

    fn moving(topic: &str, t_ns: u64, sample: OwnedSample) -> Moving {
        Moving {
            channel: channel_index(topic).expect("a channel") as u16,
            number: 0,
            t_ns,
            sample,
        }
    }

    /// Times and texts of all messages, and whether the log has its end.
    fn contents(log: &Path) -> (Vec<u64>, Vec<String>, bool) {
        let (mut times, mut texts) = (Vec::new(), Vec::new());
        let end = read(log, &mut |logged| {
            match channels()[logged.channel].topic {
                "/run" => logged.fields(&["text"], &mut |_, text| {
                    if let Scalar::Text(text) = text {
                        texts.push(text);
                    }
                }),
                _ => times.push(logged.t_ns),
            }
            ControlFlow::Continue(())
        });
        (times, texts, end.expect("a log").whole)
    }

    #[cfg(unix)]
    #[test]
    fn a_recording_is_listed_by_the_name_of_its_folder_and_a_link_is_none() {
        let home = tempfile::tempdir().expect("a folder");
        let folder = home.path().join("0007");
        fs::create_dir(&folder).expect("created");
        let summary = Summary {
            id: "\u{1b}[31m<img>".to_owned(),
            program: String::new(),
            robot: String::new(),
            scenario: String::new(),
            seed: 1,
            begin_us: 0,
            end_us: None,
            hash: None,
            dropped: 0,
            repeatable: false,
            failure: None,
        };
        let text = serde_json::to_string(&summary).expect("JSON");
        fs::write(folder.join(SUMMARY), text).expect("written");
        std::os::unix::fs::symlink(&folder, home.path().join("0008")).expect("a link");
        let listed = list(home.path(), 10);
        let ids: Vec<&str> = listed.iter().map(|(summary, _)| &*summary.id).collect();
        assert_eq!(ids, ["0007"]);
    }

    #[test]
    fn a_long_log_is_cut_into_parts_that_are_read_as_one() {
        let root = tempfile::tempdir().expect("a folder");
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("stand").expect("built in");
        let about = About::new(&robot, "", &scenario, "").expect("a robot");
        let about = About {
            part_ns: 1_000_000_000,
            ..about
        };
        let head = OwnedSample::Provenance(ProvenanceSample {
            kind: "robot".to_owned(),
            text: "wheeleg-2003".to_owned(),
        });
        let place = channel_index("/run").expect("a channel") as u16;
        // It begins in mid-run: its parts count from there.
        let begin_s = 5;
        let known = [(place, head.clone())];
        let mut folder = Folder::create(root.path(), &about, begin_s * 1_000_000, &known, None)
            .expect("a recording");
        // In a recording from power-up on, the head comes later.
        folder
            .sample(&moving("/run", 0, head), false)
            .expect("written");
        let times: Vec<u64> = (0..250).map(|n| (5_000 + 10 * n) * 1_000_000).collect();
        for t_ns in &times {
            let body = OwnedSample::Body(BodySample::default());
            let written = folder.sample(&moving("/body", *t_ns, body), false);
            written.expect("written");
        }
        folder.finish().expect("finished");
        let log = root.path().join("0001").join(LOG);
        let files: Vec<PathBuf> = parts(&log).collect();
        let names: Vec<&str> = files
            .iter()
            .filter_map(|file| file.file_name()?.to_str())
            .collect();
        assert_eq!(names, ["log.mcap", "log.2.mcap", "log.3.mcap"]);
        let robot = vec!["wheeleg-2003".to_owned(); 2];
        assert_eq!(contents(&log), (times.clone(), robot.clone(), true));
        // Each is a complete log.
        assert_eq!(
            contents(&files[1]),
            (times[100..200].to_vec(), robot.clone(), true)
        );
        let bytes = files
            .iter()
            .map(|file| file.metadata().expect("there").len());
        assert_eq!(list(root.path(), 9)[0].1, bytes.sum::<u64>());
        // One that had just begun misses nothing, and its log is reported as broken off.
        fs::write(&files[2], "").expect("written");
        assert_eq!(contents(&log), (times[..200].to_vec(), robot, false));
    }
}
