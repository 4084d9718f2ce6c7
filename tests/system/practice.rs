//! Inputs from practice: axes of catalogue cylinders and valves, and files based on user reports. The results
//! of all of them are in docs/records/practice-inputs.md.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

use crate::axis_text::changed;
use crate::program;

const BENCH: &str = include_str!("../../host-sim/axes/bench-vq110u.toml");
const SMALL: &str = include_str!("../../host-sim/axes/small-12x50.toml");
const HEAVY: &str = include_str!("../../host-sim/axes/heavy-40x250.toml");

/// Changes of an axis file.
type Changes = Vec<(&'static str, f64, &'static str)>;

fn wheeleg(arguments: &[&str], path: &Path) -> Output {
    let mut command = Command::new(program::path());
    command.env("NO_COLOR", "1").args(arguments).arg(path);
    command.output().expect("start")
}

/// An axis file in a folder.
fn axis(folder: &Path, base: &str, changes: &Changes) -> PathBuf {
    let path = folder.join("axis.toml");
    fs::write(&path, changed(base, changes)).expect("written");
    path
}

/// Both valves of a kind: conductance in dm3/(s bar), critical ratio, delays in ms.
fn valves(conductance: f64, ratio: f64, on_ms: f64, off_ms: f64) -> Changes {
    let flow = "dm3/(s bar)";
    vec![
        ("fill_valve.conductance", conductance, flow),
        ("fill_valve.critical_ratio", ratio, "1"),
        ("fill_valve.t_on", on_ms, "ms"),
        ("fill_valve.t_off", off_ms, "ms"),
        ("vent_valve.conductance", conductance, flow),
        ("vent_valve.critical_ratio", ratio, "1"),
        ("vent_valve.t_on", on_ms, "ms"),
        ("vent_valve.t_off", off_ms, "ms"),
    ]
}

/// A cylinder: bore, rod, stroke in mm, dead volumes in cm3, friction in N, mass in kg, track of the
/// potentiometer and its offset in mm.
fn cylinder(
    mm: [f64; 3],
    dead_cm3: f64,
    friction_n: [f64; 2],
    kg: f64,
    track: [f64; 2],
) -> Changes {
    vec![
        ("cylinder.bore", mm[0], "mm"),
        ("cylinder.rod", mm[1], "mm"),
        ("cylinder.stroke", mm[2], "mm"),
        ("cylinder.dead_volume_a", dead_cm3, "cm3"),
        ("cylinder.dead_volume_b", dead_cm3, "cm3"),
        ("friction.coulomb", friction_n[0], "N"),
        ("friction.static", friction_n[1], "N"),
        ("moving.mass", kg, "kg"),
        ("start.stroke", 0.2 * mm[2], "mm"),
        ("sensor.potentiometer.electrical_stroke", track[0], "mm"),
        ("sensor.potentiometer.offset", track[1], "mm"),
    ]
}

/// Bore 80 x 200 mm with slow valves; `dead_cm3` may be too little.
fn wide(dead_cm3: f64) -> Changes {
    let mut all = valves(4.0, 0.35, 31.0, 40.0);
    let size = [80.0, 25.0, 200.0];
    all.extend(cylinder(size, dead_cm3, [80.0, 120.0], 40.0, [220.0, 10.0]));
    all
}

/// Bore 25 mm without a rod.
fn rodless(stroke_mm: f64) -> Changes {
    let mut all = valves(0.71, 0.35, 2.0, 2.0);
    let size = [25.0, 0.0, stroke_mm];
    all.extend(cylinder(size, 3.0, [30.0, 45.0], 3.0, [512.0, 6.0]));
    all
}

