//! Documents: short enough to be read, complete, and true about names, links and arrows.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::{ARROWS, files, root};

/// The list for newcomers matches the tested table; crates of tests and tools are not in it.
#[test]
fn the_architecture_lists_the_arrows() {
    let short = |name: &str| name.trim_start_matches("wheeleg-").to_owned();
    let beside = [
        "wheeleg-fuzz-targets",
        "wheeleg-peers",
        "wheeleg-tests",
        "xtask",
        "insn-plugin",
    ];
    let table: BTreeMap<String, BTreeSet<String>> = ARROWS
        .iter()
        .filter(|(name, _)| !beside.contains(name))
        .map(|(name, uses)| (short(name), uses.iter().map(|name| short(name)).collect()))
        .collect();
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("it is there");
    let section = text.split("## Arrows").nth(1).expect("its arrows");
    let section = section.split("## ").next().expect("a section");
    let mut listed = BTreeMap::new();
    for line in section.lines().filter_map(|line| line.strip_prefix("    ")) {
        let (names, uses) = line.split_once(": ").expect("crates: crates");
        let uses: BTreeSet<String> = match uses {
            "none" => BTreeSet::new(),
            uses => uses.split(", ").map(str::to_owned).collect(),
        };
        for name in names.split(", ") {
            assert_eq!(
                listed.insert(name.to_owned(), uses.clone()),
                None,
                "{name} twice"
            );
        }
    }
    assert_eq!(listed, table);
}

/// A newcomer's first reading fits into an hour.
#[test]
fn the_first_documents_are_short() {
    for (name, most) in [("README.md", 120), ("ARCHITECTURE.md", 150)] {
        let text = fs::read_to_string(root().join(name)).expect(name);
        let lines = text.lines().count();
        assert!(lines <= most, "{name}: {lines} lines, at most {most}");
        assert!(lines > most / 2, "{name}: {lines} lines");
    }
}

/// Each release fits into 60 lines, and so do the changes since.
#[test]
fn each_section_of_the_changelog_is_short() {
    let text = fs::read_to_string(root().join("CHANGELOG.md")).expect("CHANGELOG.md");
    let sections: Vec<&str> = text.split("\n## ").skip(1).collect();
    assert!(sections.len() >= 2, "{} sections", sections.len());
    for section in sections {
        let lines = section.lines().count();
        assert!(lines <= 60, "{lines} lines: {:?}", section.lines().next());
    }
}

/// No sentence of the README has more than 30 words.
#[test]
fn the_readme_has_short_sentences() {
    let readme = fs::read_to_string(root().join("README.md")).expect("README.md");
    let is_text = |paragraph: &&str| !paragraph.starts_with(['#', '|', '!', ' ']);
    let (mut sentences, mut longest) = (0, (0, String::new()));
    for paragraph in readme.split("\n\n").filter(is_text) {
        let mut words = Vec::new();
        for word in paragraph.split_whitespace() {
            words.push(word);
            if word.trim_end_matches(['*', ')']).ends_with(['.', '!', '?']) {
                sentences += 1;
                longest = longest.max((words.len(), words.join(" ")));
                words.clear();
            }
        }
    }
    assert!(sentences > 30, "{sentences} sentences");
    assert!(longest.0 <= 30, "{} words: {}", longest.0, longest.1);
}

#[test]
fn continuous_integration_runs_the_command_of_the_readme() {
    let readme = fs::read_to_string(root().join("README.md")).expect("README.md");
    let script = fs::read_to_string(root().join(".ci/run")).expect(".ci/run");
    let command = "cargo xtask test";
    assert!(readme.lines().any(|line| line.trim() == command));
    assert!(script.contains("set -euo pipefail"));
    assert!(script.lines().any(|line| {
        let line = line.trim();
        !line.starts_with('#') && line.starts_with(&format!("exec {command}"))
    }));
}

/// The book's summary and the first page list the same guide, in the same order and with the same titles.
#[test]
fn the_guide_has_one_order() {
    let guide = |name: &str| -> Vec<String> {
        let text = fs::read_to_string(root().join(name)).expect(name);
        let links = text
            .split('[')
            .filter_map(|link| link.split_once("](guide/"));
        let links = links.map(|(title, rest)| {
            let page = rest.split(')').next().expect("a page");
            format!("{title}: {page}")
        });
        links.collect()
    };
    let book = guide("docs/SUMMARY.md");
    assert!(book.len() > 20, "{book:?}");
    assert_eq!(guide("docs/README.md"), book);
}

/// Links and file names in documents: a move that forgets them sends a newcomer nowhere.
#[test]
fn documents_point_to_what_exists() {
    let mut links = 0;
    let mut dead = Vec::new();
    for (name, text) in files() {
        if !name.ends_with(".md") {
            continue;
        }
        let folder = Path::new(&name).parent().expect("a folder");
        for target in text.split("](").skip(1) {
            let target = target.split([')', '#', ' ']).next().expect("a target");
            if target.is_empty() || target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            links += 1;
            if !root().join(folder).join(target).exists() {
                dead.push(format!("{name}: link {target}"));
            }
        }
    }
    let summary = fs::read_to_string(root().join("docs/SUMMARY.md")).expect("it is there");
    let pages = files().into_iter().filter_map(|(name, text)| {
        let page = name.strip_prefix("docs/")?.to_owned();
        page.ends_with(".md").then_some((page, text))
    });
    for (page, text) in pages {
        if page != "SUMMARY.md" && !summary.contains(&format!("]({page})")) {
            dead.push(format!("docs/SUMMARY.md lacks {page}"));
        }
        let decision = page
            .strip_prefix("decisions/")
            .filter(|p| *p != "README.md");
        for head in ["Status: ", "## Context", "## Choice", "## Consequence"] {
            if decision.is_some() && !text.lines().any(|line| line.starts_with(head)) {
                dead.push(format!("docs/{page} lacks {head:?}"));
            }
        }
    }
    let architecture = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("it is there");
    let places = architecture.split('`').skip(1).step_by(2);
    let tops = [
        "firmware/",
        "host-sim/",
        "protocol/",
        "tests/",
        "xtask/",
        "docs/",
    ];
    for place in places.filter(|p| tops.iter().any(|top| p.starts_with(top))) {
        links += 1;
        if !root().join(place).exists() {
            dead.push(format!("ARCHITECTURE.md: {place}"));
        }
    }
    assert!(links > 100, "only {links} links found");
    assert!(dead.is_empty(), "{dead:#?}");
}
