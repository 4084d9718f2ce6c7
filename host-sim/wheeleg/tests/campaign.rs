//! Campaigns from the user's point of view: shared, killed, stopped, replayed, and refused.
//!
//! This suite runs a few cases; `cargo xtask deep campaign` runs as many as the table of the specification
//! demands.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Variables for the samples of the plan and for how often a run is killed.
const SAMPLES_VARIABLE: &str = "WHEELEG_CAMPAIGN_SAMPLES";
const KILLS_VARIABLE: &str = "WHEELEG_CAMPAIGN_KILLS";
/// Longest time that a program may take.
const HUNG: Duration = Duration::from_secs(600);

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |n| n.parse().expect("a number"))
}

fn wheeleg() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wheeleg"));
    for variable in [
        "SLURM_ARRAY_TASK_ID",
        "SLURM_ARRAY_TASK_COUNT",
        "JOB_COMPLETION_INDEX",
    ] {
        command.env_remove(variable);
    }
    command.env("NO_COLOR", "1").stdin(Stdio::null());
    command.args(["campaign"]);
    command
}

/// Two laws on robots whose seals and valves differ. The runs are short, because their start-up is not. A
/// non-trivial exponent makes a power, which a C library would compute differently on different processors.
fn plan(folder: &Path, samples: u64) -> PathBuf {
    let text = format!(
        "name = \"short\"\nroot = 3\nsamples = {samples}\nblock = 4\nsampler = \"sobol\"\n\
         [base]\nscenario = \"stand\"\n\
         [factor.length]\nparameter = \"scenario.duration\"\ngrid = [0.3]\nunit = \"s\"\n\
         [factor.friction]\nscale = true\n\
         parameter = [\"robot.friction.coulomb\", \"robot.friction.static\"]\n\
         lognormal = {{ median = 1.0, sigma = 0.2, min = 0.5, max = 2.0 }}\n\
         [factor.exponent]\nparameter = [\"robot.fill_valve.subsonic_exponent\", \
         \"robot.vent_valve.subsonic_exponent\"]\n\
         uniform = {{ min = 0.35, max = 0.65 }}\n\
         [factor.robot]\nparameter = \"robot\"\ngrid = [\"wheeleg-2003\", \"wheeleg\"]\n\
         paired = true\n"
    );
    let path = folder.join("plan.toml");
    fs::write(&path, text).expect("written");
    path
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn output(command: &mut Command) -> Output {
    command.output().expect("started")
}

/// The output, with its wrapped lines joined.
fn text(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    text.replace("\n  │ ", " ")
}

fn succeeded(command: &mut Command) -> String {
    let output = output(command);
    assert!(
        output.status.success(),
        "{}: {}{}",
        output.status,
        text(&output.stdout),
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// The hash of all rows.
fn merged(folders: &[&Path], out: &Path) -> String {
    let told = succeeded(wheeleg().arg("merge").args(folders).arg("--out").arg(out));
    let line = told.lines().find_map(|line| line.strip_prefix("hash    "));
    line.expect("a hash").to_owned()
}

fn parts(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder.join("parts")).expect("parts").flatten();
    let files = entries.map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        (name, fs::read(entry.path()).expect("read"))
    });
    let mut files: Vec<_> = files.filter(|(name, _)| !name.contains("run")).collect();
    files.sort();
    files
}

/// Hides fused multiplication and wide vectors from the C library of a Linux computer, which otherwise
/// chooses its mathematics by the processor (manual of glibc, "Hardware Capability Tunables").
const MASKED: (&str, &str) = (
    "GLIBC_TUNABLES",
    "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX512F,-AVX",
);

