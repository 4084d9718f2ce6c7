//! Reads which image an ELF file holds, and checks that it is the wanted one.

use std::fmt;
use std::format;
use std::path::{Path, PathBuf};
use std::string::{String, ToString as _};
use std::vec::Vec;

use object::read::elf::ElfFile32;
use object::{Object as _, ObjectSection as _};
use wheeleg_identity::SECTION;
pub use wheeleg_identity::{Digest, Identity, Kind};

use crate::LINK_VERSION;

/// An image that is not the wanted one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongImage {
    /// The file.
    pub path: PathBuf,
    /// Its description.
    pub what: String,
    /// The wanted one.
    pub wanted: String,
    /// How to build the wanted one.
    pub build: &'static str,
}

impl fmt::Display for WrongImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        write!(f, "{path} {}; wanted is {}", self.what, self.wanted)
    }
}

/// Reads the record of the image at `path`, which must be one of `kinds`, built with
/// this version of the board link if it speaks it, and with the bus interface
/// `interface`, if that matters.
///
/// # Errors
/// [`WrongImage`].
pub fn identify(
    path: &Path,
    kinds: &[Kind],
    interface: Option<u64>,
) -> Result<Identity, WrongImage> {
    let names: Vec<String> = kinds
        .iter()
        .map(|kind| format!("`{}`, {}", kind.name(), kind.title()))
        .collect();
    let build = kinds.first().map_or("", |kind| kind.build_command());
    let wrong = |what: String, wanted: String| WrongImage {
        path: path.to_path_buf(),
        what,
        wanted,
        build,
    };
    let kind_wanted = || names.join(" or ");
    let identity = read(path).map_err(|what| wrong(what, kind_wanted()))?;
    if !kinds.contains(&identity.kind) {
        let (name, what) = (identity.kind.name(), identity.kind.title());
        return Err(wrong(
            format!("is the image `{name}`, {what}"),
            kind_wanted(),
        ));
    }
    if identity.kind.speaks_link() && identity.link != LINK_VERSION {
        return Err(wrong(
            format!("speaks version {} of the board link", identity.link),
            format!("version {LINK_VERSION}"),
        ));
    }
    match interface {
        Some(interface) if interface != identity.interface => Err(wrong(
            format!("has the bus interface {:016x}", identity.interface),
            format!("{interface:016x}, that of this program"),
        )),
        _ => Ok(identity),
    }
}

/// The record, or a description of the file.
fn read(path: &Path) -> Result<Identity, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("cannot be read ({e})"))?;
    let elf: ElfFile32 = ElfFile32::parse(&*bytes)
        .map_err(|_| "is no ELF file for a 32-bit processor".to_string())?;
    let section = elf.section_by_name(SECTION);
    let record = section.as_ref().and_then(|section| section.data().ok());
    Identity::parse(record.unwrap_or_default()).map_err(|e| e.to_string())
}
