//! Studies stopped by a signal write their results so far and say so; two of them never share a folder.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::every_command::{Inputs, Leaves, tries};
use crate::schema::assert_valid;
use crate::{cli, program};

/// Longest time that a program may take to begin, or to end on request.
const HUNG: Duration = Duration::from_secs(120);
/// Longest time from a signal to the end, on a computer that does other work, too: a part of a study
/// is not finished first, a row of the fault matrix least of all.
const PROMPT: Duration = Duration::from_secs(20);

/// A study in the folder `out`.
pub(crate) fn start(out: &Path, arguments: &[&str], outputs: fn() -> Stdio) -> Child {
    Command::new(program::path())
        .args(arguments)
        .arg("--out")
        .arg(out)
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .stdout(outputs())
        .stderr(outputs())
        .spawn()
        .expect("start")
}

/// Waits until something is there, while the program runs.
fn wait_until(child: &mut Child, what: &str, there: impl Fn() -> bool) {
    let begin = Instant::now();
    while !there() {
        if let Some(status) = child.try_wait().expect("status") {
            panic!("no {what}: ended by itself with {status}");
        }
        assert!(begin.elapsed() < HUNG, "no {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([&format!("-{name}"), &child.id().to_string()])
        .status()
        .expect("kill");
    assert!(sent.success());
}

pub(crate) fn end(mut child: Child) -> Output {
    let asked = Instant::now();
    while child.try_wait().expect("status").is_none() {
        if asked.elapsed() > HUNG {
            let _ = child.kill();
            panic!("still running {HUNG:?} after the signal");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.wait_with_output().expect("output")
}

fn summary(out: &Path) -> Value {
    let text = fs::read_to_string(out.join("summary.json")).expect("summary.json");
    serde_json::from_str(&text).expect("JSON")
}

/// Starts a study, stops it with Ctrl-C once `lasting` has gone by since it took the folder,
/// and checks message, exit code, summary and report. The summary.
fn interrupted(study: &str, arguments: &[&str], lasting: Duration) -> (Value, TempDir) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let mut child = start(&out, arguments, Stdio::piped);
    wait_until(&mut child, "lock", || out.join(".lock").exists());
    std::thread::sleep(lasting);
    signal(&child, "INT");
    let output = end(child);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{study}: {stderr}");
    let summary = summary(&out);
    assert_valid(&summary, study);
    let stopped = &summary["stopped"];
    assert_eq!(stopped["signal"], "SIGINT");
    let [done, of] = ["done", "of"].map(|key| stopped[key].as_u64().expect("a number"));
    assert!(done < of, "{stopped}");
    let said = format!("interrupted after {done} of {of} ");
    assert!(stderr.contains(&said), "{said}: {stderr}");
    let page = fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(page.contains(&said), "{study}: the report says it, too");
    (summary, folder)
}

#[test]
fn a_comparison_that_is_interrupted_has_the_cases_that_were_played() {
    let arguments = ["compare", "--axis", "bench-vq110u", "--seeds", "1000"];
    let arguments = [&arguments[..], &["--controller", "predictive"]].concat();
    let arguments = [
        &arguments[..],
        &["--move", "s-curve", "--combinations", "0"],
    ]
    .concat();
    let (summary, folder) = interrupted("compare", &arguments, Duration::from_secs(3));
    let cases = summary["cases"].as_array().expect("a list").len();
    assert_eq!(summary["stopped"]["done"], cases);
    assert_eq!(summary["stopped"]["of"], 1000 + 17);
    assert!(cases > 0);
    let csv = fs::read_to_string(folder.path().join("out/csv/cases.csv")).expect("a table");
    assert_eq!(csv.lines().count(), cases + 1);
}

#[test]
fn a_comparison_that_is_interrupted_while_it_looks_for_bounds_has_no_case() {
    let arguments = ["compare", "--axis", "bench-vq110u"];
    let (summary, _folder) = interrupted("compare", &arguments, Duration::from_millis(300));
    assert_eq!(summary["stopped"]["done"], 0);
    assert_eq!(summary["cases"], serde_json::json!([]));
}

#[test]
fn a_comparison_that_was_interrupted_goes_on_to_the_results_of_a_whole_one() {
    let arguments = ["compare", "--axis", "bench-vq110u", "--quick"];
    let law = ["--controller", "predictive", "--move", "s-curve"];
    let arguments = [&arguments[..], &law, &["--combinations", "600"]].concat();
    let (stopped, folder) = interrupted("compare", &arguments, Duration::from_secs(2));
    let out = folder.path().join("out");
    // Its first two campaigns were done.
    let parts =
        ["sheet", "factors"].map(|name| out.join(format!("campaign/{name}/parts/000000.parquet")));
    let written = || {
        let of = |part: &PathBuf| fs::metadata(part).and_then(|m| m.modified());
        parts.each_ref().map(|part| of(part).expect("a part"))
    };
    let before = written();
    let again = end(start(&out, &arguments, Stdio::piped));
    assert_eq!(again.status.code(), Some(0));
    let whole = folder.path().join("whole");
    assert_eq!(
        end(start(&whole, &arguments, Stdio::piped)).status.code(),
        Some(0)
    );
    let all = fs::read(whole.join("summary.json")).expect("a summary");
    assert_eq!(fs::read(out.join("summary.json")).expect("a summary"), all);
    let done = stopped["stopped"]["done"].as_u64().expect("a number");
    assert!(done > 13);
    assert_eq!(written(), before, "what was done was not done again");
    let table = |folder: &Path| fs::read(folder.join("csv/cases.csv")).expect("a table");
    assert_eq!(table(&out), table(&whole));
}

#[test]
fn a_matrix_that_is_interrupted_has_the_rows_that_were_run() {
    let arguments = ["faults", "run", "--all"];
    // The rows under way are not finished first: on a busy computer the first takes a while.
    for seconds in [4, 8, 16, 32] {
        let (summary, _folder) = interrupted("faults", &arguments, Duration::from_secs(seconds));
        let rows = summary["rows"].as_array().expect("a list");
        assert_eq!(summary["stopped"]["done"], rows.len());
        assert!(rows.iter().all(|row| row["verdict"].is_string()));
        if !rows.is_empty() {
            return;
        }
    }
    panic!("no row was done within half a minute");
}

#[test]
fn other_studies_that_are_interrupted_have_their_finished_parts() {
    let (summary, folder) = interrupted("delay", &["delay"], Duration::from_secs(3));
    let starts = summary["starts"]["list"].as_array().expect("a list");
    assert!(starts.len() < 14 && summary["predictions"].is_null());
    let page = fs::read_to_string(folder.path().join("out/report.html")).expect("a report");
    assert!(page.contains("not done"));
    let (_, folder) = interrupted("tune", &["tune", "bench-vq110u"], Duration::ZERO);
    // Not all of its tests were played.
    assert!(!folder.path().join("out/node-parameters.toml").exists());
    let (summary, _folder) = interrupted("figures", &["figures"], Duration::ZERO);
    assert!(!summary["axes"].as_array().expect("a list").is_empty());
}

/// A run of an hour, its log begun.
fn long_run(folder: &Path, out: &Path, outputs: fn() -> Stdio) -> Child {
    let scenario = cli::scenario_file(folder, 3600.0);
    let scenario = scenario.to_string_lossy();
    let mut child = start(out, &["run", &scenario], outputs);
    let log = out.join("log.mcap");
    wait_until(&mut child, "log", || {
        fs::metadata(&log).is_ok_and(|log| log.len() > 1_000_000)
    });
    child
}

fn ends_whole(log: &Path) {
    let bytes = fs::read(log).expect("log");
    assert!(bytes.ends_with(b"\x89MCAP0\r\n"), "a log has its footer");
}

#[test]
fn a_run_that_is_terminated_or_hung_up_leaves_log_summary_and_report() {
    for (name, code) in [("TERM", 143), ("HUP", 129)] {
        let folder = tempfile::tempdir().expect("temporary folder");
        let out = folder.path().join("out");
        // No one reads the output of a program whose terminal is gone.
        let mut child = long_run(folder.path(), &out, Stdio::piped);
        drop((child.stdout.take(), child.stderr.take()));
        signal(&child, name);
        assert_eq!(end(child).status.code(), Some(code), "{name}");
        ends_whole(&out.join("log.mcap"));
        let summary = summary(&out);
        assert_valid(&summary, "run");
        assert_eq!(summary["complete"], false);
        assert_eq!(summary["stopped"]["signal"], format!("SIG{name}"));
        let page = fs::read_to_string(out.join("report.html")).expect("a report");
        assert!(page.contains("was stopped after"));
    }
}

/// Twenty instants of a run, from its first to its last milliseconds: every file begun is whole.
#[test]
fn a_run_can_be_terminated_at_any_time() {
    let mut stopped = 0;
    for instant in 0..20 {
        let dir = tempfile::tempdir().expect("temporary folder");
        let out = dir.path().join("out");
        let mut child = start(&out, &["run", "three-step"], Stdio::piped);
        // From the folder on: before it there is nothing to leave behind.
        wait_until(&mut child, "the log", || out.join("log.mcap").exists());
        std::thread::sleep(Duration::from_millis(40 * instant));
        // The program may have ended by itself.
        signal(&child, "TERM");
        let output = end(child);
        let code = output.status.code();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(
            matches!(code, Some(0 | 143)),
            "{instant}: {code:?} {stderr}"
        );
        let summary = summary(&out);
        assert!(summary["targets"].is_array() && summary["hash"].is_string());
        assert_eq!(summary["complete"] == false, code == Some(143), "{instant}");
        assert!(out.join("report.html").exists(), "{instant}");
        ends_whole(&out.join("log.mcap"));
        let names = fs::read_dir(&out).expect("readable").flatten();
        let names = names.map(|f| f.file_name().to_string_lossy().into_owned());
        let hidden: Vec<String> = names.filter(|name| name.starts_with('.')).collect();
        assert_eq!(hidden, [".lock"], "{instant}: nothing is left half done");
        stopped += u32::from(code == Some(143));
    }
    assert!(stopped > 0, "at least one was stopped on its way");
}

/// Every command that computes for long or waits, each signal, at instants from its first milliseconds on:
/// the program ends soon, with the code of the signal or because it was done; its files are whole, and there
/// are no others.
#[test]
fn every_long_command_can_be_stopped_at_any_time() {
    use std::os::unix::process::ExitStatusExt as _;
    let inputs = Inputs::new();
    let commands = inputs.commands(false);
    let signals = [("TERM", 143), ("HUP", 129), ("INT", 130)];
    let (mut stopped, mut started) = (0, 0);
    // Within this each is signalled; shorter for one that has turned out to be over sooner.
    let mut within = vec![Duration::from_millis(1100); commands.len()];
    // How long a command takes depends on the computer: where too few were caught, the next round, with the
    // times that this one has found, catches more.
    for round in 0..20 {
        if round >= tries(1, 20) && 3 * stopped >= started {
            break;
        }
        for (number, tried) in commands.iter().enumerate() {
            let (name, code) = signals[(number + round) % signals.len()];
            let folder = tempfile::tempdir().expect("temporary folder");
            let out = folder.path().join("out");
            let mut command = inputs.start(tried, &out);
            command.stdin(Stdio::null()).stdout(Stdio::piped());
            let mut child = command.stderr(Stdio::piped()).spawn().expect("start");
            started += 1;
            let share = ((7 * (number + round)) % 20) as f64 / 20.0;
            let instant = within[number].mul_f64(0.02 + 0.97 * share);
            std::thread::sleep(instant);
            let over = child.try_wait().expect("status").is_some();
            match over {
                true => within[number] = instant,
                false => signal(&child, name),
            }
            let asked = Instant::now();
            let output = end(child);
            let stderr = String::from_utf8_lossy(&output.stderr);
            let told = format!("{:?} {instant:?} {name}: {stderr}", tried.arguments);
            assert!(asked.elapsed() < PROMPT, "{:?}, {told}", asked.elapsed());
            let left = files_below(folder.path());
            if output.status.signal().is_some() {
                // Before it had begun, with nothing to finish, or after it had: a file is there as a whole, or not.
                if !left.is_empty() {
                    assert_eq!(
                        (tried.leaves, &*left),
                        (Leaves::File, &["out".to_owned()][..]),
                        "{told}"
                    );
                    let again = folder.path().join("again");
                    let whole = inputs.start(tried, &again).output().expect("run");
                    assert!(whole.status.success(), "{told}");
                    let length = |path: &Path| fs::metadata(path).expect("there").len();
                    assert_eq!(length(&out), length(&again), "{told}");
                }
                continue;
            }
            // A scheduler restarts what it has ended, which is code 75.
            let again = tried.arguments[0] == "campaign" && name != "INT";
            let expected = if again { 75 } else { code };
            let ended = output.status.code().expect("a code");
            // A run that reached its end reports its result: 1 where a move or a bar is missed.
            assert!([expected, 0, 1].contains(&ended), "{ended}, {told}");
            assert!(
                over || ended != expected || !stderr.is_empty(),
                "no message, {told}"
            );
            assert!(!stderr.contains("panicked"), "{told}");
            stopped += u32::from(ended == expected);
            // `.partial.parquet` is whole: the cases of a campaign's block that are done.
            let half = |file: &&String| {
                let begun = ["tmp", ".new", "recovered"];
                begun.iter().any(|end| file.contains(end)) || file.ends_with(".part")
            };
            let half: Vec<&String> = left.iter().filter(half).collect();
            assert!(half.is_empty(), "{half:?}, {told}");
            match tried.leaves {
                Leaves::Study(study) if out.is_dir() => {
                    assert_valid(&summary(&out), study);
                    assert!(out.join("report.html").exists(), "{told}");
                }
                // Of a file that was not finished nothing is left. A log has its footer.
                Leaves::File if ended == expected && out.exists() => ends_whole(&out),
                _ => {}
            }
        }
    }
    println!("{stopped} of {started} commands were stopped on their way");
    assert!(3 * stopped >= started, "{stopped} of {started}");
}

/// One of several instants after it has taken its folder catches every study and campaign at work: it ends
/// with the code of the signal, and reports the signal and its progress.
#[test]
fn every_study_that_is_caught_at_its_work_names_the_signal() {
    let inputs = Inputs::new();
    let signals = [
        ("TERM", 143, "terminated"),
        ("HUP", 129, "hung up"),
        ("INT", 130, "interrupted"),
    ];
    let mut caught = 0;
    let mut missed = Vec::new();
    let tried = inputs.commands(false).into_iter();
    let tried = tried.filter(|t| matches!(t.leaves, Leaves::Study(_) | Leaves::Parts));
    for (number, tried) in tried.enumerate() {
        let (name, code, word) = signals[number % signals.len()];
        let again = tried.leaves == Leaves::Parts && name != "INT";
        let code = if again { 75 } else { code };
        let mut told = String::new();
        let found = (0..12).any(|attempt| {
            let folder = tempfile::tempdir().expect("temporary folder");
            let out = folder.path().join("out");
            let mut command = inputs.start(&tried, &out);
            command.stdin(Stdio::null()).stdout(Stdio::piped());
            let mut child = command.stderr(Stdio::piped()).spawn().expect("start");
            let begun = || out.join(".lock").exists() || out.join("plan.json").exists();
            while !begun() && child.try_wait().expect("status").is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
            std::thread::sleep(Duration::from_millis(20 * attempt));
            if child.try_wait().expect("status").is_none() {
                signal(&child, name);
            }
            let output = end(child);
            told = String::from_utf8_lossy(&output.stderr).into_owned();
            output.status.code() == Some(code) && told.contains(word) && told.contains(" of ")
        });
        if found {
            caught += 1;
        } else {
            missed.push(format!("{:?} {name}: {told}", tried.arguments));
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(caught >= 9, "{caught}");
}

/// Bytes of the finished parts of a campaign.
fn parts(out: &Path) -> Vec<(String, Vec<u8>)> {
    let names = files_below(out).into_iter().filter(|name| {
        let parts = name.strip_prefix("parts/");
        parts.is_some_and(|name| name.len() == "000000.parquet".len())
    });
    let read = |name: String| {
        let bytes = fs::read(out.join(&name)).expect("readable");
        (name, bytes)
    };
    let mut parts: Vec<_> = names.map(read).collect();
    parts.sort();
    parts
}

/// From the instant at which a campaign makes its folder on: a signal leaves nothing, or a folder with its
/// plan, from which the same command continues to the same parts.
#[test]
fn a_campaign_that_is_stopped_has_written_nothing_or_goes_on() {
    use std::os::unix::process::ExitStatusExt as _;
    let folder = tempfile::tempdir().expect("temporary folder");
    let plan = folder.path().join("plan.toml");
    let text = "name = \"two\"\nroot = 7\nblock = 1\nsamples = 2\n[base]\nscenario = \"stand\"\n\
                [factor.droop]\nparameter = \"robot.supply.droop\"\n\
                uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n";
    fs::write(&plan, text).expect("written");
    let arguments = ["campaign", "run", &plan.to_string_lossy()].map(str::to_owned);
    let arguments = arguments.each_ref().map(String::as_str);
    let whole = folder.path().join("whole");
    assert!(end(start(&whole, &arguments, Stdio::null)).status.success());
    let whole = parts(&whole);
    assert_eq!(whole.len(), 2);
    let mut stopped = 0;
    for instant in 0..tries(6, 40) {
        let out = folder.path().join(format!("out{instant}"));
        let mut child = start(&out, &arguments, Stdio::piped);
        // No sleep: the first file is there within a millisecond of the folder.
        while !out.exists() && child.try_wait().expect("status").is_none() {
            std::hint::spin_loop();
        }
        std::thread::sleep(Duration::from_micros(300 * instant as u64));
        signal(&child, ["TERM", "HUP"][instant % 2]);
        let output = end(child);
        let stderr = String::from_utf8_lossy(&output.stderr);
        if output.status.signal().is_some() {
            assert!(!out.exists(), "{:?} {stderr}", files_below(&out));
            continue;
        }
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 75)), "{instant}: {code:?} {stderr}");
        assert!(out.join("plan.json").exists(), "{instant}: {stderr}");
        let again = end(start(&out, &arguments, Stdio::piped));
        let stderr = String::from_utf8_lossy(&again.stderr);
        assert!(again.status.success(), "{instant}: {stderr}");
        assert!(parts(&out) == whole, "{instant}: other parts");
        stopped += u32::from(code == Some(75));
    }
    assert!(stopped > 0, "none was stopped on its way");
}

/// Paths of all files below a folder, from it.
pub(crate) fn files_below(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let path = path.strip_prefix(folder).expect("below it");
                found.push(path.to_string_lossy().into_owned());
            }
        }
    }
    found
}

