//! Recordings: an operator's inputs repeat to the bit, however the recording ended; a folder that is no
//! recording, or was tampered with, is reported.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use miette::Diagnostic as _;
use serde_json::{Value, json};
use wheeleg_console::ConsoleError;
use wheeleg_console::client::http;
use wheeleg_console::replay::{Replayed, recorded, replay};
use wheeleg_telemetry::{Derived, attachments, first_difference, read_derived};

use crate::common::{TestRig, done, refusal};
use crate::control::revokes;

fn folder(rig: &TestRig, id: &str) -> PathBuf {
    rig.home.path().join("recordings").join(id)
}

fn told(folder: &Path, log: Option<&Path>) -> Result<Replayed, ConsoleError> {
    replay(
        recorded(folder)?,
        log,
        &mut |_, _| ControlFlow::Continue(()),
    )
}

fn repeated(folder: &Path) -> Replayed {
    told(folder, None).expect("a recording")
}

/// The error for a folder, with the problems of its files.
fn error(folder: &Path) -> String {
    let told = told(folder, None).expect_err("no recording");
    let related = told.related().into_iter().flatten();
    let problems: Vec<String> = related.map(|problem| problem.to_string()).collect();
    format!("{told} {}", problems.join(" "))
}

fn copied(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().expect("a folder");
    for entry in fs::read_dir(folder).expect("there") {
        let from = entry.expect("there").path();
        fs::copy(&from, copy.path().join(from.file_name().expect("a name"))).expect("copied");
    }
    copy
}

/// An operator arms, moves, tries a fault, stops, and is gone.
fn drive(rig: &TestRig) {
    let mut driver = rig.driver("driver");
    let args = json!({ "joint": 3, "stroke": 120.3 });
    driver
        .carry_out("JointReference", &args, 500)
        .expect("sent");
    rig.until("a while later", |state| {
        state["master_us"].as_u64() > Some(2_000_000)
    });
    let fault = json!({ "fault": "pot-open:joint3" });
    driver.carry_out("Inject", &fault, 500).expect("sent");
    rig.until("held", |state| !state["hold"].is_null());
    driver.carry_out("EndFault", &fault, 500).expect("sent");
    let (status, _) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
    drop(driver);
    rig.until("free", |state| state["control"].is_null());
}

#[test]
fn a_session_under_an_operators_hands_is_repeated_to_the_bit() {
    let rig = TestRig::recorded(1.0);
    drive(&rig);
    let folder = folder(&rig, "0001");
    let TestRig { server, home, .. } = rig;
    drop(server);
    let log = home.path().join("again.mcap");
    let told = told(&folder, Some(&log)).expect("a recording");
    assert!(told.is_same() && !told.cut_short, "{told:?}");
    // One hash per second, and that of the end.
    assert!(told.compared > told.end_ms / 1_000, "{told:?}");
    assert_eq!(told.summary.hash.as_ref(), Some(&told.hash));
    assert_eq!(told.summary.dropped, 0);
    let first = first_difference(&folder.join("log.mcap"), &log).expect("two logs");
    assert_eq!(first, None);

    // One changed digit in one command makes another session; the second of the difference is reported.
    let other = copied(&folder);
    let inputs = other.path().join("inputs.jsonl");
    let text = fs::read_to_string(&inputs).expect("inputs");
    assert!(text.contains("120.3"), "{text}");
    fs::write(&inputs, text.replace("120.3", "120.4")).expect("written");
    let line = text.lines().find(|line| line.contains("120.3"));
    let line: Value = serde_json::from_str(line.expect("a line")).expect("JSON");
    let given_ms = line["ms"].as_u64().expect("a time");
    let told = repeated(other.path());
    let (from_ms, to_ms) = told.parted.expect("another session");
    assert!(!told.is_same());
    assert!(
        (from_ms..=to_ms).contains(&given_ms),
        "{given_ms}: {told:?}"
    );
    assert!(to_ms - from_ms <= 1_000, "{told:?}");

    // A program that was killed leaves no end, and perhaps half a line.
    let killed = copied(&folder);
    let mut summary: Value =
        serde_json::from_slice(&fs::read(killed.path().join("recording.json")).expect("read"))
            .expect("JSON");
    summary["end_us"] = Value::Null;
    summary["hash"] = Value::Null;
    fs::write(killed.path().join("recording.json"), summary.to_string()).expect("written");
    fs::write(killed.path().join("inputs.jsonl"), &text[..text.len() - 9]).expect("written");
    let told = repeated(killed.path());
    assert!(told.is_same() && told.cut_short, "{told:?}");
    assert!(told.compared >= 2, "{told:?}");
}

