//! A case that ends the process: a program of its own, which is started again and again.
//!
//! Without a harness, because the program under test is this one.

use std::path::Path;
use std::process::{Command, Stdio};

use wheeleg_campaign::{
    Case, Cases, Options, Outcome, PlanFile, Shard, Status, Store, isolated, run, status,
};
use wheeleg_config::plan::{Plan, Sources};
use wheeleg_studies::study::Stop;

const PLAN: &str = "name = \"planted\"\nroot = 1\nsamples = 12\nblock = 4\n[base]\n\
     scenario = \"stand\"\n[factor.droop]\nparameter = \"robot.supply.droop\"\n\
     uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n";

/// The case that ends its process, and one that did so once alone: its process was killed.
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
    Some(Outcome {
        status: Status::Ok,
        error: None,
        log_hash: Some(format!("{:064x}", case.seed)),
        simulated_s: Some(1.0),
        passed: Some(true),
        targets: Vec::new(),
    })
}

fn plan() -> Plan {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    std::fs::write(&path, PLAN).expect("written");
    Plan::of(Sources::load(&path.to_string_lossy()).expect("read")).expect("a plan")
}

/// The campaign, as the program under test runs it.
fn work(folder: &Path) {
    let plan = plan();
    let cases = Cases::new(&plan).expect("a plan");
    let store = Store::create(folder, PlanFile::of(&plan, 1.0)).expect("a folder");
    let options = Options {
        shard: Shard::ALL,
        threads: 1,
        first: None,
        stop: Stop::default(),
        program: std::env::current_exe().ok(),
        json: false,
    };
    run(&store, &cases, &options, &|case| simulate(case, folder)).expect("it runs");
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["work", folder] => work(Path::new(folder)),
        ["campaign", "case", folder, index, "--row", file] => {
            let store = Store::open(Path::new(folder)).expect("a folder");
            let index = index.parse().expect("a place");
            let of = |case: &Case| simulate(case, Path::new(folder));
            assert!(isolated(&store, index, Path::new(file), &of).expect("a row"));
        }
        _ => test(),
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
    // Once in each of the two; then each is run in a process of its own.
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
