//! Measures the overhead of a campaign, without its simulations: the first row of a plan of 1,000,000 cases,
//! building a case, parts, merge, report. Prints times and memory.
//!
//! `cargo run --release -p wheeleg-campaign --example large [ROWS]`; the default is 4,096 rows.

use std::time::Instant;

use wheeleg_campaign::{
    Case, Cases, Options, Outcome, PlanFile, Shard, Status, Store, merge, report, run, work_s,
};
use wheeleg_config::plan::{Plan, Sources};
use wheeleg_studies::analysis::Analyser;
use wheeleg_studies::study::Stop;

/// Number of cases that get a row, unless the command line states another.
const ROWS: u64 = 4096;

/// Returns a result without a simulation.
fn computed(case: &Case) -> Option<Outcome> {
    let (scenario, robot) = case.setup.as_ref().ok()?.robot()?;
    let mut targets = Analyser::new(scenario, robot).finish().targets;
    for (i, target) in targets.iter_mut().enumerate() {
        target.value = Some(case.seed as f64 * 1e-18 + i as f64);
    }
    Some(Outcome {
        status: Status::Ok,
        error: None,
        log_hash: Some(format!("{:064x}", case.seed)),
        simulated_s: Some(1.0),
        passed: Some(!case.seed.is_multiple_of(3)),
        targets,
    })
}

fn plan(samples: u64) -> Plan {
    let sources = Sources::load("three-step-spread").expect("built in");
    let text = sources
        .plan
        .text
        .replace("samples = 100", &format!("samples = {samples}"));
    let text = text.replace("block = 8", "block = 64");
    let mut sources = sources;
    sources.plan.text = text;
    Plan::of(sources).expect("a plan")
}

/// Peak memory so far, MB, where the system reports it.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kb = line.and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok());
    kb.unwrap_or(f64::NAN) * 1e-3
}

fn main() {
    let rows = std::env::args().nth(1).map_or(ROWS, |rows| {
        rows.parse().expect("a number of rows, an even one")
    });
    let folder = tempfile::tempdir().expect("a folder");
    let options = |first| Options {
        shard: Shard::ALL,
        threads: 1,
        first: Some(first),
        stop: Stop::default(),
        program: None,
        json: false,
        save_every: wheeleg_campaign::SAVE_EVERY,
    };
    let begun = Instant::now();
    let large = plan(500_000);
    let cases = Cases::new(&large).expect("a plan");
    let store = Store::create(
        folder.path(),
        PlanFile::of(&large, work_s(10.0)),
        &Stop::default(),
    )
    .expect("a folder");
    run(&store, &cases, &options(1), &computed).expect("it runs");
    println!(
        "first row of {} cases: {:.3} s, {:.0} MB",
        large.cases(),
        begun.elapsed().as_secs_f64(),
        peak_mb()
    );
    let begun = Instant::now();
    for index in 0..200 {
        assert!(cases.case(index * 4999).setup.is_ok());
    }
    println!(
        "making a case: {:.2} ms",
        begun.elapsed().as_secs_f64() * 1e3 / 200.0
    );
    let small = plan(rows / 2);
    let cases = Cases::new(&small).expect("a plan");
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::create(
        folder.path(),
        PlanFile::of(&small, work_s(10.0)),
        &Stop::default(),
    )
    .expect("a folder");
    let begun = Instant::now();
    run(&store, &cases, &options(rows), &computed).expect("it runs");
    let each_ms = begun.elapsed().as_secs_f64() * 1e3 / rows as f64;
    println!("a row with all but its simulation: {each_ms:.2} ms");
    let table = folder.path().join("cases.parquet");
    let begun = Instant::now();
    let merged = merge(&[folder.path().to_owned()], &table, &Stop::default()).expect("merged");
    let merged = merged.expect("not stopped");
    let merge_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let report = report::Report::of(&table, None).expect("a table");
    report
        .write(&folder.path().join("cases.html"))
        .expect("a page");
    println!(
        "{} rows x {} columns: merge {merge_s:.2} s, report {:.2} s, {:.0} MB",
        merged.rows,
        cases.columns().all.len(),
        begun.elapsed().as_secs_f64(),
        peak_mb()
    );
}