/// The folder of a run is removed while it is under way: the verdict is printed all the same.
#[test]
fn a_folder_that_vanishes_costs_no_verdict() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let out = dir.path().join("out");
    let mut child = start(&out, &["run", "three-step"], Stdio::piped);
    let log = out.join("log.mcap");
    wait_until(&mut child, "the log", || {
        fs::metadata(&log).is_ok_and(|log| log.len() > 50_000)
    });
    fs::remove_dir_all(&out).expect("removed");
    let output = end(child);
    let [told, said] = [&output.stdout, &output.stderr].map(|t| String::from_utf8_lossy(t));
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(told.contains("required targets met"), "{told}");
    assert!(
        said.contains("log.mcap") && said.contains("csv") && !said.contains("panicked"),
        "{said}"
    );
    // Files that can be remade are.
    assert_valid(&summary(&out), "run");
}

/// The folder of any study is removed while the study runs: a remade one has its summary, or nothing is
/// there. A report alone would pass for a whole study.
#[test]
fn no_study_whose_folder_vanishes_leaves_a_report_without_a_summary() {
    let inputs = Inputs::new();
    let mut remade = 0;
    for tried in inputs.commands(true) {
        let Leaves::Study(study) = tried.leaves else {
            continue;
        };
        for delay_ms in [0, 150] {
            let folder = tempfile::tempdir().expect("temporary folder");
            let out = folder.path().join("out");
            let mut command = inputs.start(&tried, &out);
            command.stdin(Stdio::null()).stdout(Stdio::piped());
            let mut child = command.stderr(Stdio::piped()).spawn().expect("start");
            wait_until(&mut child, "the folder", || out.join(".lock").exists());
            std::thread::sleep(Duration::from_millis(delay_ms));
            while out.exists() && fs::remove_dir_all(&out).is_err() {}
            let output = end(child);
            let said = String::from_utf8_lossy(&output.stderr);
            let told = format!("{:?}, {delay_ms} ms: {said}", tried.arguments);
            assert!(!said.contains("panicked"), "{told}");
            let left = files_below(&out);
            assert_eq!(
                out.join("summary.json").exists(),
                out.join("report.html").exists(),
                "{left:?}, {told}"
            );
            if out.join("summary.json").exists() {
                assert_valid(&summary(&out), study);
                remade += 1;
            }
            // A fast computer has ended before the folder goes: then nothing is left.
            if study == "tune" && output.status.success() && out.exists() {
                assert!(
                    left.iter().any(|file| file == "node-parameters.toml"),
                    "{told}"
                );
            }
        }
    }
    assert!(remade >= 8, "{remade} folders were made anew");
}

