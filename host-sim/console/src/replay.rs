//! Replays a recorded session: the same robot is powered up, gets the same inputs at the same times, and must
//! behave the same to the bit.

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader, Read as _};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use wheeleg_config::builtin::Source;
use wheeleg_config::faults::FaultSpec;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Request;
use wheeleg_master::layer0::operator::{OPERATOR_CLIENT, STOP_CLIENT};
use wheeleg_scene::Scene;
use wheeleg_sim::{Boards, Session, SimError, provenance};
use wheeleg_telemetry::{Keep, LogError, LogFile, Recorder};

use crate::error::ConsoleError;
use crate::live::Live;
use crate::record::Summary;
use crate::record::folder::{INPUTS, ROBOT, SCENARIO, SUMMARY, opened, summary};
use crate::record::inputs::{Input, LINE_MAX, Line};
use wheeleg_access::request::Order;

/// Longest session that can be repeated, ms: a month.
const LONGEST_MS: u64 = 31 * 24 * 3_600_000;
/// Largest robot or scenario file.
const TOML_MAX: u64 = 4 << 20;
/// Message about an invalid line.
const NO_INPUT: &str = "it is no input: allowed is an object of JSON with `ms`, a whole number, and one of \
    `beat`, `stop`, `command`, `fault_begins`, `fault_ends`, `pace`, `revoked` and `hash`";
/// Simulated time between two progress reports, ms.
const STRIDE_MS: u64 = 10;

/// Result of a repetition.
#[derive(Debug)]
pub struct Replayed {
    /// The recording's own summary.
    pub summary: Summary,
    /// Simulated time since power-up, ms.
    pub end_ms: u64,
    /// Inputs given: commands, stops, beats, faults.
    pub inputs: u64,
    /// Hash of everything from power-up to the end.
    pub hash: String,
    /// Hashes of the recording that were compared.
    pub compared: u64,
    /// Times between which it first behaved differently, ms.
    pub parted: Option<(u64, u64)>,
    /// The caller stopped it early.
    pub stopped: bool,
    /// The last line is cut short: the recording was killed.
    pub cut_short: bool,
    /// Why its log is incomplete; everything else holds.
    pub unwritten: Option<LogError>,
}

impl Replayed {
    /// Whether every hash of the recording was found again, and there was one.
    #[must_use]
    pub fn is_same(&self) -> bool {
        self.parted.is_none() && self.compared > 0
    }
}

/// A recording that can be repeated.
#[derive(Debug)]
pub struct Recorded {
    summary: Summary,
    live: Live,
    lines: Lines,
    end_ms: u64,
}

/// Reads the recording in `folder`.
///
/// # Errors
/// [`ConsoleError`] if the folder is not a recording that can be repeated.
pub fn recorded(folder: &Path) -> Result<Recorded, ConsoleError> {
    let folder = folder_of(folder);
    let summary = summary(&folder).map_err(unusable)?;
    if !summary.repeatable {
        let what = format!(
            "{}: its inputs are incomplete: the robot had run too long, the disk was too slow, or its boards were real",
            folder.display()
        );
        return Err(ConsoleError::other(what, "open its log instead"));
    }
    let live = Live::of(&source(&folder, SCENARIO)?, &source(&folder, ROBOT)?);
    let live = live.map_err(Box::new)?;
    let lines = Lines::open(&folder.join(INPUTS))?;
    let end_ms = match summary.end_us {
        Some(end_us) if end_us > LONGEST_MS * 1_000 => {
            return Err(unusable(format!(
                "{}: `end_us` is {end_us}, allowed: 0 to {LONGEST_MS}000",
                folder.join(SUMMARY).display()
            )));
        }
        Some(end_us) => end_us.div_ceil(1_000),
        None => Lines::open(&folder.join(INPUTS))?.last_ms()?,
    };
    Ok(Recorded {
        summary,
        live,
        lines,
        end_ms,
    })
}

