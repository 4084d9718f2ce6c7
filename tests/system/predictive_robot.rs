//! The robot on the predictive law, over several seeds, with the failure probability that they
//! leave: one-sided 95 %, Clopper and Pearson.

use crate::sil;
use wheeleg_config::builtin;
use wheeleg_report::stats::failure_bound;
use wheeleg_studies::analysis::analyse;

/// Seeds of the suite.
const SEEDS: u32 = 8;

/// Every required target of every seed.
fn all_targets(scenario: &str) {
    let robot = builtin::robot("wheeleg").expect("built in");
    let scenario = builtin::scenario(scenario).expect("built in");
    let mut missed = Vec::new();
    for seed in 1..=SEEDS {
        let recording = sil::run(&scenario, &robot, u64::from(seed));
        let analysis = analyse(&scenario, &robot, &recording);
        let failed = analysis.targets.iter().filter(|t| t.required && !t.pass);
        let failed: Vec<_> = failed.map(|t| format!("{} {:?}", t.id, t.value)).collect();
        if !failed.is_empty() {
            missed.push(format!("seed {seed}: {}", failed.join(", ")));
        }
    }
    let bound = failure_bound(missed.len() as u32, SEEDS);
    println!(
        "{}: {} of {SEEDS} seeds miss a target; failure probability at most {:.1} % (95 %)",
        scenario.name,
        missed.len(),
        100.0 * bound
    );
    assert!(missed.is_empty(), "{}: {missed:?}", scenario.name);
}

#[test]
fn the_three_steps_meet_their_targets() {
    all_targets("three-step");
}

#[test]
fn it_stands_without_a_valve_edge() {
    all_targets("stand");
}

#[test]
fn the_safe_states_are_reached() {
    all_targets("master-lost");
    all_targets("estop");
}