/// Figures of a tuning that are worse after than before, by this test's rule: by more than a tenth, and
/// beyond what is good enough, mm.
fn found_worse(summary: &Value) -> Vec<String> {
    let tests = summary["tests"].as_array().expect("a list");
    assert!(tests.len() >= 5, "{summary}");
    let mut worse = Vec::new();
    if tests.iter().all(|test| test["after"]["stopped"] == true) {
        worse.push("every move is stopped".to_owned());
    }
    for test in tests {
        let motion = test["move"].as_str().expect("a name");
        let [before, after] = ["before", "after"].map(|when| &test[when]);
        let is_set = |figures: &Value, name: &str| figures[name] == true;
        let follows = ["s-curve", "sine"].contains(&motion);
        let rests = motion.starts_with("step") || motion == "hold";
        for (name, enough, counts) in [
            ("steady_error_mm", 0.5, true),
            ("contact_error_mm", 2.0, true),
            (
                "overshoot_mm",
                3.0,
                !motion.starts_with("contact") && !is_set(before, "stopped"),
            ),
            ("worst_mm", 5.0, follows && !is_set(before, "stopped")),
        ] {
            let [was, is] =
                [before, after].map(|figures| figures[name].as_f64().unwrap_or(0.0).abs());
            if counts && is > f64::max(enough, 1.1 * was) {
                worse.push(format!("{motion}: {name} {was} to {is}"));
            }
        }
        for (name, counts) in [("stopped", true), ("limit_cycle", rests)] {
            if counts && is_set(after, name) && !is_set(before, name) {
                worse.push(format!("{motion}: {name}"));
            }
        }
        if after["settle_s"].is_null() && !before["settle_s"].is_null() {
            worse.push(format!("{motion}: never settles"));
        }
        let [was, is] = [before, after].map(|figures| figures["settle_s"].as_f64());
        let comparable = !is_set(before, "stopped") && !is_set(before, "limit_cycle");
        if let (Some(was), Some(is)) = (was, is)
            && motion.starts_with("step")
            && comparable
            && is > f64::max(0.25, 1.1 * was)
        {
            worse.push(format!("{motion}: settles in {was} to {is} s"));
        }
    }
    worse
}

/// Tunes an axis. Either it is at least as good as before and its parameters are written, or it is refused
/// with the figures that got worse, without parameters. Returns the exit code.
fn tuned(base: &str, changes: &Changes) -> i32 {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let path = axis(folder.path(), base, changes);
    let told = wheeleg(&["tune", "--json", "--out", &out.to_string_lossy()], &path);
    let stderr = String::from_utf8_lossy(&told.stderr);
    let summary: Value =
        serde_json::from_slice(&told.stdout).unwrap_or_else(|_| panic!("{stderr}"));
    let written = out.join("node-parameters.toml").exists();
    let worse = summary["worse"].as_array().expect("a list").len();
    let own = found_worse(&summary);
    assert_eq!(own.is_empty(), worse == 0, "{own:?}: {}", summary["worse"]);
    let code = told.status.code().expect("a code");
    assert_eq!((written, worse == 0), (code == 0, code == 0), "{summary}");
    assert_eq!(summary["accepted"], code == 0);
    code
}

#[test]
fn tuning_never_makes_an_axis_worse() {
    let light = vec![
        ("friction.viscous", 50.0, "N s/m"),
        ("moving.mass", 0.1, "kg"),
    ];
    assert_eq!(tuned(SMALL, &light), 1, "viscous and light");
    let mut dsnu = valves(0.05, 0.3, 4.0, 4.0);
    let size = [8.0, 4.0, 20.0];
    dsnu.extend(cylinder(size, 0.2, [2.5, 4.0], 0.1, [27.6, 3.8]));
    let line = [
        ("line.volume", 0.3, "cm3"),
        ("line.conductance", 0.5, "dm3/(s bar)"),
    ];
    dsnu.extend(line);
    dsnu.push(("end_stop.cushion_length", 0.0, "mm"));
    assert_eq!(tuned(HEAVY, &dsnu), 1, "8 x 20 mm");
    let mut slow = valves(0.71, 0.35, 20.0, 20.0);
    let size = [32.0, 16.0, 50.0];
    slow.extend(cylinder(size, 6.0, [25.0, 40.0], 5.0, [60.0, 5.0]));
    assert_eq!(tuned(HEAVY, &slow), 1, "slow valves");
    // So much noise that the supervision stops every move, before and after.
    let noisy = vec![
        ("sensor.adc.bits", 8.0, "bit"),
        ("sensor.adc.noise", 100.0, "LSB"),
    ];
    assert_eq!(tuned(BENCH, &noisy), 1, "noise");
    // These may come out either way, but never worse.
    tuned(HEAVY, &wide(30.0));
    tuned(
        BENCH,
        &vec![("moving.mass", 0.08, "kg"), ("numerics.step", 50.0, "us")],
    );
}