/// There is one hash, and the parts have equal bytes: with one thread, with two, with seven processes, when
/// killed again and again, and on a processor that seems to lack fused multiplication. A replayed case equals
/// its original.
#[test]
fn however_it_is_run_the_table_is_the_same() {
    let samples = number(SAMPLES_VARIABLE, 7);
    let home = folder();
    let plan = plan(home.path(), samples);
    let at = |name: &str| home.path().join(name);
    let run = |to: &Path| {
        let mut command = wheeleg();
        command.arg("run").arg(&plan).arg("--out").arg(to);
        command
    };
    let (one, two, seven, killed) = (at("one"), at("two"), at("seven"), at("killed"));
    let masked = at("masked");
    let begun = Instant::now();
    let told = succeeded(run(&one).args(["--threads", "1"]));
    let one_s = begun.elapsed().as_secs_f64();
    assert!(
        told.contains(&format!("cases   {0} of {0}", 2 * samples)),
        "{told}"
    );
    let begun = Instant::now();
    succeeded(run(&two).args(["--threads", "2"]));
    let two_s = begun.elapsed().as_secs_f64();
    succeeded(
        run(&masked)
            .args(["--threads", "2"])
            .env(MASKED.0, MASKED.1),
    );
    let children: Vec<_> = (0..7)
        .map(|i| {
            run(&seven)
                .args(["--threads", "1", "--shard", &format!("{i}/7")])
                .stdout(Stdio::null())
                .spawn()
                .expect("started")
        })
        .collect();
    for mut child in children {
        assert!(child.wait().expect("ended").success());
    }
    let kills = number(KILLS_VARIABLE, 4);
    let mut state = 88_172_645_463_325_252;
    for _ in 0..kills {
        let mut child = run(&killed)
            .args(["--threads", "2"])
            .stdout(Stdio::null())
            .spawn()
            .expect("started");
        let wait = one_s / (kills + 2) as f64 * (random(&mut state) % 1000) as f64 * 2e-3;
        std::thread::sleep(Duration::from_secs_f64(wait));
        let _ = child.kill();
        let _ = child.wait();
    }
    succeeded(run(&killed).args(["--threads", "2"]));
    let table = at("cases.parquet");
    let hash = merged(&[&one], &table);
    for other in [&two, &seven, &killed, &masked] {
        let name = other.display();
        assert_eq!(merged(&[other], &at("other.parquet")), hash, "{name}");
        assert!(parts(other) == parts(&one), "{name}");
    }
    // From the folder by index, from the table by identity.
    let list = succeeded(wheeleg().arg("run").arg(&plan).arg("--list"));
    let cases: Vec<&str> = list
        .lines()
        .skip(1)
        .filter_map(|line| line.split('\t').nth(1))
        .collect();
    assert_eq!(cases.len() as u64, 2 * samples);
    let replays = (2 * samples).min(50);
    let every = (2 * samples / replays).max(1) as usize;
    let replays: Vec<usize> = match samples {
        0..20 => vec![1, 2 * samples as usize - 2],
        _ => (0..2 * samples as usize).step_by(every).collect(),
    };
    for place in &replays {
        let (from, case) = match place % 2 {
            0 => (&one, place.to_string()),
            _ => (&table, cases[*place].to_owned()),
        };
        let out = at(&format!("replay-{place}"));
        let told = succeeded(
            wheeleg()
                .arg("replay")
                .args([from, Path::new(&case)])
                .arg("--out")
                .arg(&out),
        );
        assert!(told.contains("row     bit-identical"), "{told}");
        assert!(told.contains("log     bit-identical"), "{told}");
        assert!(out.join("log.mcap").exists() && out.join("report.html").exists());
        fs::remove_dir_all(&out).expect("there");
    }
    let told = succeeded(wheeleg().arg("report").arg(&table));
    assert!(
        at("cases.html").exists() && told.contains("paired  robot wheeleg against"),
        "{told}"
    );
    println!(
        "campaign: {} cases, 1 and 2 threads, 7 processes, {kills} kills: one hash; {} replays \
         equal; 2 threads are {:.2} times as fast",
        2 * samples,
        replays.len(),
        one_s / two_s
    );
}

