//! The fault matrix: every row of host-sim/FAULTS.md is run, and comes out as it must or
//! as the shortfalls of that file say; no fault trips where there is none.

use crate::program;
use crate::sil;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

use crate::sil::{gait, robot, run, scenario, story};
use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use wheeleg_config::faults::{FaultKind, KINDS};
use wheeleg_config::{EventAction, LegChoice, Motion, builtin};
use wheeleg_interface::{Side, archive, first_difference};
use wheeleg_master::command::Command as UserCommand;
use wheeleg_protocol::SCHEMA_HASH;
use wheeleg_studies::matrix::{self, Expect, ROWS, Verdict};
use wheeleg_studies::study::Progress;
use wheeleg_telemetry::Recorder;

const DOCUMENT: &str = include_str!("../../host-sim/FAULTS.md");

/// Names between back-ticks in a text.
fn names(text: &str) -> BTreeSet<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

/// Rows that the document's table lists, in its last column.
fn documented() -> BTreeSet<&'static str> {
    let lines = DOCUMENT.lines().filter(|line| line.starts_with("| "));
    let lines = lines.filter_map(|line| line.trim_end_matches(" |").rsplit_once('|'));
    lines.flat_map(|(_, rows)| names(rows)).collect()
}

/// Rows known to come out wrong.
fn shortfalls() -> BTreeSet<&'static str> {
    let (_, rest) = DOCUMENT
        .split_once("<!-- begin shortfalls -->")
        .expect("begin");
    let (list, _) = rest.split_once("<!-- end shortfalls -->").expect("end");
    names(list)
}

#[test]
fn the_table_has_the_rows_of_the_document() {
    let listed = documented();
    let coded: BTreeSet<&str> = ROWS.iter().map(|row| row.id).collect();
    assert_eq!(listed, coded);
    assert!(
        coded.len() == ROWS.len() && ROWS.len() >= 70,
        "{}",
        ROWS.len()
    );
    // The document lists exactly the faults that are not implemented.
    let (_, rest) = DOCUMENT.split_once("## Not implemented").expect("section");
    let (section, _) = rest.split_once("##").expect("next section");
    for row in ROWS {
        let stated = names(section).contains(row.id);
        let missing = matches!(row.expect, Expect::NotImplemented);
        assert_eq!(stated, missing, "{}", row.id);
    }
}

/// Numbers of a text: `0.9 to 3.1 ms` has 0.9 and 3.1.
fn numbers(text: &str) -> BTreeSet<&str> {
    let parts = text.split(|c: char| !c.is_ascii_digit() && c != '.' && c != '-');
    let parts = parts.map(|part| part.trim_matches('.'));
    parts.filter(|part| part.parse::<f64>().is_ok()).collect()
}

/// The document's limits are those by which the rows are judged.
#[test]
fn the_document_has_the_limits_of_its_rows() {
    let lines = DOCUMENT.lines().filter(|line| line.starts_with("| "));
    let mut judged = 0;
    for line in lines {
        let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
        let [_, _, within, _, listed] = cells[..] else {
            continue;
        };
        let stated = numbers(within);
        for row in ROWS.iter().filter(|row| names(listed).contains(row.id)) {
            let mut limits = match row.expect {
                Expect::Stop(stop) => {
                    let own = (stop.axis > 0).then_some(stop.own_ms);
                    let from = Some(stop.detected_ms[0]).filter(|ms| *ms > 0.0);
                    let all = [Some(stop.detected_ms[1]), Some(stop.all_ms), own, from];
                    all.into_iter().flatten().collect()
                }
                Expect::GoesOn { deviation_mm } => vec![deviation_mm],
                _ => Vec::new(),
            };
            limits.extend(row.held_mm);
            for limit in limits {
                judged += 1;
                let limit = limit.to_string();
                assert!(stated.contains(&*limit), "{}: {limit} in{within}", row.id);
            }
        }
    }
    assert!(judged > 130, "{judged} limits");
}