/// It is removed as soon as it exists: in any case the verdict is printed, and the loss of the log is
/// reported.
#[test]
fn a_folder_that_vanishes_in_the_first_milliseconds_costs_no_verdict() {
    let mut lost = 0;
    for delay_ms in [0, 1, 3, 10, 30] {
        let dir = tempfile::tempdir().expect("temporary folder");
        let out = dir.path().join("out");
        let mut child = start(&out, &["run", "three-step"], Stdio::piped);
        wait_until(&mut child, "the folder", || out.join(".lock").exists());
        std::thread::sleep(Duration::from_millis(delay_ms));
        // A file that appears meanwhile keeps a folder.
        while out.exists() && fs::remove_dir_all(&out).is_err() {}
        let output = end(child);
        let [told, said] = [&output.stdout, &output.stderr].map(|t| String::from_utf8_lossy(t));
        assert_eq!(output.status.code(), Some(2), "{delay_ms} ms: {said}");
        assert!(!said.contains("panicked"), "{delay_ms} ms: {said}");
        if told.contains("required targets met") {
            assert!(said.contains("log.mcap"), "{delay_ms} ms: {said}");
            lost += 1;
        } else {
            // It could not even begin, and names the file.
            assert!(said.contains("cannot "), "{delay_ms} ms: {said}");
        }
    }
    assert!(lost > 0, "no run outlived its folder");
}

