//! Long runs, and runs that end before their time: bounded memory, a log that can be recovered,
//! and a verdict that needs no disk.

use crate::program;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use mcap::read::Options;
use serde_json::Value;
use wheeleg_studies::run::{log_bytes, table_bytes};
use wheeleg_telemetry::{channels, read};

/// Longest wait for a file or a number.
const HUNG: Duration = Duration::from_secs(300);

fn wheeleg() -> Command {
    let mut command = Command::new(program::path());
    command.env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

/// A robot that stands for `duration_s`, in a file of its own.
fn stand(folder: &Path, duration_s: u32) -> PathBuf {
    let path = folder.join(format!("stand-{duration_s}.toml"));
    let text = format!(
        "name = \"stand-{duration_s}\"\n\
         description = \"Rest at home: no valve may switch\"\n\
         robot = \"wheeleg-2003\"\n\
         duration = {{ value = {duration_s}.0, unit = \"s\" }}\n\
         seed = 1\n\
         targets = \"stand\"\n\
         [motion]\n\
         kind = \"stand\"\n"
    );
    fs::write(&path, text).expect("written");
    path
}

/// A run of `scenario` into `out`, just begun.
fn begin(scenario: &Path, out: &Path) -> Child {
    wheeleg()
        .args(["run", "--json", "--out"])
        .args([out, scenario])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("start")
}

fn json(output: &Output) -> Value {
    let stderr = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {stderr}"))
}

/// `VmHWM` of a process: the most memory that it has had, MB.
#[cfg(target_os = "linux")]
fn peak_mb(id: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kb = line.split_whitespace().nth(1)?.parse::<f64>().ok()?;
    Some(kb / 1e3)
}

/// Runs to the end; returns the peak memory, MB, and the summary.
#[cfg(target_os = "linux")]
fn measured(scenario: &Path, out: &Path) -> (f64, Value) {
    let mut child = begin(scenario, out);
    let mut peak: f64 = 0.0;
    while child.try_wait().expect("status").is_none() {
        peak = peak_mb(child.id()).map_or(peak, |mb| mb.max(peak));
        std::thread::sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().expect("output");
    let stderr = String::from_utf8_lossy(&output.stderr);
    ensure_disk_is_told(&stderr, out);
    let summary = json(&output);
    // A missed target is reported, and is no failure without `--strict`.
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    (peak, summary)
}

/// Bytes of the files of a folder.
#[cfg(target_os = "linux")]
fn size(folder: &Path) -> f64 {
    let files = crate::stop::files_below(folder);
    let sizes = files.iter().map(|file| fs::metadata(folder.join(file)));
    sizes.map(|file| file.expect("a file").len() as f64).sum()
}

/// The announced disk space is what the files take, or up to three times as much: a robot that stands writes
/// less than one that walks.
#[cfg(target_os = "linux")]
fn ensure_disk_is_told(stderr: &str, out: &Path) {
    let before = |what: &str| -> f64 {
        let (before, _) = stderr.split_once(what).expect("the disk is told");
        let word = before.rsplit(' ').next().expect("a word");
        1e9 * word.parse::<f64>().expect("a number")
    };
    let log = fs::metadata(out.join("log.mcap")).expect("a log").len() as f64;
    for (told, is) in [
        (before(" GB of log"), log),
        (before(" GB of tables"), size(&out.join("csv"))),
    ] {
        assert!(
            (is..3.0 * is).contains(&told),
            "{told} for {is} bytes: {stderr}"
        );
    }
}

/// The scenario that writes most takes no more disk than announced.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
#[cfg(target_os = "linux")]
fn no_built_in_scenario_takes_more_disk_than_is_told() {
    let dir = tempfile::tempdir().expect("temporary folder");
    for scenario in ["rocks-20", "walk", "three-step"] {
        let out = dir.path().join(scenario);
        let output = begin(Path::new(scenario), &out);
        let summary = json(&output.wait_with_output().expect("ended"));
        let recorded_s = summary["recorded_s"].as_f64().expect("a number");
        let log = fs::metadata(out.join("log.mcap")).expect("a log").len() as f64;
        let tables = size(&out.join("csv"));
        println!(
            "{scenario}: {:.0} and {:.0} kB/s",
            1e-3 * log / recorded_s,
            1e-3 * tables / recorded_s
        );
        let told = [log_bytes(recorded_s), table_bytes(recorded_s)];
        assert!(
            log < told[0] && tables < told[1],
            "{scenario}: {log}, {tables}, {told:?}"
        );
    }
}

/// Each channel of a log goes on in time to the end of the run, even if a counter has wrapped by then.
#[cfg(target_os = "linux")]
fn ensure_time_goes_on(log: &Path, duration_s: u32) {
    let mut newest = vec![None; channels().len()];
    let end = read(log, &mut |logged| {
        let before = newest[logged.channel].replace(logged.t_ns);
        let def = &channels()[logged.channel];
        let topic = def.topic;
        let (before, now) = (before.unwrap_or(0), logged.t_ns);
        // Events may share an instant.
        assert!(before <= now, "{topic}: {now} ns after {before}");
        // The slowest of the channels with a rate comes every 100 ms.
        let regular = def.rate_hz > 0 && before > 0;
        assert!(
            !regular || now - before <= 1_000_000_000,
            "{topic}: {before} to {now} ns"
        );
        ControlFlow::Continue(())
    });
    assert!(end.expect("a log").whole);
    let duration_ns = u64::from(duration_s) * 1_000_000_000;
    let ended = newest.iter().flatten().max().expect("messages");
    assert!(
        duration_ns.abs_diff(*ended) <= 1_000_000_000,
        "it ends at {ended} ns"
    );
}

/// Required targets that a run has missed.
fn missed(summary: &serde_json::Value) -> Vec<&str> {
    let targets = summary["targets"].as_array().expect("a list");
    let missed = targets
        .iter()
        .filter(|t| t["required"] == true && t["pass"] == false);
    missed.filter_map(|t| t["id"].as_str()).collect()
}

/// `cargo xtask deep long-run` has it longer than the 2^32 us of a counter.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
#[cfg(target_os = "linux")]
fn memory_does_not_grow_with_simulated_time() {
    let long_s = std::env::var("WHEELEG_LONG_RUN_S")
        .map_or(600, |text| text.parse().expect("WHEELEG_LONG_RUN_S"));
    let dir = tempfile::tempdir().expect("temporary folder");
    let run = |duration_s: u32| {
        let out = dir.path().join(duration_s.to_string());
        let (peak, summary) = measured(&stand(dir.path(), duration_s), &out);
        assert_eq!(summary["complete"], true, "{summary}");
        ensure_time_goes_on(&out.join("log.mcap"), duration_s);
        let log = fs::metadata(out.join("log.mcap")).expect("a log").len();
        let page = fs::read_to_string(out.join("report.html")).expect("a page");
        assert!(page.contains("A long run: the figures draw one sample every"));
        fs::remove_dir_all(out).expect("removed");
        (peak, log as f64, summary)
    };
    // For 165 s and for 600 s the figures keep about as many rows, so the remaining difference is growth.
    let short_s = 165;
    let (short, _, _) = run(short_s);
    let (long, log, summary) = run(long_s);
    let slope_kb_s = (long - short) * 1e3 / f64::from(long_s - short_s);
    println!(
        "{long_s} s simulated in {:.0} s: {long:.0} MB of memory at most, {short:.0} MB for {short_s} s \
         ({slope_kb_s:.1} kB/s); log {:.0} kB/s; targets missed: {:?}",
        summary["wall_s"].as_f64().expect("a number"),
        log * 1e-3 / f64::from(long_s),
        missed(&summary),
    );
    // In two hours a piston that is held in mid-stroke creeps out of its dead band, and the
    // paper's law corrects it: of all targets R1, no valve edge at rest, may then be missed.
    let known: &[&str] = if long_s < 3_600 { &[] } else { &["R1"] };
    let missed = missed(&summary);
    assert!(missed.iter().all(|id| known.contains(id)), "{summary}");
    let met = summary["targets"].as_array().expect("a list").iter();
    let met = met.filter(|t| t["required"] == true && t["pass"] == true);
    assert!(met.count() >= 1, "{summary}");
    assert!(long < 300.0, "{long} MB");
    // The index of the log, which is written at its end, has 4 kB per second. Over 435 s, 4 kB/s more
    // are 1.7 MB: by about 1 MB two runs differ.
    assert!(slope_kb_s < 8.0, "{short} MB, then {long} MB");
}

/// A walk of 6 s over low blocks, 100 mm apart, and as many `far` ones beyond its end.
fn over_blocks(folder: &Path, far: usize) -> PathBuf {
    use std::fmt::Write as _;
    let path = folder.join(format!("blocks-{far}.toml"));
    let mut text = String::from(
        "name = \"blocks\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"6 s\"\nseed = 1\n\
         targets = \"none\"\n[motion]\nkind = \"walk\"\nspeed = \"120 mm/s\"\nturn = \"0 rad/s\"\n\
         pattern = \"alternate\"\nlift = \"60 mm\"\nnose = \"-20 mm\"\n\
         [[bars]]\nmeasure = \"distance\"\ninfo = true\n",
    );
    let mut block = |x_m: f64, y_m: f64| {
        let _ = write!(
            text,
            "[[terrain]]\nkind = \"block\"\nx = {{ value = [{x_m:.3}, {:.3}], unit = \"m\" }}\n\
             y = {{ value = [{y_m:.3}, {:.3}], unit = \"m\" }}\nheight = \"3 mm\"\n",
            x_m + 0.02,
            y_m + 0.02
        );
    };
    for i in 0..2_000 {
        let x_m = 0.25 + f64::from(i / 40) * 0.1;
        // None below the feet at the start.
        if !(0.6..0.95).contains(&x_m) {
            block(x_m, f64::from(i % 40) * 0.1 - 2.0);
        }
    }
    for i in 0..far {
        block(20.0 + (i / 40) as f64 * 0.1, (i % 40) as f64 * 0.1 - 2.0);
    }
    fs::write(&path, text).expect("written");
    path
}

/// Of 2,000 parts of the ground and of 100,000 the robot meets the same ones. That a step looks at the near
/// ones alone is counted where they are looked up, in the plant.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn parts_of_the_ground_that_are_far_away_change_nothing() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let way_mm = [0, 98_000].map(|far| {
        let begun = Instant::now();
        let scenario = over_blocks(dir.path(), far);
        let run = begin(&scenario, &dir.path().join(format!("out-{far}")));
        let output = run.wait_with_output().expect("ended");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{far}: {stderr}");
        let summary = json(&output);
        println!(
            "{far} far ones: {:.1} s, {:.1} s of them simulating",
            begun.elapsed().as_secs_f64(),
            summary["wall_s"].as_f64().expect("a number")
        );
        assert_eq!(summary["complete"], true, "{far}");
        let targets = summary["targets"].as_array().expect("a list");
        let distance = targets.iter().find(|t| t["unit"] == "m").expect("one");
        1e3 * distance["value"].as_f64().expect("a number")
    });
    println!("{way_mm:?} mm");
    assert!(way_mm[0] > 200.0, "{way_mm:?}");
    // Their sums may be rounded in another order.
    assert!((way_mm[0] - way_mm[1]).abs() < 1.0, "{way_mm:?}");
}

