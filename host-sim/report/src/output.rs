//! The folder of a run's results.
//!
//! New results never mix with old ones: what stands where they go is set aside
//! in `previous`, or `previous-2` and so on where that is taken. Nothing is
//! deleted, and files with other names stay untouched.

use std::path::{Path, PathBuf};

use crate::ReportError;

/// Everything that a run writes.
const RESULTS: [&str; 6] = [
    "log.mcap",
    "summary.json",
    "report.html",
    "csv",
    "figures",
    NATIVE,
];
/// Folder below of the native run that a run was compared with (`--compare-sil`).
pub const NATIVE: &str = "sil";
/// Where the results of the run before stay.
const PREVIOUS: &str = "previous";

/// The first of `previous`, `previous-2`, … that does not exist.
fn free_place(folder: &Path) -> PathBuf {
    let numbered = (2_u32..).map(|n| format!("{PREVIOUS}-{n}"));
    std::iter::once(PREVIOUS.to_owned())
        .chain(numbered)
        .map(|name| folder.join(name))
        .find(|place| !place.exists())
        .unwrap_or_else(|| folder.join(PREVIOUS))
}

/// Creates the folder, or sets aside the results in it.
///
/// # Errors
/// [`ReportError::Output`] if a folder cannot be created or a result not moved.
pub fn prepare(folder: &Path) -> Result<(), ReportError> {
    std::fs::create_dir_all(folder)
        .map_err(|e| ReportError::output("create the folder", folder, e))?;
    let old = RESULTS.map(|name| folder.join(name));
    if !old.iter().any(|path| path.exists()) {
        return Ok(());
    }
    let previous = free_place(folder);
    std::fs::create_dir_all(&previous)
        .map_err(|e| ReportError::output("create the folder", &previous, e))?;
    for (name, path) in RESULTS.iter().zip(&old) {
        if path.exists() {
            std::fs::rename(path, previous.join(name))
                .map_err(|e| ReportError::output("set aside", path, e))?;
        }
    }
    eprintln!(
        "earlier results in {} moved to {}",
        folder.display(),
        previous.display()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn results_of_two_runs_never_mix_and_other_files_stay() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("a/b");
        prepare(&folder).expect("created");
        assert!(folder.is_dir() && !folder.join("previous").exists());

        let run = |n: u8, figure: &str| {
            fs::create_dir_all(folder.join("figures")).expect("created");
            fs::write(folder.join("figures").join(figure), [n]).expect("written");
            fs::write(folder.join("log.mcap"), [n]).expect("written");
            fs::create_dir_all(folder.join(NATIVE)).expect("created");
            fs::write(folder.join(NATIVE).join("log.mcap"), [n]).expect("written");
        };
        run(1, "event.png");
        fs::write(folder.join("notes.txt"), "mine").expect("written");
        prepare(&folder).expect("set aside");
        let previous = folder.join("previous");
        assert!(!folder.join("log.mcap").exists() && !folder.join("figures").exists());
        assert_eq!(fs::read(previous.join("log.mcap")).expect("kept"), [1]);
        assert!(previous.join("figures/event.png").exists());
        assert!(folder.join("notes.txt").exists());

        // Every run is kept, each in a place of its own.
        run(2, "other.png");
        prepare(&folder).expect("set aside");
        let second = folder.join("previous-2");
        assert_eq!(fs::read(previous.join("log.mcap")).expect("kept"), [1]);
        assert_eq!(fs::read(second.join("log.mcap")).expect("kept"), [2]);
        assert!(second.join("figures/other.png").exists());
        assert!(!second.join("figures/event.png").exists());
        // A comparison stays with the run that it belongs to.
        assert!(!folder.join(NATIVE).exists());
        assert_eq!(fs::read(second.join("sil/log.mcap")).expect("kept"), [2]);
    }

    #[test]
    fn a_file_in_the_place_of_the_folder_is_an_error_with_its_path() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let file = temporary.path().join("taken");
        fs::write(&file, "x").expect("written");
        let error = prepare(&file).expect_err("not a folder");
        assert!(error.to_string().contains("taken"), "{error}");
    }
}