/// Both signals reach the program at once, before it could have ended by itself.
#[test]
fn a_second_signal_ends_the_program_at_once() {
    use std::os::unix::process::ExitStatusExt as _;
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let child = long_run(folder.path(), &out, Stdio::null);
    for name in ["STOP", "INT", "TERM", "CONT"] {
        signal(&child, name);
    }
    let status: ExitStatus = end(child).status;
    assert!(status.signal().is_some(), "{status}");
    assert!(!out.join("report.html").exists());
}

/// `nohup` has a program ignore hang-ups.
#[cfg(target_os = "linux")]
#[test]
fn a_hang_up_that_is_ignored_from_the_start_stays_ignored() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let scenario = cli::scenario_file(folder.path(), 3600.0);
    let mut child = Command::new("nohup")
        .arg(program::path())
        .args(["run", &scenario.to_string_lossy(), "--out"])
        .arg(&out)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("nohup");
    let log = out.join("log.mcap");
    let longer = |bytes: u64| fs::metadata(&log).is_ok_and(|log| log.len() > bytes);
    wait_until(&mut child, "log", || longer(1_000_000));
    signal(&child, "HUP");
    let now = fs::metadata(&log).expect("log").len();
    wait_until(&mut child, "more log", || longer(now + 2_000_000));
    signal(&child, "TERM");
    assert_eq!(end(child).status.code(), Some(143));
}

