//! A technician's work on boards with the command line: commission them, change and store a parameter, and
//! read which one is at fault.

use crate::program;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

fn wheeleg(arguments: &[&str]) -> (bool, String) {
    let mut command = Command::new(program::path());
    let output = command
        .env("NO_COLOR", "1")
        .args(arguments)
        .output()
        .expect("runs");
    let said = [output.stdout, output.stderr].map(|b| String::from_utf8(b).expect("UTF-8"));
    // Line breaks of a message are for the width of the console.
    let words: Vec<String> = said.concat().lines().map(|l| l.trim().to_owned()).collect();
    (output.status.success(), words.join(" ").replace("│ ", ""))
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, text).expect(name);
    path
}

/// A robot that stands for `duration_s`, and its events.
fn scenario(folder: &Path, duration_s: f64, events: &str) -> PathBuf {
    let text = format!(
        "name = \"service\"\ndescription = \"boards\"\nrobot = \"wheeleg-2003\"\n\
         duration = {{ value = {duration_s:?}, unit = \"s\" }}\nseed = 1\ntargets = \"none\"\n\
         [motion]\nkind = \"stand\"\n{events}"
    );
    write(folder, "service.toml", &text)
}

fn event(at_s: f64, rest: &str) -> String {
    format!("[[events]]\nat = {{ value = {at_s:?}, unit = \"s\" }}\naction = \"command\"\n{rest}\n")
}

fn robot_with(folder: &Path, section: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/robots/wheeleg-2003.toml");
    let text = fs::read_to_string(root).expect("the robot");
    write(folder, "robot.toml", &format!("{text}\n{section}"))
}

#[test]
fn commissioned_boards_run_and_swapped_ones_are_named_with_both_ids() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(program::path());
    let output = command.arg("commission").output().expect("runs");
    assert!(output.status.success());
    let section = String::from_utf8(output.stdout).expect("UTF-8");
    assert_eq!(section.matches(" = \"").count(), 8, "{section}");
    let out = folder.path().join("out");
    let scenario = scenario(folder.path(), 0.2, "");
    let run = |section: &str| {
        let robot = robot_with(folder.path(), section);
        let arguments = ["run", &scenario.to_string_lossy(), "--robot"].map(str::to_owned);
        let more = [robot.to_string_lossy().into_owned(), "--out".to_owned()];
        let all: Vec<String> = arguments.into_iter().chain(more).collect();
        let mut all: Vec<&str> = all.iter().map(String::as_str).collect();
        let out = out.to_string_lossy();
        all.push(&out);
        wheeleg(&all)
    };
    let (good, said) = run(&section);
    assert!(good, "{said}");
    let swapped = section
        .replace("joint3 = ", "joint9 = ")
        .replace("joint4 = ", "joint3 = ")
        .replace("joint9 = ", "joint4 = ");
    let (good, said) = run(&swapped);
    assert!(!good);
    for words in [
        "the board at the address of joint 3 is 030303030303030303030303",
        "which belongs to joint 4; commissioned is 040404040404040404040404",
        "will not arm",
        "commission the robot again",
    ] {
        assert!(said.contains(words), "`{words}` in {said}");
    }
    let (good, said) = run(&section.replace("joint5 = \"05", "joint5 = \"0"));
    assert!(!good && said.contains("is not a unique id"), "{said}");
    let (good, said) = wheeleg(&["commission", "--fault", "other-interface:joint4@0s"]);
    assert!(
        !good && said.contains("joint 4") && said.contains("same version"),
        "{said}"
    );
    assert!(said.contains("The first difference is in"), "{said}");
}

#[test]
fn a_parameter_that_was_saved_is_back_after_the_board_lost_its_power() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = "board = 8\nparameter = \"following_error\"";
    let events = [
        event(0.1, "command = \"Disarm\""),
        event(
            0.2,
            &format!("command = \"WriteParameter\"\n{of}\nvalue = 12345"),
        ),
        event(0.3, "command = \"SaveParameters\"\nboard = 8"),
        event(
            0.5,
            &format!("command = \"WriteParameter\"\n{of}\nvalue = 777"),
        ),
        event(1.1, &format!("command = \"ReadParameter\"\n{of}")),
        // Within its own limits, but below the board's `stroke_min`: only the board refuses it.
        event(
            1.2,
            "command = \"WriteParameter\"\nboard = 1\nparameter = \"stroke_max\"\nvalue = -10",
        ),
    ];
    let scenario = scenario(folder.path(), 1.4, &events.concat());
    let out = folder.path().join("out");
    let (scenario, out_text) = (scenario.to_string_lossy(), out.to_string_lossy());
    let fault = "brown-out:wheel8=30@0.6s";
    let (good, said) = wheeleg(&["run", &scenario, "--out", &out_text, "--fault", fault]);
    assert!(good, "{said}");
    // Printed: the event, why, and the remedy.
    for words in [
        "wheel 8 is lost",
        "wheel 8 says why: it has restarted",
        "this was a brown-out",
    ] {
        assert!(said.contains(words), "`{words}` in {said}");
    }
    let events = fs::read_to_string(out.join("csv/events.csv")).expect("events");
    let values: Vec<&str> = events
        .lines()
        .filter_map(|line| line.split_once("following_error of wheel 8 is "))
        .map(|(_, value)| value.trim_end_matches('"'))
        .collect();
    assert_eq!(values, ["12345 counts", "777 counts", "12345 counts"]);
    assert!(events.contains("SaveParameters done"));
    assert!(events.contains("WriteParameter refused: joint 1: A value is outside"));
    // The boards' logs are beside it.
    assert!(events.contains(" logs at "));
    let page = fs::read_to_string(out.join("report.html")).expect("report");
    assert!(!page.contains(" logs at "));
}

