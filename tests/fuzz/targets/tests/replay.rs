//! Runs every input of the corpus and every regression through its target, as a plain test. The names of the
//! regressions say what was once wrong.

use std::fs;
use std::path::{Path, PathBuf};

use wheeleg_fuzz_targets::TARGETS;

fn fuzz_folder() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("tests/fuzz").to_path_buf()
}

fn inputs(kind: &str, target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let Ok(entries) = fs::read_dir(fuzz_folder().join(kind).join(target)) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    paths.sort();
    paths
        .into_iter()
        .map(|path| (path.clone(), fs::read(&path).expect("an input")))
        .collect()
}

/// Runs inputs; names the failing one before the panic continues.
fn replay(kind: &str, at_least: usize) {
    for target in TARGETS {
        let inputs = inputs(kind, target.name);
        assert!(
            inputs.len() >= at_least,
            "{kind} of {}: {} inputs",
            target.name,
            inputs.len()
        );
        for (path, input) in inputs {
            let result = std::panic::catch_unwind(|| (target.run)(&input));
            assert!(result.is_ok(), "{} fails {}", path.display(), target.name);
        }
    }
}

#[test]
fn the_corpus_passes() {
    replay("corpus", 3);
}

#[test]
fn what_was_once_wrong_stays_right() {
    replay("regressions", 0);
}

#[test]
fn the_built_in_scenarios_and_robots_pass() {
    let root = fuzz_folder().join("../../host-sim");
    let mut files = 0;
    for folder in ["scenarios", "robots"] {
        for entry in fs::read_dir(root.join(folder)).expect("a folder") {
            let text = fs::read(entry.expect("an entry").path()).expect("a file");
            for target in TARGETS {
                (target.run)(&text);
            }
            files += 1;
        }
    }
    assert!(files >= 11, "only {files} files");
}
