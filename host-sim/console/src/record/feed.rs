//! The robot's side of a recording: everything goes into one ring, so that order is kept.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use wheeleg_telemetry::{Contact, SampleRef, Sink, Taken};

use super::{Given, Note, Shared, Touching};
use crate::live::Moving;

/// Places in the ring that samples leave free for inputs, begin and end.
const RESERVE: usize = 2_048;
/// How long the end of a recording may wait for its place when the robot is switched off.
const LAST_WORDS: Duration = Duration::from_secs(5);

/// Takes the robot's inputs and samples.
pub(crate) struct Feed {
    to: rtrb::Producer<Note>,
    shared: Arc<Shared>,
    /// Number of the newest recording.
    number: u64,
    running: bool,
    dropped: u64,
}

impl Feed {
    pub(super) fn new(to: rtrb::Producer<Note>, shared: Arc<Shared>, running: bool) -> Self {
        Self {
            to,
            shared,
            number: u64::from(running),
            running,
            dropped: 0,
        }
    }

    /// Whether a recording is under way; false once its disk has failed.
    pub(crate) fn is_running(&mut self) -> bool {
        if self.running && self.shared.failed.load(Ordering::Acquire) == self.number {
            self.running = false;
        }
        self.running
    }

    /// Begins a recording, or returns why not.
    pub(crate) fn begin(&mut self, request: u32, at_us: u64) -> Result<(), &'static str> {
        if self.is_running() {
            return Err("a recording is in progress: stop it first");
        }
        let number = self.number + 1;
        let note = Note::Begin {
            number,
            request,
            at_us,
        };
        self.to.push(note).map_err(|_| "the recorder is busy")?;
        (self.number, self.running, self.dropped) = (number, true, 0);
        self.shared.dropped.store(0, Ordering::Relaxed);
        Ok(())
    }

    /// Ends the recording, or returns why not. `hash` covers everything since power-up.
    pub(crate) fn end(
        &mut self,
        request: Option<u32>,
        at_us: u64,
        hash: String,
    ) -> Result<(), &'static str> {
        if !self.is_running() {
            return Err("nothing is being recorded");
        }
        let note = Note::End {
            request,
            at_us,
            hash,
            dropped: self.dropped,
        };
        self.to.push(note).map_err(|_| "the recorder is busy")?;
        self.running = false;
        Ok(())
    }

    /// Ends the recording of a robot that is switched off: it waits for the disk.
    pub(crate) fn close(&mut self, at_us: u64, hash: &str) {
        let begin = Instant::now();
        while self.is_running()
            && self.end(None, at_us, hash.to_owned()).is_err()
            && begin.elapsed() < LAST_WORDS
        {
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Adds an item for the log, if there is room.
    fn note(&mut self, note: Note) {
        if self.to.slots() < RESERVE || self.to.push(note).is_err() {
            self.dropped += 1;
            self.shared.dropped.store(self.dropped, Ordering::Relaxed);
        }
    }

    /// Records an input at the simulated time `ms`.
    pub(crate) fn given(&mut self, ms: u64, given: Given) {
        if self.to.push(Note::Input { ms, given }).is_err() {
            self.shared.gap.store(true, Ordering::Release);
        }
    }
}

/// The sink of a [`Feed`]: takes samples that are due in the log.
pub(crate) struct FeedSink(pub(crate) Rc<RefCell<Feed>>);

impl Sink for FeedSink {
    fn take(&mut self, taken: &Taken<'_>) {
        // Every recording holds the inputs of its run, whenever it begins.
        let head = matches!(taken.sample, SampleRef::Provenance(_));
        let mut feed = self.0.borrow_mut();
        if !taken.due || !(feed.running || head) {
            return;
        }
        let moving = Moving {
            channel: taken.channel as u16,
            number: 0,
            t_ns: taken.t_ns,
            sample: taken.sample.to_owned(),
        };
        feed.note(Note::Sample(Box::new(moving), taken.lost));
    }

    fn wants_contacts(&self) -> bool {
        self.0.borrow().running
    }

    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], lost: bool) {
        let touching = Touching {
            t_ns,
            contacts: contacts.to_vec(),
            lost,
        };
        let mut feed = self.0.borrow_mut();
        feed.note(Note::Contacts(Box::new(touching)));
    }
}
