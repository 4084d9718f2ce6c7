//! Recordings of a live robot. The robot's thread puts its inputs and samples into one ring; a separate
//! thread writes them to a folder. A slow or full disk costs data, counted and reported, never a tick.
//!
//! A recording can be repeated ([`crate::replay()`]): its folder holds the seed, the robot and every input
//! since power-up, with the millisecond at which the robot's thread took it. So it may begin at any time; its
//! log begins with it, its inputs with the power.

mod feed;
pub(crate) mod folder;
pub(crate) mod inputs;
mod session;
mod writer;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use wheeleg_config::faults::FaultSpec;
use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_scene::Scene;
use wheeleg_telemetry::Contact;

use crate::error::ConsoleError;
use crate::live::Moving;
use wheeleg_access::request::Spoken;

pub(crate) use feed::{Feed, FeedSink};
pub use folder::Summary;

/// Default folder of recordings.
pub const FOLDER: &str = "runs/live";

/// Items that may wait for the disk: some seconds of the log.
const NOTES: usize = 32_768;

/// Subject of a recording.
#[derive(Debug, Clone)]
pub(crate) struct About {
    /// Robot.
    pub(crate) robot: String,
    /// Scenario.
    pub(crate) scenario: String,
    /// Seed of all noise.
    pub(crate) seed: u64,
    /// Text of the robot's file.
    pub(crate) robot_toml: String,
    /// Text of the scenario's file.
    pub(crate) scenario_toml: String,
    /// Picture of the robot on its ground, at rest.
    pub(crate) scene: Scene,
    /// Length of a part of its log, ns.
    part_ns: u64,
    /// The same inputs can be given to the robot again.
    pub(crate) repeatable: bool,
}

impl About {
    pub(crate) fn new(
        robot: &RobotConfig,
        robot_toml: &str,
        scenario: &Scenario,
        scenario_toml: &str,
    ) -> Result<Self, ConsoleError> {
        let scene = Scene::new(robot, scenario);
        Ok(Self {
            robot: robot.name.clone(),
            scenario: scenario.name.clone(),
            seed: scenario.seed,
            robot_toml: robot_toml.to_owned(),
            scenario_toml: scenario_toml.to_owned(),
            scene: scene.map_err(|e| ConsoleError::other(e.to_string(), "choose another robot"))?,
            part_ns: folder::PART_NS,
            repeatable: true,
        })
    }

    /// The same for real boards, to which nobody can give the same inputs again.
    pub(crate) fn of_boards(self) -> Self {
        Self {
            scene: self.scene.of_boards(),
            repeatable: false,
            ..self
        }
    }
}

/// A note from the robot's thread.
#[derive(Debug)]
enum Note {
    /// A recording begins.
    Begin {
        /// Number of the recording since the start of the program.
        number: u64,
        /// Number of the request at the hub.
        request: u32,
        /// Master time, µs.
        at_us: u64,
    },
    /// The recording ends.
    End {
        /// Number of the request at the hub, if somebody asked.
        request: Option<u32>,
        /// Master time, µs.
        at_us: u64,
        /// Hash of everything since power-up.
        hash: String,
        /// Samples that found the ring full.
        dropped: u64,
    },
    /// An input of the robot.
    Input {
        /// Simulated time that the robot had reached, ms.
        ms: u64,
        /// The input.
        given: Given,
    },
    /// A sample for the log.
    Sample(Box<Moving>, bool),
    /// The contacts with the ground, for the log.
    Contacts(Box<Touching>),
}

/// All contacts with the ground at one instant.
#[derive(Debug)]
struct Touching {
    t_ns: u64,
    contacts: Vec<Contact>,
    lost: bool,
}

/// An input of the robot.
#[derive(Debug)]
pub(crate) enum Given {
    /// The operator has seen its state of this time, µs.
    Beat(u64),
    /// A stop, by its number.
    Stop(u32),
    /// A command of the operator.
    Command {
        /// Number of the request.
        id: u32,
        /// Master time by which it must begin, µs.
        deadline_us: u64,
        /// The command.
        spoken: Spoken,
        /// Name of the client that takes control.
        by: Option<String>,
    },
    /// A fault begins, or ends.
    Fault(FaultSpec, bool),
    /// The pace changes; the robot does not notice.
    Pace {
        /// Ratio of simulated to wall time.
        speed: Option<f64>,
        /// The clock is paused.
        paused: bool,
    },
    /// Control was revoked; the robot notices that its operator's beats stop.
    Revoked {
        /// Name of the client that was in control, or had asked for it.
        holder: String,
        /// Name of the client that revoked it.
        by: String,
    },
    /// Hash of everything so far, to compare with a repetition.
    Hash(String),
}

