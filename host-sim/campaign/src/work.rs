//! Computes the blocks of a shard: a queue of cases, and a part as soon as its block is done.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};
use std::time::{Duration, Instant};

use wheeleg_studies::study::{STACK, Stop};

use crate::CampaignError;
use crate::attempts::{Attempts, Event};
use crate::cases::Cases;
use crate::compute::{Simulate, row, row_of};
use crate::isolate::{Isolated, isolate};
use crate::part::{self, Effort};
use crate::row::{Row, Status, is_failed};
use crate::simulate::Outcome;
use crate::store::{Kept, Store, write_whole};

/// Number of separate processes that a case must have crashed before it is given up.
const ENDS: u32 = 2;

/// A block in progress.
struct Block {
    number: u64,
    /// Number of its cases, or for a pilot the number wanted.
    wanted: usize,
    rows: Mutex<BTreeMap<u64, Row>>,
    efforts: Mutex<Vec<Effort>>,
    attempts: Attempts,
    saved: Mutex<Saved>,
}

/// The rows of an unfinished block that are on disk.
struct Saved {
    /// When they were last saved.
    since: Instant,
    /// The files that hold them: this process's own, and those that it has taken over. Another process may be
    /// working on the same block; its files are left alone.
    files: Vec<PathBuf>,
    /// Whether the part exists, so that there is nothing more to save.
    finished: bool,
}

/// Pending and open work.
struct Queue<'a> {
    blocks: Box<dyn Iterator<Item = u64> + Send + 'a>,
    block: Option<(Arc<Block>, VecDeque<u64>)>,
    open: Vec<Arc<Block>>,
    error: Option<CampaignError>,
}

/// A shard in progress.
pub(crate) struct Work<'a> {
    pub(crate) store: &'a Store,
    pub(crate) cases: &'a Cases<'a>,
    pub(crate) simulate: Simulate<'a>,
    pub(crate) stop: &'a Stop,
    /// Only cases below this index are computed.
    pub(crate) first: u64,
    /// Interval at which the rows of an unfinished block are saved.
    pub(crate) save_every: Duration,
    /// Program that runs cases that may crash the process.
    pub(crate) program: Option<&'a Path>,
    /// Called with the number of cases that already have a row, and how many of them failed.
    pub(crate) found: &'a (dyn Fn(u64, u64) + Sync),
    /// Called for every computed row.
    pub(crate) on_row: &'a (dyn Fn(&Row) -> Result<(), CampaignError> + Sync),
    /// Called for every part that was set aside.
    pub(crate) aside: &'a (dyn Fn(&Path, &str) + Sync),
    /// Called for every block on which another process is working, too.
    pub(crate) shared: &'a (dyn Fn() + Sync),
}

