//! The command line as a user meets it: good input, bad input, an interrupted run.

use crate::program;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use tempfile::TempDir;
use wheeleg_interface::archive;
use wheeleg_protocol::SCHEMA_HASH;

/// Longest time that any one call may take before it counts as hung.
const HUNG: Duration = Duration::from_secs(120);

fn wheeleg() -> Command {
    let mut command = Command::new(program::path());
    command.timeout(HUNG).env("NO_COLOR", "1");
    command
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("temporary folder")
}

fn source(path: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim");
    fs::read_to_string(root.join(path)).expect(path)
}

/// `text` with the first line of `key` replaced; fails if there is no such line.
fn with_line(text: &str, key: &str, line: &str) -> String {
    let prefix = format!("{key} = ");
    let old = text
        .lines()
        .find(|found| found.starts_with(&prefix))
        .unwrap_or_else(|| panic!("no `{key}` in\n{text}"));
    text.replacen(old, line, 1)
}

/// The three-step scenario, cut to `duration_s`, in a file of its own.
pub(crate) fn scenario_file(folder: &Path, duration_s: f64) -> PathBuf {
    let text = source("scenarios/three-step.toml");
    let duration = format!("duration = {{ value = {duration_s:?}, unit = \"s\" }}");
    let text = with_line(&text, "duration", &duration);
    let text = with_line(&text, "targets", "targets = \"none\"");
    write(folder, "short.toml", &text)
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, text).expect(name);
    path
}

/// Runs a scenario with `--json` and returns standard output's JSON.
fn summary(scenario: &Path, out: &Path, seed: &str) -> Value {
    let assert = wheeleg()
        .args(["run", "--json", "--seed", seed, "--out"])
        .args([out, scenario])
        .assert()
        .success();
    let stdout = String::from_utf8(assert.get_output().stdout.clone()).expect("UTF-8");
    let summary = serde_json::from_str(&stdout).unwrap_or_else(|e| panic!("{e}: {stdout}"));
    crate::schema::assert_valid(&summary, "run");
    assert!(summary["stopped"].is_null(), "{summary}");
    summary
}

