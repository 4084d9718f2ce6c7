//! Many cases of a check, computed by the engine of campaigns: on all cores, each row on disk soon after it is known.
//!
//! `cargo xtask deep` names a folder for the rows, so that a check that was stopped goes on where it was.

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use wheeleg_campaign::{
    Case, Cases, Columns, Options, Outcome, PlanFile, Row, SAVE_EVERY, Shard, Status, Store, run,
};
use wheeleg_config::plan::{Plan, Sources, Text};
use wheeleg_studies::analysis::Target;
use wheeleg_studies::study::Stop;

/// The folder in which `cargo xtask deep` keeps the rows.
const FOLDER_VARIABLE: &str = "WHEELEG_DEEP_FOLDER";

/// The outcome of a case that a check has played itself: whether it passed, what it has to tell, and a figure.
pub(crate) fn outcome(passed: bool, told: Option<String>, figure: Option<(&str, f64)>) -> Outcome {
    let target = |(id, value): (&str, f64)| Target {
        id: id.to_owned(),
        description: String::new(),
        value: Some(value),
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
        targets: figure.map(target).into_iter().collect(),
    }
}

/// A check's cases: a plan's `[base]`, its factors but the seeds, and the seeds.
pub(crate) struct Many<'a> {
    pub(crate) name: &'a str,
    pub(crate) base: &'a str,
    pub(crate) factors: &'a str,
    pub(crate) seeds: std::ops::Range<u64>,
}

impl Many<'_> {
    /// The rows of all cases, and the columns of their figures; `play` simulates one.
    pub(crate) fn played(&self, play: impl Fn(&Case) -> Outcome + Sync) -> (Vec<Row>, Columns) {
        let plan = self.plan();
        let cases = Cases::new(&plan).expect("its files are built in");
        let file = PlanFile::of(&plan, cases.work_s());
        let temporary = tempfile::tempdir().expect("a folder");
        let kept = std::env::var_os(FOLDER_VARIABLE).map(PathBuf::from);
        let folder = kept.unwrap_or_else(|| temporary.path().to_owned());
        let folder = folder.join(self.name);
        if folder.exists() && Store::ensure_not_of_another(&folder, &file).is_err() {
            std::fs::remove_dir_all(&folder).expect("rows of another program");
        }
        let stop = Stop::default();
        let store = Store::create(&folder, file, &stop).expect("a folder for the rows");
        let options = Options {
            shard: Shard::ALL,
            threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            first: None,
            stop,
            program: None,
            json: false,
            save_every: SAVE_EVERY,
        };
        run(&store, &cases, &options, &|case| Some(play(case))).expect("rows are written");
        let rows = store.rows().expect("rows");
        assert_eq!(rows.len() as u64, plan.cases());
        std::fs::remove_dir_all(&folder).expect("nothing is left to go on with");
        (rows, cases.columns().clone())
    }

    fn plan(&self) -> Plan {
        let Self {
            name,
            base,
            factors,
            seeds,
        } = self;
        let seeds: Vec<String> = seeds.clone().map(|seed| seed.to_string()).collect();
        let seeds = seeds.join(", ");
        // The engine knows the sources of the program, not those of a check.
        let check = built_s();
        let text = format!(
            "# by a check built at {check} s\nname = \"{name}\"\nroot = 1\n[base]\n{base}\n{factors}\n\
             [factor.seed]\nparameter = \"seed\"\ngrid = [{seeds}]\n"
        );
        let file = format!("{name}.toml");
        let sources = Sources::of(Text { file, text }, Path::new("")).expect("built in");
        Plan::of(sources).expect("a plan")
    }
}

/// When this test program was built.
fn built_s() -> u64 {
    let about = std::env::current_exe().and_then(std::fs::metadata);
    let built = about.and_then(|about| about.modified()).expect("a program");
    built.duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs())
}