/// Who revoked whose control is in the recording, and on `/session`.
#[test]
fn a_revoked_control_is_recorded_and_repeats() {
    let rig = TestRig::recorded(1.0);
    let driver = rig.driver("driver");
    let mut owner = rig.control("owner");
    revokes(&mut owner);
    let state = rig.until("over", |state| state["control"].is_null());
    assert_eq!(state["hold"], "operator_lost");
    let query = "samples?channel=/session";
    let (_, told) = http(&rig.url, "GET", query, &rig.keys.view).expect("an answer");
    let rows = told["rows"].as_array().expect("a list");
    let row = rows.iter().find(|row| row[1] == "revoked").expect("a row");
    assert_eq!(row[3], "owner", "{row}");
    let text = row[row.as_array().map_or(0, Vec::len) - 1].as_str();
    assert!(text.is_some_and(|text| text.contains("driver")), "{row}");
    drop((driver, owner));
    let folder = folder(&rig, "0001");
    let TestRig { server, home, .. } = rig;
    drop(server);
    let inputs = fs::read_to_string(folder.join("inputs.jsonl")).expect("inputs");
    assert!(
        inputs.contains(r#""revoked":{"holder":"driver","by":"owner"}"#),
        "{inputs}"
    );
    let told = repeated(&folder);
    assert!(told.is_same(), "{told:?}");
    drop(home);
}

#[test]
fn a_recording_begins_and_ends_when_it_is_asked_to_and_still_repeats() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    assert_eq!(refusal(&mut driver, "RecordStop", &json!({})), "recording");
    done(&mut driver, "RecordStart");
    let state = rig.until("recorded", |state| !state["recording"].is_null());
    assert_eq!(state["recording"]["id"], "0001");
    assert_eq!(state["recording"]["failure"], Value::Null);
    assert_eq!(refusal(&mut driver, "RecordStart", &json!({})), "recording");
    let mut other = rig.control("other");
    crate::common::look(&mut other, "state");
    assert_eq!(
        refusal(&mut other, "RecordStop", &json!({})),
        "control_held"
    );
    done(&mut driver, "Stand");
    done(&mut driver, "RecordStop");
    let state = rig.until("no longer", |state| state["recording"].is_null());
    assert_eq!(state["armed"], true);
    done(&mut driver, "RecordStart");
    done(&mut driver, "RecordStop");
    let list = || {
        let (status, list) =
            http(&rig.url, "GET", "recordings", &rig.keys.view).expect("an answer");
        assert_eq!(status, 200);
        list["recordings"].as_array().expect("a list").clone()
    };
    let list = list();
    let ids: Vec<&Value> = list.iter().map(|r| &r["id"]).collect();
    assert_eq!(ids, ["0002", "0001"]);
    assert!(list[1]["log_bytes"].as_u64() > Some(10_000), "{list:?}");
    let first = repeated(&folder(&rig, "0001"));
    assert!(first.is_same(), "{first:?}");
    assert!(first.summary.begin_us > 0 && first.inputs > 2);
    // A viewer finds robot, ground and forces in a log that begins in mid-run.
    let log = folder(&rig, "0001").join("log.mcap");
    assert_eq!(attachments(&log).expect("a log")[0].name, "robot.urdf");
    let mut counts = [0; 5];
    let whole = read_derived(&log, &mut |channel, _, _| {
        counts[channel as usize] += 1;
        ControlFlow::Continue(())
    });
    assert!(whole.expect("a log"));
    let count = |channel| counts[channel as usize];
    assert_eq!(count(Derived::Scene), 1);
    assert!(count(Derived::Tf) > 5 && count(Derived::Tf) == count(Derived::JointStates));
    let (frames, forces) = (count(Derived::Tf), count(Derived::Contacts));
    assert!(forces * 2 + 4 > frames && forces < frames, "{counts:?}");
    let second = repeated(&folder(&rig, "0002"));
    assert!(
        second.is_same() && second.end_ms > first.end_ms,
        "{second:?}"
    );
}

