//! The folder of a run's results.
//!
//! New results never mix with old ones: what an earlier run left in the folder
//! is set aside in `previous`, where the results of one run are kept. Files
//! that are no results of ours stay untouched.

use std::path::Path;

use crate::SimError;

/// Everything that a run writes.
const RESULTS: [&str; 5] = ["log.mcap", "summary.json", "report.html", "csv", "figures"];
/// Where the results of the run before stay.
const PREVIOUS: &str = "previous";

/// Creates the folder, or sets aside the results in it.
///
/// # Errors
/// [`SimError::Output`] if a folder cannot be created or a result not moved.
pub(crate) fn prepare(folder: &Path) -> Result<(), SimError> {
    std::fs::create_dir_all(folder)
        .map_err(|e| SimError::output("create the folder", folder, e))?;
    let old = RESULTS.map(|name| folder.join(name));
    if !old.iter().any(|path| path.exists()) {
        return Ok(());
    }
    let previous = folder.join(PREVIOUS);
    std::fs::create_dir_all(&previous)
        .map_err(|e| SimError::output("create the folder", &previous, e))?;
    for name in RESULTS {
        remove(&previous.join(name))?;
    }
    for (name, path) in RESULTS.iter().zip(&old) {
        if path.exists() {
            std::fs::rename(path, previous.join(name))
                .map_err(|e| SimError::output("set aside", path, e))?;
        }
    }
    eprintln!(
        "earlier results in {} moved to {}",
        folder.display(),
        previous.display()
    );
    Ok(())
}

fn remove(path: &Path) -> Result<(), SimError> {
    let removed = if path.is_dir() {
        std::fs::remove_dir_all(path)
    } else if path.exists() {
        std::fs::remove_file(path)
    } else {
        return Ok(());
    };
    removed.map_err(|e| SimError::output("remove", path, e))
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
        };
        run(1, "event.png");
        fs::write(folder.join("notes.txt"), "mine").expect("written");
        prepare(&folder).expect("set aside");
        let previous = folder.join("previous");
        assert!(!folder.join("log.mcap").exists() && !folder.join("figures").exists());
        assert_eq!(fs::read(previous.join("log.mcap")).expect("kept"), [1]);
        assert!(previous.join("figures/event.png").exists());
        assert!(folder.join("notes.txt").exists());

        // One run is kept, whole: nothing of the first one is left beside the second.
        run(2, "other.png");
        prepare(&folder).expect("set aside");
        assert_eq!(fs::read(previous.join("log.mcap")).expect("kept"), [2]);
        assert!(previous.join("figures/other.png").exists());
        assert!(!previous.join("figures/event.png").exists());
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
