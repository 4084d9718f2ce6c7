//! The field tests as a campaign: stopped, continued, and set aside when other runs are asked for.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use wheeleg_campaign::field::{Options, Summary, write};
use wheeleg_campaign::{Cases, Shard, Store, Table, replay, simulate, status};
use wheeleg_config::builtin;
use wheeleg_config::plan::Plan;
use wheeleg_studies::run;
use wheeleg_studies::study::{Finished, Settings, Signal, Stop};
use wheeleg_telemetry::{Keep, Recorder};

use crate::common::{options, run_in};

/// The shortest of the scenarios.
const SCENARIO: &str = "frozen-layer-1";

fn field(out: &Path, seeds: u32, stop: &Stop) -> Finished<Summary> {
    let options = Options {
        scenarios: vec![SCENARIO],
        seeds,
        program: None,
    };
    let settings = Settings {
        stop: stop.clone(),
        ..Settings::new(out)
    };
    write(&options, &settings).expect("written")
}

/// The files with rows, and when they were written.
fn parts(out: &Path) -> BTreeMap<String, std::time::SystemTime> {
    let entries = fs::read_dir(out.join("campaign/parts")).expect("parts");
    let entries = entries.map(|entry| entry.expect("an entry"));
    let written = |entry: &fs::DirEntry| entry.metadata().and_then(|m| m.modified());
    entries
        .map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let time = written(&entry).expect("a time");
            (name, time)
        })
        .collect()
}

#[test]
fn a_stopped_field_test_goes_on_where_it_was() {
    const SEEDS: u32 = 6;
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("field");
    let stop = Stop::default();
    let stopped = std::thread::scope(|scope| {
        // As soon as one case has ended.
        scope.spawn(|| {
            let ended = || {
                let state = status(&Store::open(&out.join("campaign")).ok()?, Shard::ALL).ok()?;
                (state.rows + state.unsaved > 0).then_some(())
            };
            while ended().is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
            stop.ask(Signal::Terminate);
        });
        field(&out, SEEDS, &stop)
    });
    let why = stopped.stopped.expect("stopped");
    assert!((1..SEEDS.into()).contains(&why.done), "{why}");
    assert_eq!(why.done, stopped.result.runs.len() as u64);
    // Runs that were abandoned are neither lost nor still to be saved.
    let store = Store::open(&out.join("campaign")).expect("a campaign");
    let state = status(&store, Shard::ALL).expect("a state");
    assert_eq!((state.begun, state.unsaved, state.lost), (0, 0, 0));

    let whole = field(&out, SEEDS, &Stop::default());
    assert!(whole.stopped.is_none());
    let seeds: Vec<u64> = whole.result.runs.iter().map(|run| run.seed).collect();
    assert_eq!(seeds, [1, 2, 3, 4, 5, 6]);
    for run in &stopped.result.runs {
        assert!(whole.result.runs.contains(run));
    }
    // The record of who computed what has the cases of the process that finished the block.
    let (record, _) =
        Table::read_from(&out.join("campaign/parts/000000.run.parquet"), &[]).expect("a record");
    assert_eq!(record.rows() as u64, u64::from(SEEDS) - why.done);

    let written = parts(&out);
    let again = field(&out, SEEDS, &Stop::default());
    assert_eq!(again.summary, whole.summary);
    assert_eq!(parts(&out), written, "runs were repeated");
    let text = fs::read_to_string(out.join("previous-2/summary.json")).expect("earlier results");
    assert_eq!(text, whole.summary);

    // Other seeds are another campaign: the runs go with the results made of them.
    let other = field(&out, 2, &Stop::default());
    assert_eq!(other.result.runs.len(), 2);
    assert!(out.join("previous-3/campaign/plan.json").exists());
}

/// A run has the log of the same scenario, seed and ground played alone, and the bars of its scenario.
#[test]
fn a_run_of_the_field_test_is_that_of_its_seed() {
    let folder = tempfile::tempdir().expect("a folder");
    let finished = field(folder.path(), 2, &Stop::default());
    let scenario = builtin::scenario_on_ground(SCENARIO, 2).expect("built in");
    let robot = builtin::robot_of(&scenario, SCENARIO).expect("built in");
    let recorder = Recorder::new(Keep::nothing());
    let alone = run::simulate(
        wheeleg_sim::Boards::default(),
        &scenario,
        &robot,
        2,
        recorder,
        &mut |_| std::ops::ControlFlow::Continue(()),
    );
    let alone = alone.expect("simulated");
    let [_, second] = &finished.result.runs[..] else {
        panic!("{:?}", finished.result.runs)
    };
    assert_eq!(second.hash, alone.recording.hash);
    assert_eq!(second.bars, alone.analysis.targets);
    assert_eq!(second.passed, alone.analysis.passed());
}

/// A case with a counted seed stands on the ground of that seed, in its row and when it is played again.
#[test]
fn a_counted_seed_is_that_of_noise_and_ground() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, _, rocks) = builtin::SCENARIOS
        .iter()
        .find(|(name, ..)| *name == "rocks-20")
        .expect("built in");
    let duration = rocks
        .lines()
        .find(|line| line.starts_with("duration"))
        .expect("a duration");
    let short = rocks.replace(duration, "duration = { value = 1.0, unit = \"s\" }");
    fs::write(folder.path().join("short.toml"), &short).expect("written");
    let path = folder.path().join("plan.toml");
    fs::write(
        &path,
        "name = \"ground\"\nroot = 1\nfirst_seed = 7\nreplicates = 2\n[base]\nscenario = \"short.toml\"\n",
    )
    .expect("written");
    let plan = Plan::load(&path.to_string_lossy()).expect("usable");
    let (stop, parts) = (Stop::default(), folder.path().join("parts"));
    let (ran, _) = run_in(&parts, &plan, &options(1), &|case| {
        simulate(case, None, &stop)
    });
    ran.expect("computed");
    let (store, cases) = (Store::open(&parts), Cases::new(&plan));
    let (store, cases) = (store.expect("a folder"), cases.expect("usable"));
    let rows = store.rows().expect("rows");
    let seeds: Vec<u64> = rows.iter().map(|row| row.seed).collect();
    assert_eq!(seeds, [7, 8]);
    for row in &rows {
        let seed = row.seed;
        let on_ground = builtin::scenario_on_ground("rocks-20", seed).expect("built in");
        let case = cases.case(row.index);
        let (scenario, _) = case
            .setup
            .as_ref()
            .expect("a case")
            .robot()
            .expect("a robot");
        assert_eq!(scenario.ground, on_ground.ground);
        let out = folder.path().join(seed.to_string());
        let again = replay(&parts, &row.index.to_string(), Some(&out), false, &stop);
        let again = again.expect("played").expect("to its end");
        assert_eq!(
            (again.same_row(), again.same_recording()),
            (Some(true), Some(true))
        );
    }
}
