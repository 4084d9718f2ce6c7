//! House rules that a compiler does not check: which crate may depend on which, one place for versions and
//! lints, no references outside.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use wheeleg_identity::sources::{self, Images};

mod assertions;
mod circles;
mod documents;

/// Which of our own crates each may depend on (ARCHITECTURE.md). Development dependencies count too: a test
/// is no back door.
const ARROWS: [(&str, &[&str]); 32] = [
    ("wheeleg-identity", &[]),
    ("wheeleg-units", &[]),
    ("wheeleg-kinematics", &[]),
    ("wheeleg-control", &["wheeleg-units"]),
    ("wheeleg-protocol", &["wheeleg-units"]),
    (
        "wheeleg-node",
        &["wheeleg-control", "wheeleg-protocol", "wheeleg-units"],
    ),
    (
        "wheeleg-master",
        &["wheeleg-kinematics", "wheeleg-protocol", "wheeleg-units"],
    ),
    (
        "wheeleg-remote",
        &[
            "wheeleg-node",
            "wheeleg-protocol",
            "wheeleg-remote-link",
            "wheeleg-units",
        ],
    ),
    (
        "wheeleg-board",
        &[
            "wheeleg-identity",
            "wheeleg-node",
            "wheeleg-protocol",
            "wheeleg-remote",
            "wheeleg-remote-link",
            "wheeleg-units",
        ],
    ),
    (
        "wheeleg-board-qemu",
        &[
            "wheeleg-identity",
            "wheeleg-protocol",
            "wheeleg-remote",
            "wheeleg-remote-link",
            "wheeleg-units",
        ],
    ),
    ("wheeleg-plant", &["wheeleg-kinematics"]),
    ("wheeleg-remote-link", &["wheeleg-identity"]),
    // GPL-2.0-only: nothing may depend on it (no line here names it).
    ("wheeleg-pil-unicorn", &["wheeleg-remote-link"]),
    (
        "wheeleg-config",
        &[
            "wheeleg-master",
            "wheeleg-node",
            "wheeleg-plant",
            "wheeleg-protocol",
            "wheeleg-units",
        ],
    ),
    ("wheeleg-interface", &["wheeleg-protocol"]),
    (
        "wheeleg-telemetry",
        &[
            "wheeleg-config",
            "wheeleg-interface",
            "wheeleg-master",
            "wheeleg-protocol",
        ],
    ),
    (
        "wheeleg-remote-host",
        &[
            "wheeleg-config",
            "wheeleg-identity",
            "wheeleg-interface",
            "wheeleg-protocol",
            "wheeleg-remote-link",
        ],
    ),
    (
        "wheeleg-scene",
        &[
            "wheeleg-config",
            "wheeleg-kinematics",
            "wheeleg-plant",
            "wheeleg-protocol",
            "wheeleg-telemetry",
        ],
    ),
    (
        "wheeleg-access",
        &[
            "wheeleg-config",
            "wheeleg-master",
            "wheeleg-protocol",
            "wheeleg-telemetry",
        ],
    ),
    ("wheeleg-sim", &SIM),
    ("wheeleg-report", &[]),
    (
        "wheeleg-campaign",
        &[
            "wheeleg-config",
            "wheeleg-identity",
            "wheeleg-remote-host",
            "wheeleg-report",
            "wheeleg-scene",
            "wheeleg-sim",
            "wheeleg-studies",
            "wheeleg-telemetry",
        ],
    ),
    (
        "wheeleg-console",
        &[
            "wheeleg-access",
            "wheeleg-config",
            "wheeleg-master",
            "wheeleg-protocol",
            "wheeleg-remote-host",
            "wheeleg-scene",
            "wheeleg-sim",
            "wheeleg-telemetry",
        ],
    ),
    ("wheeleg-studies", &STUDIES),
    (
        "wheeleg-fmu",
        &["wheeleg-config", "wheeleg-plant", "wheeleg-studies"],
    ),
    (
        "wheeleg-python",
        &[
            "wheeleg-campaign",
            "wheeleg-config",
            "wheeleg-master",
            "wheeleg-plant",
            "wheeleg-protocol",
            "wheeleg-sim",
            "wheeleg-studies",
            "wheeleg-telemetry",
            "wheeleg-units",
        ],
    ),
    ("wheeleg", &PROGRAM),
    ("wheeleg-tests", &TESTED),
    (
        "wheeleg-fuzz-targets",
        &[
            "wheeleg-access",
            "wheeleg-board",
            "wheeleg-campaign",
            "wheeleg-config",
            "wheeleg-console",
            "wheeleg-kinematics",
            "wheeleg-master",
            "wheeleg-node",
            "wheeleg-protocol",
            "wheeleg-remote",
            "wheeleg-remote-link",
            "wheeleg-report",
            "wheeleg-studies",
            "wheeleg-telemetry",
            "wheeleg-units",
        ],
    ),
    (
        "wheeleg-peers",
        &[
            "wheeleg-console",
            "wheeleg-control",
            "wheeleg-kinematics",
            "wheeleg-plant",
            "wheeleg-protocol",
            "wheeleg-units",
        ],
    ),
    ("xtask", &[]),
    ("insn-plugin", &[]),
];

