//! Common parts of all studies: progress, stopping, the folder of the results, the summary as JSON, figures
//! and report.
//!
//! A study begins a [`Job`], which holds the output folder; works through [`Progress`], which says when to
//! stop; and ends with [`Job::finish`]. A stopped study writes what it has, and says so in summary, report
//! and exit code ([`Stopped`]). Files that a full disk does not take are named, and cost neither the result
//! nor the other files ([`Finished::unwritten`]).

mod progress;
pub mod schema;
mod stop;
#[cfg(unix)]
mod suspend;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use minijinja::context;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_report::output::Folder;
use wheeleg_report::plot::{Figure, ensure_png};
use wheeleg_report::results::{FIGURES, REPORT, SUMMARY};
use wheeleg_report::{page, subfolder};

pub use progress::STACK;
pub use progress::{Ended, Progress};
pub use schema::Summary;
pub use stop::{Signal, Stop, outlive_file_limit};
#[cfg(unix)]
pub use suspend::Suspend;

use crate::StudyError;

/// Folder of a study's results, and its stop signal.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Folder for the results.
    pub out: PathBuf,
    /// Figures as PNG in addition to SVG.
    pub png: bool,
    /// The stop signal.
    pub stop: Stop,
}

impl Settings {
    /// Results in a folder, without PNG and without a stop signal.
    #[must_use]
    pub fn new(out: impl Into<PathBuf>) -> Self {
        Self {
            out: out.into(),
            png: false,
            stop: Stop::default(),
        }
    }
}

/// Why a study stopped early, and how far it got.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Stopped {
    /// The signal.
    pub signal: Signal,
    /// Finished parts.
    pub done: u64,
    /// Parts of the whole study.
    pub of: u64,
    /// Kind of the parts.
    pub unit: &'static str,
}

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            signal,
            done,
            of,
            unit,
        } = self;
        write!(f, "{} after {done} of {of} {unit}", signal.label())
    }
}

/// A study with its files written.
#[derive(Debug)]
pub struct Finished<T> {
    /// The result.
    pub result: T,
    /// Contents of `summary.json`.
    pub summary: String,
    /// The page.
    pub report: PathBuf,
    /// Why it stopped before its end.
    pub stopped: Option<Stopped>,
    /// Errors of files that could not be written, in order; everything else is there.
    pub unwritten: Vec<StudyError>,
}

impl<T> Finished<T> {
    /// The same with another result.
    pub fn map<R>(self, change: impl FnOnce(T) -> R) -> Finished<R> {
        let Self {
            result,
            summary,
            report,
            stopped,
            unwritten,
        } = self;
        Finished {
            result: change(result),
            summary,
            report,
            stopped,
            unwritten,
        }
    }
}

/// A figure with its SVG text.
pub type Drawn = (Figure, String);

/// A study under way. It holds the folder of its results.
#[derive(Debug)]
pub struct Job {
    folder: Folder,
    png: bool,
    /// Errors of files that could not be written so far.
    unwritten: Mutex<Vec<StudyError>>,
    /// Its progress.
    pub progress: Progress,
}

impl Job {
    /// Takes the folder; earlier results in it are set aside in its folders `previous`, `previous-2`, … The
    /// files that the study `reads` stay where they are.
    ///
    /// # Errors
    /// [`StudyError::Report`] if the folder is in use or cannot be written, if a result would overwrite an
    /// input file, or if a program without PNG is asked for it.
    pub fn begin(name: &str, settings: &Settings, reads: &[&Path]) -> Result<Self, StudyError> {
        Self::begin_with(name, settings, reads, &[])
    }

