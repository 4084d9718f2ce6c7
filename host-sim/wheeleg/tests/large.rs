//! Time, memory and size of the largest tables of campaigns: for merge, report and the first row.
//!
//! This suite makes a few rows; `cargo xtask deep large` makes as many as the specification demands.

// Times and memory of a process are read from `/proc`.
#![cfg(target_os = "linux")]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use wheeleg_campaign::{Cases, Figure, PlanFile, Row, Status, Store, work_s};
use wheeleg_config::plan::Plan;
use wheeleg_studies::study::Stop;

/// Rows of the table, and the variable that sets another number.
const ROWS: u64 = 20_000;
const ROWS_VARIABLE: &str = "WHEELEG_CAMPAIGN_ROWS";

fn campaign() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wheeleg"));
    command.arg("campaign").stdin(Stdio::null());
    command
}

/// Random numbers, the same every time.
fn random(state: &mut u64) -> u64 {
    // Xorshift (Marsaglia 2003).
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

/// A plan whose table has the 44 columns stated in the specification.
fn wide_plan(folder: &Path, samples: u64) -> Plan {
    const MEASURES: [&str; 14] = [
        "speed",
        "distance",
        "climb",
        "slip",
        "supported",
        "roll",
        "pitch",
        "heading",
        "chassis-force",
        "steps",
        "faults",
        "step-time",
        "air-per-step",
        "air-per-metre",
    ];
    let bars = MEASURES.map(|measure| format!("[[bars]]\nmeasure = \"{measure}\"\ninfo = true\n"));
    let drawn = ["a", "b", "c", "d"].into_iter().zip([
        "robot.supply.droop",
        "robot.friction.viscous",
        "robot.fill_valve.conductance",
        "robot.vent_valve.conductance",
    ]);
    let drawn = drawn.map(|(name, path)| {
        format!(
            "[factor.{name}]\nparameter = \"{path}\"\nscale = true\n\
             uniform = {{ min = 0.9, max = 1.1 }}\n"
        )
    });
    let text = format!(
        "name = \"wide\"\nroot = 3\nsamples = {samples}\nblock = 256\nsampler = \"sobol\"\n{}\
         [base]\nscenario = \"climb\"\n{}\
         [factor.law]\nparameter = \"robot.node.joint.law\"\ngrid = [0, 5]\npaired = true\n",
        bars.concat(),
        drawn.collect::<String>(),
    );
    let path = folder.join("wide.toml");
    fs::write(&path, text).expect("written");
    Plan::load(&path.to_string_lossy()).unwrap_or_else(|e| panic!("{:?}", e.problems()))
}

/// The rows of a block, as if its cases had been simulated.
fn made_up(cases: &Cases<'_>, indices: std::ops::Range<u64>, state: &mut u64) -> Vec<Row> {
    let targets = cases.columns().targets.len();
    indices
        .map(|index| {
            let place = cases.place(index);
            let mut words = || random(state);
            let case = format!("{:016x}{:016x}", words(), words());
            let log_hash = [0; 4].map(|_| format!("{:016x}", words())).concat();
            let figure = |i| Figure {
                value: Some(words() as f64 * 1e-18 + f64::from(i)),
                pass: Some(true),
            };
            Row {
                case: case.parse().expect("an identity"),
                index,
                block: index / 256,
                sample: place.sample,
                replicate: place.replicate,
                factors: cases.values(place),
                status: Status::Ok,
                error: None,
                log_hash: Some(log_hash),
                simulated_s: Some(26.5),
                figures: (0..targets as u32).map(figure).collect(),
                passed: Some(index % 7 != 0),
                seed: words() >> 1,
            }
        })
        .collect()
}

/// Time and memory that a command took.
#[derive(Debug)]
struct Weight {
    /// Elapsed time, s.
    wall_s: f64,
    /// Processor time, s: the time on an idle computer, whatever else runs on this one.
    busy_s: f64,
    /// Peak memory, MB.
    peak_mb: f64,
}

/// Runs a command to its end, and measures it.
fn weighed(command: &mut Command) -> Weight {
    /// Resolution of the times in `/proc`, s: Linux reports the same to all programs.
    const STEP_S: f64 = 0.01;
    let begun = Instant::now();
    let mut child = command.stdout(Stdio::null()).spawn().expect("started");
    let read = |name: &str| fs::read_to_string(format!("/proc/{}/{name}", child.id()));
    let mut peak_mb: f64 = 0.0;
    let busy_s = loop {
        let status = read("status").expect("not waited for yet");
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb = line.and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok());
        peak_mb = kb.map_or(peak_mb, |kb| peak_mb.max(kb * 1e-3));
        // After the name in brackets comes the state; counting from there, the 12th and 13th fields are
        // times.
        let stat = read("stat").expect("not waited for yet");
        let (_, fields) = stat.rsplit_once(") ").expect("a name");
        let fields: Vec<&str> = fields.split(' ').collect();
        if fields[0] == "Z" {
            let steps = |at: usize| fields[at].parse::<f64>().expect("a number");
            break STEP_S * (steps(11) + steps(12));
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let wall_s = begun.elapsed().as_secs_f64();
    let ended = child.wait().expect("ended");
    assert!(ended.success(), "{command:?}: {ended}");
    Weight {
        wall_s,
        busy_s,
        peak_mb,
    }
}

/// Numbers of the specification: 1,000,000 rows of 44 columns are merged in less than 10 s and 500 MB, and
/// their report takes less than 30 s and 10 MB; the first row of a plan of this size comes within 0.2 s and
/// 200 MB. The suite makes fewer rows and judges sizes only. The rows are made up, and the times are
/// processor times.
#[test]
fn a_large_table_is_merged_and_told_in_time() {
    let asked = std::env::var(ROWS_VARIABLE).ok();
    let is_timed = asked.is_some();
    let rows = asked.map_or(ROWS, |n| n.parse().expect("a number"));
    let home = tempfile::tempdir().expect("a folder");
    let plan = wide_plan(home.path(), rows / 2);
    let cases = Cases::new(&plan).expect("a plan");
    let columns = cases.columns();
    assert_eq!(columns.all.len(), 44);
    let store = Store::create(
        home.path(),
        PlanFile::of(&plan, work_s(25.0)),
        &Stop::default(),
    )
    .expect("a folder");
    let mut state = 88_172_645_463_325_252;
    for block in 0..store.blocks() {
        let rows = made_up(&cases, store.cases_of(block), &mut state);
        store.write_part(columns, block, &rows).expect("written");
    }
    let [table, page] = ["cases.parquet", "cases.html"].map(|name| home.path().join(name));
    let merge = weighed(
        campaign()
            .arg("merge")
            .arg(home.path())
            .arg("--out")
            .arg(&table),
    );
    let report = weighed(campaign().arg("report").arg(&table).arg("--out").arg(&page));
    let large = wide_plan(home.path(), 500_000);
    assert_eq!(large.cases(), 1_000_000);
    let list = weighed(
        campaign()
            .arg("run")
            .arg(home.path().join("wide.toml"))
            .args(["--list", "--first", "1"]),
    );
    let page_mb = fs::metadata(&page).expect("there").len() as f64 * 1e-6;
    let told = |of: &Weight| {
        let Weight {
            wall_s,
            busy_s,
            peak_mb,
        } = of;
        format!("{busy_s:.2} s busy ({wall_s:.1} s by the clock) and {peak_mb:.0} MB")
    };
    println!(
        "large: {rows} rows of 44 columns: merge {} (bars 10 s, 500 MB); report {}, page of {page_mb:.2} MB \
         (bars 30 s, 10 MB); first of 1000000 cases {} (bars 0.2 s, 200 MB)",
        told(&merge),
        told(&report),
        told(&list)
    );
    assert!(merge.peak_mb < 500.0, "{merge:?}");
    assert!(page_mb < 10.0, "{page_mb}");
    assert!(list.peak_mb < 200.0, "{list:?}");
    if is_timed {
        assert!(merge.busy_s < 10.0, "{merge:?}");
        assert!(report.busy_s < 30.0, "{report:?}");
        assert!(list.busy_s < 0.2, "{list:?}");
    }
}
