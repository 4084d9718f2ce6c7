//! Digest of the sources of an image, for build scripts.
//!
//! It depends on names below the workspace's root and on contents, not on the place of the workspace, on
//! times or on line ends. Images and host have the same one if and only if the files listed here are the
//! same. It does not change with the simulator's sources; it does with the root `Cargo.toml` or `Cargo.lock`,
//! even if only the simulator is concerned (one of its dependencies, a member of the workspace), because they
//! also hold versions and profiles of the images.

use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::{env, fs};

use crate::Digest;

/// Sources of every image.
const COMMON: [&str; 8] = [
    "Cargo.toml",
    "Cargo.lock",
    "protocol",
    "firmware/units",
    "firmware/control",
    "firmware/node",
    "firmware/remote",
    "firmware/identity",
];
/// The board link's wire types; `remote` speaks it.
const LINK: &str = "protocol/remote-link";
/// Of a crate: its manifest, its sources, its build script if it has one. Tests and fuzz
/// targets are in no image.
const MANIFEST: &str = "Cargo.toml";
const SOURCES: &str = "src";
const BUILD_SCRIPT: &str = "build.rs";

/// Which images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Images {
    /// Those of the STM32G431.
    G431,
    /// Those of QEMU's mps2-an386.
    Qemu,
}

impl Images {
    /// Sources of only these images.
    const fn own(self) -> [&'static str; 2] {
        match self {
            Self::G431 => ["firmware/board", "memory.x"],
            Self::Qemu => ["firmware/board-qemu", "firmware/board-qemu/mps2-an386.ld"],
        }
    }

    /// All their sources.
    fn sources(self) -> Vec<&'static str> {
        let common = COMMON.into_iter().chain([LINK]);
        common.chain(self.own()).collect()
    }
}

/// Digest and files of the sources of `images` below the workspace's `root`.
///
/// # Errors
/// A file, a crate, its manifest or its sources that are missing or cannot be read.
pub fn digest(root: &Path, images: Images) -> io::Result<(Digest, Vec<PathBuf>)> {
    digest_of(root, &images.sources())
}

