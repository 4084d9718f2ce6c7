//! The folder that an export fills: a new one, which appears once it is complete.

use std::fs;
use std::path::{Path, PathBuf};

use wheeleg_report::results::LOG;

use crate::StudyError;

/// The log of a run: `run` is its folder, or the log itself.
#[must_use]
pub fn log_of(run: &Path) -> PathBuf {
    if run.is_dir() {
        run.join(LOG)
    } else {
        run.to_path_buf()
    }
}

/// A folder that is filled beside its final place. An unfinished one leaves nothing.
pub(super) struct Filling {
    beside: PathBuf,
    place: PathBuf,
    done: bool,
}

impl Filling {
    /// Begins to fill `place`.
    ///
    /// # Errors
    /// [`StudyError::Refused`] if it exists, [`StudyError::Report`] if it cannot be made.
    pub(super) fn begin(place: &Path) -> Result<Self, StudyError> {
        if place.exists() {
            return Err(StudyError::refused(
                format!("`{}` is there already", place.display()),
                "choose another folder with --out DIR, or move this one away",
            ));
        }
        let name = place.file_name().unwrap_or_default().to_string_lossy();
        let beside = place.with_file_name(format!(".{name}.{}.part", std::process::id()));
        let failed = |e| StudyError::output("create the folder", place, e);
        fs::create_dir_all(&beside).map_err(failed)?;
        Ok(Self {
            beside,
            place: place.to_path_buf(),
            done: false,
        })
    }

    /// Temporary path of a file in it.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.beside.join(name)
    }

    /// Final path of that file, as the user knows it.
    pub(super) fn shown(&self, name: &str) -> PathBuf {
        self.place.join(name)
    }

    /// Puts the folder in its place.
    ///
    /// # Errors
    /// [`StudyError::Report`] if the operating system fails to.
    pub(super) fn finish(mut self) -> Result<(), StudyError> {
        let moved = fs::rename(&self.beside, &self.place);
        moved.map_err(|e| StudyError::output("put in its place", &self.place, e))?;
        self.done = true;
        Ok(())
    }
}

impl Drop for Filling {
    fn drop(&mut self) {
        if !self.done {
            let _ = fs::remove_dir_all(&self.beside);
        }
    }
}
