//! The two keys of a console: the control key allows driving, the view key looking and stopping. Each is a
//! file that only its owner can read.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use wheeleg_config::open_file;

use crate::error::ConsoleError;
use wheeleg_access::Key;
use wheeleg_access::hex;

/// File of the control key.
pub const CONTROL_FILE: &str = "control.key";
/// File of the view key.
pub const VIEW_FILE: &str = "view.key";

/// Remedy for a server's own files.
const MAKE: &str = "make new keys: wheeleg serve --new-key; clients need them then";
/// Remedy for a client: new keys would lock out all others.
const GIVE: &str = "give the file control.key or view.key; `wheeleg serve` prints their paths";

/// Digits of a key in its file.
const DIGITS: usize = 64;

/// Both keys.
#[derive(Debug, Clone)]
pub struct Keys {
    /// May drive.
    pub control: Key,
    /// May look and stop.
    pub view: Key,
}

impl Keys {
    /// Reads both keys from `folder`, and creates missing files.
    ///
    /// # Errors
    /// [`ConsoleError::Key`] if a file cannot be read or made, others can read it, or it holds no
    /// key.
    pub fn open(folder: &Path) -> Result<Self, ConsoleError> {
        make_folder(folder)?;
        Self::draw()?.put(folder)?;
        let [control, view] =
            [CONTROL_FILE, VIEW_FILE].map(|name| read_or(&folder.join(name), MAKE));
        let (control, view) = (control?, view?);
        if control.to_hex() == view.to_hex() {
            let what = format!("is the same key as {CONTROL_FILE}: who may look could drive");
            return Err(wrong(&folder.join(VIEW_FILE), what, MAKE));
        }
        Ok(Self { control, view })
    }

    /// New keys, not in any file yet.
    ///
    /// # Errors
    /// [`ConsoleError::Other`] if the system has no random numbers.
    pub fn draw() -> Result<Self, ConsoleError> {
        let key = || {
            let mut bytes = [0; 32];
            let drawn = getrandom::fill(&mut bytes).map(|()| Key::new(bytes));
            drawn.map_err(|e| {
                let what = format!("the system has no random numbers for a key: {e}");
                ConsoleError::other(what, "try again later")
            })
        };
        Ok(Self {
            control: key()?,
            view: key()?,
        })
    }

