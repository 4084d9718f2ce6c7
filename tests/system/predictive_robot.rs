//! The robot on the predictive law, over several seeds, with the failure probability that they
//! leave: one-sided 95 %, Clopper and Pearson.
//!
//! The seeds of the three steps begin at a hash of the law's sources, so that the law is not tuned to them. A few run here;
//! `cargo xtask deep robot` runs as many as the bar needs.

use crate::long_checks::number;
use crate::sil;
use crate::step_back::is_no_step_back;
use std::collections::BTreeMap;
use wheeleg_config::builtin;
use wheeleg_report::stats::failure_bound;
use wheeleg_studies::analysis::analyse;
use wheeleg_studies::compare::judging_root;

/// Seeds of the three steps.
const STEPS_VARIABLE: &str = "WHEELEG_THREE_STEP_SEEDS";
/// Bar of the probability that the three steps miss a required target.
const STEPS_BAR: f64 = 0.05;
/// Measured upper bound of it: a rate clearly above is a regression.
const STEPS_KNOWN: f64 = 0.03;
/// The scenarios that must meet all targets, and their seeds, from 1 on.
const OTHERS: [&str; 4] = ["stand", "sinusoid", "master-lost", "estop"];
const OTHER_SEEDS: u64 = 8;

/// How many of these seeds miss a required target, and how many miss each.
fn misses(scenario: &str, seeds: impl Iterator<Item = u64>) -> (u64, BTreeMap<String, u32>) {
    let robot = builtin::robot("wheeleg").expect("built in");
    let scenario = builtin::scenario(scenario).expect("built in");
    let (mut missed, mut by_target) = (0, BTreeMap::new());
    for seed in seeds {
        let recording = sil::run(&scenario, &robot, seed);
        let analysis = analyse(&scenario, &robot, &recording);
        let failed = analysis.targets.iter().filter(|t| t.required && !t.pass);
        let failed: Vec<_> = failed.map(|t| t.id.clone()).collect();
        missed += u64::from(!failed.is_empty());
        for id in failed {
            println!("{}, seed {seed}: misses {id}", scenario.name);
            *by_target.entry(id).or_default() += 1;
        }
    }
    (missed, by_target)
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_three_steps_meet_their_targets() {
    let seeds = number(STEPS_VARIABLE, 32);
    let root = judging_root();
    let (missed, by_target) = misses("three-step", root..root + seeds);
    let bound = failure_bound(missed as u32, seeds as u32);
    // One line: it goes into the record of long checks.
    println!(
        "robot, three steps from seed {root}: {missed} of {seeds} miss a target {by_target:?}, bound {:.1} % (bar {:.0} %, {})",
        100.0 * bound,
        100.0 * STEPS_BAR,
        if bound <= STEPS_BAR {
            "met"
        } else if failure_bound(0, seeds as u32) > STEPS_BAR {
            "for which these are too few"
        } else {
            "not met"
        },
    );
    assert!(
        is_no_step_back(missed, seeds, STEPS_KNOWN),
        "{missed} of {seeds}: {by_target:?}"
    );
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn standing_the_sinusoid_and_the_safe_states_meet_all_targets() {
    let mut told = Vec::new();
    let mut all_targets = true;
    for scenario in OTHERS {
        let (missed, by_target) = misses(scenario, 1..=OTHER_SEEDS);
        told.push(format!("{scenario} {missed} {by_target:?}"));
        all_targets &= missed == 0;
    }
    // One line: it goes into the record of long checks.
    let told = told.join(", ");
    println!("robot, {OTHER_SEEDS} seeds each, of which miss a target: {told}");
    assert!(all_targets, "{told}");
}

/// The foot is slow where it may meet the ground: 100 mm/s are wanted in the last 10 mm. A board that is told 1.5 kg
/// instead of the 0.66 that b6 moves in the air makes it stick and jump, at 210 mm/s.
#[test]
fn a_foot_is_slow_near_the_ground() {
    let robot = builtin::robot("wheeleg").expect("built in");
    let scenario = builtin::scenario("three-step").expect("built in");
    for seed in 1..=3 {
        let recording = sil::run(&scenario, &robot, seed);
        let targets = analyse(&scenario, &robot, &recording).targets;
        let [speed_mm_s, time_s] =
            ["M4-b6", "M1-b6"].map(|id| sil::value(&targets, id).expect("measured"));
        println!("seed {seed}: {speed_mm_s:.1} mm/s, down after {time_s:.3} s");
        assert!((75.0..=110.0).contains(&speed_mm_s), "{speed_mm_s}");
        // The push begins 1 s after the lowering.
        assert!((0.5..1.0).contains(&time_s), "{time_s}");
    }
}