/// Nor does it make one of the random axes of the plant's calibration worse.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn tuning_makes_no_random_axis_worse() {
    let [mut accepted, mut refused] = [0, 0];
    for seed in 0..30 {
        let text = crate::plant_check::text(seed);
        if wheeleg_config::AxisConfig::parse("random.toml", &text).is_err() {
            continue;
        }
        match tuned(&text, &Vec::new()) {
            0 => accepted += 1,
            _ => refused += 1,
        }
    }
    println!("{accepted} tuned, {refused} refused");
    assert!(
        accepted >= 5 && accepted + refused >= 20,
        "{accepted} and {refused}"
    );
}

/// A standard stroke works. A longer one, which no board accepts, is refused by its own range by everything
/// that reads the file.
#[test]
fn the_longest_standard_stroke_is_tuned() {
    assert_eq!(tuned(HEAVY, &rodless(500.0)), 0);
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let path = axis(folder.path(), HEAVY, &rodless(600.0));
    let commands: [&[&str]; 3] = [
        &["tune", "--out", &out.to_string_lossy()],
        &["plant", "check"],
        &["export", "fmu", "--out", &out.to_string_lossy()],
    ];
    for command in commands {
        let told = wheeleg(command, &path);
        assert_eq!(told.status.code(), Some(2), "{command:?}");
        let said = String::from_utf8_lossy(&told.stderr);
        for word in [
            "`cylinder.stroke` = 600 mm is out of range: allowed 1 to 500 mm",
            ".toml:",
        ] {
            assert!(said.contains(word), "{command:?}, {word}: {said}");
        }
        assert!(!out.exists());
    }
}

/// Result of `plant check` for an axis: its exit code and its text.
fn checked(base: &str, changes: &Changes) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = axis(folder.path(), base, changes);
    let told = wheeleg(&["plant", "check"], &path);
    let text = [told.stdout, told.stderr].concat();
    (
        told.status.code(),
        String::from_utf8_lossy(&text).into_owned(),
    )
}

#[test]
fn an_axis_that_the_step_cannot_follow_is_refused_by_its_fields() {
    let mass = |kg: f64| vec![("moving.mass", kg, "kg")];
    for (base, changes, words) in [
        (
            SMALL,
            mass(0.02),
            vec![
                "`friction.bristle_damping`",
                "`moving.mass` = 0.02",
                "`numerics.step`",
            ],
        ),
        (
            HEAVY,
            wide(6.0),
            vec![
                "`cylinder.dead_volume_a` = 6",
                "`cylinder.bore` = 80",
                "`end_stop.stiffness`",
            ],
        ),
    ] {
        let (code, said) = checked(base, &changes);
        // Messages are wrapped to the width of a terminal.
        let said = said.replace("\n  │ ", " ");
        assert_eq!(code, Some(2), "{said}");
        for word in words.iter().chain(&["axis.toml:", "help: "]) {
            assert!(said.contains(word), "{word}: {said}");
        }
    }
}

#[test]
fn sound_axes_near_rounding_pass() {
    let (code, said) = checked(BENCH, &vec![("moving.mass", 0.2, "kg")]);
    assert_eq!(code, Some(0), "{said}");
    let mut cj2 = valves(0.037, 0.11, 5.0, 4.0);
    let size = [10.0, 4.0, 45.0];
    cj2.extend(cylinder(size, 0.3, [3.0, 4.7], 0.2, [55.0, 5.0]));
    let (code, said) = checked(SMALL, &cj2);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn names_of_axes_are_checked_before_anything_is_played() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    for name in ["../../x", &"x".repeat(300), ""] {
        let path = folder.path().join("axis.toml");
        let line = BENCH.lines().find(|line| line.starts_with("name = "));
        let named = format!("name = {name:?}");
        fs::write(&path, BENCH.replacen(line.expect("a name"), &named, 1)).expect("written");
        let arguments = [
            "compare",
            "--quick",
            "--out",
            &out.to_string_lossy(),
            "--axis",
        ];
        let told = wheeleg(&arguments, &path);
        // Messages are wrapped to the width of a terminal.
        let said = String::from_utf8_lossy(&told.stderr).replace("\n  │ ", " ");
        assert_eq!(told.status.code(), Some(2), "{said}");
        assert!(
            said.contains("is not a name") && said.contains("1 to 64"),
            "{said}"
        );
        assert!(!out.exists());
    }
}

