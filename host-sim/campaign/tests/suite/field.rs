//! The field tests as a campaign: stopped, continued, and set aside when other runs are asked for.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use wheeleg_campaign::field::{Options, Summary, write};
use wheeleg_config::builtin;
use wheeleg_studies::run;
use wheeleg_studies::study::{Finished, Settings, Signal, Stop};
use wheeleg_telemetry::{Keep, Recorder};

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
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("field");
    let stop = Stop::default();
    stop.ask(Signal::Terminate);
    let stopped = field(&out, 3, &stop);
    let why = stopped.stopped.expect("stopped");
    assert_eq!((why.done, why.of), (0, 3));
    assert!(stopped.result.runs.is_empty());

    let whole = field(&out, 3, &Stop::default());
    assert!(whole.stopped.is_none());
    let seeds: Vec<u64> = whole.result.runs.iter().map(|run| run.seed).collect();
    assert_eq!(seeds, [1, 2, 3]);
    let written = parts(&out);
    let again = field(&out, 3, &Stop::default());
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
