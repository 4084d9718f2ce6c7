//! Runs a shard of a campaign.

use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde_json::json;
use wheeleg_config::plan::KeepLogs;
use wheeleg_studies::study::{Job, Progress, Signal, Stop};

use crate::CampaignError;
use crate::cases::Cases;
use crate::causes::Causes;
use crate::columns::Columns;
use crate::compute::Simulate;
use crate::row::Row;
use crate::shard::Shard;
use crate::simulate::{log, simulate};
use crate::store::Store;
use crate::work::Work;

/// Options of a run.
#[derive(Debug, Clone)]
pub struct Options {
    /// The shard to compute.
    pub shard: Shard,
    /// Number of threads.
    pub threads: usize,
    /// Compute only this many cases, as a pilot.
    pub first: Option<u64>,
    /// Handle to request a stop.
    pub stop: Stop,
    /// This program, to run cases that may crash the process; if `None`, they run in this process.
    pub program: Option<PathBuf>,
    /// Whether to report progress as lines of JSON on standard error.
    pub json: bool,
    /// Interval at which the rows of an unfinished block are saved, which limits what a killed process loses.
    /// Use [`SAVE_EVERY`] unless there is a reason not to.
    pub save_every: Duration,
}

impl Options {
    /// All cases, on all cores, in this process.
    #[must_use]
    pub fn whole(stop: &Stop) -> Self {
        Self {
            shard: Shard::ALL,
            threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            first: None,
            stop: stop.clone(),
            program: None,
            json: false,
            save_every: SAVE_EVERY,
        }
    }
}

/// Saving a block of 4096 cases takes less than a thousandth of this.
pub const SAVE_EVERY: Duration = Duration::from_secs(30);

/// The result of a process.
#[derive(Debug, Clone, PartialEq)]
pub struct Ran {
    /// Cases of its share that already had a row.
    pub found: u64,
    /// Cases that it computed.
    pub computed: u64,
    /// Computed cases that missed a required target or have no result.
    pub failed: u64,
    /// Why these cases failed.
    pub causes: Causes,
    /// Number of cases in its share.
    pub of: u64,
    /// The signal that stopped it.
    pub stopped: Option<Signal>,
    /// Parts that were set aside, and why.
    pub aside: Vec<(PathBuf, String)>,
    /// Whether another process worked on the same blocks, so that cases may have been computed twice.
    pub shared: bool,
}

/// Computes a shard. Work that an earlier process finished is not repeated.
///
/// # Errors
/// A file that cannot be written, with its path. Cases that fail are rows, not errors.
pub fn run(
    store: &Store,
    cases: &Cases<'_>,
    options: &Options,
    simulate: Simulate<'_>,
) -> Result<Ran, CampaignError> {
    let first = options.first.unwrap_or(u64::MAX);
    let blocks = (0..store.blocks()).filter(|block| options.shard.has(*block));
    let blocks = blocks.filter(|block| store.cases_of(*block).start < first);
    let of = blocks.clone().map(|block| {
        let cases = store.cases_of(block);
        cases.end.min(first) - cases.start
    });
    let of: u64 = of.sum();
    let progress = Progress::new(&cases.plan().name, options.stop.clone());
    let live = Live {
        progress: &progress,
        json: options.json,
        of,
        begun: Instant::now(),
        computed: AtomicU64::new(0),
        failed: AtomicU64::new(0),
        causes: Mutex::new(Causes::default()),
        last: Mutex::new(None),
        lined: Mutex::new(Instant::now()),
        is_terminal: std::io::stderr().is_terminal(),
        found: AtomicU64::new(0),
        failed_before: AtomicU64::new(0),
    };
    if !options.json {
        progress.begin("cases", of);
    }
    let aside = Mutex::new(Vec::new());
    let shared = AtomicBool::new(false);
    let work = Work {
        store,
        cases,
        simulate,
        stop: &options.stop,
        first,
        save_every: options.save_every,
        program: options.program.as_deref(),
        found: &|cases, failed| live.found(cases, failed),
        on_row: &|row| {
            live.computed(cases.columns(), row);
            keep_log(store, cases, row, &options.stop)
        },
        aside: &|path: &Path, why: &str| {
            let mut list = aside.lock().expect("nobody panics with it");
            list.push((path.to_owned(), why.to_owned()));
        },
        shared: &|| {
            let first = !shared.swap(true, Ordering::Relaxed);
            if first && !options.json {
                progress.tell(
                    "another process works on the same blocks, and both compute the same cases: stop one, \
                     or give each its share with --shard I/N",
                );
            }
        },
    };
    let result = work.run(blocks, options.threads);
    store.tidy();
    live.tell(true);
    progress.clear();
    let (found, computed) = (
        live.found.load(Ordering::Relaxed),
        live.computed.load(Ordering::Relaxed),
    );
    result.inspect_err(|_| {
        // Standard error may be closed or full.
        let done = found + computed;
        let _ = writeln!(
            std::io::stderr(),
            "{done} of {of} cases had a result when a file could not be written"
        );
    })?;
    Ok(Ran {
        found,
        computed,
        failed: live.failed.load(Ordering::Relaxed),
        causes: live.causes.into_inner().unwrap_or_default(),
        of,
        stopped: options.stop.signal().filter(|_| found + computed < of),
        aside: aside.into_inner().unwrap_or_default(),
        shared: shared.into_inner(),
    })
}