#[test]
fn a_folder_that_cannot_be_made_is_told_and_the_robot_goes_on() {
    let rig = TestRig::new();
    fs::write(rig.home.path().join("recordings"), "a file").expect("written");
    let mut driver = rig.driver("driver");
    assert_eq!(refusal(&mut driver, "RecordStart", &json!({})), "recording");
    let begin = Instant::now();
    // Once the path is freed, it works.
    fs::remove_file(rig.home.path().join("recordings")).expect("removed");
    done(&mut driver, "RecordStart");
    done(&mut driver, "RecordStop");
    assert!(begin.elapsed() < Duration::from_secs(10));
    assert!(repeated(&folder(&rig, "0001")).is_same());
    assert_eq!(rig.state()["armed"], true);
}

#[test]
fn a_folder_that_is_no_recording_or_was_tampered_with_is_told_by_file_and_line() {
    let nothing = tempfile::tempdir().expect("a folder");
    assert!(error(nothing.path()).contains("recording.json"));
    let folder = {
        let rig = TestRig::recorded(2.0);
        rig.until("ready", |state| state["ready"] == true);
        let folder = folder(&rig, "0001");
        drop(rig.server);
        copied(&folder)
    };
    let inputs = folder.path().join("inputs.jsonl");
    for (lines, wanted) in [
        (
            "{\"ms\":5,\"stop\":1}\n{\"ms\":4,\"stop\":2}\n",
            "line 2: `ms` is 4",
        ),
        ("{\"ms\":99999999999999,\"stop\":1}\n", "line 1: `ms`"),
        ("{\"ms\":1,\"fly\":1}\n", "line 1"),
        ("{\"ms\":-1,\"stop\":1}\n", "`ms`, a whole number"),
        ("[]\n", "line 1: it is no input"),
        ("\u{0}\u{1}\n", "line 1"),
        (
            "{\"ms\":1,\"command\":{\"id\":1,\"deadline_us\":9,\"spoken\":{\"cmd\":\"Fly\",\"args\":{}}}}\n",
            "no command \"Fly\"",
        ),
        (
            "{\"ms\":1,\"command\":{\"id\":1,\"deadline_us\":9,\"spoken\":{\"cmd\":\"Pause\",\"args\":{}}}}\n",
            "Pause is not a command of the robot",
        ),
        (
            "{\"ms\":1,\"fault_begins\":\"pot-open:joint9\"}\n",
            "joint9",
        ),
    ] {
        fs::write(&inputs, lines).expect("written");
        let told = error(folder.path());
        assert!(
            told.contains("inputs.jsonl") && told.contains(wanted),
            "{told}"
        );
    }
    let long = format!("{{\"ms\":1,\"fault_begins\":\"{}\"}}\n", "x".repeat(9_000));
    fs::write(&inputs, long).expect("written");
    assert!(error(folder.path()).contains("too long"));
    fs::remove_file(&inputs).expect("removed");
    assert!(error(folder.path()).contains("inputs.jsonl"));
    let summary = folder.path().join("recording.json");
    // A time so late that nobody waits for it, and an invalid robot.
    let sound = fs::read_to_string(&summary).expect("read");
    fs::write(&inputs, "").expect("written");
    let mut late: Value = serde_json::from_str(&sound).expect("JSON");
    late["end_us"] = json!(u64::MAX);
    fs::write(&summary, late.to_string()).expect("written");
    let told = error(folder.path());
    let wanted = [
        "recording.json",
        "`end_us` is 18446744073709551615",
        "0 to 2678400000000",
    ];
    assert!(wanted.iter().all(|word| told.contains(word)), "{told}");
    fs::write(&summary, sound).expect("written");
    let robot = folder.path().join("robot.toml");
    let text = fs::read_to_string(&robot).expect("read");
    fs::write(&robot, format!("{text}\nwings = 2\n")).expect("written");
    let told = error(folder.path());
    assert!(
        told.contains("robot.toml") && told.contains("`wings`"),
        "{told}"
    );
    fs::write(&summary, "x".repeat(100_000)).expect("written");
    assert!(error(folder.path()).contains("100000 bytes"));
    fs::write(&summary, "{}").expect("written");
    assert!(error(folder.path()).contains("recording.json"));
    // A device has no end, and a pipe may never begin.
    #[cfg(unix)]
    {
        fs::remove_file(&summary).expect("removed");
        std::os::unix::fs::symlink("/dev/zero", &summary).expect("linked");
        assert!(error(folder.path()).contains("not a file"));
        fs::remove_file(&summary).expect("removed");
        let made = std::process::Command::new("mkfifo").arg(&summary).status();
        assert!(made.expect("mkfifo").success());
        assert!(error(folder.path()).contains("not a file"));
    }
}