#[test]
fn the_log_of_a_killed_run_is_recovered() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let out = dir.path().join("out");
    let log = out.join("log.mcap");
    let mut child = begin(&stand(dir.path(), 7200), &out);
    let asked = Instant::now();
    while !fs::metadata(&log).is_ok_and(|m| m.len() > 300_000) {
        assert!(child.try_wait().expect("status").is_none(), "it ended");
        assert!(asked.elapsed() < HUNG, "no log appeared");
        std::thread::sleep(Duration::from_millis(5));
    }
    // SIGKILL: nothing can be finished.
    child.kill().expect("killed");
    child.wait().expect("ended");

    let cut = fs::read(&log).expect("a log");
    let output = wheeleg()
        .args(["log", "recover"])
        .arg(&log)
        .output()
        .expect("start");
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(fs::read(&log).expect("kept"), cut);
    let whole = fs::read(out.join("log-recovered.mcap")).expect("a new log");
    let index = mcap::Summary::read(&whole).expect("summary section");
    let statistics = index.and_then(|s| s.stats).expect("statistics");
    let strict = mcap::MessageStream::new(&whole).expect("an MCAP file");
    let times: Vec<u64> = strict.map(|m| m.expect("message").log_time).collect();
    assert_eq!(statistics.message_count, times.len() as u64);
    let told = format!("{} messages recovered, up to ", times.len());
    assert!(text.starts_with(&told), "{text}");
    // All that a reader finds in the cut log, whose chunks are whole, is in the new one.
    let tolerant = mcap::MessageStream::new_with_options(&cut, Options::IgnoreEndMagic.into());
    let found = tolerant.expect("an MCAP file").map_while(Result::ok);
    let found: Vec<u64> = found.map(|m| m.log_time).collect();
    assert_eq!(times, found);
    assert!(times.len() > 1000);

    // Once more: the file is there.
    let again = wheeleg().args(["log", "recover"]).arg(&log).output();
    let again = again.expect("start");
    assert_eq!(again.status.code(), Some(2), "{again:?}");
    assert!(String::from_utf8_lossy(&again.stderr).contains("log-recovered.mcap"));
    assert_eq!(
        fs::read(out.join("log-recovered.mcap")).expect("kept"),
        whole
    );
}