#[cfg(unix)]
#[test]
fn a_signal_leaves_what_was_done_and_a_full_disk_is_named() {
    let home = folder();
    let plan = plan(home.path(), 40);
    let out = home.path().join("out");
    for (signal, code) in [("TERM", 75), ("INT", 130)] {
        let child = wheeleg()
            .arg("run")
            .arg(&plan)
            .arg("--out")
            .arg(&out)
            .args(["--threads", "2", "--progress", "json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("started");
        let before = finished(&out);
        let begun = Instant::now();
        while finished(&out) == before {
            assert!(begun.elapsed() < HUNG, "no block is finished");
            std::thread::sleep(Duration::from_millis(5));
        }
        let sent = Command::new("kill")
            .args([&format!("-{signal}"), &child.id().to_string()])
            .status();
        assert!(sent.expect("kill").success());
        let output = child.wait_with_output().expect("ended");
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(stderr.contains("run the same command again"), "{stderr}");
        let line = stderr
            .lines()
            .find(|line| line.starts_with('{'))
            .expect("progress");
        let line: serde_json::Value = serde_json::from_str(line).expect("JSON");
        assert_eq!(line["of"], 80);
    }
    let state = output(wheeleg().arg("status").arg(&out).arg("--json"));
    assert_eq!(state.status.code(), Some(3), "incomplete");
    let state: serde_json::Value = serde_json::from_slice(&state.stdout).expect("JSON");
    let rows = state["rows"].as_u64().expect("a number");
    assert!((4..80).contains(&rows), "{state}");
    assert_eq!(state["bad_parts"], serde_json::json!([]));
    // No file above 4 kB can be written, and a part is larger.
    let full = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_wheeleg"))
        .args(["campaign", "run"])
        .arg(&plan)
        .arg("--out")
        .arg(&out)
        .env("NO_COLOR", "1")
        .output()
        .expect("started");
    let stderr = text(&full.stderr);
    assert_eq!(full.status.code(), Some(74), "{stderr}");
    assert!(
        stderr.contains("parts") && stderr.contains("File too large"),
        "{stderr}"
    );
    let state = output(wheeleg().arg("status").arg(&out).arg("--json"));
    let state: serde_json::Value = serde_json::from_slice(&state.stdout).expect("JSON");
    assert!(
        state["rows"].as_u64() >= Some(rows),
        "finished rows are intact: {state}"
    );
}

/// Number of files of finished blocks.
#[cfg(unix)]
fn finished(out: &Path) -> usize {
    let entries = fs::read_dir(out.join("parts"))
        .into_iter()
        .flatten()
        .flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.ends_with(".run.parquet")).count()
}

/// None of these short runs meets its targets.
#[test]
fn strict_runs_end_with_1_where_a_case_failed() {
    let home = folder();
    let plan = plan(home.path(), 1);
    let out = home.path().join("out");
    for (options, code) in [(&[][..], 0), (&["--strict"], 1)] {
        let run = output(
            wheeleg()
                .arg("run")
                .arg(&plan)
                .arg("--out")
                .arg(&out)
                .args(options),
        );
        assert_eq!(run.status.code(), Some(code), "{}", text(&run.stderr));
        assert_eq!(parts(&out).len(), 1, "the rows are kept");
        if code == 0 {
            let told = text(&run.stdout);
            assert!(
                told.contains("failed  2 of the 2") && told.contains(" not measured: "),
                "it says of what: {told}"
            );
        }
    }
}

/// A pilot names the command that makes a table of it, and the report accepts this table.
#[test]
fn a_pilot_has_a_table_and_a_page() {
    let home = folder();
    let plan = plan(home.path(), 4);
    let out = home.path().join("out");
    let mut pilot = wheeleg();
    let told = succeeded(
        pilot
            .arg("run")
            .arg(&plan)
            .arg("--out")
            .arg(&out)
            .args(["--first", "3"]),
    );
    let next = told
        .lines()
        .find_map(|line| line.strip_prefix("next    wheeleg campaign "));
    let next: Vec<&str> = next.expect("what comes next").split(' ').collect();
    assert!(next.contains(&"--partial"), "{next:?}");
    let told = succeeded(wheeleg().args(&next));
    assert!(told.contains("rows    3\nmissing 5 cases"), "{told}");
    let table = next.last().expect("the table");
    let told = succeeded(wheeleg().args(["report", table]));
    assert!(told.contains("rows    3"), "{told}");
    // None of these short runs meets its targets: the worst is named, with the command that replays it.
    let after = |word: &str| told.lines().find_map(|line| line.strip_prefix(word));
    let worst = after("worst   ").expect("the worst case");
    let (case, why) = worst.split_once(": ").expect("why");
    assert!(why.starts_with("missed "), "{worst}");
    let replay = format!("replay {table} {case}");
    assert_eq!(after("next    wheeleg campaign "), Some(&*replay));
    let page = fs::read_to_string(out.join("cases.html")).expect("a page");
    assert!(page.contains("3 of 8 cases") && page.contains("a level floor of rock"));
    let state = output(wheeleg().arg("status").arg(&out).arg("--json"));
    let state: serde_json::Value = serde_json::from_slice(&state.stdout).expect("JSON");
    assert_eq!((&state["rows"], &state["partial"]), (&3.into(), &3.into()));
    assert!(state["causes"][0]["cases"].as_u64() > Some(0), "{state}");
    // The progress of a continued run counts all finished cases, and all failed ones among them.
    let mut again = wheeleg();
    let again = again.arg("run").arg(&plan).arg("--out").arg(&out);
    let again = output(again.args(["--first", "5", "--progress", "json"]));
    let told = text(&again.stderr);
    let last = told.lines().last().expect("progress");
    let last: serde_json::Value = serde_json::from_str(last).expect("JSON");
    let number = |key: &str| last[key].as_u64();
    assert_eq!(["done", "failed", "of"].map(number), [Some(5); 3], "{last}");
}

fn view(folder: &Path) -> Output {
    let mut view = Command::new(env!("CARGO_BIN_EXE_wheeleg"));
    output(view.arg("view").arg(folder).env("NO_COLOR", "1"))
}

/// The page of a robot's log shows what its run missed.
#[test]
fn the_log_of_a_replayed_case_tells_what_it_missed() {
    let home = folder();
    let plan = plan(home.path(), 1);
    let [out, again] = ["out", "again"].map(|name| home.path().join(name));
    succeeded(wheeleg().arg("run").arg(&plan).arg("--out").arg(&out));
    succeeded(
        wheeleg()
            .arg("replay")
            .arg(&out)
            .arg("0")
            .arg("--out")
            .arg(&again),
    );
    let told = text(&view(&again).stdout);
    assert!(told.contains("required targets missed"), "{told}");
    let page = fs::read_to_string(again.join("log.html")).expect("a page");
    assert!(page.contains("<h2>Missed</h2>") && page.contains("asked: "));
    // The summary of another run is not used for this log.
    let summary = again.join("summary.json");
    let other = fs::read_to_string(&summary).expect("there");
    fs::write(&summary, other.replace("\"seed\": \"", "\"seed\": \"1")).expect("written");
    let told = text(&view(&again).stdout);
    assert!(!told.contains("missed"), "{told}");
}

/// A cylinder on the bench, from the plan to its page; it has no log, and `view` says where its page is.
#[test]
fn a_cylinder_goes_from_the_plan_to_its_page() {
    let home = folder();
    let plan = home.path().join("bench.toml");
    let text_of = "name = \"bench\"\nroot = 3\nsamples = 2\nblock = 2\n[base]\naxis = \"small-12x50\"\n\
        move = \"step-20\"\n[factor.friction]\nparameter = \"plant.friction.viscous\"\nscale = true\n\
        uniform = { min = 0.5, max = 1.5 }\n";
    fs::write(&plan, text_of).expect("written");
    let at = |name: &str| home.path().join(name);
    let (out, table, again) = (at("out"), at("cases.parquet"), at("again"));
    succeeded(wheeleg().arg("run").arg(&plan).arg("--out").arg(&out));
    merged(&[&out], &table);
    let told = succeeded(wheeleg().arg("report").arg(&table));
    assert!(told.contains("rows    2"), "{told}");
    let page = fs::read_to_string(at("cases.html")).expect("a page");
    assert!(page.contains("rest-error") && !page.contains("<h2>Ground</h2>"));
    let told = succeeded(
        wheeleg()
            .arg("replay")
            .arg(&table)
            .arg("1")
            .arg("--out")
            .arg(&again),
    );
    assert!(told.contains("row     bit-identical"), "{told}");
    assert!(told.contains("moves   bit-identical"), "{told}");
    let refused = view(&again);
    assert_eq!(refused.status.code(), Some(2));
    let told = text(&refused.stderr);
    assert!(
        told.contains("no log.mcap") && told.contains("report.html"),
        "{told}"
    );
    let both = text_of.replace("[base]\n", "[base]\nscenario = \"stand\"\n");
    fs::write(&plan, both).expect("written");
    let refused = output(
        wheeleg()
            .arg("run")
            .arg(&plan)
            .arg("--out")
            .arg(at("other")),
    );
    assert_eq!(refused.status.code(), Some(2));
    let told = text(&refused.stderr);
    assert!(
        told.contains("bench.toml:7") && told.contains("both given"),
        "{told}"
    );
}

#[test]
fn bad_input_is_told_before_the_first_case() {
    let home = folder();
    let plan = plan(home.path(), 2);
    let out = home.path().join("out");
    let bad = home.path().join("bad.toml");
    let good = fs::read_to_string(&plan).expect("there");
    let text_of = good.replace("max = 2.0 }", "max = 2000.0 }").replace(
        "\"robot\"\ngrid = [\"wheeleg-2003\"",
        "\"robot\"\ngrid = [\"wheeleg-2004\"",
    );
    fs::write(&bad, text_of).expect("written");
    let refused = output(wheeleg().arg("run").arg(&bad).arg("--out").arg(&out));
    assert_eq!(refused.status.code(), Some(2));
    let told = text(&refused.stderr);
    assert!(told.contains("wheeleg-2004") && !out.exists(), "{told}");
    fs::write(&bad, good.replace("max = 2.0 }", "max = 2000.0 }")).expect("written");
    let refused = output(wheeleg().arg("run").arg(&bad).arg("--out").arg(&out));
    let told = text(&refused.stderr);
    assert!(
        told.contains("factor.friction") && told.contains("0 to 500 N"),
        "{told}"
    );
    assert!(!out.exists(), "nothing is begun");
    for (arguments, code, words) in [
        (vec!["run", "no-such-plan"], 2, "no-such-plan"),
        (vec!["status", "no-such-folder"], 2, "plan.json"),
        (vec!["merge", "no-such-folder"], 2, "plan.json"),
        (vec!["report", "no-such-table"], 2, "no-such-table"),
        (vec!["replay", "no-such-table", "0"], 2, "no-such-table"),
        (
            vec!["run", "three-step-spread", "--shard", "4/4"],
            2,
            "0 to N - 1",
        ),
        (
            vec!["run", "three-step-spread", "--shards", "4"],
            2,
            "--shards 4",
        ),
    ] {
        let refused = output(wheeleg().args(&arguments).current_dir(home.path()));
        let told = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(code), "{arguments:?}: {told}");
        assert!(told.contains(words), "{words}: {told}");
    }
    let refused = output(
        wheeleg()
            .arg("run")
            .arg(&plan)
            .arg("--out")
            .arg(&out)
            .args(["--shard", "0/2"])
            .env("SLURM_ARRAY_TASK_ID", "1")
            .env("SLURM_ARRAY_TASK_COUNT", "2"),
    );
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("the Slurm array says 1/2"));
}

