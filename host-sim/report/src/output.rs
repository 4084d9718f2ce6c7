//! The folder of a run's results.
//!
//! New results never mix with old ones: existing results in their place are set aside in `previous`, or
//! `previous-2` and so on if that is taken. Nothing is deleted, and files with other names stay untouched.
//!
//! A run that ends without a result leaves nothing: the folder that it made is removed, and the results that
//! it set aside come back.
//!
//! A run holds its folder ([`Folder`]) until it is done, so that a second run at the same time cannot move
//! its results away. It uses the operating system's lock, on the file `.lock`: the lock ends with the
//! process, however that ends.

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use crate::{ReportError, results};

/// The file that a run holds while it writes into a folder.
const LOCK: &str = ".lock";
/// Where earlier results are kept.
const PREVIOUS: &str = "previous";

/// All results of a kind of run that also writes `also`.
fn results(also: &'static [&'static str]) -> impl Iterator<Item = &'static str> {
    results::ALL.into_iter().chain(also.iter().copied())
}

/// The result that would overwrite a file in a folder, or the folder of that file: a run that reads the file
/// may not write there.
fn result_in_place_of(
    file: &Path,
    folder: &Path,
    also: &'static [&'static str],
) -> Option<&'static str> {
    let file = file.canonicalize().ok()?;
    results(also).find(|name| {
        let result = folder.join(name).canonicalize();
        result.is_ok_and(|result| file.starts_with(result))
    })
}

/// Whether two paths lead to the same existing file.
#[must_use]
pub fn same_file(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().ok();
    real(one).is_some_and(|one| real(other) == Some(one))
}

/// Refuses an output file that is one of the inputs.
///
/// # Errors
/// [`ReportError::InPlaceOfInput`] with both paths.
pub fn ensure_no_input(out: &Path, reads: &[&Path]) -> Result<(), ReportError> {
    match reads.iter().find(|input| same_file(input, out)) {
        None => Ok(()),
        Some(input) => Err(ReportError::InPlaceOfInput {
            input: input.to_path_buf(),
            result: out.to_owned(),
        }),
    }
}

/// Whether something is at this path, even a link that leads nowhere: output written to it would go to
/// wherever it leads.
#[must_use]
pub fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// The first of `previous`, `previous-2`, … whose `place` is free.
#[must_use]
pub fn free_place(place: impl Fn(&str) -> PathBuf) -> PathBuf {
    let numbered = (2_u32..).map(|n| format!("{PREVIOUS}-{n}"));
    std::iter::once(PREVIOUS.to_owned())
        .chain(numbered)
        .map(|name| place(&name))
        .find(|place| !is_there(place))
        .unwrap_or_else(|| place(PREVIOUS))
}

/// The folder for the results of a running command. Nobody else gets it until this is dropped.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Names of results in addition to those of every run.
    also: &'static [&'static str],
    /// Folders that it created, the innermost first.
    made: Vec<PathBuf>,
    /// Where the earlier results went.
    previous: Option<PathBuf>,
    /// Locked while it is open.
    _lock: File,
}

impl Folder {
    /// Creates the folder, or sets aside the results in it, and holds it. `also` are names of results that
    /// only this kind of run has, `reads` its input files: they stay where they are.
    ///
    /// # Errors
    /// [`ReportError::InPlaceOfInput`] if a result would overwrite such a file, [`ReportError::InUse`] if
    /// another run holds the folder, [`ReportError::Output`] if a folder or its lock cannot be created or a
    /// result not moved.
    pub fn prepare(
        path: &Path,
        also: &'static [&'static str],
        reads: &[&Path],
    ) -> Result<Self, ReportError> {
        for input in reads {
            if let Some(result) = result_in_place_of(input, path, also) {
                return Err(ReportError::InPlaceOfInput {
                    input: input.to_path_buf(),
                    result: path.join(result),
                });
            }
        }
        let above = path.ancestors().filter(|p| !p.as_os_str().is_empty());
        let made = above.take_while(|p| !p.exists());
        let made: Vec<PathBuf> = made.map(Path::to_owned).collect();
        let gone = |_: &ReportError| remove_empty(&made);
        std::fs::create_dir_all(path)
            .map_err(|e| ReportError::output("create the folder", path, e))
            .inspect_err(gone)?;
        let lock = lock(&path.join(LOCK)).inspect_err(gone)?;
        let previous = set_aside(path, also)?;
        Ok(Self {
            path: path.to_owned(),
            also,
            made,
            previous,
            _lock: lock,
        })
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    /// A run that has written nothing leaves nothing.
    fn drop(&mut self) {
        if results(self.also).any(|name| is_there(&self.path.join(name))) {
            return;
        }
        if let Some(previous) = &self.previous {
            let all: Vec<&str> = results(self.also).collect();
            bring_back(&self.path, previous, &all);
        } else if !self.made.is_empty() {
            // It is still locked; a process that has opened it meanwhile finds another file in its place.
            let _ = std::fs::remove_file(self.path.join(LOCK));
            remove_empty(&self.made);
        }
    }
}