/// The disk fills up at ten different times of a run: the verdict is printed and kept all the same. Each disk
/// is a file system in memory, of a mount name space of its own.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
#[cfg(target_os = "linux")]
fn a_disk_that_fills_at_any_time_keeps_the_summary() {
    let dir = tempfile::tempdir().expect("temporary folder");
    // From hardly more than the summary to room for everything.
    for kib in [96, 160, 256, 400, 640, 1000, 1600, 2500, 4000, 12_000] {
        // That disk vanishes with the name space, so the summary is copied out of it.
        let script = format!(
            "mount -t tmpfs -o size={kib}k tmpfs \"$1\" || exit 77\n\
             \"$0\" run three-step --json --out \"$1/out\"; code=$?\n\
             cat \"$1/out/summary.json\" >&2; exit $code"
        );
        let output = Command::new("unshare")
            .args(["--mount", "--map-root-user", "bash", "-c", &script])
            .arg(program::path())
            .arg(dir.path())
            .env("NO_COLOR", "1")
            .output()
            .expect("unshare of util-linux");
        let stderr = String::from_utf8_lossy(&output.stderr);
        let code = output.status.code();
        assert_ne!(code, Some(77), "no file system in memory: {stderr}");
        let told = json(&output);
        assert_eq!(told["complete"], true, "{kib} KiB");
        assert_eq!(told["passed"], true, "{kib} KiB");
        let kept = &stderr[stderr.rfind("\n{").map_or(0, |at| at + 1)..];
        let kept: Value = serde_json::from_str(kept).unwrap_or_default();
        assert_eq!(kept, told, "{kib} KiB: the summary on the disk: {stderr}");
        let filled = stderr.contains("No space left on device");
        assert_eq!(
            code,
            Some(if filled { 2 } else { 0 }),
            "{kib} KiB: {stderr}"
        );
        assert_eq!(filled, kib < 12_000, "{kib} KiB: {stderr}");
    }
}

