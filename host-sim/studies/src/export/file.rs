//! One exported file; an existing one in its place is kept.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::StudyError;
use wheeleg_report::output::{ensure_no_input, free_place, is_there};

/// `FILE.previous`, or the first of `FILE.previous-2`, … that does not exist.
fn free_place_beside(path: &Path) -> PathBuf {
    free_place(|previous| {
        let mut name = path.as_os_str().to_owned();
        name.push(".");
        name.push(previous);
        PathBuf::from(name)
    })
}

/// Writes a file. An existing one with other contents is set aside first, like the results of a run, unless
/// it is one that the command `reads`; a missing folder is created.
///
/// # Errors
/// [`StudyError::Report`] with the path, and the operating system's reason or the input.
pub fn write_new(
    path: &Path,
    content: impl AsRef<[u8]>,
    reads: &[&Path],
) -> Result<(), StudyError> {
    ensure_no_input(path, reads)?;
    let content = content.as_ref();
    // A device may have no end and a pipe no writer: read only regular files.
    if path.is_file() && std::fs::read(path).is_ok_and(|old| old == content) {
        return Ok(());
    }
    if is_device(path) {
        return std::fs::write(path, content)
            .map_err(|e| StudyError::output("write the file", path, e));
    }
    make_room(path, reads)?;
    std::fs::write(path, content).map_err(|e| {
        // A part of a file would be taken for the whole.
        let _ = std::fs::remove_file(path);
        StudyError::output("write the file", path, e)
    })
}

/// Whether the path is written to directly: a device, or the pipe behind the name of standard output. A named
/// pipe may have no reader, and opening it would block.
fn is_device(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let about = std::fs::symlink_metadata(path);
        if about.is_ok_and(|about| about.file_type().is_fifo()) {
            return false;
        }
    }
    path.exists() && !path.is_file() && !path.is_dir()
}

/// Makes room for a file: one of the same name is set aside, a missing folder is created.
///
/// # Errors
/// [`StudyError::Report`] with the path if it is a folder, a device or one of the files that the command
/// `reads`, or cannot be moved or made.
pub fn make_room(path: &Path, reads: &[&Path]) -> Result<(), StudyError> {
    ensure_no_input(path, reads)?;
    let kind = match std::fs::metadata(path) {
        Err(_) if !is_there(path) => None,
        Ok(about) if about.is_dir() => Some(std::io::ErrorKind::IsADirectory.into()),
        Ok(about) if !about.is_file() => Some(std::io::Error::other("it is not a file")),
        // A file, or a link that leads nowhere.
        Ok(_) | Err(_) => {
            let previous = free_place_beside(path);
            std::fs::rename(path, &previous)
                .map_err(|e| StudyError::output("set aside", path, e))?;
            let told = format!("earlier {} moved to {}", path.display(), previous.display());
            // Standard error may be closed or full.
            let _ = writeln!(std::io::stderr(), "{told}");
            return Ok(());
        }
    };
    if let Some(reason) = kind {
        return Err(StudyError::output("write the file", path, reason));
    }
    match path.parent().filter(|f| !f.as_os_str().is_empty()) {
        Some(folder) => std::fs::create_dir_all(folder)
            .map_err(|e| StudyError::output("create the folder", folder, e)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn nothing_is_overwritten_and_the_same_text_is_no_change() {
        let temporary = tempfile::tempdir().expect("temporary folder");
        let path = temporary.path().join("a/robot.urdf");
        let previous = |n: &str| temporary.path().join(format!("a/robot.urdf.previous{n}"));
        write_new(&path, "one", &[]).expect("written");
        write_new(&path, "one", &[]).expect("unchanged");
        assert!(!previous("").exists());
        write_new(&path, "two", &[]).expect("written");
        write_new(&path, "three", &[]).expect("written");
        assert_eq!(fs::read_to_string(&path).expect("new"), "three");
        assert_eq!(fs::read_to_string(previous("")).expect("kept"), "one");
        assert_eq!(fs::read_to_string(previous("-2")).expect("kept"), "two");
        let refused = write_new(&path, "four", &[&path]).expect_err("an input");
        assert!(refused.to_string().contains("is an input"), "{refused}");
        assert_eq!(fs::read_to_string(&path).expect("stays"), "three");
        #[cfg(target_os = "linux")]
        {
            write_new(Path::new("/dev/null"), "x", &[]).expect("a device takes it");
            let full = write_new(Path::new("/dev/full"), "x", &[]).expect_err("full");
            assert!(full.to_string().contains("/dev/full"), "{full}");
            let pipe = temporary.path().join("pipe");
            let made = std::process::Command::new("mkfifo").arg(&pipe).status();
            assert!(made.expect("mkfifo").success());
            let refused = write_new(&pipe, "x", &[]).expect_err("nobody reads it");
            assert!(refused.to_string().contains("not a file"), "{refused}");
            assert!(Path::new("/dev/full").exists() && !Path::new("/dev/null.previous").exists());
        }
        #[cfg(unix)]
        {
            let [link, foreign] = ["link", "foreign"].map(|name| temporary.path().join(name));
            std::os::unix::fs::symlink(&foreign, &link).expect("a link that leads nowhere");
            write_new(&link, "x", &[]).expect("written");
            assert!(link.symlink_metadata().expect("a file").is_file());
            assert!(is_there(&temporary.path().join("link.previous")) && !is_there(&foreign));
        }
        let error = write_new(temporary.path(), "x", &[]).expect_err("a folder");
        assert!(error.to_string().contains("cannot write"), "{error}");
    }
}
