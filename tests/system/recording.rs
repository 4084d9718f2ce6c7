//! The program records a live robot: however the recording ends, it can be repeated.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::program;

/// Longest time that anything here may take.
const HUNG: Duration = Duration::from_secs(60);

/// `wheeleg serve` in a home of its own; `limits` are commands of the shell before it.
struct Served {
    child: Child,
    address: String,
    home: TempDir,
}

impl Served {
    fn new(limits: &str) -> Self {
        let home = tempfile::tempdir().expect("a folder");
        let mut child = Command::new("sh")
            .arg("-c")
            .arg(format!("{limits} exec \"$@\""))
            .arg("sh")
            .arg(program::path())
            .args(["serve", "stand", "--listen", "127.0.0.1:0", "--record"])
            .arg("--recordings")
            .arg(home.path().join("recordings"))
            .env("XDG_STATE_HOME", home.path())
            .stdout(Stdio::piped())
            .spawn()
            .expect("start");
        let mut first = String::new();
        let out = child.stdout.as_mut().expect("piped");
        BufReader::new(out).read_line(&mut first).expect("a line");
        let address = first.split_whitespace().nth(1).expect("an address");
        Self {
            child,
            address: address.to_owned(),
            home,
        }
    }

    fn ctl(&self, arguments: &[&str]) -> Output {
        Command::new(program::path())
            .args(["ctl", "--url", &self.address])
            .args(arguments)
            .env("XDG_STATE_HOME", self.home.path())
            .output()
            .expect("run")
    }