/// Runs a command with its arguments; exit code and output, without line breaks of a terminal.
fn said(arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(program::path());
    command.env("NO_COLOR", "1").args(arguments);
    let told = command.timeout(std::time::Duration::from_secs(60));
    let told = told.output().expect("start");
    let text = String::from_utf8_lossy(&[told.stderr, told.stdout].concat()).into_owned();
    (told.status.code(), text.replace("\n  │ ", " "))
}

/// A scenario that the robot's plant refuses: a block occupies the robot's place.
const NO_PLACE: &str = "name = \"no-place\"\ndescription = \"\"\nrobot = \"wheeleg\"\n\
    duration = \"1 s\"\nseed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n[[terrain]]\n\
    kind = \"block\"\nx = { value = [-0.1, 0.1], unit = \"m\" }\n\
    y = { value = [-1.0, 1.0], unit = \"m\" }\nheight = \"1 m\"\n";

#[test]
fn a_run_that_is_refused_leaves_no_folder_and_costs_no_earlier_results() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let scenario = folder.path().join("no-place.toml");
    fs::write(&scenario, NO_PLACE).expect("written");
    let out = folder.path().join("runs/out");
    let run = || {
        let (code, text) = said(&[
            "run",
            &scenario.to_string_lossy(),
            "--out",
            &out.to_string_lossy(),
        ]);
        assert_eq!(code, Some(2), "{text}");
        assert!(
            text.contains("does not stand") && text.contains("help: "),
            "{text}"
        );
    };
    run();
    assert!(!folder.path().join("runs").exists());
    fs::create_dir_all(&out).expect("created");
    fs::write(out.join("summary.json"), "earlier").expect("written");
    run();
    let kept = fs::read_to_string(out.join("summary.json"));
    assert_eq!(kept.expect("kept"), "earlier");
    let left = fs::read_dir(&out).expect("readable").count();
    assert_eq!(left, 1, "nothing beside it");
}

/// Pipes without a writer, endless devices and folders, in place of a log: refused at once, by name, with
/// what to give instead.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_file_is_no_log() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let pipe = path("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo").success());
    let out = path("out");
    let missing = path("missing.mcap");
    let empty = path("empty");
    fs::create_dir(&empty).expect("created");
    for log in [&pipe, &missing, &empty, "/dev/zero", "/dev/null"] {
        for command in [
            &["view"][..],
            &["log", "recover"],
            &["export", "parquet"],
            &["export", "ros2"],
        ] {
            let (code, text) = said(&[command, &[log, "--out", &out]].concat());
            assert_eq!(code, Some(2), "{command:?} {log}: {text}");
            for part in [log, "log.mcap"] {
                assert!(text.contains(part), "{command:?} {log}: {text}");
            }
            assert!(!Path::new(&out).exists(), "{command:?} {log}");
        }
    }
    let mut left: Vec<_> = fs::read_dir(folder.path())
        .expect("readable")
        .flatten()
        .collect();
    left.retain(|entry| {
        ![path("pipe"), path("empty")].contains(&entry.path().to_string_lossy().into_owned())
    });
    assert!(left.is_empty(), "{left:?}");
}