/// A pod of an indexed job has a completion index in its environment, and the manifest contains the rest.
/// Several pods, started by a loop in arbitrary order, produce the table of one process.
#[test]
fn an_indexed_job_of_kubernetes_comes_to_the_table_of_one_process() {
    const PODS: usize = 3;
    let home = folder();
    let plan = plan(home.path(), 6);
    let [one, job] = ["one", "job"].map(|name| home.path().join(name));
    succeeded(wheeleg().arg("run").arg(&plan).arg("--out").arg(&one));
    let submit = |shards: usize| {
        let mut command = wheeleg();
        command.arg("submit").arg(&plan).arg("--out").arg(&job);
        command.args(["--kubernetes", "--shards", &shards.to_string()]);
        command
    };
    let manifest = succeeded(&mut submit(PODS));
    let line = manifest
        .lines()
        .find_map(|line| line.trim().strip_prefix("command: ["));
    let words = line.and_then(|words| words.strip_suffix(']'));
    let words: Vec<String> = words
        .expect("the command of a pod")
        .split(", ")
        .map(|word| word.trim_matches('"').to_owned())
        // The volume is mounted there.
        .map(|word| word.replacen("/campaign", &job.to_string_lossy(), 1))
        .collect();
    assert_eq!(words[..2], ["wheeleg", "campaign"]);
    for index in [2, 0, 1, 0] {
        let pod = succeeded(
            wheeleg()
                .args(&words[2..])
                .env("JOB_COMPLETION_INDEX", index.to_string()),
        );
        assert!(pod.contains(&format!("in shard {index}/{PODS}")), "{pod}");
    }
    let table = home.path().join("cases.parquet");
    assert_eq!(merged(&[&job], &table), merged(&[&one], &table));
    assert!(parts(&job) == parts(&one));
    let refused = output(&mut submit(1_000));
    assert_eq!(refused.status.code(), Some(2), "more pods than blocks");
}

