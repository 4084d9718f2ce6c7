//! The robot on the predictive law, over several seeds, with the failure probability that they
//! leave: one-sided 95 %, Clopper and Pearson.

use crate::sil;
use wheeleg_config::builtin;
use wheeleg_report::stats::failure_bound;
use wheeleg_studies::analysis::analyse;

/// Seeds of the suite.
const SEEDS: u32 = 8;
/// Seeds of the three steps, of which some are known to switch valves at rest: 3 of 40, on
/// 2026-11-25 (`docs/records/known-shortfalls.md`). More than this many of 24 would be another
/// robot: with 7.5 % one such set of seeds in 200.
const STEPS_SEEDS: u32 = 24;
const STEPS_MISSES: usize = 5;

/// The seeds that miss a required target, with the targets.
fn misses(scenario: &str, seeds: u32) -> Vec<(u32, Vec<String>)> {
    let robot = builtin::robot("wheeleg").expect("built in");
    let scenario = builtin::scenario(scenario).expect("built in");
    let mut missed = Vec::new();
    for seed in 1..=seeds {
        let recording = sil::run(&scenario, &robot, u64::from(seed));
        let analysis = analyse(&scenario, &robot, &recording);
        let failed = analysis.targets.iter().filter(|t| t.required && !t.pass);
        let failed: Vec<_> = failed.map(|t| t.id.clone()).collect();
        if !failed.is_empty() {
            missed.push((seed, failed));
        }
    }
    let bound = failure_bound(missed.len() as u32, seeds);
    println!(
        "{}: {} of {seeds} seeds miss a target; failure probability at most {:.1} % (95 %)",
        scenario.name,
        missed.len(),
        100.0 * bound
    );
    missed
}

/// Every required target of every seed.
fn all_targets(scenario: &str) {
    let missed = misses(scenario, SEEDS);
    assert!(missed.is_empty(), "{scenario}: {missed:?}");
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_three_steps_meet_all_targets_but_at_times_that_of_rest() {
    let missed = misses("three-step", STEPS_SEEDS);
    let of_rest = missed.iter().all(|(_, targets)| *targets == ["R1"]);
    assert!(of_rest && missed.len() <= STEPS_MISSES, "{missed:?}");
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn it_stands_without_a_valve_edge() {
    all_targets("stand");
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_safe_states_are_reached() {
    all_targets("master-lost");
    all_targets("estop");
}
