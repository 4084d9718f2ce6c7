//! Disks that are read-only, or fill up: every file is whole or named. Each disk is a file system in memory,
//! in its own mount name space.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::every_command::{Inputs, Leaves, tries};
use crate::program;
use crate::schema::assert_valid;
use crate::stop::files_below;

/// How a program ended.
struct Ended {
    code: Option<i32>,
    /// Its standard error.
    said: String,
    stdout: String,
}

/// Runs a script in a mount name space of its own; `$0` is the program, `$1` the place of the disk,
/// the others its arguments.
fn on_a_disk(script: &str, disk: &Path, arguments: &[&str]) -> Ended {
    let state = disk.with_file_name("state");
    let output = Command::new("unshare")
        .args(["--mount", "--map-root-user", "bash", "-c", script])
        .arg(program::path())
        .arg(disk)
        .args(arguments)
        .env("NO_COLOR", "1")
        .env("XDG_STATE_HOME", state)
        .output()
        .expect("unshare of util-linux");
    // Messages are wrapped to the width of a terminal.
    Ended {
        code: output.status.code(),
        said: String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " "),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
    }
}

/// A folder without write permission, and one on a read-only disk: refused by name before any computation,
/// and nothing in it changes. In its own mount name space.
#[test]
fn a_disk_that_can_only_be_read_is_refused_by_its_name_at_once() {
    let inputs = Inputs::new();
    let disk = inputs.path("disk");
    fs::create_dir(&disk).expect("created");
    let mut refused = 0;
    for tried in inputs.commands(true) {
        let Some(option) = tried.out else { continue };
        let script = format!(
            "mount -t tmpfs -o size=64k,ro tmpfs \"$1\" || exit 77\n\
             disk=\"$1\"; shift; exec \"$0\" \"$@\" {option} \"$disk/out\""
        );
        let arguments: Vec<&str> = tried.arguments.iter().map(String::as_str).collect();
        let begin = Instant::now();
        let Ended {
            code: ended, said, ..
        } = on_a_disk(&script, &disk, &arguments);
        assert_eq!(ended, Some(tried.unwritable), "{arguments:?}: {said}");
        for word in ["disk/", "Read-only file system", "help: "] {
            assert!(said.contains(word), "{arguments:?}, {word}: {said}");
        }
        let took = begin.elapsed();
        assert!(
            took < Duration::from_secs(30),
            "{arguments:?} took {took:?}"
        );
        refused += 1;
    }
    assert!(refused >= 20, "{refused} commands");
    assert_eq!(files_below(&disk), [""; 0]);
}

/// Sizes of a disk, KiB: from hardly more than a lock to room for everything.
const SIZES_KIB: [usize; 10] = [4, 12, 32, 64, 128, 256, 512, 1000, 2000, 4000];

