//! Reference vectors: the independent generators are rerun, and their output must equal, byte for byte, the
//! checked-in files.
//!
//! A generator is a Python script in a folder `tests/vectors` of a crate (or in `tests/vectors` itself) that
//! writes its data files beside itself, or to standard output if it documents the call `python3 NAME.py >
//! FILE`. It is run in a copy of the folder without any data files, so that only its own results are
//! compared.
//!
//! A data file without a generator (digitised or taken from elsewhere) must be named in the folder's
//! README.md, with its source.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::process::{command, empty_folder, output, root, run, step_folder};
use crate::report::{Report, StepResult};
use crate::tools;

/// Folders that hold crates, searched for `tests/vectors`.
const CRATE_PARENTS: [&str; 3] = [".", "firmware", "host-sim"];

/// Extensions of data files.
const DATA: [&str; 4] = ["json", "csv", "txt", "bin"];

type Files = BTreeMap<String, Vec<u8>>;

/// One step per folder of vectors.
pub(crate) fn steps(report: &mut Report) {
    let found = report.step("find reference vectors", || Ok(find(&root())?));
    for folder in found.unwrap_or_default() {
        let name = folder
            .strip_prefix(root())
            .unwrap_or(&folder)
            .display()
            .to_string();
        report.step(format!("reference vectors: {name}"), || check(&folder));
    }
}

/// All folders of vectors; without those of the control laws the check would be empty.
fn find(root: &Path) -> Result<Vec<PathBuf>> {
    let found = folders(root)?;
    ensure!(
        found
            .iter()
            .any(|folder| folder.ends_with("firmware/control/tests/vectors")),
        "the control crate has no reference vectors"
    );
    Ok(found)
}

/// All folders of vectors that exist, in a fixed order.
fn folders(root: &Path) -> Result<Vec<PathBuf>> {
    let mut found = BTreeSet::new();
    for parent in CRATE_PARENTS {
        let parent = root.join(parent);
        for entry in fs::read_dir(&parent).with_context(|| format!("{}", parent.display()))? {
            let folder = entry?.path().join("tests/vectors");
            if folder.is_dir() {
                found.insert(folder);
            }
        }
    }
    let own = root.join("tests/vectors");
    if own.is_dir() {
        found.insert(own);
    }
    Ok(found
        .into_iter()
        .map(|path| path.components().collect())
        .collect())
}

fn check(folder: &Path) -> StepResult {
    let checked_in = data_files(folder)?;
    let scratch = step_folder("vectors");
    let mut regenerated = Files::new();
    for script in scripts(folder)? {
        let python = tools::python()?;
        empty_folder(&scratch)?;
        copy_sources(folder, &scratch)?;
        let mut call = command(python);
        call.arg("-B").arg(&script).current_dir(&scratch);
        let source = fs::read_to_string(scratch.join(&script))?;
        match redirection(&source, &script) {
            Some(file) => fs::write(scratch.join(file), output(&mut call)?)?,
            None => run(&mut call)?,
        }
        let written = data_files(&scratch)?;
        ensure_some(&script, &written)?;
        regenerated.extend(written);
    }
    let readme = fs::read_to_string(folder.join("README.md")).unwrap_or_default();
    compare(&checked_in, &regenerated, &readme)?;
    println!(
        "    {} files, {} of them regenerated, byte for byte equal",
        checked_in.len(),
        regenerated.len()
    );
    Ok(())
}

/// The file that a script's documented call redirects its output to.
fn redirection<'a>(source: &'a str, script: &str) -> Option<&'a str> {
    let call = format!("python3 {script} > ");
    source
        .lines()
        .find_map(|line| line.trim().strip_prefix(call.as_str()))
        .filter(|file| is_data(file) && !file.contains(['/', '\\']))
}

fn ensure_some(script: &str, written: &Files) -> Result<()> {
    ensure!(
        !written.is_empty(),
        "{script} wrote no data file beside itself"
    );
    Ok(())
}

/// Scripts that a person would run; modules shared by them start with `_`.
fn scripts(folder: &Path) -> Result<Vec<String>> {
    let mut names: Vec<String> = names(folder)?
        .into_iter()
        .filter(|name| name.ends_with(".py") && !name.starts_with('_'))
        .collect();
    names.sort();
    Ok(names)
}

fn data_files(folder: &Path) -> Result<Files> {
    let mut files = Files::new();
    for name in names(folder)? {
        if is_data(&name) {
            let content = fs::read(folder.join(&name))?;
            files.insert(name, content);
        }
    }
    Ok(files)
}

fn copy_sources(from: &Path, to: &Path) -> Result<()> {
    for name in names(from)? {
        if !is_data(&name) {
            fs::copy(from.join(&name), to.join(&name))?;
        }
    }
    Ok(())
}

fn names(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("{}", folder.display()))? {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    Ok(names)
}

fn is_data(name: &str) -> bool {
    Path::new(name)
        .extension()
        .and_then(|extension| extension.to_str())
        .is_some_and(|extension| DATA.contains(&extension))
        && name != "requirements.txt"
}

fn compare(checked_in: &Files, regenerated: &Files, readme: &str) -> Result<()> {
    let mut wrong = Vec::new();
    for (name, content) in checked_in {
        match regenerated.get(name) {
            Some(new) if new == content => {}
            Some(new) => wrong.push(format!("{name} differs {}", first_difference(content, new))),
            None if readme.contains(name.as_str()) => {}
            None => wrong.push(format!(
                "{name} has neither a generator nor a line in README.md"
            )),
        }
    }
    for name in regenerated.keys() {
        if !checked_in.contains_key(name) {
            wrong.push(format!("{name} is generated but not checked in"));
        }
    }
    if !wrong.is_empty() {
        bail!("{}", wrong.join("; "));
    }
    Ok(())
}

fn first_difference(old: &[u8], new: &[u8]) -> String {
    let at = old.iter().zip(new).take_while(|(a, b)| a == b).count();
    let line = old.iter().take(at).filter(|byte| **byte == b'\n').count() + 1;
    format!("first in line {line}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(list: &[(&str, &str)]) -> Files {
        list.iter()
            .map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()))
            .collect()
    }

    #[test]
    fn equal_files_pass_and_one_byte_fails() {
        let old = files(&[("a.json", "1\n2\n")]);
        assert!(compare(&old, &old, "").is_ok());
        let error = compare(&old, &files(&[("a.json", "1\n3\n")]), "")
            .unwrap_err()
            .to_string();
        assert_eq!(error, "a.json differs first in line 2");
        // A README line excuses a missing generator, never a difference.
        assert!(compare(&old, &files(&[("a.json", "1")]), "a.json").is_err());
    }

    #[test]
    fn orphans_fail_unless_their_source_is_named() {
        let old = files(&[("a.json", "1")]);
        assert!(compare(&old, &Files::new(), "").is_err());
        assert!(compare(&old, &Files::new(), "`a.json`: digitised").is_ok());
        assert!(compare(&Files::new(), &old, "a.json").is_err());
    }

    #[test]
    fn a_documented_redirection_names_the_file() {
        let source = "\"\"\"Doc.\n\n    python3 make.py > a.json\n\"\"\"\n";
        assert_eq!(redirection(source, "make.py"), Some("a.json"));
        assert_eq!(redirection(source, "other.py"), None);
        assert_eq!(redirection("python3 make.py > ../a.json", "make.py"), None);
    }

    #[test]
    fn scripts_and_data_are_told_apart() {
        assert!(is_data("fuzzy.json") && is_data("pwm.csv"));
        assert!(!is_data("fuzzy.py") && !is_data("README.md") && !is_data("requirements.txt"));
    }
}
