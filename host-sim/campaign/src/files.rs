//! Files of a campaign, whoever put them there.

use std::fs::{self, File};
use std::path::Path;

/// Opens a file of a campaign to read it: a pipe may have no writer, a device no end.
pub(crate) fn opened(path: &Path) -> std::io::Result<File> {
    if fs::metadata(path)?.is_file() {
        return File::open(path);
    }
    Err(std::io::Error::other("it is not a file"))
}