/// Two laws on the bench: eight cases of a few milliseconds.
fn bench_plan(folder: &Path, head: &str) -> PathBuf {
    let path = folder.join("bench.toml");
    let text = format!(
        "name = \"bench\"\nroot = 3\nsamples = 8\n{head}[base]\naxis = \"small-12x50\"\nmove = \"first-step\"\n\
         [factor.friction]\nparameter = \"plant.friction.viscous\"\nscale = true\n\
         uniform = {{ min = 0.5, max = 1.5 }}\n"
    );
    fs::write(&path, text).expect("written");
    path
}

/// A shard without work says why: too few blocks, or a pilot that ends before it.
#[test]
fn a_shard_without_work_says_why() {
    let home = folder();
    let run = |plan: &Path, out: &str, arguments: &[&str]| {
        let mut command = wheeleg();
        command
            .arg("run")
            .arg(plan)
            .arg("--out")
            .arg(home.path().join(out));
        let run = output(command.args(arguments));
        assert!(run.status.success(), "{}", text(&run.stderr));
        [text(&run.stdout), text(&run.stderr)]
    };
    let one = bench_plan(home.path(), "");
    for shard in ["0/2", "1/2"] {
        let [_, told] = run(&one, "one", &["--shard", shard]);
        let words =
            "only 1 of 2 shards have work: the 8 cases make 1 block; for all, write `block = 4`";
        assert!(told.contains(words), "{told}");
    }
    let two = bench_plan(home.path(), "block = 4\n");
    let [told, warned] = run(&two, "two", &["--shard", "1/2", "--first", "3"]);
    assert!(
        told.contains("0 of 0 in shard 1/2: it begins with place 4 in the plan")
            && !warned.contains("only"),
        "{told}{warned}"
    );
    // A pilot of all cases is the whole campaign.
    let [told, _] = run(&two, "two", &["--first", "99999"]);
    assert!(
        told.contains("next    wheeleg campaign merge") && !told.contains("--partial"),
        "{told}"
    );
}