    /// The same for a study that writes further files.
    ///
    /// # Errors
    /// As [`Job::begin`].
    pub fn begin_with(
        name: &str,
        settings: &Settings,
        reads: &[&Path],
        also: &'static [&'static str],
    ) -> Result<Self, StudyError> {
        if settings.png {
            ensure_png()?;
        }
        settings.stop.begin();
        Ok(Self {
            folder: Folder::prepare(&settings.out, also, reads)?,
            png: settings.png,
            unwritten: Mutex::default(),
            progress: Progress::new(name, settings.stop.clone()),
        })
    }

    /// The folder of the results.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Creates a folder for tables or figures.
    ///
    /// # Errors
    /// [`StudyError::Report`] if it cannot be created.
    pub fn subfolder(&self, name: &str) -> Result<PathBuf, StudyError> {
        Ok(subfolder(self.folder(), name)?)
    }

    /// Writes a text file; returns its path. Recreates a folder that was removed.
    ///
    /// # Errors
    /// [`StudyError::Report`] if it cannot be written.
    pub fn save(&self, name: &str, text: &str) -> Result<PathBuf, StudyError> {
        let path = self.folder().join(name);
        if let Some(folder) = path.parent() {
            // If that fails, so does the file, with a better message.
            let _ = std::fs::create_dir_all(folder);
        }
        std::fs::write(&path, text).map_err(|e| {
            // A part of a file would be taken for the whole.
            let _ = std::fs::remove_file(&path);
            StudyError::output("write", &path, e)
        })?;
        Ok(path)
    }

    /// The written file; otherwise none, and its error is kept for [`Finished::unwritten`].
    pub fn keep<T>(&self, written: Result<T, StudyError>) -> Option<T> {
        written.map_err(|e| self.unwritten().push(e)).ok()
    }

    /// Errors of unwritten files so far. A panic while one was added spoils none of the others.
    pub(crate) fn unwritten(&self) -> MutexGuard<'_, Vec<StudyError>> {
        let list = self.unwritten.lock();
        list.unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes a figure into the folder `figures`, which must exist: its SVG text, and a PNG if requested.
    fn save_figure(&self, figure: &Figure, svg: &str) -> Result<(), StudyError> {
        if self.png {
            let path = self.folder().join(format!("{FIGURES}/{}.png", figure.id));
            figure.png(&path).inspect_err(|_| {
                let _ = std::fs::remove_file(&path);
            })?;
        }
        self.save(&format!("{FIGURES}/{}.svg", figure.id), svg)?;
        Ok(())
    }

    /// Draws figures as SVG; returns them with their text.
    #[must_use]
    pub fn draw(&self, figures: Vec<Figure>) -> Vec<Drawn> {
        self.progress.begin("drawing", figures.len() as u64);
        progress::on_workers(|| {
            let drawn = figures.into_par_iter().map(|figure| {
                let svg = figure.svg();
                self.progress.step();
                (figure, svg)
            });
            drawn.collect()
        })
    }

    /// Writes figures into the folder `figures`, also as PNG if requested.
    ///
    /// # Errors
    /// [`StudyError`]: one for all that are missing.
    pub fn save_figures(&self, drawn: &[Drawn]) -> Result<(), StudyError> {
        self.subfolder(FIGURES)?;
        self.progress.begin("pictures", drawn.len() as u64);
        let failed: Vec<StudyError> = progress::on_workers(|| {
            let failed = drawn.par_iter().filter_map(|(figure, svg)| {
                let failed = self.save_figure(figure, svg).err();
                self.progress.step();
                failed
            });
            failed.collect()
        });
        let count = failed.len();
        match failed.into_iter().next() {
            None => Ok(()),
            Some(only) if count == 1 => Err(only),
            Some(first) => Err(StudyError::refused(
                format!("{count} of {} figures are missing: {first}", drawn.len()),
                "the report has all figures in it, if it could be written",
            )),
        }
    }

    /// The report of a study that was stopped before its page could be made: `how`, the parts, and which of
    /// them are done.
    ///
    /// # Errors
    /// [`StudyError::Report`] if the page cannot be made.
    pub fn stopped_page(
        title: &str,
        how: &str,
        parts: &[(String, bool)],
    ) -> Result<String, StudyError> {
        let parts: Vec<_> = parts
            .iter()
            .map(|(name, done)| context! { name => name, done => done })
            .collect();
        let values = context! {
            title => title,
            stopped => how,
            parts => parts,
            version => env!("CARGO_PKG_VERSION"),
        };
        Ok(page(include_str!("stopped.html"), values)?)
    }

    /// Writes the results of a study and releases the folder. The most valuable files go first in case room
    /// is short: the summary, then those of `rest`, then the page that it returns, then the figures. A file
    /// that cannot be written is named in [`Finished::unwritten`], leaves no part of itself behind, and does
    /// not affect the others.
    pub fn finish<T>(
        self,
        result: T,
        summary: String,
        stopped: Option<Stopped>,
        rest: impl FnOnce(&Self, &T) -> (Result<String, StudyError>, Vec<Drawn>),
    ) -> Finished<T> {
        let saved = self.keep(self.save(SUMMARY, &summary));
        let (page, drawn) = rest(&self, &result);
        self.keep(page.and_then(|page| self.save(REPORT, &page)));
        if !drawn.is_empty() {
            self.keep(self.save_figures(&drawn));
        }
        // It is missing if the folder was removed meanwhile; there is no report without it.
        if saved.is_some_and(|path| !path.exists()) {
            self.keep(self.save(SUMMARY, &summary));
        }
        self.end(result, summary, stopped)
    }

    /// Releases the folder.
    pub fn end<T>(self, result: T, summary: String, stopped: Option<Stopped>) -> Finished<T> {
        self.progress.clear();
        let unwritten = std::mem::take(&mut *self.unwritten());
        Finished {
            result,
            summary,
            report: self.folder().join(REPORT),
            stopped,
            unwritten,
        }
    }
}
