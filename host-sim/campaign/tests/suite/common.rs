//! Plans, and a simulation that costs nothing.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use wheeleg_campaign::{
    CampaignError, Case, Cases, Options, Outcome, PlanFile, Ran, Status, Store, run,
};
use wheeleg_config::plan::{Plan, Sources, Value};
use wheeleg_studies::analysis::{Analyser, Target};
use wheeleg_studies::study::Stop;

pub(crate) const HEAD: &str = "name = \"test\"\nroot = 7\nblock = 4\n";
pub(crate) const BASE: &str = "[base]\nscenario = \"stand\"\n";
pub(crate) const SPREAD: &str = "[factor.droop]\nparameter = \"robot.supply.droop\"\n\
     uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n\
     [factor.friction]\nparameter = [\"robot.friction.coulomb\", \"robot.friction.static\"]\n\
     scale = true\nlognormal = { median = 1.0, sigma = 0.3, max = 3.0 }\n\
     [factor.law]\nparameter = \"robot.node.joint.law\"\ngrid = [\"fuzzy\", \"predictive\"]\n\
     paired = true\n";

pub(crate) fn plan_of(text: &str) -> Plan {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.toml");
    fs::write(&path, text).expect("written");
    let sources = Sources::load(&path.to_string_lossy()).expect("read");
    Plan::of(sources).unwrap_or_else(|e| panic!("{:#?}", e.problems()))
}

/// The spread with this many samples, in two cells.
pub(crate) fn spread(samples: u64) -> Plan {
    plan_of(&format!("samples = {samples}\n{HEAD}{BASE}{SPREAD}"))
}

/// A result without a simulation that depends on every value and, by less than 0.1, on the seed.
pub(crate) fn computed(case: &Case) -> Outcome {
    let setup = case.setup.as_ref().expect("it can be");
    let (scenario, robot) = setup.robot().expect("a robot");
    let number = |v: &Value| match v {
        Value::Number(x) => *x,
        other => other.to_string().len() as f64,
    };
    let sum: f64 = case.values.iter().map(number).sum();
    let targets = Analyser::new(scenario, robot).finish().targets.into_iter();
    let targets = targets.enumerate().map(|(i, target)| Target {
        value: (i % 3 != 2).then_some(sum * (i as f64 + 1.0) + case.seed as f64 * 1e-20),
        pass: i != 0 || sum < 8.0,
        ..target
    });
    Outcome {
        status: Status::Ok,
        error: None,
        log_hash: Some(format!("{:064x}", case.seed)),
        simulated_s: Some(sum),
        passed: Some(sum < 8.0),
        targets: targets.collect(),
    }
}

pub(crate) fn options(threads: usize) -> Options {
    Options {
        threads,
        ..Options::whole(&Stop::default())
    }
}

/// Runs a plan into a folder, and counts the simulated cases.
pub(crate) fn run_in(
    folder: &Path,
    plan: &Plan,
    options: &Options,
    simulate: &(dyn Fn(&Case) -> Option<Outcome> + Sync),
) -> (Result<Ran, CampaignError>, usize) {
    let cases = Cases::new(plan).expect("a plan");
    let store = Store::create(folder, PlanFile::of(plan, 1.0), &Stop::default()).expect("a folder");
    let count = AtomicUsize::new(0);
    let ran = run(&store, &cases, options, &|case| {
        count.fetch_add(1, Ordering::Relaxed);
        simulate(case)
    });
    (ran, count.into_inner())
}

/// Names and bytes of all parts.
pub(crate) fn parts(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder.join("parts")).expect("parts");
    let mut found: Vec<(String, Vec<u8>)> = entries
        .map(|entry| {
            let path = entry.expect("entry").path();
            let name = path
                .file_name()
                .expect("a name")
                .to_string_lossy()
                .into_owned();
            (name, fs::read(&path).expect("read"))
        })
        .filter(|(name, _)| name.len() == "000000.parquet".len())
        .collect();
    found.sort();
    found
}
