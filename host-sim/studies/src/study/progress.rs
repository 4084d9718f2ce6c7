//! Progress of a study, and whether it should stop.

use std::sync::LazyLock;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{Stop, Stopped};
use crate::StudyError;

/// Stack of a worker: it must hold a simulated robot while it is built, 2 MB in builds for tests.
pub const STACK: usize = 8 << 20;

/// Works with the workers that all studies share, which have room for a simulated robot; if called on a
/// worker, with those of its own pool. Not rayon's global pool: its first user in the process sets the stack
/// size of its workers.
pub(super) fn on_workers<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    static WORKERS: LazyLock<Option<ThreadPool>> = LazyLock::new(|| {
        let workers = ThreadPoolBuilder::new().stack_size(STACK);
        workers.build().ok()
    });
    match &*WORKERS {
        Some(workers) if rayon::current_thread_index().is_none() => workers.install(work),
        _ => work(),
    }
}

/// Shows the progress of a study, on standard error and only if that is a terminal, and knows whether it
/// should stop.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    stop: Stop,
}

/// Why a part of a study has no result.
#[derive(Debug)]
pub enum Ended {
    /// The study was asked to stop.
    Stopped,
    /// It is impossible.
    Failed(Box<StudyError>),
}

impl Ended {
    /// The result of a part, or none if the study was stopped in it.
    ///
    /// # Errors
    /// The error of the part.
    pub fn kept<T>(result: Result<T, Self>) -> Result<Option<T>, StudyError> {
        match result {
            Ok(value) => Ok(Some(value)),
            Err(Self::Stopped) => Ok(None),
            Err(Self::Failed(e)) => Err(*e),
        }
    }
}

impl From<StudyError> for Ended {
    fn from(e: StudyError) -> Self {
        Self::Failed(Box::new(e))
    }
}

impl Progress {
    /// Nothing done yet.
    #[must_use]
    pub fn new(name: &str, stop: Stop) -> Self {
        stop.begin();
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{prefix} {wide_bar} {percent:>3} %  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_prefix(name.to_owned());
        Self { bar, stop }
    }

    /// One that shows nothing and never stops.
    #[must_use]
    pub fn silent() -> Self {
        Self {
            bar: ProgressBar::hidden(),
            stop: Stop::default(),
        }
    }

    /// Begins a phase of `steps` steps.
    pub fn begin(&self, what: impl Into<String>, steps: u64) {
        self.bar.set_message(what.into());
        self.bar.set_length(steps);
        self.bar.set_position(0);
    }

    /// Shows another message beside the bar.
    pub fn say(&self, what: String) {
        self.bar.set_message(what);
    }

    /// Writes a line on standard error, above the bar.
    pub fn tell(&self, line: &str) {
        use std::io::Write as _;
        // Standard error may be closed or full.
        self.bar.suspend(|| {
            let _ = writeln!(std::io::stderr(), "{line}");
        });
    }

    /// Sets the number of finished steps of the phase.
    pub fn at(&self, steps: u64) {
        self.bar.set_position(steps);
    }

    /// Counts one more finished step of the phase.
    pub fn step(&self) {
        self.bar.inc(1);
    }

    /// Removes the bar from the terminal.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Whether to stop.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stop.is_asked()
    }

    /// Record of a study that was stopped with `done` of its parts; none if it was not, or had nothing left
    /// to do.
    #[must_use]
    pub fn stopped(&self, done: u64, of: u64, unit: &'static str) -> Option<Stopped> {
        let signal = self.stop.signal().filter(|_| done < of)?;
        Some(Stopped {
            signal,
            done,
            of,
            unit,
        })
    }

    /// Works on items in parallel; results are in the order of the items. An item that was not begun before
    /// the study was stopped has none.
    ///
    /// # Errors
    /// The error of an item; no further one is begun then.
    pub fn map<T: Sync, R: Send, E: Send>(
        &self,
        items: &[T],
        work: impl Fn(&T) -> Result<R, E> + Sync,
    ) -> Result<Vec<Option<R>>, E> {
        on_workers(|| {
            items
                .par_iter()
                .map(|item| match self.is_stopped() {
                    true => Ok(None),
                    false => work(item).map(Some),
                })
                .collect()
        })
    }

    /// The same as a phase with a step for each item.
    ///
    /// # Errors
    /// As [`Progress::map`].
    pub fn each<T: Sync, R: Send, E: Send>(
        &self,
        what: &str,
        items: &[T],
        work: impl Fn(&T) -> Result<R, E> + Sync,
    ) -> Result<Vec<Option<R>>, E> {
        self.begin(what, items.len() as u64);
        self.map(items, |item| {
            let result = work(item)?;
            self.step();
            Ok(result)
        })
    }

    /// The same if all results are needed.
    ///
    /// # Errors
    /// As [`Progress::map`], or that the study was asked to stop.
    pub fn all<T: Sync, R: Send, E: Send + Into<StudyError>>(
        &self,
        what: &str,
        items: &[T],
        work: impl Fn(&T) -> Result<R, E> + Sync,
    ) -> Result<Vec<R>, Ended> {
        let results = self.each(what, items, work).map_err(Into::into)?;
        let results: Option<Vec<R>> = results.into_iter().collect();
        results.ok_or(Ended::Stopped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Signal;

    /// A simulated robot is built on the stack, in more than a thread's default of 2 MB; also if another
    /// library has started rayon's own workers before.
    #[test]
    fn workers_have_room_for_a_simulated_robot() {
        assert!(rayon::current_num_threads() > 0);
        let items = [1_u8; 4];
        let done = Progress::silent().map(&items, |item| {
            let room = std::hint::black_box([*item; STACK / 2]);
            Ok::<_, ()>(usize::from(room[room.len() - 1]))
        });
        assert_eq!(done, Ok(vec![Some(1); 4]));
    }

    #[test]
    fn what_was_done_before_the_stop_is_kept_in_its_place() {
        let stop = Stop::default();
        let progress = Progress::new("test", stop.clone());
        let items: Vec<u32> = (0..1000).collect();
        let work = |item: &u32| {
            if *item == 0 {
                stop.ask(Signal::HangUp);
            }
            Ok::<_, StudyError>(10 * item)
        };
        let results = progress.each("items", &items, work).expect("no error");
        let done = results.iter().flatten().count() as u64;
        assert!((1..1000).contains(&done), "{done}");
        for (item, result) in items.iter().zip(&results) {
            assert!(result.is_none_or(|result| result == 10 * item));
        }
        let stopped = progress.stopped(done, 1000, "items").expect("stopped");
        assert_eq!(
            stopped.to_string(),
            format!("hung up after {done} of 1000 items")
        );
        assert_eq!(progress.stopped(1000, 1000, "items"), None);
        let all = progress.all("items", &items, |item| Ok::<_, StudyError>(*item));
        assert!(matches!(all, Err(Ended::Stopped)));
    }

    #[test]
    fn an_error_of_an_item_is_that_of_all() {
        let items: Vec<u32> = (0..100).collect();
        let work = |item: &u32| match item {
            30.. => Err(StudyError::refused(item.to_string(), "")),
            _ => Ok(()),
        };
        let error = Progress::silent().each("items", &items, work);
        let said = error.expect_err("an item fails").to_string();
        assert!(said.parse().is_ok_and(|item: u32| item >= 30), "{said}");
    }
}
