//! Files that may be anybody's.

use std::fs::{self, File};
use std::path::Path;

/// Opens a file to read it, and nothing else: a pipe may have no writer, a device no end.
///
/// # Errors
/// What the operating system says, or that it is not a file.
pub fn open_file(path: &Path) -> std::io::Result<File> {
    if fs::metadata(path)?.is_file() {
        return File::open(path);
    }
    Err(std::io::Error::other("it is not a file"))
}