/// Computes the cases of a study that is a campaign, and tells what was set aside; with them, all rows that are there.
///
/// # Errors
/// As [`run`], or a part that cannot be read.
pub(crate) fn run_in(
    job: &Job,
    store: &Store,
    cases: &Cases<'_>,
    options: &Options,
) -> Result<(Ran, Vec<Row>), CampaignError> {
    let one = |case: &_| simulate(case, None, &options.stop);
    let ran = run(store, cases, options, &one)?;
    for (path, why) in &ran.aside {
        let told = format!("set aside: {}: {why}", path.display());
        job.progress.tell(&told);
    }
    Ok((ran, store.rows()?))
}

/// Writes the log of a case if the plan keeps it; the case is simulated again for this.
fn keep_log(store: &Store, cases: &Cases<'_>, row: &Row, stop: &Stop) -> Result<(), CampaignError> {
    let wanted = match cases.plan().keep {
        KeepLogs::None => false,
        KeepLogs::Failed => row.is_failed(),
        KeepLogs::All => true,
    };
    if !wanted || row.log_hash.is_none() {
        return Ok(());
    }
    let folder = store.folder().join("logs");
    std::fs::create_dir_all(&folder)
        .map_err(|e| CampaignError::output("create the folder", &folder, e))?;
    let path = folder.join(format!("{}.mcap", row.case));
    if !path.exists() {
        log(&cases.case(row.index), &path, cases.plan().limit_s, stop)?;
    }
    Ok(())
}

/// Progress of a run.
struct Live<'a> {
    progress: &'a Progress,
    json: bool,
    of: u64,
    begun: Instant,
    found: AtomicU64,
    /// Failed cases among those found.
    failed_before: AtomicU64,
    computed: AtomicU64,
    /// Failed cases among those computed.
    failed: AtomicU64,
    causes: Mutex<Causes>,
    last: Mutex<Option<Instant>>,
    /// When the last line was written, if no progress bar is shown.
    lined: Mutex<Instant>,
    is_terminal: bool,
}

/// Interval between two progress reports, and between two plain lines, which stay on the screen.
const BETWEEN: Duration = Duration::from_secs(1);
const BETWEEN_LINES: Duration = Duration::from_secs(30);

impl Live<'_> {
    /// Writes a plain line from time to time if no progress bar is shown, as in the log of a scheduler.
    fn line(&self, done: u64, told: &str) {
        let Ok(mut lined) = self.lined.try_lock() else {
            return;
        };
        if !self.is_terminal && lined.elapsed() >= BETWEEN_LINES {
            *lined = Instant::now();
            // Standard error may be closed or full.
            let _ = writeln!(std::io::stderr(), "{done} of {} cases, {told}", self.of);
        }
    }

    fn found(&self, cases: u64, failed: u64) {
        self.found.fetch_add(cases, Ordering::Relaxed);
        self.failed_before.fetch_add(failed, Ordering::Relaxed);
        self.tell(false);
    }

    fn computed(&self, columns: &Columns, row: &Row) {
        if let Ok(mut causes) = self.causes.lock() {
            causes.add(columns, row);
        }
        self.computed.fetch_add(1, Ordering::Relaxed);
        self.failed
            .fetch_add(u64::from(row.is_failed()), Ordering::Relaxed);
        self.tell(false);
    }

    fn tell(&self, at_once: bool) {
        let Ok(mut last) = self.last.try_lock() else {
            return;
        };
        if !at_once && last.is_some_and(|last| last.elapsed() < BETWEEN) {
            return;
        }
        *last = Some(Instant::now());
        let computed = self.computed.load(Ordering::Relaxed);
        let done = computed + self.found.load(Ordering::Relaxed);
        // Counts all finished cases, including those of earlier processes.
        let failed =
            self.failed.load(Ordering::Relaxed) + self.failed_before.load(Ordering::Relaxed);
        let rate = computed as f64 / self.begun.elapsed().as_secs_f64().max(1e-3);
        let left_s = (computed > 0).then(|| (self.of.saturating_sub(done)) as f64 / rate);
        if self.json {
            let line = json!({
                "done": done, "failed": failed, "of": self.of,
                "cases_per_s": rate, "left_s": left_s,
            });
            let _ = writeln!(std::io::stderr(), "{line}");
            return;
        }
        let left = left_s.map_or(String::new(), |s| format!(", {s:.0} s left"));
        let told = format!("{failed} failed, {rate:.1} cases/s{left}");
        self.progress.at(done);
        self.progress.say(told.clone());
        self.line(done, &told);
    }
}
