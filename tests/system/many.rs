//! Many cases of a check, computed by the engine of campaigns, on all cores. What no plan can draw, a check draws and
//! plays itself, in place of the simulation.

use std::ops::Range;
use std::path::Path;

use wheeleg_campaign::{Case, Cases, Columns, Options, Outcome, PlanFile, Row, Status, Store, run};
use wheeleg_config::plan::{Plan, Sources, Text};
use wheeleg_studies::analysis::Target;
use wheeleg_studies::study::Stop;

/// What a check found in a case: whether it passed, and figures, which must be among the targets of its plan.
pub(crate) fn found(
    passed: bool,
    told: Option<String>,
    figures: &[(&str, Option<f64>)],
) -> Outcome {
    let target = |(id, value): &(&str, Option<f64>)| Target {
        id: (*id).to_owned(),
        description: String::new(),
        value: *value,
        unit: "",
        min: None,
        max: None,
        pass: true,
        required: false,
    };
    Outcome {
        status: Status::Ok,
        error: told,
        log_hash: None,
        simulated_s: None,
        passed: Some(passed),
        targets: figures.iter().map(target).collect(),
    }
}

/// Rows in the order of the plan, and the columns of their figures.
pub(crate) struct Played {
    pub(crate) rows: Vec<Row>,
    columns: Columns,
}

impl Played {
    pub(crate) fn figure(&self, row: &Row, target: &str) -> Option<f64> {
        row.figure(&self.columns, target).value
    }
}

/// Plays a plan of this base and these factors on each of the seeds.
pub(crate) fn many(
    base_and_factors: &str,
    seeds: &Range<u64>,
    play: impl Fn(&Case) -> Outcome + Sync,
) -> Played {
    let (first, count) = (seeds.start, seeds.end - seeds.start);
    let text = format!(
        "name = \"check\"\nroot = 1\nfirst_seed = {first}\nreplicates = {count}\n{base_and_factors}"
    );
    let file = "check.toml".to_owned();
    let sources = Sources::of(Text { file, text }, Path::new("")).expect("built in");
    let plan = Plan::of(sources).unwrap_or_else(|e| panic!("{:?}", e.problems()));
    let cases = Cases::new(&plan).expect("built in");
    let file = PlanFile::of(&plan, cases.work_s());
    let folder = tempfile::tempdir().expect("a folder");
    let stop = Stop::default();
    let store = Store::create(folder.path(), file, &stop).expect("a folder for the rows");
    let options = Options::whole(&stop);
    run(&store, &cases, &options, &|case| Some(play(case))).expect("rows are written");
    let rows = store.rows().expect("rows");
    assert_eq!(rows.len() as u64, plan.cases());
    for row in &rows {
        // The engine goes on after a panic; a check does not.
        assert_eq!(row.status, Status::Ok, "seed {}: {:?}", row.seed, row.error);
    }
    Played {
        rows,
        columns: cases.columns().clone(),
    }
}