/// What a killed process has lost is counted, with the command that repeats it.
#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_process_has_lost_is_told_with_what_to_do() {
    let home = folder();
    let plan = plan(home.path(), 200);
    let long = fs::read_to_string(&plan)
        .expect("there")
        .replace("block = 4", "block = 400");
    fs::write(&plan, long).expect("written");
    let out = home.path().join("out");
    let mut child = wheeleg()
        .arg("run")
        .arg(&plan)
        .arg("--out")
        .arg(&out)
        .args(["--threads", "2"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("started");
    let attempts = out.join("attempts/000000.jsonl");
    let begun = Instant::now();
    let lines = || {
        fs::read_to_string(&attempts)
            .unwrap_or_default()
            .lines()
            .count()
    };
    while lines() < 6 {
        assert!(begun.elapsed() < HUNG, "no case is begun");
        std::thread::sleep(Duration::from_millis(5));
    }
    let state = || text(&output(wheeleg().arg("status").arg(&out)).stdout);
    let running = state();
    assert!(running.contains("begun ") && !running.contains("lost ") && !running.contains("next "));
    // A second process is told that it repeats the work of the first.
    let mut second = wheeleg();
    let second = second
        .arg("run")
        .arg(&plan)
        .arg("--out")
        .arg(&out)
        .args(["--first", "1"]);
    let second = output(second);
    assert!(text(&second.stderr).contains("another process works on the same blocks"));
    assert!(text(&second.stdout).contains("shared  another process"));
    child.kill().expect("killed");
    child.wait().expect("ended");
    let told = state();
    let lost = told.lines().find_map(|line| line.strip_prefix("lost    "));
    let lost = lost.and_then(|line| line.split(' ').next()?.parse::<u64>().ok());
    assert!(lost >= Some(2), "{told}");
    let folder = out.display();
    let next = format!("next    wheeleg campaign run {folder}/plan.json --out {folder}\n");
    assert!(told.ends_with(&next), "{told}");
}

/// The corrected command is not refused because of what a first, refused one has left.
#[test]
fn a_refused_submission_and_a_dry_run_write_nothing() {
    let home = folder();
    let plan = plan(home.path(), 6);
    let out = home.path().join("out");
    let submit = |arguments: &[&str]| {
        let mut command = wheeleg();
        command.arg("submit").arg(&plan).arg("--out").arg(&out);
        command.args(arguments);
        output(&mut command)
    };
    for (arguments, code) in [
        (&["--slurm", "--dry-run", "--shards", "1000"][..], 2),
        (&["--slurm", "--shards", "1000"], 2),
        (&["--kubernetes", "--shards", "1000"], 2),
        (&["--slurm", "--dry-run", "--shards", "3"], 0),
        (&["--kubernetes", "--dry-run", "--shards", "3"], 0),
    ] {
        let told = submit(arguments);
        let words = text(&told.stderr);
        assert_eq!(told.status.code(), Some(code), "{arguments:?}: {words}");
        assert_eq!(told.stdout.is_empty(), code != 0, "{arguments:?}");
        assert!(!out.exists(), "{arguments:?}");
    }
    // What another campaign forbids is refused before the submission.
    succeeded(
        wheeleg()
            .arg("run")
            .arg(&plan)
            .arg("--out")
            .arg(&out)
            .args(["--first", "1"]),
    );
    fs::write(
        &plan,
        fs::read_to_string(&plan).expect("there") + "# more\n",
    )
    .expect("written");
    let told = submit(&["--slurm", "--dry-run", "--shards", "3"]);
    assert!(
        text(&told.stderr).contains("`# more` now"),
        "{}",
        text(&told.stderr)
    );
}

/// Random numbers, the same every time.
fn random(state: &mut u64) -> u64 {
    // Xorshift (Marsaglia 2003).
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}