/// A fault that no row injects would remain unmeasured.
#[test]
fn every_fault_of_the_catalogue_is_in_a_row() {
    // Restarts have tests of their own (restart.rs).
    let elsewhere = [FaultKind::MasterReset, FaultKind::ClientReset];
    for kind in KINDS.iter().filter(|k| !elsewhere.contains(&k.kind)) {
        let faults = ROWS.iter().flat_map(|row| row.faults);
        let name = |what: &str| what.split([':', '=']).next().unwrap_or("").to_owned();
        let found = faults.map(|s| name(s.what)).any(|n| n == kind.name);
        assert!(found, "no row injects {}", kind.name);
    }
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn every_row_comes_out_as_it_must_or_as_the_shortfalls_say() {
    let rows: Vec<_> = ROWS.iter().collect();
    let outcomes = matrix::run(&rows, 1, &Progress::silent()).expect("the runs without faults");
    assert_eq!(outcomes.len(), ROWS.len());
    let known = shortfalls();
    let mut wrong = String::new();
    for o in &outcomes {
        let id = o.row.id;
        let failed = o.verdict == Verdict::Fail;
        if failed && !known.contains(id) {
            wrong += &format!(
                "{id} fails: {:?}\n  {}\n",
                o.failures,
                o.measured.reads.join("\n  ")
            );
        }
        if !failed && known.contains(id) {
            wrong += &format!("{id} is a known shortfall and comes out as it must\n");
        }
        // In every row: no board acts on a frame that nobody sent.
        assert_eq!(o.measured.wrong_frames, 0, "{id}");
    }
    assert!(wrong.is_empty(), "{wrong}");
    // A minute of broken frames: most get through, some do not, and none turns into another one.
    let minute = outcomes.iter().find(|o| o.row.id == "bit-errors/60s");
    let m = &minute.expect("the row").measured;
    let lost = 1.0 - m.accepted_frames as f64 / m.sent_frames as f64;
    assert!(m.sent_frames > 40_000, "{} frames sent", m.sent_frames);
    // Of 102 bytes 8 % have a wrong bit, of 29 bytes 2 %; one SYNC comes to eight replies.
    assert!(
        (0.015..0.05).contains(&lost),
        "{lost} of the frames are lost"
    );
    // The very line in which the interfaces of master and board begin to differ.
    let mismatch = outcomes
        .iter()
        .find(|o| o.row.id == "version-mismatch/joint");
    let side = |name, hash| Side { name, hash };
    let earlier = archive::newest_earlier().expect("an earlier interface");
    let here = side("the master", SCHEMA_HASH);
    let told = first_difference(here, side("joint 4", earlier));
    let reads = &mismatch.expect("the row").measured.reads;
    assert!(
        reads.iter().any(|line| line.contains(&told)),
        "{told}: {reads:?}"
    );
    for id in known {
        assert!(ROWS.iter().any(|row| row.id == id), "no row {id}");
    }
}

/// A run without faults reports none: over every scenario in which nothing goes wrong.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn nothing_trips_without_a_fault() {
    let robot = robot();
    let mut quiet = 0;
    for (name, ..) in builtin::SCENARIOS {
        let scenario = scenario(name);
        if !scenario.events.is_empty() || !scenario.faults.is_empty() {
            continue;
        }
        quiet += 1;
        // The robot of the paper does not walk.
        let own = builtin::robot(&scenario.robot).expect("built in");
        let walks = matches!(scenario.motion, Motion::Walk(_));
        let recording = run(&scenario, if walks { &own } else { &robot }, 2);
        for (i, rows) in recording.joints.iter().enumerate() {
            let tripped = rows.iter().find(|r| r.v.faults != 0);
            assert!(
                tripped.is_none(),
                "{name}, joint {}\n{}",
                i + 1,
                story(&recording)
            );
        }
        for (i, rows) in recording.wheels.iter().enumerate() {
            let tripped = rows.iter().find(|r| r.v.faults != 0);
            assert!(
                tripped.is_none(),
                "{name}, wheel {}\n{}",
                i + 7,
                story(&recording)
            );
        }
        let holds = recording.events.iter().any(|e| e.v.cause.is_hold());
        assert!(!holds, "{name}\n{}", story(&recording));
    }
    assert!(quiet >= 7, "{quiet} scenarios without faults");
}