/// Digest and files of the crates and files with these names below the workspace's `root`.
///
/// # Errors
/// As [`digest`].
pub fn digest_of(root: &Path, names: &[&str]) -> io::Result<(Digest, Vec<PathBuf>)> {
    let mut files = Vec::new();
    for name in names {
        let path = root.join(name);
        if path.is_file() {
            files.push(path);
            continue;
        }
        // A path to neither a file nor a crate has no sources.
        files.push(path.join(MANIFEST));
        walk(&path.join(SOURCES), &mut files)?;
        let script = path.join(BUILD_SCRIPT);
        if script.is_file() {
            files.push(script);
        }
    }
    let mut named: Vec<(String, PathBuf)> = files
        .into_iter()
        .map(|path| (name_below(root, &path), path))
        .collect();
    named.sort();
    let mut hasher = blake3::Hasher::new();
    for (name, path) in &named {
        let mut text = fs::read(path).map_err(|e| with_path(path, &e))?;
        text.retain(|byte| *byte != b'\r');
        for part in [name.as_bytes(), &text] {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
    }
    let mut digest = Digest::default();
    hasher.finalize_xof().fill(&mut digest);
    Ok((digest, named.into_iter().map(|(_, path)| path).collect()))
}

/// For a build script: writes the digest into the file `name` of `OUT_DIR`, and has the
/// script run again when a source changes.
///
/// # Errors
/// As [`digest`]; the file cannot be written.
pub fn emit(root: &Path, images: Images, name: &str) -> io::Result<()> {
    emit_of(root, &images.sources(), name)
}

/// The same for the crates and files with these names.
///
/// # Errors
/// As [`emit`].
pub fn emit_of(root: &Path, names: &[&str], name: &str) -> io::Result<()> {
    let (digest, files) = digest_of(root, names)?;
    for file in files {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    // New files: a folder's time is that of its newest entry.
    for name in names {
        let sources = root.join(name).join(SOURCES);
        if sources.is_dir() {
            println!("cargo:rerun-if-changed={}", sources.display());
        }
    }
    let out = env::var_os("OUT_DIR").ok_or(io::ErrorKind::NotFound)?;
    fs::write(Path::new(&out).join(name), digest)
}

/// The error, and which file it is about.
fn with_path(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// Rust sources below a folder.
fn walk(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| with_path(folder, &e))? {
        let path = entry?.path();
        if path.is_dir() {
            walk(&path, files)?;
        } else if path.extension() == Some(OsStr::new("rs")) {
            files.push(path);
        }
    }
    Ok(())
}

/// `firmware/units/src/lib.rs` on every system.
fn name_below(root: &Path, path: &Path) -> String {
    let below = path.strip_prefix(root).unwrap_or(path);
    let parts = below.iter().map(|part| part.to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A workspace with one line in every file.
    fn workspace(root: &Path) {
        let crates = COMMON.into_iter().chain([LINK]);
        let own = [Images::G431, Images::Qemu].map(Images::own).concat();
        for name in crates.chain(own) {
            if name.contains('.') {
                write(root, name, "a line\n");
            } else {
                write(root, &format!("{name}/Cargo.toml"), "a line\n");
                write(root, &format!("{name}/src/lib.rs"), "a line\n");
                write(root, &format!("{name}/src/deep/er.rs"), "a line\n");
            }
        }
    }

    fn write(root: &Path, name: &str, text: &str) {
        let path = root.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    }

    fn of(root: &Path, images: Images) -> Digest {
        digest(root, images).expect("a digest").0
    }

    #[test]
    fn the_place_and_what_is_in_no_image_do_not_count() {
        let (here, there) = (tempfile::tempdir(), tempfile::tempdir());
        let (here, there) = (here.expect("a folder"), there.expect("a folder"));
        workspace(here.path());
        workspace(&there.path().join("much/deeper"));
        let there = there.path().join("much/deeper");
        for images in [Images::G431, Images::Qemu] {
            let before = of(here.path(), images);
            assert_eq!(before, of(&there, images), "another place");
            for other in [
                "host-sim/sim/src/lib.rs",
                "firmware/master/src/lib.rs",
                "firmware/units/tests/all.rs",
                "firmware/units/src/lib.rs.orig",
                "README.md",
            ] {
                write(here.path(), other, "another line\n");
            }
            write(here.path(), "protocol/src/lib.rs", "a line\r\n");
            assert_eq!(before, of(here.path(), images), "in no image");
        }
    }

    #[test]
    fn every_change_of_a_source_changes_the_digest() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        workspace(root);
        for images in [Images::G431, Images::Qemu] {
            let (before, files) = digest(root, images).expect("a digest");
            assert!(files.len() > 20, "{files:?}");
            for file in files {
                fs::write(&file, "a lime\n").expect("written");
                assert_ne!(before, of(root, images), "{}", file.display());
                fs::write(&file, "a line\n").expect("written");
                let renamed = file.with_file_name("renamed.rs");
                if file.parent().is_some_and(|p| p.ends_with("src")) {
                    fs::rename(&file, &renamed).expect("renamed");
                    assert_ne!(before, of(root, images), "{}", renamed.display());
                    fs::rename(&renamed, &file).expect("back");
                }
            }
            assert_eq!(before, of(root, images));
            // A board's own support concerns only its own images.
            let [own, _] = images.own();
            let other = [Images::G431, Images::Qemu].map(|i| of(root, i));
            write(root, &format!("{own}/src/new.rs"), "a line\n");
            let after = [Images::G431, Images::Qemu].map(|i| of(root, i));
            let changed = [0, 1].map(|i| other[i] != after[i]);
            assert_eq!(changed, [images == Images::G431, images == Images::Qemu]);
            fs::remove_file(root.join(own).join("src/new.rs")).expect("removed");
        }
    }

    #[test]
    fn what_is_missing_is_an_error_and_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        workspace(root);
        let aside = root.join("aside");
        for images in [Images::G431, Images::Qemu] {
            let listed = COMMON.into_iter().chain([LINK]).chain(images.own());
            let missing: Vec<String> = listed
                .flat_map(|name| {
                    let inside = [MANIFEST, SOURCES].map(|part| format!("{name}/{part}"));
                    let inside = inside.into_iter().filter(|_| !name.contains('.'));
                    [name.to_owned()].into_iter().chain(inside)
                })
                .collect();
            // Three files, and eight crates with a manifest and sources each.
            assert_eq!(missing.len(), 3 + 3 * 8, "{missing:?}");
            for name in missing {
                let path = root.join(&name);
                fs::rename(&path, &aside).expect("moved");
                let error = digest(root, images).expect_err(&name);
                assert_eq!(error.kind(), io::ErrorKind::NotFound, "{name}: {error}");
                let text = error.to_string().replace('\\', "/");
                assert!(text.contains(&name), "{name}: {text}");
                fs::rename(&aside, &path).expect("back");
            }
            assert!(digest(root, images).is_ok(), "all is back");
        }
    }

    #[test]
    fn this_workspace_has_a_digest() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let (_, files) = digest(&root, Images::G431).expect("a digest");
        let names: Vec<String> = files.iter().map(|f| name_below(&root, f)).collect();
        for needed in [
            "Cargo.lock",
            "memory.x",
            "firmware/board/build.rs",
            "firmware/board/src/g431/bus.rs",
            "firmware/control/src/lib.rs",
            "protocol/src/lib.rs",
        ] {
            assert!(
                names.iter().any(|name| name == needed),
                "{needed}: {names:?}"
            );
        }
    }
}
