//! The table of gains and thresholds: every row is guarded by a test that stands where the row says.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use wheeleg_control::tuning::TABLE;

/// All Rust files below a folder.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// `file::name` of the functions that follow a `#[test]` in this crate.
fn tests() -> BTreeSet<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = Vec::new();
    files(&root.join("src"), &mut paths);
    files(&root.join("tests"), &mut paths);
    let mut names = BTreeSet::new();
    for path in paths {
        let text = fs::read_to_string(&path).expect("a file");
        let file = path.strip_prefix(root).expect("below the root").display();
        for after in text.split("#[test]").skip(1) {
            let name = after
                .split_once("fn ")
                .and_then(|(_, rest)| rest.split_once('('));
            names.extend(name.map(|(name, _)| format!("{file}::{name}")));
        }
    }
    names
}

#[test]
fn every_row_has_unit_reason_and_a_test_where_it_says() {
    let tests = tests();
    assert!(
        tests.contains("tests/suite/tuning.rs::every_row_has_unit_reason_and_a_test_where_it_says")
    );
    assert!(TABLE.len() > 50, "{} rows", TABLE.len());
    let names: BTreeSet<_> = TABLE.iter().map(|row| row.name).collect();
    assert_eq!(names.len(), TABLE.len(), "a name twice");
    for row in TABLE {
        assert!(
            tests.contains(row.test),
            "{}: no test `{}`",
            row.name,
            row.test
        );
        assert!(
            !row.unit.is_empty() && !row.reason.is_empty(),
            "{}",
            row.name
        );
    }
}

/// Axis, observer and law have no constant of their own that is not in the table, but formats, shifts, and what follows
/// from the table, from units or from nature.
#[test]
fn no_gain_stands_beside_the_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    for folder in ["axis", "observer", "law"] {
        files(&root.join(folder), &mut paths);
    }
    // What a number stands for that cannot be tuned.
    let allowed = [
        "CHOKED_MM3_S",
        "FRESH",
        "OBSERVE_STROKE",
        "OBSERVE_SPEED",
        "OBSERVE_LOAD",
        "OSCILLATION",
        "PERIOD_TICKS",
        "QUARTER_PI",
        "EDGES",
        "WIDENS_STEP",
        "TICKS_PER_SECOND",
        "ONE",
        "THERE",
        "UNKNOWNS",
        "BITS",
        "FRACTION",
    ];
    for path in paths {
        let text = fs::read_to_string(&path).expect("a file");
        let code = text.split("#[cfg(test)]").next().expect("code");
        for line in code.lines() {
            let line = line.trim_start().trim_start_matches("pub(super) ");
            let line = line
                .trim_start_matches("pub(crate) ")
                .trim_start_matches("pub ");
            let name = line.strip_prefix("const ");
            let name = name.and_then(|rest| rest.split_once(':'));
            if let Some((name, _)) = name.filter(|(name, _)| !name.starts_with("fn ")) {
                assert!(allowed.contains(&name), "{}: {name}", path.display());
            }
        }
    }
}
