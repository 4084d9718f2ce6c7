//! Data files named in a scenario.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml_edit::{Document, TableLike};

use crate::open_file;

/// Largest data file, bytes.
const LARGEST: u64 = 512 << 20;

/// Location of a scenario's data files.
pub(crate) enum Files<'a> {
    /// Paths count from this folder.
    Below(PathBuf),
    /// They are part of the program: names and contents.
    BuiltIn(&'static [(&'static str, &'static [u8])]),
    /// A plan holds them, by their names in its scenario.
    Held(&'a BTreeMap<String, Data>),
}

/// The content of a data file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Data(pub Vec<u8>);

impl Data {
    /// BLAKE3 of it, in hexadecimal digits.
    #[must_use]
    pub fn digest(&self) -> String {
        blake3::hash(&self.0).to_hex().to_string()
    }
}

/// Hexadecimal digits: JSON has no bytes.
impl Serialize for Data {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut digits = String::with_capacity(2 * self.0.len());
        for byte in &self.0 {
            // Writing into a text cannot fail.
            let _ = write!(digits, "{byte:02x}");
        }
        serializer.serialize_str(&digits)
    }
}

impl<'de> Deserialize<'de> for Data {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let digits = String::deserialize(deserializer)?;
        let byte = |pair: &[u8]| {
            let [high, low] = [pair.first(), pair.get(1)]
                .map(|digit| digit.and_then(|digit| char::from(*digit).to_digit(16)));
            u8::try_from(16 * high? + low?).ok()
        };
        let bytes: Option<Vec<u8>> = digits.as_bytes().chunks(2).map(byte).collect();
        bytes
            .map(Self)
            .ok_or_else(|| serde::de::Error::custom("a data file is not in hexadecimal digits"))
    }
}

impl Files<'_> {
    /// The data files of a scenario file with this path.
    pub(crate) fn beside(scenario: &str) -> Self {
        Self::Below(Path::new(scenario).with_file_name(""))
    }

    /// The content of a file.
    ///
    /// # Errors
    /// In words: there is none, it is not a file, it is too large, it cannot be read.
    pub(crate) fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        let folder = match self {
            Self::BuiltIn(all) => {
                let data = all.iter().find(|(n, _)| *n == name);
                let found = data.map(|(_, bytes)| bytes.to_vec());
                return found.ok_or_else(|| "no such file is built in".to_owned());
            }
            Self::Held(all) => {
                let data = all.get(name).map(|data| data.0.clone());
                return data.ok_or_else(|| "the plan does not hold this file".to_owned());
            }
            Self::Below(folder) => folder,
        };
        let path = folder.join(name);
        let reason = |what: &dyn std::fmt::Display| format!("{}: {what}", path.display());
        let file = open_file(&path).map_err(|e| reason(&e))?;
        let about = file.metadata().map_err(|e| reason(&e))?;
        if about.len() > LARGEST {
            let size = about.len() >> 20;
            let most = LARGEST >> 20;
            return Err(reason(&format!("{size} MiB; allowed are {most} MiB")));
        }
        let mut bytes = Vec::new();
        let read = file.take(LARGEST).read_to_end(&mut bytes);
        read.map_err(|e| reason(&e))?;
        Ok(bytes)
    }
}

/// The data files for the ground of a scenario.
pub(crate) fn named_files(text: &str) -> Vec<String> {
    let Ok(document) = Document::parse(text) else {
        return Vec::new();
    };
    let Some(terrain) = document.get("terrain") else {
        return Vec::new();
    };
    let file = |part: &dyn TableLike| Some(part.get("file")?.as_str()?.to_owned());
    match (terrain.as_array_of_tables(), terrain.as_array()) {
        (Some(parts), _) => parts.iter().filter_map(|part| file(part)).collect(),
        (None, Some(parts)) => {
            let tables = parts.iter().filter_map(|part| part.as_inline_table());
            tables.filter_map(|part| file(part)).collect()
        }
        _ => Vec::new(),
    }
}
