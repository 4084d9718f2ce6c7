//! Disks that can only be read, or fill up: what is there is whole or named. Each disk is a file
//! system in memory, of a mount name space of its own.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::program;
use crate::stop::{files_below, log_of_a_run};

/// Runs a script in a mount name space of its own; `$0` is the program, `$1` the place of the disk,
/// the others its arguments. Its code, and what it said on standard error.
fn on_a_disk(script: &str, disk: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new("unshare")
        .args(["--mount", "--map-root-user", "bash", "-c", script])
        .arg(program::path())
        .arg(disk)
        .args(arguments)
        .env("NO_COLOR", "1")
        .output()
        .expect("unshare of util-linux");
    // Messages are wrapped to the width of a terminal.
    let said = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
    (output.status.code(), said)
}

/// A folder that nobody may write into, and one on a disk that is mounted to be read: refused by
/// its name before anything is computed, and nothing in it changes. In a mount name space of its own.
#[test]
fn a_disk_that_can_only_be_read_is_refused_by_its_name_at_once() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let log = log_of_a_run(dir.path());
    let disk = dir.path().join("disk");
    fs::create_dir(&disk).expect("created");
    for (arguments, code) in [
        (&["run", "three-step"][..], 2),
        (&["tune", "bench-vq110u"], 2),
        (&["compare", "--axis", "bench-vq110u", "--quick"], 2),
        (&["delay"], 2),
        (&["figures"], 2),
        (&["field", "sand-flat"], 2),
        (&["faults", "run", "--all"], 2),
        (&["view", &log], 2),
        (&["log", "recover", &log], 2),
        (&["export", "parquet", &log], 2),
        (&["export", "ros2", &log], 2),
        (&["export", "urdf"], 2),
        (&["plant", "export"], 2),
        (&["campaign", "run", "three-step-spread"], 74),
    ] {
        let script = "mount -t tmpfs -o size=64k,ro tmpfs \"$1\" || exit 77\n\
                      disk=\"$1\"; shift; exec \"$0\" \"$@\" --out \"$disk/out\"";
        let begin = Instant::now();
        let (ended, said) = on_a_disk(script, &disk, arguments);
        assert_eq!(ended, Some(code), "{arguments:?}: {said}");
        for word in ["disk/", "Read-only file system", "help: "] {
            assert!(said.contains(word), "{arguments:?}, {word}: {said}");
        }
        let took = begin.elapsed();
        assert!(
            took < Duration::from_secs(30),
            "{arguments:?} took {took:?}"
        );
    }
    assert_eq!(files_below(&disk), [""; 0]);
}

/// The disk fills while other studies write: what is there is whole or named, and nothing claims
/// to be done.
#[test]
fn a_disk_that_fills_under_any_study_is_told() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let log = log_of_a_run(dir.path());
    let disk = dir.path().join("disk");
    fs::create_dir(&disk).expect("created");
    let commands: [&[&str]; 7] = [
        &["tune", "bench-vq110u"],
        &["figures"],
        &["view", &log],
        &["log", "recover", &log],
        &["export", "parquet", &log],
        &["export", "ros2", &log],
        &["export", "urdf"],
    ];
    let mut filled = 0;
    for (number, kib) in [4, 12, 32, 64, 128, 256, 512, 1000, 2000, 4000]
        .into_iter()
        .enumerate()
    {
        for arguments in [commands[number % 7], commands[(number + 3) % 7]] {
            // What is left is listed before it goes with the name space.
            let script = format!(
                "mount -t tmpfs -o size={kib}k tmpfs \"$1\" || exit 77\n\
                 disk=\"$1\"; shift; \"$0\" \"$@\" --out \"$disk/out\"; code=$?\n\
                 echo left: $(find \"$disk\" -type f) >&2; exit $code"
            );
            let (code, said) = on_a_disk(&script, &disk, arguments);
            let told = format!("{arguments:?} on {kib} KiB: {said}");
            let full = said.contains("No space left on device");
            let code = code.expect("a code");
            assert_eq!(code == 2, full, "{code}: {told}");
            assert!(matches!(code, 0..=2), "{code}: {told}");
            let left = said.rsplit("left:").next().unwrap_or_default();
            assert!(
                !left.contains(".part") && !left.contains("recovered"),
                "{told}"
            );
            if full {
                filled += 1;
                // The one file that was to be made is not there in part.
                let single = ["view", "log"].contains(&arguments[0]) || arguments.contains(&"urdf");
                assert!(!single || left.trim().is_empty(), "{told}");
            }
        }
    }
    assert!(filled >= 10, "{filled} of 20 filled their disk");
}