/// In the row of a minute the robot holds most of the time: this one is commanded to walk on after every
/// stop, so that driving boards see the broken frames.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_robot_that_is_started_again_and_again_acts_on_no_wrong_frame_for_a_minute() {
    let rounds = (0..20).flat_map(|round| {
        let from_s = 1.0 + 3.0 * f64::from(round);
        let clear = (from_s, EventAction::ClearFault);
        let commands = [
            (0.2, UserCommand::Arm),
            (0.5, UserCommand::Stand),
            (1.5, UserCommand::StartGait),
        ];
        let commands =
            commands.map(|(after_s, command)| (from_s + after_s, EventAction::Command(command)));
        std::iter::once(clear).chain(commands)
    });
    let mut scenario = gait(LegChoice::Left, 61.0, &rounds.collect::<Vec<_>>());
    scenario.faults = vec!["bit-errors=1e-4@0.5s..60.5s".parse().expect("a fault")];
    let mut recorder = Recorder::in_memory();
    let go_on = &mut |_| ControlFlow::Continue(());
    let outcome = wheeleg_sim::run(&scenario, &robot(), 1, &mut recorder, go_on);
    let line = outcome.expect("the run gets to its end").line;
    let recording = recorder.finish().expect("nothing is written to a file");
    let mut story = story(&recording);
    story.truncate(6_000);
    assert_eq!(line.wrong, 0, "{story}");
    let lost = 1.0 - line.accepted as f64 / line.sent as f64;
    assert!(
        line.sent > 40_000 && lost > 0.015,
        "{} sent, {lost} lost",
        line.sent
    );
    let rows = &recording.joints[1];
    let driving = rows.iter().filter(|r| matches!(r.v.mode, 2 | 3)).count();
    let share = driving as f64 / rows.len() as f64;
    assert!((0.4..0.8).contains(&share), "{share}\n{story}");
}

/// How far the yaw of the left leg, at rest in mid-stroke, is from there 1 and 2 s after
/// all axes hold, mm, with these valves stuck open.
fn moved_mm(valves: &[&str]) -> [f64; 2] {
    let mut scenario = scenario("three-step");
    scenario.duration_s = 3.1;
    let stuck = valves
        .iter()
        .map(|v| format!("valve-stuck-open:joint1.{v}@1s"));
    let faults = stuck.chain(["pot-open:joint6@1s".to_owned()]);
    scenario.faults = faults.map(|f| f.parse().expect("a fault")).collect();
    let recording = run(&scenario, &robot(), 1);
    let at = |s: f64| sil::at(&recording.joints[0], s).position_mm;
    [at(2.0) - at(1.0), at(3.0) - at(1.0)]
}

/// The figures of the document: with an inlet stuck open, the trapped air stops a held axis;
/// with the opposite outlet open too it runs to its end.
#[test]
fn a_held_axis_with_an_inlet_stuck_open_comes_to_rest_in_mid_stroke() {
    for (valves, expected_mm) in [
        (&["fill-a"][..], 49.0..54.0),
        (&["fill-b"], -37.0..-32.0),
        (&["fill-a", "vent-b"], 88.0..91.0),
        (&["fill-b", "vent-a"], -91.0..-88.0),
    ] {
        let [soon_mm, late_mm] = moved_mm(valves);
        assert!(expected_mm.contains(&late_mm), "{valves:?}: {late_mm} mm");
        assert!((late_mm - soon_mm).abs() < 0.5, "{valves:?}: {soon_mm} mm");
    }
}

fn faults_run(arguments: &[&str]) -> (Command, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut command = Command::new(program::path());
    command.args(["faults", "run"]).args(arguments);
    command.arg("--out").arg(folder.path().join("matrix"));
    (command, folder)
}

