//! The page: a fixed table of files, built into the program, or read from a folder by people who work on it.
//! No name in a request ever becomes a path.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use axum::body::Bytes;
use include_dir::{Dir, include_dir};

use crate::error::ConsoleError;

static BUILT_IN: Dir = include_dir!("$CARGO_MANIFEST_DIR/../report/page");

/// Name of the file served at `/`.
const INDEX: &str = "index.html";

/// Location of a file in the table.
#[derive(Debug, Clone)]
enum Place {
    BuiltIn(&'static [u8]),
    Disk(PathBuf),
}

/// The files of the page.
#[derive(Debug)]
pub(crate) struct Page(BTreeMap<String, (&'static str, Place)>);

impl Page {
    /// The page of this program, or that in `folder`.
    ///
    /// # Errors
    /// [`ConsoleError::Other`] if the folder cannot be read or holds no page.
    pub(crate) fn new(folder: Option<&Path>) -> Result<Self, ConsoleError> {
        let mut table = BTreeMap::new();
        match folder {
            None => built_in(&BUILT_IN, &mut table),
            Some(folder) => on_disk(folder, "", &mut table).map_err(|e| {
                ConsoleError::other(
                    format!("the page in {} cannot be read: {e}", folder.display()),
                    "give the folder host-sim/report/page with --page-dir, or leave it out",
                )
            })?,
        }
        if !table.contains_key(INDEX) {
            return Err(ConsoleError::other(
                format!("the page has no {INDEX}"),
                "give the folder host-sim/report/page with --page-dir, or leave it out",
            ));
        }
        Ok(Self(table))
    }

    /// Content type and bytes of a file; `name` is the path of the request without its slash.
    pub(crate) fn get(&self, name: &str) -> Option<(&'static str, Bytes)> {
        let name = if name.is_empty() { INDEX } else { name };
        let (kind, place) = self.0.get(name)?;
        let bytes = match place {
            Place::BuiltIn(bytes) => Bytes::from_static(bytes),
            Place::Disk(path) => std::fs::read(path).ok()?.into(),
        };
        Some((kind, bytes))
    }
}

/// Content type of a file of the page; `None`: it is not served.
fn content_type(name: &str) -> Option<&'static str> {
    let (_, extension) = name.rsplit_once('.')?;
    Some(match extension {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        _ => return None,
    })
}

fn built_in(dir: &'static Dir, table: &mut BTreeMap<String, (&'static str, Place)>) {
    for file in dir.files() {
        let name = file.path().to_string_lossy().replace('\\', "/");
        if let Some(kind) = content_type(&name) {
            table.insert(name, (kind, Place::BuiltIn(file.contents())));
        }
    }
    for dir in dir.dirs() {
        built_in(dir, table);
    }
}

fn on_disk(
    folder: &Path,
    prefix: &str,
    table: &mut BTreeMap<String, (&'static str, Place)>,
) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        // Links are not followed: they may lead out of the folder.
        let kind = entry.file_type()?;
        if kind.is_dir() {
            on_disk(&entry.path(), &format!("{name}/"), table)?;
        } else if kind.is_file()
            && let Some(kind) = content_type(&name)
        {
            table.insert(name, (kind, Place::Disk(entry.path())));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use wheeleg_master::dispatcher::{Refusal, Reject};
    use wheeleg_telemetry::PLACES;
    use wheeleg_telemetry::event::reject_name;
    use wheeleg_telemetry::messages::reject;

    use super::*;

    fn text(name: &str) -> String {
        let page = Page::new(None).expect("built in");
        let (_, bytes) = page.get(name).expect("a file of the page");
        String::from_utf8(bytes.to_vec()).expect("text")
    }

    /// The page repeats the places of the boards: the same as everywhere else.
    #[test]
    fn the_page_has_the_boards_where_the_program_has_them() {
        let places: Vec<String> = PLACES.iter().map(|place| format!("{place:?}")).collect();
        let line = format!("const PLACES = [{}];", places.join(", "));
        assert!(text("boards.js").contains(&line), "{line}");
    }

    #[test]
    fn the_page_knows_by_which_faults_a_reading_is_none() {
        use wheeleg_protocol::Fault::{SensorRange, SensorRate};
        let joint = text("joint.js");
        for line in [
            format!("new Set([{}, {}])", SensorRange.code(), SensorRate.code()),
            format!(
                "= (1 << {}) | (1 << {});",
                SensorRange.bit(),
                SensorRate.bit()
            ),
        ] {
            assert!(joint.contains(&line), "{line}");
        }
    }

    /// The page says what to press where a terminal names commands; why, both say in the same words.
    #[test]
    fn the_page_gives_the_same_reasons_as_a_terminal() {
        let words = text("words.js");
        for refusal in [
            Refusal::NotArmed,
            Refusal::NotDisarmed,
            Refusal::Moving,
            Refusal::NotMoving,
            Refusal::Latched,
            Refusal::NoAir,
            Refusal::Interrupted,
        ] {
            let refusal = Reject::Refused(refusal);
            let name = reject_name(&refusal);
            let line = words
                .lines()
                .find(|line| line.trim_start().starts_with(&format!("{name}: (")));
            let line = line.unwrap_or_else(|| panic!("words.js has no words for {name}"));
            let told = reject(&refusal);
            let why = told.split([':', ';']).next().unwrap_or_default();
            assert!(line.contains(why), "{why}: {line}");
        }
    }

    #[test]
    fn names_of_the_table_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str| std::fs::write(folder.path().join(name), "x").expect("written");
        write("index.html");
        std::fs::create_dir(folder.path().join("vendor")).expect("made");
        write("vendor/uplot.js");
        write("secret.key");
        for page in [
            Page::new(None).expect("built in"),
            Page::new(Some(folder.path())).expect("on disk"),
        ] {
            let (kind, _) = page.get("").expect("an index");
            assert_eq!(kind, "text/html; charset=utf-8");
            for name in [
                "../Cargo.toml",
                "/etc/passwd",
                "./index.html",
                "secret.key",
                "nothing.js",
            ] {
                assert!(page.get(name).is_none(), "{name}");
            }
        }
        let page = Page::new(Some(folder.path())).expect("on disk");
        assert!(page.get("vendor/uplot.js").is_some());
        std::fs::remove_file(folder.path().join("index.html")).expect("removed");
        assert!(Page::new(Some(folder.path())).is_err());
    }
}