/// Removes empty folders, the innermost first.
fn remove_empty(folders: &[PathBuf]) {
    for folder in folders {
        // A folder with contents stays.
        let _ = std::fs::remove_dir(folder);
    }
}

/// Start of the text in a lock file.
const HOLDER: &str = "process ";

/// Opens the lock file, locks it and writes its holder into it, for the message to others.
fn lock(path: &Path) -> Result<File, ReportError> {
    let failed = |e: std::io::Error| ReportError::output("lock", path, e);
    let foreign = |what: &str| {
        failed(std::io::Error::other(format!(
            "{what}: move it away, or choose another folder"
        )))
    };
    let open = || {
        // A link may lead to another user's file, and opening a pipe would block.
        if let Ok(about) = std::fs::symlink_metadata(path)
            && !about.is_file()
        {
            let what = if about.is_symlink() {
                "a link"
            } else {
                "no file"
            };
            return Err(foreign(&format!("it is {what}")));
        }
        let mut options = OpenOptions::new();
        options.create(true).truncate(false).read(true).write(true);
        options.open(path).map_err(failed)
    };
    let mut file = open()?;
    loop {
        if !take(&file).map_err(failed)? {
            return Err(ReportError::InUse {
                folder: path.parent().unwrap_or(path).to_owned(),
                lock: path.to_owned(),
                holder: holder(&mut file),
            });
        }
        // A run without results may have removed it in between.
        if is_at(&file, path) {
            break;
        }
        file = open()?;
    }
    let mut text = Vec::new();
    let longest = HOLDER.len() as u64 + 21;
    std::io::Read::by_ref(&mut file)
        .take(longest)
        .read_to_end(&mut text)
        .map_err(failed)?;
    if !text.is_empty() && !text.starts_with(HOLDER.as_bytes()) {
        return Err(foreign("it is not a lock of this program"));
    }
    // Written in any case: the time of the file is the start of the run.
    file.set_len(0).map_err(failed)?;
    file.rewind().map_err(failed)?;
    writeln!(file, "{HOLDER}{}", std::process::id()).map_err(failed)?;
    Ok(file)
}

/// The holder of a lock, and for how long, in words.
fn holder(lock: &mut File) -> String {
    let mut text = String::new();
    let name = match lock.read_to_string(&mut text) {
        Ok(_) if !text.trim().is_empty() => text.trim(),
        _ => "another run",
    };
    let since = lock.metadata().and_then(|m| m.modified());
    match since.map(|since| since.elapsed()) {
        Ok(Ok(time)) => format!("{name}, for {} s", time.as_secs()),
        _ => name.to_owned(),
    }
}

/// Locks a file for this process only; false if another holds it.
#[cfg(unix)]
fn take(file: &File) -> std::io::Result<bool> {
    use rustix::fs::{FlockOperation, flock};
    use rustix::io::Errno;
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        // A file system without locks is written to without one.
        Ok(()) | Err(Errno::NOTSUP | Errno::NOLCK | Errno::NOSYS) => Ok(true),
        Err(Errno::WOULDBLOCK) => Ok(false),
        Err(e) => Err(e.into()),
    }
}

/// Whether an open file is the one that a path leads to.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number = |m: std::fs::Metadata| (m.dev(), m.ino());
    let there = std::fs::metadata(path).map(number);
    there.is_ok_and(|there| file.metadata().map(number).is_ok_and(|own| own == there))
}

/// Without a lock nobody removes it.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Only Unix has the lock that this program uses.
#[cfg(not(unix))]
fn take(_: &File) -> std::io::Result<bool> {
    Ok(true)
}