/// A limit on file size acts as the full disk: log and page do not fit, the summary does.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_costs_neither_verdict_nor_summary() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let out = dir.path().join("out");
    let output = Command::new("bash")
        .args([
            "-c",
            "trap '' XFSZ; ulimit -f 500; exec \"$0\" run three-step --json --out \"$1\"",
        ])
        .arg(program::path())
        .arg(&out)
        .env("NO_COLOR", "1")
        .output()
        .expect("bash");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    let told = json(&output);
    assert_eq!(told["complete"], true);
    assert!(told["targets"].as_array().is_some_and(|t| t.len() > 10));
    assert!(
        told["unwritten"]
            .to_string()
            .contains("cannot write the log")
    );
    let summary = fs::read(out.join("summary.json")).expect("a summary");
    let summary: Value = serde_json::from_slice(&summary).expect("JSON");
    assert_eq!(summary, told);
    assert!(
        stderr.contains("cannot write the log") && stderr.contains("report.html"),
        "{stderr}"
    );
    assert!(stderr.contains("wheeleg log recover"), "{stderr}");
    // Files that do not fit do not exist in part; those that fit exist.
    assert!(!out.join("report.html").exists());
    for figure in ["fig12-b5", "fig16-f6", "body"] {
        let path = out.join("figures").join(format!("{figure}.svg"));
        assert!(path.exists(), "{figure}");
    }
    let recovered = wheeleg()
        .args(["log", "recover"])
        .arg(out.join("log.mcap"))
        .output();
    assert!(recovered.expect("start").status.success());
}