/// The one MCAP log of a run.
fn log_of(out: &Path) -> PathBuf {
    let mut logs: Vec<PathBuf> = fs::read_dir(out)
        .expect("output folder")
        .map(|entry| entry.expect("entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "mcap"))
        .collect();
    assert_eq!(logs.len(), 1, "{logs:?}");
    logs.remove(0)
}

/// `NO_COLOR` wins over variables that force colours.
#[test]
fn no_colour_is_no_colour() {
    for forced in ["CLICOLOR_FORCE", "FORCE_COLOR"] {
        for arguments in [&["run", "nix"][..], &["run", "--nix"], &["run", "--help"]] {
            let mut command = wheeleg();
            let told = command
                .env(forced, "1")
                .args(arguments)
                .output()
                .expect("start");
            let said = String::from_utf8_lossy(&[told.stdout, told.stderr].concat()).into_owned();
            assert!(
                !said.is_empty() && !said.contains('\u{1b}'),
                "{forced}: {said:?}"
            );
        }
    }
}

/// The program's output, word for word; `TRYCMD=overwrite` rewrites it.
#[test]
fn texts_are_those_of_the_files() {
    trycmd::TestCases::new()
        .register_bin("wheeleg", program::path())
        .env("NO_COLOR", "1")
        .case("system/cli/*.md");
}

/// The largest seed: as a number of JSON it would lose its last digits.
const SEED: &str = "18446744073709551615";

#[test]
fn json_is_one_object_with_every_key() {
    let dir = folder();
    let out = dir.path().join("out");
    let json = summary(&scenario_file(dir.path(), 0.5), &out, SEED);
    let object = json.as_object().expect("an object");
    for key in [
        "scenario",
        "seed",
        "faults",
        "hash",
        "simulated_s",
        "wall_s",
        "realtime_factor",
        "targets",
    ] {
        assert!(object.contains_key(key), "no `{key}` in {json}");
    }
    assert_eq!(json["seed"], SEED);
    let recorded = json["recorded_s"].as_f64().expect("a number");
    assert!((recorded - 0.5).abs() < 1e-6, "{recorded}");
    // The start-up is simulated too.
    let simulated = json["simulated_s"].as_f64().expect("a number");
    assert!((1.0..5.0).contains(&(simulated - recorded)), "{simulated}");
    let hash = json["hash"].as_str().expect("text");
    assert_eq!(hash.len(), 64, "{hash}");
    assert!(hash.chars().all(|c| c.is_ascii_hexdigit()), "{hash}");
    let file: Value =
        serde_json::from_str(&fs::read_to_string(out.join("summary.json")).expect("summary.json"))
            .expect("JSON");
    assert_eq!(file, json, "summary.json and standard output agree");
}

#[test]
fn targets_carry_value_unit_band_and_verdict() {
    let dir = folder();
    let text = source("scenarios/three-step.toml");
    let scenario = write(dir.path(), "full.toml", &text);
    let out = dir.path().join("out");
    let assert = wheeleg()
        .args(["run", "--json", "--out"])
        .args([&out, &scenario])
        .assert();
    let stdout = &assert.get_output().stdout;
    let json: Value = serde_json::from_slice(stdout).expect("one JSON object");
    let targets = json["targets"].as_array().expect("targets");
    assert!(targets.len() >= 8, "{targets:?}");
    for target in targets {
        assert!(target["id"].is_string(), "{target}");
        assert!(target["unit"].is_string(), "{target}");
        assert!(target["pass"].is_boolean(), "{target}");
        for key in ["value", "min", "max"] {
            assert!(
                target[key].is_number() || target[key].is_null(),
                "{key} of {target}"
            );
        }
        // The verdict follows from the comparison alone.
        if let Some(value) = target["value"].as_f64() {
            let above = target["min"].as_f64().is_none_or(|min| value >= min);
            let below = target["max"].as_f64().is_none_or(|max| value <= max);
            assert_eq!(target["pass"], above && below, "{target}");
        }
    }
}

#[test]
fn the_seed_and_only_the_seed_changes_the_hash() {
    let dir = folder();
    let scenario = scenario_file(dir.path(), 0.5);
    let hash = |name: &str, seed: &str| {
        let json = summary(&scenario, &dir.path().join(name), seed);
        json["hash"].as_str().expect("hash").to_owned()
    };
    let first = hash("a", "7");
    assert_eq!(first, hash("elsewhere/and/deeper", "7"));
    assert_ne!(first, hash("b", "8"));
}

#[test]
fn an_unknown_scenario_is_named_with_what_there_is() {
    let dir = folder();
    let out = dir.path().join("out");
    let mut command = wheeleg();
    command
        .args(["run", "tree-step", "--out"])
        .arg(&out)
        .assert()
        .failure()
        .stderr(contains("tree-step").and(contains("three-step")));
    assert!(!out.exists(), "a run that never began leaves nothing");
}

/// Each value is within its limits; together the board refuses them.
#[test]
fn parameters_that_contradict_each_other_are_named_with_their_place() {
    let dir = folder();
    let out = dir.path().join("out");
    let robot = source("robots/wheeleg-2003.toml");
    let too_much = r#"precharge = { value = 5.5, unit = "bar", source = "ASSUMED: test" }"#;
    let empty = r#"stroke_min = { value = 200.0, unit = "mm", source = "ASSUMED: test" }"#;
    let none = robot.lines().find(|line| line.starts_with("precharge "));
    let head = "[node.vertical]\n";
    assert!(robot.contains(head));
    for (text, name) in [
        (
            robot.replace(none.expect("the robot tells it"), too_much),
            "node.joint.precharge",
        ),
        (
            robot.replace(head, &format!("{head}{empty}\n")),
            "node.vertical.stroke_min",
        ),
    ] {
        let file = dir.path().join("robot.toml");
        fs::write(&file, text).expect("written");
        let mut command = wheeleg();
        command
            .args(["run", "stand", "--robot"])
            .args([&file, &PathBuf::from("--out"), &out])
            .assert()
            .code(2)
            .stderr(
                contains("robot.toml")
                    .and(contains(name))
                    .and(contains("contradicts")),
            );
        assert!(!out.exists(), "a run that never began leaves nothing");
    }
}

/// Faults of two factors that overlap in every case: the list says so as the run does.
#[test]
fn a_list_of_a_plan_none_of_whose_cases_can_be_is_refused_as_its_run_is() {
    let dir = folder();
    let text = "name = \"p\"\nroot = 1\nsamples = 2\nsampler = \"random\"\n[base]\nscenario = \"stand\"\n\
                [factor.a]\nfault = \"pot-open:joint3@{}s\"\nuniform = { min = 0.5, max = 1 }\n\
                [factor.b]\nfault = \"pot-open:joint3@{}s\"\nuniform = { min = 0.5, max = 1 }\n";
    let plan = write(dir.path(), "p.toml", text);
    for list in [true, false] {
        let out = dir.path().join("out");
        let mut command = wheeleg();
        command
            .args(["campaign", "run"])
            .arg(&plan)
            .arg("--out")
            .arg(&out);
        if list {
            command.arg("--list");
        }
        command
            .assert()
            .code(2)
            .stdout("")
            .stderr(contains("no case of the first sample can be").and(contains("overlap")));
        assert!(!out.exists(), "nothing began");
    }
}

#[test]
fn a_wrong_unit_is_answered_with_file_field_value_and_allowed_units() {
    let dir = folder();
    let text = with_line(
        &source("scenarios/three-step.toml"),
        "duration",
        "duration = { value = 10.0, unit = \"mm\" }",
    );
    let scenario = write(dir.path(), "bad-unit.toml", &text);
    let mut command = wheeleg();
    command
        .args(["run", "--out"])
        .args([&dir.path().join("out"), &scenario])
        .assert()
        .failure()
        .stderr(
            contains("bad-unit.toml")
                .and(contains("duration"))
                .and(contains("mm"))
                .and(contains("ms")),
        );
}

#[test]
fn an_out_of_range_gain_is_answered_with_file_field_value_and_range() {
    let dir = folder();
    let robot = source("robots/wheeleg-2003.toml");
    let line = robot
        .lines()
        .find(|line| line.starts_with("proportional") && line.contains("value = "))
        .expect("a proportional gain in the robot file");
    let (key, rest) = line.split_once(" = ").expect("key = value");
    let (head, tail) = rest.split_once("value = ").expect("a value");
    let (_, tail) = tail.split_once(',').expect("a unit");
    let changed = robot.replacen(line, &format!("{key} = {head}value = 987654.0,{tail}"), 1);
    let robot = write(dir.path(), "wild.toml", &changed);
    let scenario = with_line(
        &source("scenarios/three-step.toml"),
        "robot",
        &format!("robot = {:?}", robot.to_str().expect("UTF-8")),
    );
    let scenario = write(dir.path(), "scenario.toml", &scenario);
    let mut command = wheeleg();
    command
        .args(["run", "--out"])
        .args([&dir.path().join("out"), &scenario])
        .assert()
        .failure()
        .stderr(
            contains("wild.toml")
                .and(contains(key))
                .and(contains("987654"))
                .and(contains("range")),
        );
}

#[test]
fn broken_toml_is_answered_with_the_line() {
    let dir = folder();
    let scenario = write(dir.path(), "torn.toml", "name = \"x\"\nduration = {\n");
    let mut command = wheeleg();
    command
        .args(["run", "--out"])
        .args([&dir.path().join("out"), &scenario])
        .assert()
        .failure()
        .stderr(contains("torn.toml"));
}

#[test]
fn an_output_folder_that_cannot_be_made_is_named_before_the_run() {
    let dir = folder();
    // Below a regular file: fails for root too.
    let file = write(dir.path(), "file", "not a folder");
    let mut command = wheeleg();
    command
        .args(["run", "three-step", "--out"])
        .arg(file.join("out"))
        .assert()
        .failure()
        .stderr(contains("file").and(contains("--out")));
    assert_eq!(fs::read_to_string(&file).expect("file"), "not a folder");
}

#[test]
fn every_mistake_of_a_file_is_told_once_with_the_name_of_the_file_above() {
    let dir = folder();
    let text = with_line(&source("scenarios/stand.toml"), "seed", "seed = -1");
    let scenario = write(dir.path(), "twice.toml", &text);
    let missing = dir.path().join("nowhere.toml");
    for (file, name) in [(&scenario, "twice.toml"), (&missing, "nowhere.toml")] {
        let assert = wheeleg()
            .current_dir(dir.path())
            .args(["run", name])
            .assert()
            .code(2);
        let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert_eq!(said.matches("wheeleg::config").count(), 1, "{said}");
        // In the heading, and above the lines of the file if there is one.
        let names = 1 + usize::from(file.exists());
        assert_eq!(said.matches(name).count(), names, "{said}");
    }
}

/// Nothing can be created below a regular file, so no run begins.
#[test]
fn options_without_a_command_are_those_of_a_run() {
    let dir = folder();
    let file = write(dir.path(), "file", "not a folder");
    let mut command = wheeleg();
    command
        .args(["--seed", "3", "--out"])
        .arg(file.join("out"))
        .assert()
        .code(2)
        .stderr(contains("cannot create the folder"));
}

#[test]
fn interfaces_are_listed_and_compared_and_bad_hashes_are_refused() {
    let own = format!("{SCHEMA_HASH:016x}");
    let earlier = archive::newest_earlier().expect("an earlier interface");
    let earlier = format!("{earlier:016x}");
    let listed = contains(format!("This program: {own}")).and(contains(&earlier));
    wheeleg().arg("interface").assert().success().stdout(listed);
    let first = contains("The first difference is in").and(contains("this program has"));
    let first = first.and(contains(format!("{earlier} has")));
    wheeleg()
        .args(["interface", &format!("0x{}", earlier.to_uppercase())])
        .assert()
        .success()
        .stdout(first);
    let all = contains(format!("- this program, {own}\n+ {earlier}\nin "));
    wheeleg()
        .args(["interface", &earlier, "--all"])
        .assert()
        .success()
        .stdout(all);
    wheeleg()
        .args(["interface", &own])
        .assert()
        .success()
        .stdout(contains("are the same"));
    for (bad, said) in [
        ("xyz", "`xyz` is not a hash"),
        ("1234", "16 hexadecimal digits"),
        ("+234567890abcdef", "is not a hash"),
        ("0123456789abcdef", "0123456789abcdef is not an interface"),
    ] {
        wheeleg()
            .args(["interface", bad])
            .assert()
            .code(2)
            .stdout("")
            .stderr(contains(said).and(contains(&own)));
    }
    wheeleg().args(["interface", "--all"]).assert().code(2);
}

/// All outputs give the times of events as those of the scenario, and report a refused command like a fault,
/// once.
#[test]
fn events_have_one_time_everywhere_and_refusals_are_told() {
    let dir = folder();
    let scenario = scenario_file(dir.path(), 1.0);
    let mut text = fs::read_to_string(&scenario).expect("written");
    for at in ["0.400", "0.600"] {
        text += &format!(
            "[[events]]\nat = {{ value = {at}, unit = \"s\" }}\naction = \"command\"\n\
             command = \"JointReference\"\njoint = 1\n\
             stroke = {{ value = 0.1, unit = \"m\" }}\n"
        );
    }
    let scenario = write(dir.path(), "refused.toml", &text);
    let out = dir.path().join("out");
    let fault = "pot-open:joint3@0.8s";
    let assert = wheeleg()
        .args(["run", "--fault", fault, "--out"])
        .args([&out, &scenario])
        .assert()
        .success();
    let told = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    let json = fs::read_to_string(out.join("summary.json")).expect("summary.json");
    let json: Value = serde_json::from_str(&json).expect("JSON");
    let messages: Vec<&str> = json["messages"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(Value::as_str)
        .collect();
    let refused: Vec<&&str> = messages
        .iter()
        .filter(|line| line.contains("JointReference"))
        .collect();
    assert!(
        refused.len() == 1 && refused[0].starts_with("0.4") && refused[0].ends_with("(2 times)"),
        "{messages:?}"
    );
    let page = fs::read_to_string(out.join("report.html")).expect("report.html");
    assert!(page.contains(&format!(
        ">0.800</td><td>scenario</td><td>fault {fault} begins"
    )));
    for message in messages {
        assert!(told.contains(&format!("event   {message}")), "{told}");
        let (time, _) = message.split_once(" s: ").expect("a time");
        assert!(page.contains(&format!(">{time}</td>")), "{message}");
    }
}

/// Ctrl-C in mid-run: the program ends by itself and says so, and the log up to then opens without errors.
#[cfg(unix)]
#[test]
fn a_scenario_finds_its_robot_beside_it_and_the_summary_tells_it_from_the_original() {
    let dir = folder();
    let sub = dir.path().join("sub");
    fs::create_dir(&sub).expect("folder");
    let robot = source("robots/wheeleg.toml");
    let changed = robot.replacen(
        "value = 0.010, unit = \"1/mm\"",
        "value = 0.011, unit = \"1/mm\"",
        1,
    );
    assert_ne!(robot, changed);
    write(&sub, "mine.toml", &changed);
    let short = with_line(
        &source("scenarios/stand.toml"),
        "duration",
        "duration = { value = 0.2, unit = \"s\" }",
    );
    let scenario = write(
        &sub,
        "scenario.toml",
        &with_line(&short, "robot", "robot = \"mine.toml\""),
    );
    let original = write(&sub, "original.toml", &short);
    let changed = summary(&scenario, &dir.path().join("a"), "1");
    let original = summary(&original, &dir.path().join("b"), "1");
    assert_eq!(changed["robot"], original["robot"]);
    assert_ne!(changed["robot_hash"], original["robot_hash"]);
}

#[test]
fn an_interrupted_run_leaves_a_readable_log() {
    let dir = folder();
    let scenario = scenario_file(dir.path(), 7200.0);
    let out = dir.path().join("out");
    let mut child = std::process::Command::new(program::path())
        .args(["run", "--json", "--out"])
        .args([&out, &scenario])
        .env("NO_COLOR", "1")
        .stdin(std::process::Stdio::null())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("start");
    let begin = Instant::now();
    let begun = || {
        out.is_dir()
            && fs::read_dir(&out).is_ok_and(|entries| {
                entries.flatten().any(|entry| {
                    entry.path().extension().is_some_and(|e| e == "mcap")
                        && entry.metadata().is_ok_and(|m| m.len() > 150_000)
                })
            })
    };
    while !begun() {
        if let Some(status) = child.try_wait().expect("status") {
            panic!("ended by itself with {status}");
        }
        assert!(begin.elapsed() < HUNG, "no log appeared");
        std::thread::sleep(Duration::from_millis(5));
    }
    let signalled = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .expect("kill");
    assert!(signalled.success());
    let asked = Instant::now();
    while child.try_wait().expect("status").is_none() {
        if asked.elapsed() > HUNG {
            let _ = child.kill();
            panic!("still running {HUNG:?} after Ctrl-C");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().expect("output");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.to_lowercase().contains("interrupt"), "{stderr}");
    // A handled signal ends with the shell's number for it, not by the signal.
    assert_eq!(output.status.code(), Some(130), "{stderr}");

    // The whole log reads, summary section and all.
    let bytes = fs::read(log_of(&out)).expect("log");
    let index = mcap::Summary::read(&bytes)
        .expect("summary section")
        .expect("a summary section");
    assert!(!index.chunk_indexes.is_empty());
    let mut last_ns = 0;
    let mut messages = 0_u64;
    let mut topics = std::collections::BTreeSet::new();
    for message in mcap::MessageStream::new(&bytes).expect("log") {
        let message = message.expect("message");
        last_ns = last_ns.max(message.log_time);
        messages += 1;
        topics.insert(message.channel.topic.clone());
    }
    assert!(topics.contains("/joint/1"), "{topics:?}");
    assert!(messages > 1000, "{messages}");
    let last_s = last_ns as f64 * 1e-9;
    assert!((0.1..3599.0).contains(&last_s), "{last_s}");
    // A summary, if there is one, must not claim a whole run.
    if let Ok(text) = fs::read_to_string(out.join("summary.json")) {
        let json: Value = serde_json::from_str(&text).expect("JSON");
        let simulated = json["simulated_s"].as_f64().expect("a number");
        assert!(simulated < 3599.0, "{simulated}");
    }
}

#[test]
fn a_board_of_another_interface_is_answered_with_what_to_do_about_it() {
    let dir = folder();
    let mut command = wheeleg();
    command
        .args(["run", "stand", "--fault", "other-interface:joint4@0s"])
        .arg("--out")
        .arg(dir.path().join("out"))
        .assert()
        .failure()
        .stderr(contains("build and flash this board").and(contains("supply").not()));
}

/// A program without a reader works like one with a reader.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_error_ends_nothing() {
    let dir = folder();
    let out = dir.path().join("out");
    let full = || {
        let file = fs::OpenOptions::new().write(true).open("/dev/full");
        std::process::Stdio::from(file.expect("/dev/full"))
    };
    let run = |scenario: &Path| {
        std::process::Command::new(program::path())
            .args(["run", "--out"])
            .args([&out, scenario])
            .stderr(full())
            .stdout(std::process::Stdio::null())
            .status()
            .expect("start")
    };
    let scenario = scenario_file(dir.path(), 0.2);
    // The second sets the results of the first aside, and would tell so.
    for _ in 0..2 {
        assert!(run(&scenario).success());
    }
    assert!(out.join("previous/log.mcap").exists());
    assert_eq!(run(&dir.path().join("none.toml")).code(), Some(2));
}

/// A file's own texts appear unchanged in pages, logs, tables and other files.
#[test]
fn texts_of_a_file_are_quoted_wherever_they_go() {
    const HOSTILE: &str = "</script><b onload='x'>\"a\", &amp; ;\u{202e}\tend";
    let dir = folder();
    let out = dir.path().join("out");
    let quoted = format!("{:?}", HOSTILE)
        .replace("\\u{202e}", "\\u202e")
        .replace("\\'", "'");
    let text = source("robots/wheeleg-2003.toml");
    let text = with_line(&text, "description", &format!("description = {quoted}"));
    let text = text.replace("\"ASSUMED: RS-485, not in the paper\"", &quoted);
    assert_eq!(
        text.matches("onload").count(),
        2,
        "description and a source"
    );
    let robot = write(dir.path(), "robot.toml", &text);
    let scenario = fs::read_to_string(scenario_file(dir.path(), 0.2)).expect("written");
    let scenario = with_line(&scenario, "description", &format!("description = {quoted}"));
    let scenario = write(dir.path(), "hostile.toml", &scenario);
    wheeleg()
        .args(["run", "--robot"])
        .arg(&robot)
        .arg("--out")
        .args([&out, &scenario])
        .assert()
        .success();
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(!page.contains("<b onload") && !page.contains("</script><b"));
    assert!(page.contains("&lt;b onload"), "it is shown");
    assert!(!page.contains('\u{202e}'), "the text runs as it is read");
    // A log page, a listing as JSON and an export read the same texts.
    wheeleg()
        .arg("view")
        .arg(out.join("log.mcap"))
        .assert()
        .success();
    let page = fs::read_to_string(out.join("log.html")).expect("a page");
    assert!(!page.contains("<b onload"));
    let listed = wheeleg()
        .args(["params", "--json"])
        .arg(&robot)
        .assert()
        .success();
    let listed: Value = serde_json::from_slice(&listed.get_output().stdout).expect("JSON");
    assert!(listed.to_string().contains("onload"));
    let urdf = wheeleg()
        .args(["export", "urdf"])
        .arg(&robot)
        .assert()
        .success();
    let urdf = String::from_utf8_lossy(&urdf.get_output().stdout).into_owned();
    assert!(!urdf.contains("<b onload"));
}

/// Text that no page and no other file can show is refused where it is read: in a text, a source or a name.
#[test]
fn control_characters_in_a_file_are_refused_with_their_place() {
    let dir = folder();
    let axis = source("axes/bench-vq110u.toml");
    let robot = source("robots/wheeleg-2003.toml");
    let hostile = "\"a\\u0000b\\u001b[31mc\"";
    let described =
        |text: &str| with_line(text, "description", &format!("description = {hostile}"));
    let axis_file = write(dir.path(), "axis.toml", &described(&axis));
    let robot_file = write(dir.path(), "robot.toml", &described(&robot));
    let sourced = axis.replace("\"ASSUMED: equal valves\"", hostile);
    assert_ne!(sourced, axis);
    let sourced = write(dir.path(), "sourced.toml", &sourced);
    let named = write(
        dir.path(),
        "named.toml",
        &format!("\"a\\u0007b\" = 1\n{axis}"),
    );
    let scenario = fs::read_to_string(scenario_file(dir.path(), 0.2)).expect("written");
    let scenario = write(dir.path(), "hostile.toml", &described(&scenario));
    let out = dir.path().join("out");
    for (arguments, file, place, character) in [
        (
            &["export", "fmu"][..],
            &axis_file,
            "`description`",
            "U+0000",
        ),
        (
            &["tune"],
            &sourced,
            "`cylinder.timing_spread.source`",
            "U+0000",
        ),
        (&["plant", "check"], &named, "`ab`", "U+0007"),
        (&["params"], &robot_file, "`description`", "U+0000"),
        (&["run"], &scenario, "`description`", "U+0000"),
    ] {
        let mut command = wheeleg();
        command.current_dir(dir.path()).args(arguments).arg(file);
        let said = command
            .assert()
            .code(2)
            .stdout("")
            .get_output()
            .stderr
            .clone();
        let said = String::from_utf8(said).expect("UTF-8");
        assert!(!said.contains(['\u{0}', '\u{1b}', '\u{7}']), "{said:?}");
        let said = said.replace("\n  │ ", " ");
        for part in [place, character, "allowed are", &file.to_string_lossy()] {
            assert!(said.contains(part), "{arguments:?}, {part}: {said}");
        }
    }
    assert!(!out.exists() && !dir.path().join("runs").exists());
}
