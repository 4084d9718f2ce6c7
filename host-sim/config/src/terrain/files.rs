//! Data files that a scenario names.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Largest data file, bytes.
const LARGEST: u64 = 512 << 20;

/// Where a scenario's data files are.
pub(crate) enum Files {
    /// Paths count from this folder.
    Below(PathBuf),
    /// They are part of the program: names and contents.
    BuiltIn(&'static [(&'static str, &'static [u8])]),
}

impl Files {
    /// Those of a scenario file with this path.
    pub(crate) fn beside(scenario: &str) -> Self {
        Self::Below(Path::new(scenario).with_file_name(""))
    }

    /// The content of a file.
    ///
    /// # Errors
    /// In words: there is none, it is no file, it is too large, it cannot be read.
    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        let folder = match self {
            Self::BuiltIn(all) => {
                let data = all.iter().find(|(n, _)| *n == name);
                let found = data.map(|(_, bytes)| bytes.to_vec());
                return found.ok_or_else(|| "no such file is built in".to_owned());
            }
            Self::Below(folder) => folder,
        };
        let path = folder.join(name);
        let reason = |what: &dyn std::fmt::Display| format!("{}: {what}", path.display());
        let about = std::fs::metadata(&path).map_err(|e| reason(&e))?;
        if !about.is_file() {
            return Err(reason(&"not a file"));
        }
        if about.len() > LARGEST {
            let size = about.len() >> 20;
            let most = LARGEST >> 20;
            return Err(reason(&format!("{size} MiB; allowed are {most} MiB")));
        }
        let mut bytes = Vec::new();
        let file = File::open(&path).map_err(|e| reason(&e))?;
        let read = file.take(LARGEST).read_to_end(&mut bytes);
        read.map_err(|e| reason(&e))?;
        Ok(bytes)
    }
}