#[test]
fn a_second_run_in_a_folder_is_refused_by_name_of_the_lock_and_the_first_loses_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let first = long_run(folder.path(), &out, Stdio::null);
    let holder = format!("process {}", first.id());
    for study in [
        &["run", "stand"][..],
        &["figures"],
        &["faults", "run", "--all"],
    ] {
        let second = end(start(&out, study, Stdio::piped));
        assert_eq!(second.status.code(), Some(2), "{study:?}");
        let said = String::from_utf8_lossy(&second.stderr);
        // Messages are wrapped to the width of a terminal.
        let said: String = said.split_whitespace().collect();
        for word in [".lock", &holder.replace(' ', ""), "--outDIR"] {
            assert!(said.contains(word), "{word}: {said}");
        }
    }
    assert!(!out.join("previous").exists());
    signal(&first, "INT");
    assert_eq!(end(first).status.code(), Some(130));
    ends_whole(&out.join("log.mcap"));
    assert!(out.join("summary.json").exists() && out.join("report.html").exists());

    // A program that was killed holds nothing.
    let mut killed = long_run(folder.path(), &out, Stdio::null);
    killed.kill().expect("killed");
    killed.wait().expect("ended");
    let next = end(start(&out, &["figures"], Stdio::null));
    assert!(next.status.success());
}

