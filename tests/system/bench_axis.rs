//! Two figures of the predictive law on the bench axis, which is as its sheet says, over many seeds of the noise: a step of
//! 100 mm over the fastest one that is possible, and the error along an S-curve.
//!
//! The seeds begin at a hash of the law's sources, so that the law is not tuned to them. A few run here;
//! `cargo xtask deep bench-axis` runs as many as the bars need.

use crate::long_checks::number;
use wheeleg_config::AxisConfig;
use wheeleg_report::stats::bounded_quantile;
use wheeleg_studies::axis_sim::suite::TestRig;
use wheeleg_studies::axis_sim::{Kind, Metrics, Trace, design, optimal};
use wheeleg_studies::compare::{Case, Move, STEP_S, Sizes, Variation, judging_root};

const AXIS: &str = "bench-vq110u";
/// Seeds of the steps, and of the S-curves.
const STEPS_VARIABLE: &str = "WHEELEG_BENCH_STEPS";
const CURVES_VARIABLE: &str = "WHEELEG_BENCH_CURVES";
/// Simulations of a search for the fastest move.
const SEARCH_RUNS: u32 = 3000;
/// Median of the steps over the fastest one, retracting and extending: the bars, and what is a step back from the 1.15 and
/// 1.17 of 2026-11-30.
const RATIO_BARS: [f64; 2] = [1.22, 1.15];
const RATIOS_MOST: [f64; 2] = [1.22, 1.22];
/// The 99 % quantile of the largest error along an S-curve, mm: the bar, and what is a step back from the 0.81 mm of
/// 2026-11-30 (300 seeds).
const CURVE_BAR_MM: f64 = 1.0;
const CURVE_MOST_MM: f64 = 1.0;

fn met(value: f64, bar: f64) -> &'static str {
    if value <= bar { "met" } else { "not met" }
}

/// The measured moves with each of so many seeds.
fn played(motion: Move, seeds: u64) -> Vec<Vec<Trace>> {
    let sheet = AxisConfig::load(AXIS).expect("built in").axis;
    let root = judging_root();
    let play = |seed| {
        let case = Case::new(AXIS, &sheet, Variation::Nominal, seed).expect("runs");
        let played = case.play(Kind::Predictive, motion).expect("runs");
        let measured = played.expect("no load is feasible").measured;
        for trace in &measured {
            assert!(trace.faults.is_empty() && trace.drove, "seed {seed}");
        }
        measured
    };
    (root..root + seeds).map(play).collect()
}

/// Time of the fastest retracting and extending step, from rests in which the law begins them, s.
fn fastest() -> [f64; 2] {
    let sheet = AxisConfig::load(AXIS).expect("built in").axis;
    let mut rig = TestRig::new(&sheet, &design(&sheet, Kind::Predictive), 1).expect("valid");
    let [low_m, high_m] = Sizes::of(&sheet).large_m;
    rig.step(high_m, STEP_S).expect("runs");
    [low_m, high_m].map(|target_m| {
        let bench = rig.bench();
        let bound = optimal::fastest(bench.axis(), &bench.state, target_m, 1, SEARCH_RUNS);
        rig.step(target_m, STEP_S).expect("runs");
        bound.expect("runs").settle_s
    })
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_step_takes_little_longer_than_the_fastest_possible() {
    let seeds = number(STEPS_VARIABLE, 32);
    let all = played(Move::Step100, seeds);
    let bounds = fastest();
    let mut told = Vec::new();
    for (direction, name) in ["retracting", "extending"].into_iter().enumerate() {
        let ratio = |measured: &Vec<Trace>| {
            let settle_s = Metrics::of(&measured[direction]).settle_s;
            settle_s.map_or(f64::INFINITY, |s| s / bounds[direction])
        };
        let ratios: Vec<f64> = all.iter().map(ratio).collect();
        let [median, most] = bounded_quantile(&ratios, 0.5).map(|v| v.unwrap_or(f64::INFINITY));
        let bar = RATIO_BARS[direction];
        told.push(format!(
            "{name} {median:.3} (≤ {most:.3}; bar {bar}, {}) of {:.3} s",
            met(most, bar),
            bounds[direction],
        ));
        // Nobody beats perfect knowledge, by more than the search is off.
        let range = 0.97..=RATIOS_MOST[direction];
        assert!(range.contains(&median), "{name}: {median}");
    }
    // One line: it goes into the record of long checks.
    println!(
        "bench axis, 100 mm to 1 mm over the fastest possible, median of {seeds} seeds: {}",
        told.join("; ")
    );
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn an_s_curve_is_followed_closely() {
    let seeds = number(CURVES_VARIABLE, 100);
    let worst = |measured: &Vec<Trace>| {
        let errors = measured.iter().map(|trace| Metrics::of(trace).worst_mm);
        errors.fold(0.0, f64::max)
    };
    let errors: Vec<f64> = played(Move::SCurve, seeds).iter().map(worst).collect();
    let [median, _] = bounded_quantile(&errors, 0.5);
    let [p99, most] = bounded_quantile(&errors, 0.99).map(|v| v.unwrap_or(f64::INFINITY));
    // One line: it goes into the record of long checks.
    println!(
        "bench axis, S-curve of 64 mm in 1 s, largest error of {seeds} seeds out and back: median {:.2} mm, p99 {p99:.2} mm (≤ {most:.2}; bar {CURVE_BAR_MM:.1}, {})",
        median.unwrap_or(f64::NAN),
        met(most, CURVE_BAR_MM),
    );
    assert!((0.1..=CURVE_MOST_MM).contains(&p99), "{p99}");
}