const SIM: [&str; 10] = [
    "wheeleg-config",
    "wheeleg-interface",
    "wheeleg-master",
    "wheeleg-node",
    "wheeleg-plant",
    "wheeleg-protocol",
    "wheeleg-remote-host",
    "wheeleg-remote-link",
    "wheeleg-telemetry",
    "wheeleg-units",
];

const STUDIES: [&str; 16] = [
    "wheeleg-access",
    "wheeleg-config",
    "wheeleg-control",
    "wheeleg-identity",
    "wheeleg-interface",
    "wheeleg-kinematics",
    "wheeleg-master",
    "wheeleg-node",
    "wheeleg-plant",
    "wheeleg-protocol",
    "wheeleg-remote-host",
    "wheeleg-report",
    "wheeleg-scene",
    "wheeleg-sim",
    "wheeleg-telemetry",
    "wheeleg-units",
];

const PROGRAM: [&str; 15] = [
    "wheeleg-access",
    "wheeleg-campaign",
    "wheeleg-config",
    "wheeleg-console",
    "wheeleg-fmu",
    "wheeleg-interface",
    "wheeleg-kinematics",
    "wheeleg-master",
    "wheeleg-protocol",
    "wheeleg-remote-host",
    "wheeleg-report",
    "wheeleg-scene",
    "wheeleg-sim",
    "wheeleg-studies",
    "wheeleg-telemetry",
];

const TESTED: [&str; 21] = [
    "wheeleg-campaign",
    "wheeleg-config",
    "wheeleg-console",
    "wheeleg-control",
    "wheeleg-fmu",
    "wheeleg-identity",
    "wheeleg-interface",
    "wheeleg-kinematics",
    "wheeleg-master",
    "wheeleg-node",
    "wheeleg-plant",
    "wheeleg-protocol",
    "wheeleg-remote",
    "wheeleg-remote-host",
    "wheeleg-remote-link",
    "wheeleg-report",
    "wheeleg-scene",
    "wheeleg-sim",
    "wheeleg-studies",
    "wheeleg-telemetry",
    "wheeleg-units",
];

/// Folders that may contain `unsafe`: board glue.
const UNSAFE_ALLOWED: [&str; 4] = [
    "firmware/board/src/",
    "firmware/board-qemu/",
    "host-sim/bindings/fmu/src/abi/",
    "xtask/insn-plugin/",
];

/// Longest source file, in lines.
const LINES_MAX: usize = 800;

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("the workspace root").to_path_buf()
}

/// `cargo metadata`'s packages: name and the package's description.
fn packages() -> BTreeMap<String, Value> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args([
            "metadata",
            "--no-deps",
            "--offline",
            "--format-version",
            "1",
        ])
        .current_dir(root())
        .output()
        .expect("cargo metadata");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let list = metadata["packages"].as_array().expect("packages");
    list.iter()
        .map(|package| (text(&package["name"]), package.clone()))
        .collect()
}

fn text(value: &Value) -> String {
    value.as_str().expect("text").to_owned()
}

fn dependencies(package: &Value) -> BTreeSet<String> {
    let list = package["dependencies"].as_array().expect("dependencies");
    list.iter()
        .map(|dependency| text(&dependency["name"]))
        .collect()
}

/// Tracked files with their text, as (path from the root, text); binary files
/// are left out. Without git (a source archive), all files but build products.
fn files() -> Vec<(String, String)> {
    let listed = Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(root())
        .output()
        .ok()
        .filter(|output| output.status.success() && root().join(".git").exists());
    let names: Vec<String> = match listed {
        Some(output) => String::from_utf8(output.stdout)
            .expect("file names in UTF-8")
            .split_terminator('\0')
            .map(str::to_owned)
            .collect(),
        None => {
            let mut names = Vec::new();
            walk(&root(), "", &mut names);
            names
        }
    };
    let files: Vec<(String, String)> = names
        .into_iter()
        .filter_map(|name| {
            let text = fs::read_to_string(root().join(&name)).ok()?;
            Some((name, text))
        })
        .collect();
    assert!(files.len() > 20, "only {} files found", files.len());
    files
}