    fn state(&self) -> Value {
        let output = self.ctl(&["--json", "status"]);
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    /// Waits until the state is as wanted.
    fn until(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let begin = Instant::now();
        loop {
            let state = self.state();
            if wanted(&state) {
                return state;
            }
            assert!(begin.elapsed() < HUNG, "never {what}: {state}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ends the program with a signal; its exit code, and the home.
    fn end(mut self, signal: &str) -> (Option<i32>, TempDir) {
        let pid = self.child.id().to_string();
        let sent = Command::new("kill")
            .args([&format!("-{signal}"), &pid])
            .status();
        assert!(sent.expect("kill").success());
        let code = self.child.wait().expect("ended").code();
        (code, self.home)
    }
}

/// The port is in use: the keys are those of the server that runs.
#[test]
fn a_server_that_does_not_start_leaves_the_keys_as_they_are() {
    let served = Served::new("");
    let keys = || {
        let folder = served.home.path().join("wheeleg");
        ["control.key", "view.key"].map(|name| fs::read(folder.join(name)).expect("a key"))
    };
    let before = keys();
    let address = served.address.trim_start_matches("http://");
    let refused = Command::new(program::path())
        .args(["serve", "stand", "--new-key", "--listen", address])
        .env("XDG_STATE_HOME", served.home.path())
        .output()
        .expect("run");
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(before, keys());
    assert_eq!(served.ctl(&["stop"]).status.code(), Some(0));
    served.end("TERM");
}

/// The robot's status starts with a stop and its sender.
#[test]
fn the_status_of_a_stopped_robot_begins_with_the_stop() {
    let served = Served::new("");
    served.until("ready", |state| state["ready"] == true);
    assert_eq!(served.ctl(&["stop"]).status.code(), Some(0));
    served.until("stopped", |state| state["emergency_stop"] == true);
    let told = served.ctl(&["status"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.starts_with("STOPPED, wheeleg, "), "{told}");
    assert!(
        told.contains("stopped by \"wheeleg ctl\", over the HTTP API"),
        "{told}"
    );
    assert!(told.contains("joint 3 (left vertical)"), "{told}");
    assert_eq!(served.end("TERM").0, Some(143));
}

fn replay(folder: &Path) -> (Option<i32>, Value) {
    let output = Command::new(program::path())
        .args(["replay", "--json"])
        .arg(folder)
        .output()
        .expect("run");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{told}"));
    (output.status.code(), value)
}

#[test]
fn a_recording_repeats_after_term_and_after_a_kill() {
    for (signal, code) in [("TERM", Some(143)), ("KILL", None)] {
        let served = Served::new("");
        served.until("ready", |state| state["ready"] == true);
        let armed = served.ctl(&["take", "--", "Arm"]);
        assert!(armed.status.success(), "{armed:?}");
        served.until("two seconds old", |s| {
            s["master_us"].as_u64() > Some(2_300_000)
        });
        let (ended, home) = served.end(signal);
        assert_eq!(ended, code, "{signal}");
        let folder = home.path().join("recordings/0001");
        let (code, told) = replay(&folder);
        assert_eq!(code, Some(0), "{signal}: {told}");
        assert_eq!(told["same"], true, "{signal}: {told}");
        assert!(told["hashes_compared"].as_u64() >= Some(2), "{told}");
        assert!(told["inputs"].as_u64() >= Some(3), "{told}");
        let recorded = &told["recording"]["hash"];
        match signal {
            "TERM" => assert_eq!(recorded, &told["hash"]),
            _ => assert_eq!(recorded, &Value::Null),
        }
        let log = folder.join("log.mcap");
        let recovered = Command::new(program::path())
            .args(["log", "recover"])
            .arg(&log)
            .output()
            .expect("run");
        assert!(recovered.status.success(), "{recovered:?}");
        let text = String::from_utf8_lossy(&recovered.stdout).into_owned();
        assert_eq!(text.contains("whole already"), signal == "TERM", "{text}");
    }
}

/// A `ctl take` that makes the robot walk, and the state in which it does.
fn walking(served: &Served) -> (Child, Value) {
    served.until("ready", |state| state["ready"] == true);
    for command in ["Arm", "Stand"] {
        let done = served.ctl(&["take", "--", command]);
        assert!(done.status.success(), "{done:?}");
    }
    let walk = [
        "speed=60",
        "turn=0",
        "pattern=alternate",
        "lift=60",
        "nose=-20",
    ];
    let driver = Command::new(program::path())
        .args(["ctl", "--url", &served.address, "take", "--", "Walk"])
        .args(walk)
        .env("XDG_STATE_HOME", served.home.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("start");
    let state = served.until("walking", |state| state["phase"] == "walk");
    (driver, state)
}

/// Ctrl-C ends a walk as its own stop does: the next command is carried out, without a latched stop.
#[test]
fn a_walk_that_is_interrupted_ends_on_both_feet_and_control_is_free() {
    let served = Served::new("");
    let (driver, _) = walking(&served);
    let sent = Command::new("kill")
        .args(["-INT", &driver.id().to_string()])
        .status();
    assert!(sent.expect("kill").success());
    let ended = driver.wait_with_output().expect("ended");
    assert_eq!(ended.status.code(), Some(130), "{ended:?}");
    let state = served.state();
    assert_eq!(state["hold"], Value::Null, "{state}");
    assert_eq!(state["armed"], true, "{state}");
    assert_eq!(state["control"], Value::Null, "{state}");
    let next = served.ctl(&["take", "--", "JointReference", "joint=3", "stroke=120"]);
    assert!(next.status.success(), "{next:?}");
    assert_eq!(served.end("TERM").0, Some(143));
}

/// A computer that sleeps for a while under a walking robot: nobody has watched it meanwhile.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_server_that_was_suspended_holds_and_makes_up_for_nothing() {
    let served = Served::new("");
    let (mut driver, before) = walking(&served);
    let us = |state: &Value| state["master_us"].as_u64().expect("a time");
    let pid = served.child.id().to_string();
    let signal = |name: &str| {
        let sent = Command::new("kill").args([name, &pid]).status();
        assert!(sent.expect("kill").success());
    };
    signal("-STOP");
    std::thread::sleep(Duration::from_secs(10));
    signal("-CONT");
    let woken = Instant::now();
    let state = served.until("held", |state| !state["hold"].is_null());
    assert_eq!(state["hold"], "operator_lost", "{state}");
    assert!(state["pace"]["shifts"].as_u64() > before["pace"]["shifts"].as_u64());
    // From a look before the sleep to one after it: the time awake, and not a second more.
    let passed = Duration::from_micros(us(&state) - us(&before));
    assert!(
        passed < woken.elapsed() + Duration::from_secs(3),
        "{passed:?}"
    );
    let code = driver.wait().expect("ended").code();
    assert_ne!(code, Some(0), "the walk was cut off");
    assert_eq!(served.end("TERM").0, Some(143));
}

/// A file with a size limit acts as a full disk.
#[test]
fn a_full_disk_ends_the_recording_is_told_and_the_robot_goes_on() {
    let served = Served::new("trap '' XFSZ; ulimit -f 1200;");
    let state = served.until("failed", |state| state["recording"]["failure"].is_string());
    let failure = state["recording"]["failure"].as_str().expect("a text");
    assert!(failure.contains("File too large"), "{failure}");
    let at_us = state["master_us"].as_u64();
    served.until("going on", |s| {
        s["master_us"].as_u64() > at_us.map(|us| us + 200_000) && s["alive"] == true
    });
    let told = served.ctl(&["status"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.contains("recording 0001 ended early"), "{told}");
    let (code, home) = served.end("TERM");
    assert_eq!(code, Some(143));
    let folder = home.path().join("recordings/0001");
    let summary = fs::read_to_string(folder.join("recording.json")).expect("written");
    assert!(summary.contains("File too large"), "{summary}");
    let (code, told) = replay(&folder);
    assert_eq!(code, Some(0), "{told}");
    assert_eq!(told["same"], true, "{told}");
}

/// The command line reports every error of a wrong command, and takes control from no one.
#[test]
fn a_wrong_command_is_told_with_every_value_and_range() {
    let served = Served::new("");
    let long = "x".repeat(4000);
    for (arguments, code, parts) in [
        (
            &["take", "--", "Walk", "speed=30", "pattern=trot"][..],
            1,
            &["`pattern` is \"trot\"; allowed: alternate, tandem"][..],
        ),
        (
            &["take", "--", "JointReference", "stroke=999"],
            1,
            &["`joint` is missing", "`stroke` is 999; allowed: 0 to "],
        ),
        (
            &["take", "--", "SetGait", "push=-1"],
            1,
            &["`push` is -1; allowed: 0 to 60 s"],
        ),
        (
            &[
                "take",
                "--",
                "JointReference",
                "joint=3",
                "joint=4",
                "stroke=10",
            ],
            2,
            &["`joint` is given twice"],
        ),
        (
            &["take", "--", &long],
            2,
            &["4002 bytes", "allowed are 3840"],
        ),
        (&["inject", &long], 2, &["bytes: allowed are 3840"]),
        (
            &["inject", "bogus@0s"],
            1,
            &["\"bogus@0s\"", "write \"bogus\""],
        ),
        (
            &["inject", "pot-open:joint9"],
            1,
            &["`:joint1` to `:joint6`"],
        ),
        (&["speed", "50"], 2, &["'50'", "0.1 to 10"]),
        (&["speed", "-1"], 2, &["'-1'", "0.1 to 10"]),
        (&["speed", "nan"], 2, &["'nan'", "0.1 to 10"]),
    ] {
        let output = served.ctl(arguments);
        let said = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        for part in parts {
            assert!(said.contains(part), "{arguments:?}: no {part} in {said}");
        }
        assert_eq!(served.state()["control"], Value::Null, "{arguments:?}");
    }
    assert_eq!(served.end("TERM").0, Some(143));
}

#[test]
fn parameters_of_a_board_are_read_written_and_saved_from_the_command_line() {
    let served = Served::new("");
    served.until("ready", |state| state["ready"] == true);
    let param = |arguments: &[&str]| {
        let output = served.ctl(&[&["param"], arguments].concat());
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().replace("\n  │ ", " ");
        let (said, told) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(served.state()["control"], Value::Null, "{arguments:?}");
        (output.status.code(), said, told)
    };
    let (code, before, told) = param(&["get", "3", "error_scale"]);
    assert_eq!(code, Some(0), "{told}");
    assert!(before.ends_with(" mm") && before != "21.0 mm", "{before}");
    let (code, written, told) = param(&["set", "3", "error_scale", "21"]);
    assert_eq!((code, &*written), (Some(0), "21.0 mm"), "{told}");
    // Only that board, and it has the value.
    assert_eq!(param(&["get", "3", "error_scale"]).1, "21.0 mm");
    assert_eq!(param(&["get", "2", "error_scale"]).1, before);
    let json = served.ctl(&["--json", "param", "get", "3", "error_scale"]);
    let json: Value = serde_json::from_slice(&json.stdout).expect("JSON");
    let wanted = r#"{"board":3,"parameter":"error_scale","value":21.0,"unit":"mm"}"#;
    assert_eq!(json, serde_json::from_str::<Value>(wanted).expect("JSON"));
    for (arguments, code, part) in [
        (&["set", "3", "proportional", "5"][..], 1, "0 to 4 1/mm"),
        (&["set", "3", "proportional", "-1"], 1, "0 to 4 1/mm"),
        (&["set", "3", "proportional", "much"], 2, "'much'"),
        (
            &["get", "3", "error_scal"],
            1,
            "did you mean `error_scale`?",
        ),
        (&["get", "9", "error_scale"], 2, "from 1 to 8"),
        (&["save", "0"], 2, "from 1 to 8"),
    ] {
        let (ended, said, told) = param(arguments);
        assert_eq!((ended, &*said), (Some(code), ""), "{arguments:?}: {told}");
        assert!(told.contains(part), "{arguments:?}: no {part} in {told}");
    }
    let (code, said, told) = param(&["save", "3"]);
    assert_eq!((code, &*said), (Some(0), "done"), "{told}");
    // Not while the robot is armed, and not while someone drives.
    assert!(served.ctl(&["take", "--", "Arm"]).status.success());
    let (code, _, told) = param(&["save", "3"]);
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("disarm"), "{told}");
    assert_eq!(served.end("TERM").0, Some(143));
}