    /// Writes the keys to those files in `folder` that are missing.
    fn put(&self, folder: &Path) -> Result<(), ConsoleError> {
        for (name, key) in [(CONTROL_FILE, &self.control), (VIEW_FILE, &self.view)] {
            let path = folder.join(name);
            match make(&path, key) {
                Err(e) if e.kind() != ErrorKind::AlreadyExists => {
                    return Err(wrong(&path, format!("cannot be created: {e}"), MAKE));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Replaces the keys in `folder`: the old ones no longer open anything.
    ///
    /// # Errors
    /// [`ConsoleError::Key`] if a file cannot be removed or made.
    pub fn replace(&self, folder: &Path) -> Result<(), ConsoleError> {
        make_folder(folder)?;
        for name in [CONTROL_FILE, VIEW_FILE] {
            let path = folder.join(name);
            match fs::remove_file(&path) {
                Err(e) if e.kind() != ErrorKind::NotFound => {
                    return Err(wrong(&path, format!("cannot be removed: {e}"), MAKE));
                }
                _ => {}
            }
        }
        self.put(folder)
    }
}

/// The folder of keys: `$XDG_STATE_HOME/wheeleg`, else `~/.local/state/wheeleg`.
///
/// # Errors
/// [`ConsoleError::Other`] if neither is known.
pub fn folder() -> Result<PathBuf, ConsoleError> {
    let set = |name| std::env::var_os(name).map(PathBuf::from);
    let state = set("XDG_STATE_HOME").filter(|path| path.is_absolute());
    let state = state.or_else(|| Some(set("HOME")?.join(".local/state")));
    let state = state.ok_or_else(|| {
        ConsoleError::other(
            "there is no place for the keys: neither XDG_STATE_HOME nor HOME is set",
            "set one of them",
        )
    })?;
    Ok(state.join("wheeleg"))
}

/// Reads the key of a client.
///
/// # Errors
/// [`ConsoleError::Key`] if the file cannot be read, others can read it, or it holds no key.
pub fn read(path: &Path) -> Result<Key, ConsoleError> {
    read_or(path, GIVE)
}

/// The same; `help`: remedy for a file that is not a key.
fn read_or(path: &Path, help: &str) -> Result<Key, ConsoleError> {
    let cannot = |e: std::io::Error| wrong(path, format!("cannot be read: {e}"), help);
    let file = owners_alone(path, help)?;
    let mut text = String::new();
    file.take(DIGITS as u64 + 3)
        .read_to_string(&mut text)
        .map_err(cannot)?;
    let key = hex::decode(text.trim_end());
    match key {
        None => Err(wrong(
            path,
            format!("is not a key: a key is {DIGITS} hexadecimal digits"),
            help,
        )),
        Some(bytes) if bytes == [0; 32] => {
            let what = "is not a key: it is all zeros".to_owned();
            Err(wrong(path, what, help))
        }
        Some(bytes) => Ok(Key::new(bytes)),
    }
}

/// Opens a file that only its owner can read; `help`: remedy if it cannot be read.
///
/// # Errors
/// [`ConsoleError::Key`] if it cannot be read, or others can read it.
pub(crate) fn owners_alone(path: &Path, help: &str) -> Result<File, ConsoleError> {
    let cannot = |e: std::io::Error| wrong(path, format!("cannot be read: {e}"), help);
    // Do not change the permissions of a device or a folder, or wait for the writer of a pipe.
    let file = open_file(path).map_err(cannot)?;
    match open_to_others(&file).map_err(cannot)? {
        None => Ok(file),
        Some(mode) => Err(wrong(
            path,
            format!("others can read this key (mode {mode:o})"),
            &format!(
                "chmod 600 {}; if somebody may have read it, make new keys: wheeleg serve --new-key",
                path.display()
            ),
        )),
    }
}

fn wrong(path: &Path, what: String, help: &str) -> ConsoleError {
    ConsoleError::Key {
        path: path.to_owned(),
        what,
        help: help.to_owned(),
    }
}

fn make_folder(folder: &Path) -> Result<(), ConsoleError> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder
        .create(folder)
        .map_err(|e| wrong(folder, format!("cannot be created: {e}"), MAKE))?;
    match open_to_writers(folder) {
        None => Ok(()),
        Some(mode) => Err(wrong(
            folder,
            format!("others can write to this folder, and change its keys (mode {mode:o})"),
            &format!(
                "chmod 700 {}; then make new keys: wheeleg serve --new-key",
                folder.display()
            ),
        )),
    }
}

fn make(path: &Path, key: &Key) -> std::io::Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(path)?;
    writeln!(file, "{}", key.to_hex())
}

/// Permissions of a file that others besides its owner may open.
#[cfg(unix)]
fn open_to_others(file: &File) -> std::io::Result<Option<u32>> {
    use std::os::unix::fs::PermissionsExt as _;
    let mode = file.metadata()?.permissions().mode() & 0o777;
    Ok((mode & 0o077 != 0).then_some(mode))
}

/// Permissions of a folder that others besides its owner may write to.
#[cfg(unix)]
fn open_to_writers(folder: &Path) -> Option<u32> {
    use std::os::unix::fs::PermissionsExt as _;
    let mode = fs::metadata(folder).ok()?.permissions().mode() & 0o777;
    (mode & 0o022 != 0).then_some(mode)
}

/// As below.
#[cfg(not(unix))]
fn open_to_writers(_folder: &Path) -> Option<u32> {
    None
}

/// Where files have no such permissions, the user's folder protects them.
#[cfg(not(unix))]
fn open_to_others(_file: &File) -> std::io::Result<Option<u32>> {
    Ok(None)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn keys_are_made_once_for_their_owner_and_stay() {
        let home = tempfile::tempdir().expect("a folder");
        let folder = home.path().join("state/wheeleg");
        let first = Keys::open(&folder).expect("made");
        let again = Keys::open(&folder).expect("read");
        assert_eq!(first.control.to_hex(), again.control.to_hex());
        assert_ne!(first.control.to_hex(), first.view.to_hex());
        let mode = fs::metadata(folder.join(VIEW_FILE)).expect("there");
        assert_eq!(mode.permissions().mode() & 0o777, 0o600);
        let drawn = Keys::draw().expect("drawn");
        assert_ne!(first.control.to_hex(), drawn.control.to_hex());
        drawn.replace(&folder).expect("made");
        let renewed = Keys::open(&folder).expect("read");
        assert_eq!(drawn.control.to_hex(), renewed.control.to_hex());
    }

    #[test]
    fn keys_that_are_equal_or_that_others_could_change_are_refused() {
        let home = tempfile::tempdir().expect("a folder");
        let [control, view] = [CONTROL_FILE, VIEW_FILE].map(|name| home.path().join(name));
        Keys::open(home.path()).expect("made");
        let open_to = |mode| {
            let mode = fs::Permissions::from_mode(mode);
            fs::set_permissions(home.path(), mode).expect("set");
            Keys::open(home.path()).map_err(|error| error.to_string())
        };
        assert!(open_to(0o755).is_ok());
        for mode in [0o777, 0o770, 0o722] {
            let error = open_to(mode).expect_err("refused");
            assert!(error.contains("others can write"), "{error}");
        }
        fs::copy(view, control).expect("copied");
        let error = open_to(0o700).expect_err("refused");
        assert!(error.contains("the same key"), "{error}");
    }

    #[test]
    fn short_zero_half_and_open_keys_are_refused() {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join(CONTROL_FILE);
        for (text, word) in [
            ("", "not a key"),
            ("12", "not a key"),
            (&"0".repeat(64), "zero"),
            (&"a".repeat(63), "not a key"),
            (&"a".repeat(66), "not a key"),
        ] {
            fs::write(&path, text).expect("written");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("set");
            let error = read(&path).expect_err("refused");
            assert!(error.to_string().contains(word), "{error}");
            assert!(!error.to_string().contains("aaaa"), "{error}");
            // Only the server makes new keys: everybody else's would no longer work.
            let help = |error: &ConsoleError| match error {
                ConsoleError::Key { help, .. } => help.clone(),
                other => panic!("{other}"),
            };
            assert!(!help(&error).contains("new"), "{error:?}");
            let error = Keys::open(home.path()).expect_err("refused");
            assert!(help(&error).contains("--new-key"), "{error:?}");
        }
        fs::write(&path, "a".repeat(64)).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).expect("set");
        let error = Keys::open(home.path()).expect_err("refused");
        assert!(error.to_string().contains("others can read"), "{error}");
        // A pipe without a writer is not waited for.
        let pipe = home.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("mkfifo").success());
        let error = read(&pipe).expect_err("refused");
        assert!(error.to_string().contains("not a file"), "{error}");
    }
}