/// A scenario may come from a pipe. The program waits for a pipe without a writer until a signal comes, and
/// then ends at once.
#[cfg(target_os = "linux")]
#[test]
fn a_pipe_that_nobody_writes_to_ends_with_the_first_signal() {
    use std::os::unix::process::ExitStatusExt as _;
    let folder = tempfile::tempdir().expect("temporary folder");
    let pipe = folder.path().join("pipe.toml");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo").success());
    let out = folder.path().join("out");
    for arguments in [&["run"][..], &["tune"], &["campaign", "run"], &["serve"]] {
        let mut command = std::process::Command::new(program::path());
        command.args(arguments).arg(&pipe);
        if arguments != ["serve"] {
            command.arg("--out").arg(&out);
        }
        let mut child = command.spawn().expect("start");
        std::thread::sleep(std::time::Duration::from_millis(400));
        let sent = std::process::Command::new("kill")
            .args(["-TERM", &child.id().to_string()])
            .status();
        assert!(sent.expect("kill").success());
        let begin = std::time::Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().expect("status") {
                break status;
            }
            if begin.elapsed().as_secs() > 20 {
                let _ = child.kill();
                panic!("{arguments:?} still waits");
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        };
        assert_eq!(status.signal(), Some(15), "{arguments:?}: {status}");
        assert!(!out.exists(), "{arguments:?}");
    }
}

/// The table of a campaign and its page overwrite nothing: an existing file is set aside, anything else is
/// refused and stays.
#[cfg(target_os = "linux")]
#[test]
fn a_table_takes_no_place_of_a_file_or_a_pipe_unseen() {
    use std::os::unix::fs::FileTypeExt as _;
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let plan = "name = \"short\"\nroot = 1\nlimit = \"0.05 s\"\n[base]\nscenario = \"stand\"\n";
    fs::write(path("plan.toml"), plan).expect("written");
    let (code, text) = said(&["campaign", "run", &path("plan.toml"), "--out", &path("out")]);
    assert_eq!(code, Some(0), "{text}");
    let merge = |name: &str| said(&["campaign", "merge", &path("out"), "--out", &path(name)]);

    let made = std::process::Command::new("mkfifo")
        .arg(path("pipe"))
        .status();
    assert!(made.expect("mkfifo").success());
    let (code, text) = merge("pipe");
    assert_eq!(code, Some(74), "{text}");
    assert!(
        text.contains("pipe") && text.contains("not a file"),
        "{text}"
    );
    let about = fs::metadata(path("pipe")).expect("still there");
    assert!(about.file_type().is_fifo());

    for (write, name) in [("merge", "cases.parquet"), ("report", "page.html")] {
        let out = path(name);
        fs::write(&out, "mine").expect("written");
        let give = || match write {
            "merge" => merge(name),
            _ => said(&["campaign", "report", &path("cases.parquet"), "--out", &out]),
        };
        let (code, text) = give();
        assert_eq!(code, Some(0), "{write}: {text}");
        let kept = fs::read_to_string(format!("{out}.previous"));
        assert_eq!(kept.expect("set aside"), "mine", "{write}");
        // The same again is no change.
        let before = fs::read(&out).expect("written");
        assert_eq!(give().0, Some(0));
        assert_eq!(fs::read(&out).expect("written"), before);
        assert!(!Path::new(&format!("{out}.previous-2")).exists(), "{write}");
    }
    let hidden = |e: &fs::DirEntry| e.file_name().to_string_lossy().contains("tmp");
    let left = fs::read_dir(folder.path())
        .expect("readable")
        .flatten()
        .filter(hidden);
    assert_eq!(left.count(), 0);
}

/// The record of the inputs names tests and files that exist.
#[test]
fn the_record_names_tests_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let record = root.join("docs/records/practice-inputs.md");
    let record = std::fs::read_to_string(record).expect("the record");
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./:…".contains(c);
    let quoted = record
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|word| word.chars().all(plain));
    let mut seen = 0;
    for word in quoted {
        if word.ends_with(".rs") {
            let places = ["tests/system", "tests", "host-sim", "host-sim/wheeleg/src"];
            let there = places
                .iter()
                .any(|place| root.join(place).join(word).exists());
            assert!(there, "there is no file {word}");
        } else if let Some((module, name)) = word.split_once("::") {
            let file = root.join("tests/system").join(format!("{module}.rs"));
            let text = std::fs::read_to_string(file);
            let text = text.unwrap_or_else(|_| panic!("there is no module of {word}"));
            let (begin, end) = match name.strip_suffix('…') {
                Some(begin) => (begin, ""),
                None => (name, "("),
            };
            let there = text.contains(&format!("fn {begin}{end}"));
            assert!(there, "there is no test {word}");
        } else {
            continue;
        }
        seen += 1;
    }
    assert!(seen > 30, "{seen}");
}