/// Repeats a recording, as fast as possible, and writes its log from power-up on to `log`. `progress` gets
/// the time and the end time, ms.
///
/// # Errors
/// [`ConsoleError`] if a line of its inputs is invalid, the robot cannot be built, or the log cannot be
/// written.
pub fn replay(
    recorded: Recorded,
    log: Option<&Path>,
    progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Result<Replayed, ConsoleError> {
    let Recorded {
        summary,
        live,
        mut lines,
        end_ms,
    } = recorded;
    let Live {
        scenario, robot, ..
    } = &live;
    let mut recorder = Recorder::new(Keep::nothing());
    if let Some(path) = log {
        let scene = Scene::new(robot, scenario).map_err(|e| unusable(e.to_string()))?;
        let file = LogFile::create(path).and_then(|file| file.with(scene));
        recorder = recorder.with(file.map_err(SimError::from)?);
    }
    let mut robot = Repeated {
        session: Session::live(Boards::default(), scenario, robot, scenario.seed)?,
        recorder: {
            provenance(&mut recorder, scenario, robot, scenario.seed);
            recorder
        },
        now_ms: 0,
        inputs: 0,
        compared: 0,
        equal_until_ms: 0,
        parted: None,
    };
    let mut stopped = false;
    let mut cut_short = false;
    loop {
        let next = match lines.next()? {
            Next::Line(line) => Some(line),
            Next::End => None,
            Next::CutShort => {
                cut_short = true;
                None
            }
        };
        let until_ms = next.as_ref().map_or(end_ms, |line| line.ms).min(end_ms);
        while robot.now_ms < until_ms && !stopped {
            let to_ms = (robot.now_ms + STRIDE_MS).min(until_ms);
            robot.step_to(to_ms)?;
            stopped = progress(to_ms, end_ms).is_break();
        }
        let Some(line) = next.filter(|line| line.ms <= end_ms && !stopped) else {
            break;
        };
        robot.give(line.input).map_err(|what| lines.wrong(&what))?;
    }
    let hash = robot.recorder.hash();
    if let (Some(recorded), false) = (&summary.hash, stopped) {
        robot.compare(recorded, &hash);
    }
    let (_, failed) = robot.recorder.close();
    Ok(Replayed {
        summary,
        end_ms: robot.now_ms,
        inputs: robot.inputs,
        hash,
        compared: robot.compared,
        parted: robot.parted,
        stopped,
        cut_short,
        unwritten: failed.into_iter().next(),
    })
}

/// The folder, also if `path` names one of its files.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if path.is_file() => parent.to_owned(),
        _ => path.to_owned(),
    }
}

fn unusable(what: String) -> ConsoleError {
    ConsoleError::other(
        what,
        "give the folder of a recording of `wheeleg serve`, such as runs/live/0001",
    )
}

fn source(folder: &Path, name: &str) -> Result<Source, ConsoleError> {
    let path = folder.join(name);
    let said = |what: String| unusable(format!("{}: {what}", path.display()));
    let file = opened(&path).map_err(unusable)?;
    let mut text = String::new();
    let read = file.take(TOML_MAX).read_to_string(&mut text);
    read.map_err(|e| said(e.to_string()))?;
    Ok(Source {
        file: path.display().to_string(),
        text,
    })
}

/// A robot that repeats a session.
struct Repeated {
    session: Session,
    recorder: Recorder<'static>,
    now_ms: u64,
    inputs: u64,
    compared: u64,
    equal_until_ms: u64,
    parted: Option<(u64, u64)>,
}

impl Repeated {
    fn step_to(&mut self, ms: u64) -> Result<(), ConsoleError> {
        self.session.step_to(ms * 1_000_000, &mut self.recorder)?;
        self.now_ms = ms;
        // Their ends are events of the recording.
        while self.session.take_outcome().is_some() {}
        Ok(())
    }