/// Anything at the lock's path that is no lock is not written to.
#[test]
fn a_lock_that_is_a_link_or_somebody_elses_file_is_refused() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let precious = folder.path().join("precious");
    fs::write(&precious, "of somebody").expect("written");
    // Nobody writes to a pipe, or reads it.
    let out = folder.path().join("pipe");
    fs::create_dir(&out).expect("made");
    let made = Command::new("mkfifo").arg(out.join(".lock")).status();
    assert!(made.expect("mkfifo").success());
    let refused = end(start(&out, &["run", "stand"], Stdio::piped));
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(said.contains(".lock") && said.contains("no file"), "{said}");
    for is_link in [true, false] {
        let out = folder.path().join(format!("link-{is_link}"));
        fs::create_dir(&out).expect("made");
        let lock = out.join(".lock");
        if is_link {
            std::os::unix::fs::symlink(&precious, &lock).expect("linked");
        } else {
            fs::copy(&precious, &lock).expect("copied");
        }
        let refused = end(start(&out, &["run", "stand"], Stdio::piped));
        assert_eq!(refused.status.code(), Some(2));
        let said = String::from_utf8_lossy(&refused.stderr);
        assert!(said.contains(".lock"), "{said}");
        assert_eq!(fs::read_to_string(&lock).expect("there"), "of somebody");
    }
}

/// Standard output is no folder.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_named_as_such() {
    let full = fs::OpenOptions::new().write(true).open("/dev/full");
    let output = Command::new(program::path())
        .args(["list"])
        .env("NO_COLOR", "1")
        .stdout(full.expect("/dev/full"))
        .output()
        .expect("start");
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("standard output") && !said.contains("--out"),
        "{said}"
    );
}