fn walk(folder: &Path, prefix: &str, names: &mut Vec<String>) {
    const SKIP: [&str; 5] = [".git", "target", "runs", ".venv", "__pycache__"];
    for entry in fs::read_dir(folder).expect("folder") {
        let entry = entry.expect("entry");
        let name = entry.file_name().into_string().expect("UTF-8");
        if SKIP.contains(&name.as_str()) {
            continue;
        }
        let path = format!("{prefix}{name}");
        if entry.file_type().expect("type").is_dir() {
            walk(&entry.path(), &format!("{path}/"), names);
        } else {
            names.push(path);
        }
    }
}

fn rust_files() -> Vec<(String, String)> {
    files()
        .into_iter()
        .filter(|(name, _)| name.ends_with(".rs"))
        .collect()
}

/// The code of a line, without its comment. (A `//` in a string cuts the line
/// short; good enough for keywords.)
fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or(line)
}

#[test]
fn arrows_point_one_way() {
    let packages = packages();
    let ours: BTreeSet<&str> = packages.keys().map(String::as_str).collect();
    let listed: BTreeSet<&str> = ARROWS.iter().map(|(name, _)| *name).collect();
    assert_eq!(
        ours, listed,
        "a crate without a line in the table of arrows"
    );
    for (name, _) in ARROWS {
        let extra = upward(name, &dependencies(&packages[name]));
        assert!(extra.is_empty(), "{name} must not depend on {extra:?}");
    }
}

/// Dependencies of `name` that its line in the table does not allow.
fn upward(name: &str, dependencies: &BTreeSet<String>) -> Vec<String> {
    let line = ARROWS.iter().find(|(listed, _)| *listed == name);
    let (_, allowed) = line.expect("a line in the table");
    let ours = |dependency: &&String| ARROWS.iter().any(|(listed, _)| listed == dependency);
    let found = dependencies.iter().filter(ours);
    found
        .filter(|dependency| !allowed.contains(&dependency.as_str()))
        .cloned()
        .collect()
}

/// A `use` of a crate above needs a dependency on it, which this finds.
#[test]
fn an_arrow_that_points_up_is_found() {
    let packages = packages();
    for (below, above) in [
        ("wheeleg-plant", "wheeleg-sim"),
        ("wheeleg-telemetry", "wheeleg-report"),
        ("wheeleg-control", "wheeleg-protocol"),
        ("wheeleg-sim", "wheeleg-studies"),
    ] {
        let mut dependencies = dependencies(&packages[below]);
        dependencies.insert(above.to_owned());
        assert_eq!(upward(below, &dependencies), [above], "{below}");
    }
}

/// Each crate explains its terms at the start of its documentation.
#[test]
fn every_crate_opens_with_its_glossary() {
    let mut without = Vec::new();
    for (name, package) in packages() {
        let targets = package["targets"].as_array().expect("targets").iter();
        let mut roots = targets.filter(|t| {
            ["lib", "cdylib", "bin"]
                .iter()
                .any(|kind| t["kind"][0] == *kind)
        });
        let explains = roots.any(|target| {
            let source = fs::read_to_string(text(&target["src_path"])).expect("readable");
            let mut opening = source.lines().take_while(|line| line.starts_with("//!"));
            opening.any(|line| line == "//! # Glossary")
        });
        if !explains {
            without.push(name);
        }
    }
    assert!(without.is_empty(), "{without:?}");
}

/// A crate of ours and all of ours that it is built from, optional ones and those of build
/// scripts included, those of tests not.
fn built_from(name: &str, packages: &BTreeMap<String, Value>, found: &mut BTreeSet<String>) {
    if !found.insert(name.to_owned()) {
        return;
    }
    let list = packages[name]["dependencies"].as_array();
    for dependency in list.expect("dependencies") {
        let name = text(&dependency["name"]);
        if dependency["kind"] != "dev" && packages.contains_key(&name) {
            built_from(&name, packages, found);
        }
    }
}