    fn compare(&mut self, recorded: &str, hash: &str) {
        self.compared += 1;
        if recorded == hash {
            self.equal_until_ms = self.now_ms;
        } else {
            let here = (self.equal_until_ms, self.now_ms);
            self.parted.get_or_insert(here);
        }
    }

    fn give(&mut self, input: Input) -> Result<(), String> {
        self.inputs += 1;
        match input {
            Input::Beat(seen_us) => self.session.beat(seen_us),
            Input::Stop(id) => {
                let stop = Request {
                    client: STOP_CLIENT,
                    id,
                    deadline_us: u64::MAX,
                    command: Command::EmergencyStop,
                };
                let _ = self.session.request(stop, &mut self.recorder);
            }
            Input::Command(command) => {
                let order = command.spoken.order().map_err(|bad| bad.text)?;
                let Order::Robot(order) = order else {
                    return Err(format!(
                        "{} is not a command of the robot",
                        command.spoken.cmd
                    ));
                };
                let request = Request {
                    client: OPERATOR_CLIENT,
                    id: command.id,
                    deadline_us: command.deadline_us,
                    command: order,
                };
                let _ = self.session.request(request, &mut self.recorder);
            }
            Input::FaultBegins(text) => self.fault(&text, true)?,
            Input::FaultEnds(text) => self.fault(&text, false)?,
            Input::Pace(_) | Input::Revoked(_) => self.inputs -= 1,
            Input::Hash(recorded) => {
                self.inputs -= 1;
                let hash = self.recorder.hash();
                self.compare(&recorded, &hash);
            }
        }
        Ok(())
    }

    fn fault(&mut self, text: &str, begin: bool) -> Result<(), String> {
        let fault: FaultSpec = format!("{text}@0s").parse().map_err(|e| format!("{e}"))?;
        let done = self.session.inject(&fault, begin, &mut self.recorder);
        done.map_err(|e| e.to_string())
    }
}

/// The lines of `inputs.jsonl`, read one by one.
#[derive(Debug)]
struct Lines {
    path: PathBuf,
    file: BufReader<File>,
    number: u64,
    last_ms: u64,
}

enum Next {
    Line(Line),
    /// The file ends in the middle of a line.
    CutShort,
    End,
}

impl Lines {
    fn open(path: &Path) -> Result<Self, ConsoleError> {
        let file = opened(path).map_err(unusable)?;
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::new(file),
            number: 0,
            last_ms: 0,
        })
    }

    fn wrong(&self, what: &str) -> ConsoleError {
        unusable(format!(
            "{}, line {}: {what}",
            self.path.display(),
            self.number
        ))
    }

    fn next(&mut self) -> Result<Next, ConsoleError> {
        self.number += 1;
        let mut text = Vec::new();
        let mut within = (&mut self.file).take(LINE_MAX as u64);
        let read = within.read_until(b'\n', &mut text);
        read.map_err(|e| self.wrong(&e.to_string()))?;
        if text.is_empty() {
            return Ok(Next::End);
        }
        if text.last() != Some(&b'\n') {
            if text.len() >= LINE_MAX {
                return Err(self.wrong("the line is too long"));
            }
            return Ok(Next::CutShort);
        }
        let line: Line = serde_json::from_slice(&text).map_err(|_| self.wrong(NO_INPUT))?;
        if line.ms < self.last_ms || line.ms > LONGEST_MS {
            let allowed = format!("{} to {LONGEST_MS}", self.last_ms);
            return Err(self.wrong(&format!("`ms` is {}, allowed: {allowed}", line.ms)));
        }
        self.last_ms = line.ms;
        Ok(Next::Line(line))
    }

    /// Time of the last whole line.
    fn last_ms(mut self) -> Result<u64, ConsoleError> {
        while let Next::Line(_) = self.next()? {}
        Ok(self.last_ms)
    }
}

/// Whether a folder is that of a recording.
#[must_use]
pub fn is_recording(folder: &Path) -> bool {
    fs::exists(folder.join(INPUTS)).unwrap_or(false)
}
