//! The recorder's thread: empties the ring of the robot's thread into the folder of the recording.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use wheeleg_telemetry::OwnedSample;

use super::folder::Folder;
use super::inputs::Line;
use super::{About, Note, Shared, Status, locked};

/// How often the ring is emptied.
const PERIOD: Duration = Duration::from_millis(5);
/// How often inputs are handed to the operating system.
const FLUSH: Duration = Duration::from_millis(250);
/// Bytes of inputs kept for a recording that begins later: more than ten hours of driving.
const KEPT_MAX: usize = 64 << 20;

/// A recording under way.
struct Running {
    number: u64,
    folder: Folder,
    flushed: Instant,
}

pub(super) struct Writer {
    notes: rtrb::Consumer<Note>,
    shared: Arc<Shared>,
    root: PathBuf,
    about: About,
    /// Messages at the head of every log.
    head: Vec<(u16, OwnedSample)>,
    /// Inputs since power-up; none if they were too many.
    kept: Option<Vec<u8>>,
    running: Option<Running>,
}

impl Writer {
    pub(super) fn new(
        notes: rtrb::Consumer<Note>,
        shared: Arc<Shared>,
        root: PathBuf,
        about: About,
    ) -> Self {
        Self {
            notes,
            shared,
            root,
            about,
            head: Vec::new(),
            kept: Some(Vec::new()),
            running: None,
        }
    }

    pub(super) fn run(mut self) {
        loop {
            // Checked before the ring is emptied: it then holds everything to the end.
            let over = self.notes.is_abandoned();
            while let Ok(note) = self.notes.pop() {
                self.take(note);
            }
            if over {
                break;
            }
            self.flush();
            std::thread::sleep(PERIOD);
        }
        // The robot's thread ended without notice.
        let _ = self.end(None);
    }

    /// Begins a recording.
    pub(super) fn begin(&mut self, number: u64, begin_us: u64) -> Result<(), String> {
        let gap = self.shared.gap.load(Ordering::Acquire);
        let before = self.kept.as_deref().filter(|_| !gap);
        let folder = Folder::create(&self.root, &self.about, begin_us, &self.head, before)?;
        *locked(&self.shared.status) = Some(Status {
            id: folder.summary.id.clone(),
            since_us: begin_us,
            failure: None,
        });
        self.running = Some(Running {
            number,
            folder,
            flushed: Instant::now(),
        });
        Ok(())
    }

    fn take(&mut self, note: Note) {
        match note {
            Note::Begin {
                number,
                request,
                at_us,
            } => {
                let begun = self.begin(number, at_us);
                if begun.is_err() {
                    self.shared.failed.store(number, Ordering::Release);
                }
                self.answer(request, begun);
            }
            Note::End {
                request,
                at_us,
                hash,
                dropped,
            } => {
                let ended = self.end(Some((at_us, hash, dropped)));
                if let Some(request) = request {
                    self.answer(request, ended);
                }
            }
            Note::Input { ms, given } => {
                let line = Line::new(ms, given);
                if let Some(kept) = &mut self.kept {
                    line.push_to(kept);
                    if kept.len() > KEPT_MAX {
                        self.kept = None;
                    }
                }
                let written = self.running.as_mut().map(|r| r.folder.input(&line));
                self.check(written);
            }
            Note::Sample(moving, lost) => {
                if let OwnedSample::Provenance(_) = &moving.sample {
                    self.head.push((moving.channel, moving.sample.clone()));
                }
                let written = self
                    .running
                    .as_mut()
                    .map(|r| r.folder.sample(&moving, lost));
                self.check(written);
            }
            Note::Contacts(touching) => {
                let written = self.running.as_mut().map(|r| r.folder.contacts(&touching));
                self.check(written);
            }
        }
    }

    fn answer(&self, request: u32, what: Result<(), String>) {
        locked(&self.shared.answers).push((request, what));
    }

    /// Ends the recording if the disk takes no more.
    fn check(&mut self, written: Option<Result<(), String>>) {
        let Some(Err(why)) = written else {
            return;
        };
        let Some(mut running) = self.running.take() else {
            return;
        };
        running.folder.summary.failure = Some(why.clone());
        // The files hold what could be written.
        let _ = running.folder.finish();
        self.shared.failed.store(running.number, Ordering::Release);
        if let Some(status) = locked(&self.shared.status).as_mut() {
            status.failure = Some(why);
        }
    }

    fn flush(&mut self) {
        let due = self
            .running
            .as_mut()
            .filter(|r| r.flushed.elapsed() >= FLUSH);
        let written = due.map(|running| {
            running.flushed = Instant::now();
            running.folder.flush()
        });
        self.check(written);
    }

    /// Ends the recording; `how`: time, hash and missing messages, if the robot reported them.
    fn end(&mut self, how: Option<(u64, String, u64)>) -> Result<(), String> {
        let Some(mut running) = self.running.take() else {
            return Ok(());
        };
        let summary = &mut running.folder.summary;
        if let Some((end_us, hash, dropped)) = how {
            summary.end_us = Some(end_us);
            summary.hash = Some(hash);
            summary.dropped = dropped;
        }
        summary.repeatable &= !self.shared.gap.load(Ordering::Acquire);
        let finished = running.folder.finish();
        let mut status = locked(&self.shared.status);
        match (&finished, status.as_mut()) {
            (Err(why), Some(status)) => status.failure = Some(why.clone()),
            _ => *status = None,
        }
        finished
    }
}