impl Work<'_> {
    /// Works on the blocks with this many threads.
    ///
    /// # Errors
    /// The first file that cannot be written. Rows computed until then are kept if they can be written.
    pub(crate) fn run(
        &self,
        blocks: impl Iterator<Item = u64> + Send,
        threads: usize,
    ) -> Result<(), CampaignError> {
        let queue = Mutex::new(Queue {
            blocks: Box::new(blocks),
            block: None,
            open: Vec::new(),
            error: None,
        });
        std::thread::scope(|scope| {
            for _ in 0..threads {
                let thread = std::thread::Builder::new().stack_size(STACK);
                let started = thread.spawn_scoped(scope, || self.thread(&queue));
                if let Err(e) = started {
                    let what = format!("cannot start a thread: {e}");
                    let error = CampaignError::refused(what, "give fewer --threads");
                    held(&queue).error.get_or_insert(error);
                    break;
                }
            }
        });
        let queue = queue.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut error = queue.error;
        for block in queue.open {
            if let Err(e) = self.leave(&block) {
                error.get_or_insert(e);
            }
        }
        error.map_or(Ok(()), Err)
    }

    fn thread(&self, queue: &Mutex<Queue<'_>>) {
        loop {
            let next = {
                let mut queue = held(queue);
                if self.stop.is_asked() || queue.error.is_some() {
                    return;
                }
                match self.next(&mut queue) {
                    Ok(next) => next,
                    Err(e) => {
                        queue.error.get_or_insert(e);
                        return;
                    }
                }
            };
            let Some((block, index)) = next else { return };
            match self.work_on(&block, index) {
                Ok(true) => held(queue).open.retain(|open| open.number != block.number),
                Ok(false) => {}
                Err(e) => {
                    held(queue).error.get_or_insert(e);
                    return;
                }
            }
        }
    }

    /// The next case; moves on to the next block if this one has none left.
    fn next(&self, queue: &mut Queue<'_>) -> Result<Option<(Arc<Block>, u64)>, CampaignError> {
        loop {
            if let Some((block, left)) = &mut queue.block
                && let Some(index) = left.pop_front()
            {
                return Ok(Some((Arc::clone(block), index)));
            }
            let Some(number) = queue.blocks.next() else {
                return Ok(None);
            };
            let Some((block, left)) = self.open(number)? else {
                continue;
            };
            let block = Arc::new(block);
            if left.is_empty() {
                self.finish(&block)?;
                continue;
            }
            queue.open.push(Arc::clone(&block));
            queue.block = Some((block, left));
        }
    }

    /// A block and its cases without a row; `None` if the block is done.
    fn open(&self, number: u64) -> Result<Option<(Block, VecDeque<u64>)>, CampaignError> {
        match self.store.table(number) {
            Ok(Some(table)) => {
                let pilot =
                    (table.rows() as u64).min(self.first - self.store.cases_of(number).start);
                let passed = table.flags("passed").iter().take(pilot as usize);
                let failed = passed.filter(|passed| is_failed(**passed)).count();
                (self.found)(pilot, failed as u64);
                return Ok(None);
            }
            Ok(None) => {}
            Err(why) => {
                let path = self.store.part(number);
                let to = self.store.set_aside(&path)?;
                (self.aside)(&to, &why);
            }
        }
        let wanted = self.store.cases_of(number);
        let wanted: Vec<u64> = wanted.filter(|index| *index < self.first).collect();
        let mut rows = BTreeMap::new();
        let Kept {
            rows: kept,
            files,
            aside,
        } = self.store.kept_rows(number)?;
        rows.extend(kept.into_iter().map(|row| (row.index, row)));
        for (path, why) in aside {
            (self.aside)(&path, &why);
        }
        let found = || rows.values().filter(|row| row.index < self.first);
        let failed = found().filter(|row| row.is_failed()).count();
        (self.found)(found().count() as u64, failed as u64);
        let left = wanted.iter().copied();
        let left: VecDeque<u64> = left.filter(|index| !rows.contains_key(index)).collect();
        let attempts = Attempts::read(self.store.attempts(number));
        if attempts.is_shared() {
            (self.shared)();
        }
        let block = Block {
            number,
            wanted: wanted.len(),
            rows: Mutex::new(rows),
            efforts: Mutex::new(Vec::new()),
            attempts,
            saved: Mutex::new(Saved {
                since: Instant::now(),
                files,
                finished: false,
            }),
        };
        Ok(Some((block, left)))
    }

    /// Computes one case of a block; returns true if this finishes the block.
    fn work_on(&self, block: &Block, index: u64) -> Result<bool, CampaignError> {
        let begun = Instant::now();
        let ends = block.attempts.known(index).ends();
        let Some(row) = self.attempt(block, index)? else {
            return Ok(false);
        };
        (self.on_row)(&row)?;
        held(&block.efforts).push(Effort {
            index,
            wall_s: begun.elapsed().as_secs_f64(),
            ends,
        });
        let done = {
            let mut rows = held(&block.rows);
            rows.insert(index, row);
            rows.keys().filter(|index| **index < self.first).count() >= block.wanted
        };
        if done {
            self.finish(block)?;
        } else {
            self.save_if_due(block)?;
        }
        Ok(done)
    }

    fn attempt(&self, block: &Block, index: u64) -> Result<Option<Row>, CampaignError> {
        let attempts = &block.attempts;
        let mut known = attempts.known(index);
        let Some(program) = self.program.filter(|_| known.ends() > 0) else {
            attempts.note(index, Event::Begun)?;
            let row = row(self.cases, index, self.store.plan().block, self.simulate);
            let event = match row {
                Some(_) => Event::Ended,
                None => Event::Abandoned,
            };
            attempts.note(index, event)?;
            return Ok(row);
        };
        let mut last = "an earlier process".to_owned();
        loop {
            if known.proven >= ENDS {
                let case = self.cases.case(index);
                let message = format!("ended its process {ENDS} times: {last}");
                let outcome = Outcome::without(Status::Crashed, message);
                let size = self.store.plan().block;
                return Ok(Some(row_of(self.cases, &case, size, outcome)));
            }
            attempts.note(index, Event::Begun)?;
            match isolate(program, self.store, index, self.stop)? {
                Isolated::Row(row) => {
                    attempts.note(index, Event::Ended)?;
                    return Ok(Some(*row));
                }
                Isolated::Stopped => {
                    attempts.note(index, Event::Abandoned)?;
                    return Ok(None);
                }
                Isolated::Ended(how) => {
                    attempts.note(index, Event::EndedItsProcess)?;
                    known.proven += 1;
                    last = how;
                }
            }
        }
    }

    /// Writes the part of a block that has all its rows; for a pilot, saves the rows that exist.
    fn finish(&self, block: &Block) -> Result<(), CampaignError> {
        let cases = self.store.cases_of(block.number);
        let mut saved = held(&block.saved);
        let rows = held(&block.rows);
        if (rows.len() as u64) < cases.end - cases.start {
            drop(rows);
            return self.save(block, &mut saved);
        }
        let rows: Vec<Row> = rows.values().cloned().collect();
        let partials = self.store.partials(block.number);
        let hash = &self.store.plan().hash;
        let part = self.store.part(block.number);
        let mut efforts = held(&block.efforts).clone();
        efforts.sort_by_key(|effort| effort.index);
        write_whole(
            &part.with_extension("run.parquet"),
            &part::run_bytes(hash, &efforts),
        )?;
        self.store
            .write_part(self.cases.columns(), block.number, &rows)?;
        for path in partials {
            let _ = std::fs::remove_file(path);
        }
        block.attempts.remove();
        saved.finished = true;
        Ok(())
    }

    /// Saves the rows of a block from time to time, which limits what a killed process loses.
    fn save_if_due(&self, block: &Block) -> Result<(), CampaignError> {
        let mut saved = match block.saved.try_lock() {
            Ok(saved) => saved,
            Err(TryLockError::Poisoned(e)) => e.into_inner(),
            // Another thread is saving.
            Err(TryLockError::WouldBlock) => return Ok(()),
        };
        if saved.since.elapsed() < self.save_every {
            return Ok(());
        }
        self.save(block, &mut saved)
    }

    /// Keeps the rows of an unfinished block.
    fn leave(&self, block: &Block) -> Result<(), CampaignError> {
        self.save(block, &mut held(&block.saved))
    }

    /// Saves the existing rows, and removes the files that held some of them before.
    fn save(&self, block: &Block, saved: &mut Saved) -> Result<(), CampaignError> {
        let rows: Vec<Row> = held(&block.rows).values().cloned().collect();
        let none = rows.is_empty() || held(&block.efforts).is_empty();
        if saved.finished || none {
            return Ok(());
        }
        let file = self.store.new_partial(block.number);
        let bytes = part::bytes(self.cases.columns(), &self.store.plan().hash, &rows);
        write_whole(&file, &bytes)?;
        for path in std::mem::replace(&mut saved.files, vec![file]) {
            let _ = std::fs::remove_file(path);
        }
        saved.since = Instant::now();
        Ok(())
    }
}

/// Ignores poisoning: no data is left half changed when a lock is released, even by a thread that panicked.
fn held<T>(lock: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}