/// Exit codes, JSON and page of `wheeleg faults run`.
#[test]
fn rows_can_be_run_alone_and_a_failing_or_missing_one_is_told() {
    let (mut command, folder) = faults_run(&["--row", "pot-open", "--seed", "3", "--json"]);
    let output = command.assert().success();
    let json: Value = serde_json::from_slice(&output.get_output().stdout).expect("JSON");
    crate::schema::assert_valid(&json, "faults");
    let row = &json["rows"][0];
    assert_eq!(
        (&row["row"], &row["pass"]),
        (&"pot-open".into(), &true.into())
    );
    assert_eq!(
        (&row["latched"], &json["failed"]),
        (&true.into(), &0.into())
    );
    let detected = row["measured"]["detected_ms"].as_f64().expect("measured");
    assert!((0.9..=3.1).contains(&detected), "{detected} ms");
    assert_eq!(row["expected"]["axis"], 3);
    let (expected, measured) = (&row["expected"], &row["measured"]);
    for what in ["physical_ms", "wheels_stand_ms"] {
        let [limit, value] = [expected, measured].map(|of| of[what].as_f64().expect(what));
        assert!(value <= limit && limit > 35.0, "{what}: {value} of {limit}");
    }
    assert!(
        measured["deviation_mm"].is_null(),
        "a motion that stops has none"
    );
    let page = std::fs::read_to_string(folder.path().join("matrix/report.html"));
    let page = page
        .expect("a page")
        .replace("http://www.w3.org/2000/svg", "");
    for words in [
        "pot-open",
        "PASS",
        "The position sensor reads outside its range",
        // Each limit below its value.
        "<br><small>0.9 to 3.1</small></td>",
        "<br><small>≤ 4.1</small></td>",
        "<br><small>≤ 35</small></td>",
        "in the one row that was run",
        "wheeleg run three-step --seed ",
        "wheeleg view again",
    ] {
        assert!(page.contains(words), "{words}");
    }
    for outside in ["http:", "https:", "src=", "@import"] {
        assert!(!page.contains(outside), "{outside}");
    }

    let (mut command, folder) = faults_run(&["--row", "valve-slow", "--row", "valve-slow"]);
    let failed = contains("FAIL").count(1);
    let failed = failed.and(contains("detected: never"));
    command
        .assert()
        .code(1)
        .stdout(failed.and(contains("not all axes stop")));
    // A run that continues has no stop latency.
    let json = std::fs::read_to_string(folder.path().join("matrix/summary.json"));
    let json: Value = serde_json::from_str(&json.expect("a summary")).expect("JSON");
    let measured = &json["rows"][0]["measured"];
    for what in [
        "own_commanded_ms",
        "commanded_ms",
        "sensed_ms",
        "physical_ms",
        "wheels_stand_ms",
        "held_mm",
    ] {
        assert!(measured[what].is_null(), "{what}: {measured}");
    }
    assert!(measured["deviation_mm"].is_number(), "{measured}");
    let (mut command, folder) = faults_run(&["--row", "e-stop/walking"]);
    command.assert().success();
    let page = std::fs::read_to_string(folder.path().join("matrix/report.html"));
    assert!(page.expect("a page").contains("<td>E-stop@"));
    let (mut command, _folder) = faults_run(&["--row", "pot-frozen"]);
    command
        .assert()
        .code(2)
        .stderr(contains("frozen/lowering").and(contains("frozen/reach")));
    let (mut command, _folder) = faults_run(&["--row", "brown-out/update"]);
    command.assert().code(2).stderr(contains("not implemented"));
    let (mut command, _folder) = faults_run(&["--row", "pot-opn"]);
    command.assert().code(2).stderr(contains("pot-open"));
    let mut command = Command::new(program::path());
    command.args(["run", "three-step", "--fault", "ui-replay@1s"]);
    command.assert().code(2).stderr(contains("not implemented"));
    let (mut command, _folder) = faults_run(&[]);
    command.assert().code(2);
}
