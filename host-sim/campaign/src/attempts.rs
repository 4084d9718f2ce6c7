//! Records which cases a process has begun, so that the next process knows which case may have crashed this
//! one.
//!
//! One line is written when a case begins, one when it ends, and one for each separate process that it
//! crashed (`isolate.rs`). A beginning without an end is only a suspicion: the process may have been killed
//! from outside, and may have been running several cases. Such a case is therefore run again in a process of
//! its own; if it crashes that process too, its row says so.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;

use serde::{Deserialize, Serialize};
use wheeleg_config::open_file;

use crate::{CampaignError, host};

/// One line of the file.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    case: u64,
    event: Event,
    /// The process, by [`host::this_process`]; empty in files of earlier versions.
    #[serde(default)]
    by: String,
}

/// What happened to a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Event {
    /// A process has begun the case.
    Begun,
    /// The case has a row.
    Ended,
    /// The case was abandoned because the process was asked to stop.
    Abandoned,
    /// The case crashed the separate process that ran it.
    EndedItsProcess,
}

/// What is known about a case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Known {
    /// Beginnings without an end.
    pub(crate) open: u32,
    /// Separate processes that the case crashed.
    pub(crate) proven: u32,
    /// Whether the process that had the case last is alive, if this computer can tell.
    pub(crate) lives: Option<bool>,
}

impl Known {
    /// Number of processes known to have ended while they ran the case.
    pub(crate) fn ends(self) -> u32 {
        self.open + self.proven
    }
}

/// The attempts file of a block.
#[derive(Debug)]
pub(crate) struct Attempts {
    path: PathBuf,
    known: BTreeMap<u64, Known>,
    is_shared: bool,
    /// Keeps lines of different threads from mixing.
    file: Mutex<()>,
}

impl Attempts {
    /// Reads the existing file; ignores a truncated line.
    pub(crate) fn read(path: PathBuf) -> Self {
        let text = open_file(&path)
            .and_then(std::io::read_to_string)
            .unwrap_or_default();
        let mut known: BTreeMap<u64, Known> = BTreeMap::new();
        // Whether each process is alive: few processes, and many lines.
        let mut processes: BTreeMap<String, Option<bool>> = BTreeMap::new();
        for line in text.lines() {
            let Ok(line) = serde_json::from_str::<Line>(line) else {
                continue;
            };
            let of = known.entry(line.case).or_default();
            let lives = processes.entry(line.by);
            of.lives = *lives.or_insert_with_key(|process| host::lives(process));
            match line.event {
                Event::Begun => of.open += 1,
                Event::Ended => of.open = of.open.saturating_sub(1),
                Event::Abandoned => {
                    of.open = of.open.saturating_sub(1);
                    // Nobody has anything to save.
                    if of.ends() == 0 {
                        known.remove(&line.case);
                    }
                }
                Event::EndedItsProcess => {
                    of.open = of.open.saturating_sub(1);
                    of.proven += 1;
                }
            }
        }
        let mut others = processes.iter();
        Self {
            path,
            known,
            is_shared: others
                .any(|(name, lives)| *lives == Some(true) && name != host::this_process()),
            file: Mutex::new(()),
        }
    }

    /// What was known about a case when the file was read.
    pub(crate) fn known(&self, case: u64) -> Known {
        self.known.get(&case).copied().unwrap_or_default()
    }

    /// Whether another process that is alive has worked on the block.
    pub(crate) fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// What was known about every case that was begun.
    pub(crate) fn all(&self) -> impl Iterator<Item = (u64, Known)> + '_ {
        self.known.iter().map(|(case, known)| (*case, *known))
    }

    /// Appends a line.
    pub(crate) fn note(&self, case: u64, event: Event) -> Result<(), CampaignError> {
        let line = Line {
            case,
            event,
            by: host::this_process().to_owned(),
        };
        let mut text = serde_json::to_string(&line).expect("plain data is JSON");
        text.push('\n');
        let _held = self.file.lock();
        let write = || {
            let mut file = OpenOptions::new()
                .create(true)
                .append(true)
                .open(&self.path)?;
            file.write_all(text.as_bytes())
        };
        write().map_err(|e| CampaignError::output("write", &self.path, e))
    }

    /// Removes the file when the block is done.
    pub(crate) fn remove(&self) {
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beginning_without_an_end_is_known_and_a_torn_line_is_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("000001.jsonl");
        let attempts = Attempts::read(path.clone());
        assert_eq!(attempts.known(5), Known::default());
        for (case, event) in [
            (5, Event::Begun),
            (6, Event::Begun),
            (6, Event::Ended),
            (7, Event::Begun),
            (7, Event::EndedItsProcess),
            (8, Event::Begun),
            (8, Event::Abandoned),
        ] {
            attempts.note(case, event).expect("written");
        }
        let mut text = fs::read_to_string(&path).expect("there");
        text.push_str("{\"case\":6,\"event\":\"beg");
        fs::write(&path, text).expect("written");
        let attempts = Attempts::read(path.clone());
        let known = [5, 6, 7, 8].map(|case| attempts.known(case));
        let lives = host::lives(host::this_process());
        let of = |open, proven| Known {
            open,
            proven,
            lives,
        };
        let none = Known::default();
        assert_eq!(known, [of(1, 0), of(0, 0), of(0, 1), none]);
        // Neither lost nor to be saved.
        assert!(attempts.all().all(|(case, _)| case != 8));
        assert!(!attempts.is_shared(), "only this process has worked on it");
        attempts.remove();
        assert!(!path.exists());
    }
}