/// A digest of its sources shows whether an image is up to date: a crate missing from the list could change
/// unseen, a surplus one would age images for nothing.
#[test]
fn digests_of_images_are_of_all_crates_that_they_are_made_of_and_no_others() {
    let (packages, root) = (packages(), root().canonicalize().expect("the root"));
    for (board, images) in [
        ("wheeleg-board", Images::G431),
        ("wheeleg-board-qemu", Images::Qemu),
    ] {
        let (_, files) = sources::digest(&root, images).expect("a digest");
        let files: BTreeSet<PathBuf> = files.into_iter().collect();
        let path = |value: &Value| {
            let path = PathBuf::from(text(value));
            path.canonicalize().expect("a file of the workspace")
        };
        let mut made_of = BTreeSet::new();
        built_from(board, &packages, &mut made_of);
        assert!(made_of.len() > 5, "{board}: {made_of:?}");
        let digested = packages
            .iter()
            .filter(|(_, package)| files.contains(&path(&package["manifest_path"])))
            .map(|(name, _)| name.clone());
        assert_eq!(digested.collect::<BTreeSet<_>>(), made_of, "{board}");
        for name in made_of {
            for target in packages[&name]["targets"].as_array().expect("targets") {
                let kind = target["kind"][0].as_str().expect("a kind");
                let source = path(&target["src_path"]);
                let in_an_image = !matches!(kind, "test" | "bench" | "example");
                assert_eq!(files.contains(&source), in_an_image, "{}", source.display());
            }
        }
    }
}

/// The sources that rows depend on tell parts of two programs apart: a crate missing from the list could
/// change them unseen.
#[test]
fn the_digest_of_campaigns_is_of_all_crates_that_they_are_made_of() {
    let (packages, root) = (packages(), root().canonicalize().expect("the root"));
    let script = fs::read_to_string(root.join("host-sim/campaign/build.rs")).expect("there");
    let mut made_of = BTreeSet::new();
    built_from("wheeleg-campaign", &packages, &mut made_of);
    assert!(made_of.len() > 10, "{made_of:?}");
    for name in made_of {
        let manifest = PathBuf::from(text(&packages[&name]["manifest_path"]));
        let folder = manifest.parent().expect("a folder");
        let folder = folder.canonicalize().expect("a folder");
        let below = folder.strip_prefix(&root).expect("below the root");
        let listed = format!("\"{}\",", below.to_string_lossy().replace('\\', "/"));
        assert!(script.contains(&listed), "{listed}");
    }
}

#[test]
fn the_plant_never_sees_fixed_point() {
    let plant = dependencies(&packages()["wheeleg-plant"]);
    assert!(!plant.contains("fixed"), "{plant:?}");
}

#[test]
fn micromath_is_used_in_the_master_alone() {
    for (name, package) in packages() {
        if name != "wheeleg-master" {
            assert!(!dependencies(&package).contains("micromath"), "{name}");
        }
    }
}

#[test]
fn versions_and_lints_stand_in_one_place() {
    for (name, package) in packages() {
        let path = text(&package["manifest_path"]);
        let manifest = fs::read_to_string(&path).expect("manifest");
        let mut section = String::new();
        let mut lints = false;
        for line in manifest.lines().map(str::trim) {
            if let Some(header) = line.strip_prefix('[') {
                section = header.trim_end_matches(']').to_owned();
                // `[dependencies.x]` would hide from the check below.
                assert!(
                    !section.contains("dependencies."),
                    "{name}: write [{section}] as one line"
                );
                continue;
            }
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            if section.ends_with("dependencies") {
                assert!(
                    line.contains("workspace = true") || line.contains(".workspace = true"),
                    "{name}: the version of `{line}` belongs into the root table"
                );
            }
            lints |= section == "lints" && line == "workspace = true";
        }
        assert!(lints, "{name} does not inherit the workspace's lints");
        for key in ["edition", "license", "publish", "rust-version", "version"] {
            if name == "wheeleg-pil-unicorn" && key == "license" {
                assert!(manifest.contains("license = \"GPL-2.0-only\""), "{name}");
                continue;
            }
            let inherited = format!("{key}.workspace = true");
            assert!(manifest.contains(&inherited), "{name}: {inherited}");
        }
    }
}

/// The compiler denies `unsafe` where nothing allows it.
#[test]
fn unsafe_is_allowed_for_board_glue_alone() {
    let lint = concat!("unsafe", "_code");
    let glue = |name: &str| UNSAFE_ALLOWED.iter().any(|folder| name.starts_with(folder));
    let mut allowed = rust_files();
    allowed.retain(|(name, text)| text.contains(lint) && !glue(name));
    let names: Vec<String> = allowed.into_iter().map(|(name, _)| name).collect();
    assert!(names.is_empty(), "{names:?}");
}

