//! The `wheeleg` program under test, built as the tests themselves are.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::SystemTime;

/// Source folders of the program, relative to the root.
const SOURCES: [&str; 3] = ["host-sim", "firmware", "protocol"];

/// Path of the program.
///
/// `cargo test --workspace` builds it beside the tests. `cargo test -p
/// wheeleg-tests` does not, so it is built here if it is missing or older than
/// its sources.
pub(crate) fn path() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| {
        let test = std::env::current_exe().expect("path of the test program");
        // target/<profile>/deps/<test>
        let profile = test.ancestors().nth(2).expect("folder of the profile");
        let program = profile.join(format!("wheeleg{}", std::env::consts::EXE_SUFFIX));
        let built = fs::metadata(&program).and_then(|m| m.modified()).ok();
        let root = Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .expect("the workspace root");
        if built.is_none_or(|built| built < newest(root)) {
            build(root, profile);
        }
        assert!(program.is_file(), "{} was not built", program.display());
        program
    })
}

fn newest(root: &Path) -> SystemTime {
    let mut newest = SystemTime::UNIX_EPOCH;
    let mut folders: Vec<PathBuf> = SOURCES.iter().map(|name| root.join(name)).collect();
    while let Some(folder) = folders.pop() {
        // Tests are not part of the program.
        if folder.ends_with("tests") || folder.ends_with("benches") {
            continue;
        }
        for entry in fs::read_dir(&folder).expect("sources").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path
                .extension()
                .is_some_and(|e| e == "rs" || e == "toml" || e == "html")
            {
                let changed = entry.metadata().and_then(|m| m.modified());
                newest = newest.max(changed.expect("time of change"));
            }
        }
    }
    newest
}

fn build(root: &Path, profile: &Path) {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let release = profile.ends_with("release");
    let status = Command::new(cargo)
        .args([
            "build",
            "--quiet",
            "--workspace",
            "--exclude",
            "wheeleg-pil-unicorn",
            "--bin",
            "wheeleg",
            // With a test, the features are those of the tests.
            "--test",
            "determinism",
        ])
        .args(["--profile", if release { "release" } else { "test" }])
        .arg("--target-dir")
        .arg(profile.parent().expect("target folder"))
        .current_dir(root)
        .status()
        .expect("cargo build");
    assert!(status.success(), "cargo build ended with {status}");
}