/// The disk fills under every command that writes: every file is whole or named, nothing claims to be done,
/// and the verdict is printed whether or not its summary fits.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_disk_that_fills_under_any_command_is_told() {
    let inputs = Inputs::new();
    let disk = inputs.path("disk");
    let kept = inputs.path("kept.json");
    fs::create_dir(&disk).expect("created");
    let (mut filled, mut verdicts, mut tried_disks) = (0, 0, 0);
    for (number, tried) in inputs.commands(true).into_iter().enumerate() {
        let Some(option) = tried.out else { continue };
        let sizes = (0..tries(2, 10)).map(|k| SIZES_KIB[(3 * number + 7 * k) % 10]);
        for kib in sizes {
            tried_disks += 1;
            let serves = tried.arguments[0] == "serve";
            let seconds = if serves { 4 } else { 300 };
            // The files left are listed before the name space takes them. A server gets a signal to end.
            let script = format!(
                "mount -t tmpfs -o size={kib}k tmpfs \"$1\" || exit 77\n\
                 disk=\"$1\"; shift\n\
                 timeout --preserve-status -s TERM {seconds} \"$0\" \"$@\" {option} \"$disk/out\"; code=$?\n\
                 cp \"$disk/out/summary.json\" '{}' 2>/dev/null\n\
                 echo left: $(find \"$disk\" -type f -printf '%P ') >&2; exit $code",
                kept.display()
            );
            let _ = fs::remove_file(&kept);
            let study = matches!(tried.leaves, Leaves::Study(_));
            let mut arguments: Vec<&str> = tried.arguments.iter().map(String::as_str).collect();
            arguments.extend(study.then_some("--json"));
            let Ended { code, said, stdout } = on_a_disk(&script, &disk, &arguments);
            let told = format!("{arguments:?} on {kib} KiB: {said}");
            let code = code.expect("a code");
            let full = said.contains("No space left on device");
            let ended = serves && code == 143;
            assert!(
                ended || (code == tried.unwritable) == full,
                "{code}: {told}"
            );
            assert!(
                [0, 1, tried.unwritable].contains(&code) || ended,
                "{code}: {told}"
            );
            assert!(!said.contains("panicked"), "{told}");
            let left = said.rsplit("left:").next().unwrap_or_default();
            for half in [".part ", ".part\n", "recovered", ".tmp", ".json.new"] {
                assert!(!left.contains(half), "{half}: {told}");
            }
            filled += u32::from(full);
            // The single output file does not exist in part. A log breaks off.
            if full && tried.leaves == Leaves::File && option == "--out" {
                assert_eq!(left.trim(), "", "{told}");
            }
            // Before anything was computed: there is not even room for the head of a log.
            let begun = ["create the folder", "cannot lock", "cannot write the log"];
            let refused = stdout.is_empty() && begun.iter().any(|why| said.contains(why));
            // A study that is a campaign and cannot keep its rows ends; it goes on from those that it has kept.
            let is_campaign = ["field", "compare"].contains(&arguments[0]);
            let refused = refused || (full && is_campaign && stdout.is_empty());
            if let (Leaves::Study(name), false) = (tried.leaves, refused) {
                let summary: Value = serde_json::from_str(&stdout)
                    .unwrap_or_else(|e| panic!("no verdict ({e}), {told}"));
                assert_valid(&summary, name);
                if let Ok(written) = fs::read(&kept) {
                    let written: Value = serde_json::from_slice(&written)
                        .unwrap_or_else(|e| panic!("half a summary ({e}), {told}"));
                    assert_eq!(written, summary, "{told}");
                } else {
                    assert!(said.contains("summary.json"), "{told}");
                }
                verdicts += u32::from(full);
            }
            if arguments[..2] == ["campaign", "report"] {
                assert!(stdout.contains("passed"), "{stdout}, {told}");
            }
            if arguments[0] == "replay" {
                assert!(stdout.contains("bit-identical") || refused, "{told}");
            }
        }
    }
    println!("{filled} of {tried_disks} commands filled their disk");
    assert!(3 * filled >= tried_disks, "{filled} of {tried_disks}");
    assert!(verdicts >= 3, "{verdicts} verdicts on a full disk");
}

/// A limit on file size kills no command by its signal: each reports that a file is too large, with the exit
/// code of a file that cannot be written.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_limit_on_the_size_of_files_ends_no_command_without_a_message() {
    const KIB: usize = 8;
    let inputs = Inputs::new();
    let (mut tried_commands, mut refused) = (0, 0);
    for (number, tried) in inputs.commands(true).into_iter().enumerate() {
        let Some(option) = tried.out else { continue };
        let seconds = if tried.arguments[0] == "serve" {
            4
        } else {
            300
        };
        let script = format!(
            "ulimit -f {KIB}; exec timeout --preserve-status -s TERM {seconds} \"$0\" \"$@\""
        );
        let output = Command::new("bash")
            .current_dir(inputs.path(""))
            .env("XDG_STATE_HOME", inputs.path("state"))
            .args(["-c", &script])
            .arg(program::path())
            .args(&tried.arguments)
            .arg(option)
            .arg(inputs.path(&format!("limited-{number}")))
            .output()
            .expect("start");
        // Lines of a message may break anywhere.
        let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        let code = output.status.code().expect("a code");
        let told = format!("{:?}: {code}, {said}", tried.arguments);
        tried_commands += 1;
        let large = said.contains("File too large");
        assert!(!large || code == tried.unwritable || code == 143, "{told}");
        assert!(large || matches!(code, 0 | 1 | 143), "{told}");
        refused += u32::from(large);
    }
    println!("{refused} of {tried_commands} commands met the limit");
    assert!(
        2 * refused >= tried_commands,
        "{refused} of {tried_commands}"
    );
}
