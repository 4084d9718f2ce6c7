//! A case that crashes its process, and a process that is killed. The test starts its own program again and
//! again.
//!
//! There is no harness, because the program under test is this one.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use wheeleg_campaign::{
    Case, Cases, Options, Outcome, PlanFile, Shard, Status, Store, isolated, run, status,
};
use wheeleg_config::plan::{Plan, Sources};
use wheeleg_studies::study::Stop;

const PLAN: &str = "name = \"planted\"\nroot = 1\nsamples = 12\nblock = 4\n[base]\n\
     scenario = \"stand\"\n[factor.droop]\nparameter = \"robot.supply.droop\"\n\
     uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n";

/// One block, of cases of a few ms, that takes longer than anybody waits.
const LONG: &str = "name = \"long\"\nroot = 1\nreplicates = 2000\nblock = 4096\n[base]\n\
     scenario = \"stand\"\n";
/// Duration of one of its cases, and interval at which its rows are saved.
const CASE: Duration = Duration::from_millis(5);
const SAVE_EVERY: Duration = Duration::from_millis(200);
/// Number of processes that are killed, and of their threads.
const KILLS: u64 = 6;
const THREADS: usize = 2;

/// The case that always crashes its process, and one that does so only once, as if its process had been
/// killed.
const CRASHES: u64 = 6;
const KILLED_IN: u64 = 9;

fn simulate(case: &Case, folder: &Path) -> Option<Outcome> {
    let marker = folder.join("killed-once");
    if case.place.index == CRASHES {
        std::process::abort();
    }
    if case.place.index == KILLED_IN && !marker.exists() {
        std::fs::write(marker, "").expect("written");
        std::process::abort();
    }
    Some(passed(case))
}

fn passed(case: &Case) -> Outcome {
    Outcome {
        status: Status::Ok,
        error: None,
        log_hash: Some(format!("{:064x}", case.seed)),
        simulated_s: Some(1.0),
        passed: Some(true),
        targets: Vec::new(),
    }
}

fn plan_of(text: &str) -> Plan {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    std::fs::write(&path, text).expect("written");
    Plan::of(Sources::load(&path.to_string_lossy()).expect("read")).expect("a plan")
}

/// Runs the campaign as the program under test.
fn work(folder: &Path) {
    let own = Options {
        program: std::env::current_exe().ok(),
        ..options(1)
    };
    run_in(folder, &plan_of(PLAN), &own, &|case| simulate(case, folder));
}

/// Runs the long block until killed.
fn work_long(folder: &Path) {
    let saving = Options {
        save_every: SAVE_EVERY,
        ..options(THREADS)
    };
    run_in(folder, &plan_of(LONG), &saving, &|case| {
        std::thread::sleep(CASE);
        Some(passed(case))
    });
}

fn options(threads: usize) -> Options {
    Options {
        shard: Shard::ALL,
        threads,
        first: None,
        stop: Stop::default(),
        program: None,
        json: false,
        save_every: wheeleg_campaign::SAVE_EVERY,
    }
}

fn run_in(
    folder: &Path,
    plan: &Plan,
    options: &Options,
    simulate: &(dyn Fn(&Case) -> Option<Outcome> + Sync),
) {
    let cases = Cases::new(plan).expect("a plan");
    let store = Store::create(folder, PlanFile::of(plan, 1.0), &Stop::default()).expect("a folder");
    run(&store, &cases, options, simulate).expect("it runs");
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["work", folder] => work(Path::new(folder)),
        ["work-long", folder] => work_long(Path::new(folder)),
        ["campaign", "case", folder, index, "--row", file] => {
            let store = Store::open(Path::new(folder)).expect("a folder");
            let index = index.parse().expect("a place");
            let of = |case: &Case| simulate(case, Path::new(folder));
            assert!(isolated(&store, index, Path::new(file), &of).expect("a row"));
        }
        _ => {
            test();
            a_killed_process_loses_no_more_than_it_has_not_saved();
        }
    }
}

fn test() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = std::env::current_exe().expect("this program");
    let mut ended = 0;
    loop {
        let status = Command::new(&program)
            .arg("work")
            .arg(folder.path())
            .stderr(Stdio::null())
            .status()
            .expect("started");
        if status.success() {
            break;
        }
        ended += 1;
        assert!(ended < 10, "it never gets to its end");
    }
    // Each of the two cases ends the process once; then each runs in a separate process.
    assert_eq!(ended, 2);
    let store = Store::open(folder.path()).expect("a folder");
    let state = status(&store, Shard::ALL).expect("readable");
    assert!(state.missing.is_empty());
    assert_eq!(
        state.by_status,
        [11, 0, 0, 1, 0],
        "one crashed, the killed one is sound"
    );
    let table = folder.path().join("cases.parquet");
    wheeleg_campaign::merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
    let read = wheeleg_campaign::report::Merged::read(&table)
        .expect("a table")
        .table;
    let error = read.texts("error")[CRASHES as usize]
        .clone()
        .expect("an error");
    assert!(error.starts_with("ended its process 2 times: "), "{error}");
    if cfg!(unix) {
        assert!(error.ends_with("signal 6"), "{error}");
    }
    println!("planted: a case that ends the process is a row, after {ended} runs: ok");
}

/// A process that is killed loses at most the work since its last save: one interval, the cases in progress,
/// and the duration of a save. Without saves, it would lose its whole block.
fn a_killed_process_loses_no_more_than_it_has_not_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = std::env::current_exe().expect("this program");
    let start = || {
        Command::new(&program)
            .arg("work-long")
            .arg(folder.path())
            .stderr(Stdio::null())
            .spawn()
            .expect("started")
    };
    let open = || Store::open(folder.path()).expect("a folder");
    let (mut before, mut most_lost) = (0, 0);
    for kill in 0..KILLS {
        let mut child = start();
        // Kill each process at a different time within the interval, and not before something is saved.
        let begun = Instant::now();
        let saved = || status(&open(), Shard::ALL).map_or(0, |state| state.rows);
        while !folder.path().join("plan.json").exists() || saved() == before {
            assert!(
                begun.elapsed() < Duration::from_secs(60),
                "nothing is saved"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(SAVE_EVERY * u32::try_from(kill).expect("few") / 5);
        let computing = begun.elapsed();
        child.kill().expect("killed");
        child.wait().expect("ended");
        let state = status(&open(), Shard::ALL).expect("readable");
        assert_eq!(state.missing, [0], "the block is not finished");
        assert_eq!(state.rows, state.partial);
        let lost = state.unsaved + state.begun;
        let interval = 2 * SAVE_EVERY;
        let allowed = interval.as_millis() / CASE.as_millis() * THREADS as u128;
        assert!(
            u128::from(lost) <= allowed + THREADS as u128,
            "{lost} of {} lost after {computing:?}",
            state.rows + lost
        );
        assert!(state.rows > before, "{} after {before}", state.rows);
        (before, most_lost) = (state.rows, most_lost.max(lost));
    }
    assert!(start().wait().expect("ended").success());
    let state = status(&open(), Shard::ALL).expect("readable");
    assert_eq!((state.rows, state.partial), (2000, 0));
    assert_eq!((state.begun, state.unsaved), (0, 0));
    let left = std::fs::read_dir(folder.path().join("parts")).expect("there");
    let left = left.map(|entry| {
        entry
            .expect("entry")
            .file_name()
            .to_string_lossy()
            .into_owned()
    });
    let left: Vec<String> = left.collect();
    assert_eq!(left.len(), 2, "the part and who made it: {left:?}");
    println!("planted: of {KILLS} killed processes none lost more than {most_lost} cases: ok");
}