#[test]
fn no_file_refers_outside_the_repository() {
    // Written in pieces, so that this file is not its own counter-example.
    let patterns = [
        concat!("/ho", "me/"),
        concat!("/ro", "ot/"),
        concat!("/wo", "rk/"),
        concat!("/Us", "ers/"),
        concat!("../sha", "red"),
    ];
    let mut found = Vec::new();
    for (name, text) in files() {
        for (i, line) in text.lines().enumerate() {
            for pattern in patterns {
                for (at, _) in line.match_indices(pattern) {
                    // A path begins here, or this is part of a longer one.
                    let before = line[..at].chars().next_back();
                    if !before.is_some_and(|c| c.is_alphanumeric() || "._-~}".contains(c)) {
                        found.push(format!("{name}:{}: {pattern}", i + 1));
                    }
                }
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn every_source_file_can_be_read_in_one_sitting() {
    let long: Vec<String> = rust_files()
        .into_iter()
        .filter_map(|(name, text)| {
            let lines = text.lines().count();
            (lines > LINES_MAX).then(|| format!("{name}: {lines} lines"))
        })
        .collect();
    assert!(long.is_empty(), "{long:?}");
}

/// Features of the board crate that plant a mistake in its images.
const MUTANT: &str = "mutant";

#[test]
fn images_that_are_wrong_on_purpose_are_built_by_their_own_step_alone() {
    let packages = packages();
    let board = packages["wheeleg-board"]["features"].clone();
    let board = board.as_object().expect("features");
    let mutants: BTreeSet<&str> = board
        .keys()
        .map(String::as_str)
        .filter(|name| name.starts_with("mutant-"))
        .collect();
    assert!(mutants.len() >= 4, "{mutants:?}");
    for (name, package) in &packages {
        let features = package["features"].as_object().expect("features");
        for (feature, enabled) in features {
            let inside = name == "wheeleg-board" && feature.starts_with(MUTANT);
            let enabled = enabled.to_string();
            assert!(
                inside || !enabled.contains(MUTANT),
                "{name}: the feature {feature} enables {enabled}"
            );
        }
        // A dependency could enable it, too.
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let enabled = dependency["features"].to_string();
            assert!(!enabled.contains(MUTANT), "{name}: {dependency}");
        }
    }
    // One place builds all of them; the list of the flashed images has none.
    let builder = "xtask/src/firmware.rs";
    let source = fs::read_to_string(root().join(builder)).expect(builder);
    let listed: BTreeSet<&str> = source
        .split('"')
        .filter(|word| word.starts_with("mutant-"))
        .collect();
    assert_eq!(listed, mutants);
    let images = source.split("const IMAGES").nth(1).expect("the images");
    let images = images.split("];").next().expect("their list");
    assert!(
        images.contains("\"joint\"") && !images.contains(MUTANT),
        "{images}"
    );
    // Beside it, only the sources of the mistakes and the test that finds them.
    for (name, text) in files() {
        let theirs = name.starts_with("firmware/board/src/g431/")
            || [
                builder,
                "firmware/board/Cargo.toml",
                "tests/system/pil_driver.rs",
                "tests/system/pil_mutants.rs",
                "tests/system/workspace.rs",
            ]
            .contains(&name.as_str());
        if !name.ends_with(".md") && !theirs {
            let found = mutants.iter().find(|mutant| text.contains(**mutant));
            assert_eq!(found, None, "{name}");
        }
    }
}

/// No action of an operator or a robot depends on a settable clock: server and page use monotonic ones.
#[test]
fn no_clock_on_the_wall_reaches_the_console() {
    let mut read = Vec::new();
    let mut looked_at = 0;
    for (name, text) in files() {
        let of_server = ["host-sim/access/src/", "host-sim/console/src/"];
        let server = of_server.iter().any(|f| name.starts_with(f)) && name.ends_with(".rs");
        let page = name.starts_with("host-sim/report/page/") && name.ends_with(".js");
        if !server && !page {
            continue;
        }
        looked_at += 1;
        let lines = text.lines().map(code).zip(1..);
        let clocks = ["SystemTime", "UNIX_EPOCH", "Date.now", "new Date"];
        let found = lines.filter(|(line, _)| clocks.iter().any(|clock| line.contains(clock)));
        read.extend(found.map(|(line, number)| format!("{name}:{number}: {}", line.trim())));
    }
    assert!(looked_at > 60, "{looked_at} files");
    assert!(read.is_empty(), "{read:#?}");
}