/// A disk without room for the head of a log: nothing is begun, and no part of a log stays. A limit of the
/// shell on the size of a file is such a disk.
#[cfg(target_os = "linux")]
#[test]
fn a_log_whose_head_has_no_room_leaves_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    for kilobytes in [1, 8] {
        let shell = format!("ulimit -f {kilobytes}; exec \"$0\" run stand --out out-{kilobytes}");
        let output = std::process::Command::new("bash")
            .current_dir(folder.path())
            .args(["-c", &shell])
            .arg(program::path())
            .output()
            .expect("start");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{kilobytes}: {said}");
        assert!(said.contains("File too large"), "{kilobytes}: {said}");
        assert!(said.contains("cannot write the log"), "{kilobytes}: {said}");
        let out = folder.path().join(format!("out-{kilobytes}"));
        let left = std::fs::read_dir(&out).map_or_else(
            |_| Vec::new(),
            |entries| {
                let names = entries.map(|entry| entry.expect("an entry").file_name());
                names.filter(|name| name != ".lock").collect()
            },
        );
        assert!(left.is_empty(), "{kilobytes}: {left:?}");
    }
}

/// A limit on file size that is reached later: verdict and summary exist, and missing files are named.
#[cfg(target_os = "linux")]
#[test]
fn a_file_that_may_grow_no_further_is_told_as_a_full_disk() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let output = std::process::Command::new("bash")
        .current_dir(folder.path())
        .args(["-c", "ulimit -f 1000; exec \"$0\" run three-step --out out"])
        .arg(program::path())
        .output()
        .expect("start");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("cannot write the log `out/log.mcap`: File too large"),
        "{said}"
    );
    assert!(folder.path().join("out/summary.json").is_file(), "{said}");
}

/// Where a board presses its piston against the stop is known to its law, and to the relation that judges the
/// stroke of a robot.
#[test]
fn a_board_seats_where_the_relation_takes_it_to() {
    let raw_mm = |name: &str| {
        let mut rows = wheeleg_control::tuning::TABLE.iter();
        let row = rows.find(|row| row.name == name).expect("a row");
        row.value as f64 / 65_536.0
    };
    for (name, mm) in ["SEAT_TARGET", "SEATED_WITHIN"]
        .into_iter()
        .zip(wheeleg_config::SEAT_MM)
    {
        assert!((raw_mm(name) - mm).abs() < 1e-4, "{name}: {}", raw_mm(name));
    }
}

/// Cylinders that are 3 mm longer than their boards know: refused by the fields; with the advised values the
/// robot gets ready.
#[test]
fn a_longer_stroke_is_told_to_the_boards_too() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let robot = include_str!("../../host-sim/robots/wheeleg.toml");
    let longer = changed(robot, &[("cylinder.stroke", 183.0, "mm")]);
    let path = folder.path().join("robot.toml");
    fs::write(&path, &longer).expect("written");
    let scenario = folder.path().join("stand.toml");
    let stand = "name = \"s\"\ndescription = \"d\"\nrobot = \"robot.toml\"\nduration = \"5 s\"\n\
                 seed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n";
    fs::write(&scenario, stand).expect("written");
    let out = folder.path().join("out");
    let run = |scenario: &Path| wheeleg(&["run", "--out", out.to_str().expect("UTF-8")], scenario);
    let refused = run(&scenario);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(2), "{said}");
    for part in ["`cylinder.stroke`", "`node.joint.stroke_max`", "183 mm"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let told = longer.replacen(
        "[node.joint]\n",
        "[node.joint]\nstroke_max = { value = 183.0, unit = \"mm\", source = \"ASSUMED\" }\n",
        1,
    );
    fs::write(&path, told).expect("written");
    let ready = run(&scenario);
    let said = String::from_utf8_lossy(&ready.stderr).into_owned();
    assert_eq!(ready.status.code(), Some(0), "{said}");
}