/// Moves results back from where they were set aside; missing ones are skipped.
fn bring_back(folder: &Path, previous: &Path, names: &[&str]) {
    for name in names {
        let _ = std::fs::rename(previous.join(name), folder.join(name));
    }
    let _ = std::fs::remove_dir(previous);
}

/// Moves the results in a folder to the next free `previous`, if there are any; returns their place.
fn set_aside(folder: &Path, also: &'static [&'static str]) -> Result<Option<PathBuf>, ReportError> {
    let old: Vec<&str> = results(also)
        .filter(|name| is_there(&folder.join(name)))
        .collect();
    if old.is_empty() {
        return Ok(None);
    }
    let previous = free_place(|name| folder.join(name));
    std::fs::create_dir_all(&previous)
        .map_err(|e| ReportError::output("create the folder", &previous, e))?;
    for (moved, name) in old.iter().enumerate() {
        let path = folder.join(name);
        if let Err(e) = std::fs::rename(&path, previous.join(name)) {
            // Results of one run stay in one folder.
            bring_back(folder, &previous, &old[..moved]);
            return Err(ReportError::output("set aside", &path, e));
        }
    }
    // Standard error may be closed or full.
    let _ = writeln!(
        std::io::stderr(),
        "earlier results in {} moved to {}",
        folder.display(),
        previous.display()
    );
    Ok(Some(previous))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::NATIVE;
    use std::fs;

    #[test]
    fn results_of_two_runs_never_mix_and_other_files_stay() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("a/b");
        // Each run draws its first figure while it holds the folder.
        let prepare = || {
            Folder::prepare(&folder, &[], &[]).map(|_held| {
                fs::create_dir_all(folder.join("figures")).expect("created");
            })
        };
        prepare().expect("created");
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
        prepare().expect("set aside");
        let previous = folder.join("previous");
        assert!(!folder.join("log.mcap").exists());
        assert!(!folder.join("figures/event.png").exists());
        assert_eq!(fs::read(previous.join("log.mcap")).expect("kept"), [1]);
        assert!(previous.join("figures/event.png").exists());
        assert!(folder.join("notes.txt").exists());

        // Every run is kept, each in its own place.
        run(2, "other.png");
        prepare().expect("set aside");
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
        let error = Folder::prepare(&file, &[], &[]).expect_err("not a folder");
        assert!(error.to_string().contains("taken"), "{error}");
    }

    #[test]
    fn a_folder_that_is_held_is_refused_by_name_of_its_lock_and_nothing_is_moved() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path();
        let first = Folder::prepare(folder, &[], &[]).expect("prepared");
        fs::write(folder.join("log.mcap"), "the first's").expect("written");
        let refused = Folder::prepare(folder, &[], &[]).expect_err("held");
        let said = refused.to_string();
        assert!(said.contains(".lock"), "{said}");
        assert!(
            said.contains(&format!("process {}", std::process::id())),
            "{said}"
        );
        assert!(!folder.join("previous").exists());
        // A lock without a holder does not count, whatever the file says.
        drop(first);
        assert!(folder.join(LOCK).exists());
        let _second = Folder::prepare(folder, &[], &[]).expect("free again");
        assert!(folder.join("previous/log.mcap").exists());
    }

    #[test]
    fn a_run_without_a_result_leaves_nothing_and_what_it_set_aside_comes_back() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("runs/a");
        drop(Folder::prepare(&folder, &[], &[]).expect("prepared"));
        assert!(!temporary.path().join("runs").exists());

        // Somebody else's folder stays, with its contents.
        fs::create_dir_all(&folder).expect("created");
        fs::write(folder.join("notes.txt"), "mine").expect("written");
        fs::write(folder.join("summary.json"), "earlier").expect("written");
        let held = Folder::prepare(&folder, &[], &[]).expect("prepared");
        assert!(folder.join("previous/summary.json").exists());
        drop(held);
        let kept = fs::read_to_string(folder.join("summary.json"));
        assert_eq!(kept.expect("it came back"), "earlier");
        assert!(folder.join("notes.txt").exists() && !folder.join("previous").exists());

        // With a result, everything stays where it went.
        let held = Folder::prepare(&folder, &[], &[]).expect("prepared");
        fs::write(folder.join("log.mcap"), "new").expect("written");
        drop(held);
        assert!(folder.join("previous/summary.json").exists());
    }

    /// One that cannot be moved: there is no folder for it in `previous`.
    #[test]
    fn results_that_cannot_all_be_set_aside_stay_together() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path();
        fs::write(folder.join("log.mcap"), "first").expect("written");
        fs::create_dir(folder.join("deep")).expect("created");
        fs::write(folder.join("deep/result"), "first").expect("written");
        let refused = Folder::prepare(folder, &["deep/result"], &[]).expect_err("not moved");
        assert!(refused.to_string().contains("deep/result"), "{refused}");
        for file in ["log.mcap", "deep/result"] {
            assert_eq!(
                fs::read(folder.join(file)).expect("there"),
                b"first",
                "{file}"
            );
        }
        assert!(!folder.join("previous").exists());
    }

    #[test]
    fn what_was_made_of_a_log_goes_with_it_and_so_do_files_of_one_kind_of_run() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path();
        let made = [
            "log.mcap",
            "log.html",
            "log-recovered.mcap",
            "parquet",
            "ros2",
        ];
        for name in made {
            fs::write(folder.join(name), "first").expect("written");
        }
        fs::write(folder.join("axis.toml"), "mine").expect("written");
        // The axis file is a result of another kind of run.
        let held = Folder::prepare(folder, &[], &[]).expect("prepared");
        for name in made {
            assert!(!folder.join(name).exists(), "{name}");
            assert!(folder.join("previous").join(name).exists(), "{name}");
        }
        assert!(folder.join("axis.toml").exists());
        fs::write(folder.join("log.mcap"), "second").expect("written");
        drop(held);
        let _held = Folder::prepare(folder, &["axis.toml"], &[]).expect("prepared");
        assert!(!folder.join("axis.toml").exists());
        let kept = fs::read_to_string(folder.join("previous-2/axis.toml"));
        assert_eq!(kept.expect("kept"), "mine");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_nowhere_is_set_aside_like_a_result() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("got");
        let foreign = temporary.path().join("foreign");
        fs::create_dir(&folder).expect("created");
        let names = ["report.html", "summary.json", "log.mcap"];
        for name in names.iter().chain(&["previous"]) {
            std::os::unix::fs::symlink(&foreign, folder.join(name)).expect("a link");
        }
        let held = Folder::prepare(&folder, &[], &[]).expect("prepared");
        for name in names {
            fs::write(folder.join(name), "new").expect("written");
            assert!(is_there(&folder.join("previous-2").join(name)), "{name}");
        }
        assert!(!is_there(&foreign));
        drop(held);
    }

    #[test]
    fn a_file_in_the_place_of_a_result_is_found_by_any_path_to_it() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let folder = temporary.path().join("out");
        fs::create_dir_all(folder.join("figures")).expect("created");
        for name in ["axis.toml", "figures/mine.toml", "mine.toml"] {
            fs::write(folder.join(name), "mine").expect("written");
        }
        let also: &[&str] = &["axis.toml"];
        let found = |file: &str| result_in_place_of(&folder.join(file), &folder, also);
        assert_eq!(found("axis.toml"), Some("axis.toml"));
        assert_eq!(found("../out/./axis.toml"), Some("axis.toml"));
        assert_eq!(found("figures/mine.toml"), Some("figures"));
        assert_eq!(found("mine.toml"), None);
        assert_eq!(found("none.toml"), None);
        let other = temporary.path().join("other");
        let elsewhere = result_in_place_of(&folder.join("axis.toml"), &other, also);
        assert_eq!(elsewhere, None);
        // A path to such a file gives no folder, and nothing is moved.
        fs::write(folder.join("summary.json"), "earlier").expect("written");
        let input = folder.join("figures/mine.toml");
        let refused = Folder::prepare(&folder, &[], &[Path::new("none"), &input]);
        let said = refused.expect_err("an input").to_string();
        assert!(said.contains("figures/mine.toml` is an input"), "{said}");
        assert!(folder.join("summary.json").exists() && !folder.join("previous").exists());
        let linked = folder.join("linked.toml");
        #[cfg(unix)]
        std::os::unix::fs::symlink(&input, &linked).expect("linked");
        assert!(ensure_no_input(&input, &[&linked]).is_err());
        assert!(ensure_no_input(&folder.join("mine.toml"), &[&input]).is_ok());
    }
}