/// State of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Status {
    /// Its id.
    pub(crate) id: String,
    /// Master time of its begin, µs.
    pub(crate) since_us: u64,
    /// Why it ended early.
    pub(crate) failure: Option<String>,
}

/// State of the recordings, shared by all threads. The robot's thread touches only atomics.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    /// Number of the last recording that failed.
    failed: AtomicU64,
    /// Samples of the recording that found the ring full.
    dropped: AtomicU64,
    /// An input since power-up found no room: nothing can be repeated from here on.
    gap: AtomicBool,
    status: Mutex<Option<Status>>,
    answers: Mutex<Vec<(u32, Result<(), String>)>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// The recording that is under way, or the last one if it failed.
    pub(crate) fn status(&self) -> Option<Status> {
        locked(&self.status).clone()
    }

    /// Samples of the recording that found the ring full.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Takes the answers to requests.
    pub(crate) fn take_answers(&self) -> Vec<(u32, Result<(), String>)> {
        std::mem::take(&mut locked(&self.answers))
    }
}

/// Recordings of one server.
#[derive(Debug)]
pub(crate) struct Recordings {
    pub(crate) shared: Arc<Shared>,
    /// Folder in which each has a folder.
    pub(crate) root: PathBuf,
    pub(crate) thread: JoinHandle<()>,
}

/// Refuses a path that can never be a folder; a missing one is created for the first recording.
fn ensure_can_be_made(root: &Path) -> Result<(), ConsoleError> {
    let there = root.ancestors().find(|path| path.exists());
    match there.filter(|path| !path.is_dir()) {
        None => Ok(()),
        Some(file) => Err(ConsoleError::other(
            format!(
                "nothing can be recorded in {}: {} is not a folder",
                root.display(),
                file.display()
            ),
            "give a folder with --recordings DIR",
        )),
    }
}

/// Starts the writing thread; with `at_once`, the first recording begins at power-up.
///
/// # Errors
/// [`ConsoleError::Other`] if the path cannot be a folder, or the first recording's folder cannot be made.
pub(crate) fn start(
    root: &Path,
    about: About,
    at_once: bool,
) -> Result<(Feed, Recordings), ConsoleError> {
    let shared = Arc::new(Shared::default());
    let (to, from) = rtrb::RingBuffer::new(NOTES);
    ensure_can_be_made(root)?;
    let mut writer = writer::Writer::new(from, Arc::clone(&shared), root.to_owned(), about);
    if at_once {
        writer.begin(1, 0).map_err(|what| {
            ConsoleError::other(
                format!("nothing can be recorded: {what}"),
                "give a folder that can be written with --recordings DIR, or leave out --record",
            )
        })?;
    }
    let thread = std::thread::Builder::new()
        .name("recorder".to_owned())
        .spawn(move || writer.run())
        .map_err(|e| {
            let what = format!("the recorder's thread cannot be started: {e}");
            ConsoleError::other(what, "end other programs, then try again")
        })?;
    let feed = Feed::new(to, Arc::clone(&shared), at_once);
    let recordings = Recordings {
        shared,
        root: root.to_owned(),
        thread,
    };
    Ok((feed, recordings))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_the_place_of_the_folder_is_refused_at_once() {
        let home = tempfile::tempdir().expect("a folder");
        let file = home.path().join("afile");
        std::fs::write(&file, "").expect("written");
        for fits in [home.path().to_owned(), home.path().join("new/deep")] {
            assert!(ensure_can_be_made(&fits).is_ok(), "{}", fits.display());
        }
        assert!(ensure_can_be_made(Path::new("nothing-of-this-name")).is_ok());
        for wrong in [file.clone(), file.join("below")] {
            let told = ensure_can_be_made(&wrong).expect_err("refused").to_string();
            let name = file.display().to_string();
            assert!(
                told.contains(&name) && told.contains("not a folder"),
                "{told}"
            );
        }
    }
}