/// The program waits for a reservoir that begins empty; one that never fills is named, with the cause.
#[test]
fn a_robot_that_begins_without_air_waits_for_it() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let robot = include_str!("../../host-sim/robots/wheeleg.toml");
    let scenario = folder.path().join("stand.toml");
    let stand = "name = \"s\"\ndescription = \"d\"\nrobot = \"robot.toml\"\nduration = \"0.2 s\"\n\
                 seed = 1\ntargets = \"none\"\n[motion]\nkind = \"stand\"\n";
    fs::write(&scenario, stand).expect("written");
    let out = folder.path().join("out");
    let run = |changes: &[(&str, f64, &str)]| {
        let path = folder.path().join("robot.toml");
        fs::write(path, changed(robot, changes)).expect("written");
        let output = wheeleg(&["run", "--out", out.to_str().expect("UTF-8")], &scenario);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), said)
    };
    let empty = ("supply.initial_pressure", 1.01, "bar");
    let (code, said) = run(&[empty]);
    assert_eq!(code, Some(0), "{said}");
    // The start pose is reached within 5 s of air, and not with a thousand times the volume.
    let (code, said) = run(&[
        empty,
        ("supply.reservoir", 900.0, "dm3"),
        ("start_up.limit", 5.0, "s"),
    ]);
    assert_eq!(code, Some(2), "{said}");
    for part in [
        "`supply.switch_on`",
        "`supply.initial_pressure`",
        "`start_up.limit`",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

/// A section of a file, up to the remarks before the next one.
fn section(text: &str, name: &str) -> std::ops::Range<usize> {
    let begin = text.find(&format!("[{name}]\n")).expect("the section");
    let end = text[begin + 1..]
        .find("\n[")
        .map_or(text.len(), |at| begin + at + 2);
    let remark = text[begin..end]
        .find("\n#")
        .map_or(end, |at| begin + at + 1);
    begin..remark
}

/// `docs/guide/tune.md`, word by word.
#[test]
fn the_guide_of_tune_leads_to_a_robot_that_walks() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mine = axis(folder.path(), BENCH, &Vec::new());
    let out = folder.path().join("out");
    let tuned = wheeleg(&["tune", "--out", out.to_str().expect("UTF-8")], &mine);
    assert_eq!(tuned.status.code(), Some(0));
    let parameters = fs::read_to_string(out.join("node-parameters.toml")).expect("written");
    let mut robot = include_str!("../../host-sim/robots/wheeleg.toml").to_owned();
    for name in [
        "fill_valve",
        "vent_valve",
        "line",
        "cylinder",
        "friction",
        "end_stop",
    ] {
        robot.replace_range(section(&robot, name), &BENCH[section(BENCH, name)]);
    }
    let old = robot[section(&robot, "node.joint")].to_owned();
    let key = |line: &str| line.split('=').next().unwrap_or_default().trim().to_owned();
    let kept = [
        "motion_margin",
        "precharge",
        "mass_learning",
        "release_band",
        "rest_release",
    ];
    let is_kept = |line: &&str| kept.contains(&key(line).as_str());
    let new = parameters[section(&parameters, "node.joint")]
        .lines()
        .filter(|line| !is_kept(line));
    let lines: Vec<&str> = new.chain(old.lines().filter(is_kept)).collect();
    robot.replace_range(section(&robot, "node.joint"), &(lines.join("\n") + "\n\n"));
    let path = folder.path().join("my-robot.toml");
    fs::write(&path, robot).expect("written");
    let out = folder.path().join("walk");
    let arguments = [
        "run",
        "three-step",
        "--strict",
        "--out",
        out.to_str().expect("UTF-8"),
        "--robot",
    ];
    let ran = wheeleg(&arguments, &path);
    let said = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert_eq!(ran.status.code(), Some(0), "{said}");
    assert!(said.contains("11 of 11 required targets met"), "{said}");
    let guide = include_str!("../../docs/guide/tune.md");
    for key in kept {
        assert!(
            guide.contains(&format!("`{key}`")),
            "the guide tells of {key}"
        );
    }
}