/// Lost, half loaded or changed: the sum that a board reports is not that of the file.
#[test]
fn the_console_names_a_joint_with_other_parameters_than_the_robot_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |board: u8, parameter: &str, value: u32| {
        format!(
            "command = \"WriteParameter\"\nboard = {board}\nparameter = \"{parameter}\"\nvalue = {value}"
        )
    };
    let events = [
        event(0.1, "command = \"Disarm\""),
        event(0.2, &write(3, "motion_margin", 45)),
        event(0.3, &write(8, "following_error", 777)),
    ];
    let scenario = scenario(folder.path(), 8.0, &events.concat());
    let out = folder.path().join("out");
    let [scenario, out] = [scenario, out].map(|p| p.to_string_lossy().into_owned());
    let (good, said) = wheeleg(&["run", &scenario, "--out", &out]);
    assert!(good, "{said}");
    let told = "Its parameters in force are not those of the robot file.";
    assert_eq!(said.matches(told).count(), 1, "{said}");
    assert!(said.contains(&format!("joint 3: {told}")), "{said}");
}

/// A precharge that ends by its time holds the axis for two seconds at every arming; only the
/// boards notice.
#[test]
fn the_console_names_a_precharge_that_is_too_high() {
    let folder = tempfile::tempdir().expect("a folder");
    let robot = robot_with(folder.path(), "");
    let text = fs::read_to_string(&robot).expect("the robot");
    let none = text.lines().find(|line| line.starts_with("precharge "));
    let high = "precharge = { value = 4.4, unit = \"bar\", source = \"test\" }";
    let text = text.replace(none.expect("the robot tells it"), high);
    let robot = write(folder.path(), "robot.toml", &text);
    let events = ["Disarm", "Arm"].map(|name| format!("command = \"{name}\""));
    let events = [event(0.1, &events[0]), event(0.3, &events[1])].concat();
    let scenario = scenario(folder.path(), 3.6, &events);
    let out = folder.path().join("out");
    let [scenario, robot, out] = [scenario, robot, out].map(|p| p.to_string_lossy().into_owned());
    let (good, said) = wheeleg(&["run", &scenario, "--robot", &robot, "--out", &out]);
    assert!(good, "{said}");
    let late = "The precharge ended after 2000 ms without its pressure";
    let told: Vec<&str> = said.split("event ").filter(|e| e.contains(late)).collect();
    let in_start_up = |e: &&&str| e.contains("start-up");
    assert!(told.iter().any(|e| in_start_up(&e)), "{said}");
    assert!(!told.iter().all(|e| in_start_up(&e)), "{said}");
    assert!(
        told.iter()
            .all(|e| e.contains("lower the parameter precharge"))
    );
    assert!(!said.contains("The mode changed"), "{said}");
}

#[test]
fn the_console_names_who_babbles_and_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = scenario(folder.path(), 1.5, "");
    let out = folder.path().join("out");
    let (scenario, out) = (scenario.to_string_lossy(), out.to_string_lossy());
    let run = |fault: &str| {
        let (good, said) = wheeleg(&["run", &scenario, "--out", &out, "--fault", fault]);
        assert!(good, "{said}");
        said
    };
    let said = run("babble:joint5@0.3s..0.6s");
    for words in [
        "joint 5: It sends garbage in its own slot",
        "Switch the robot off and replace this board",
        "joint 5 says why: first fault",
        "its driver was cut off",
    ] {
        assert!(said.contains(words), "`{words}` in {said}");
    }
    let folder = Path::new(&*out);
    let link = fs::read_to_string(folder.join("csv/link-1.csv")).expect("link");
    assert!(
        link.lines().count() >= 2 && link.contains("crc [1]"),
        "{link}"
    );
    let page = fs::read_to_string(folder.join("report.html")).expect("report");
    assert!(page.contains("Bus as the boards heard it"));
    let said = run("babble-unguarded:joint5@0.3s..0.6s");
    for words in [
        "source unknown",
        "Unplug the boards one by one",
        "joint 5: It did not hear the garbage that all others heard",
    ] {
        assert!(said.contains(words), "`{words}` in {said}");
    }
    for innocent in ["joint 4", "wheel 8"] {
        assert!(
            !said.contains(&format!("{innocent}: It did not hear")),
            "{said}"
        );
    }
}
