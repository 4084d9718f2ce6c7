//! How likely the predictive law misses on the four axis files, with load, mass, supply, friction and valve
//! delay varied at random: from vented chambers, and from chambers with unknown air.
//!
//! A miss is an error at rest beyond 0.5 mm, an overshoot beyond 6 mm, a limit cycle or a fault, in the two
//! moves after the first one from power-up. A hash of the law's sources selects the combinations, so that the
//! law is not tuned to them. A few run here; `cargo xtask deep combinations` runs as many as a bar needs.

use crate::long_checks::number;
use crate::step_back::is_no_step_back;
use wheeleg_config::AxisConfig;
use wheeleg_report::stats::{bounded_quantile, failure_bound};
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{Case, Move, Row, Variation, fault_names, judging_root};

/// Combinations of the bench axis; the other axes get two fifths of it.
const COMBINATIONS_VARIABLE: &str = "WHEELEG_COMBINATIONS";
/// Number of the first one, instead of the hash: to compare two versions.
const ROOT_VARIABLE: &str = "WHEELEG_COMBINATIONS_ROOT";

/// Axis, whether its chambers start with unknown air, bar of the miss probability, and the measured upper
/// bound: a rate clearly above it is a regression.
const CASES: [(&str, bool, f64, f64); 8] = [
    ("bench-vq110u", true, 0.005, 0.023),
    ("bench-vq110u", false, 0.003, 0.0075),
    ("small-12x50", true, 0.01, 0.02),
    ("small-12x50", false, 0.01, 0.02),
    ("long-16x400", true, 0.01, 0.03),
    ("long-16x400", false, 0.01, 0.02),
    ("heavy-40x250", true, 0.025, 0.03),
    ("heavy-40x250", false, 0.025, 0.03),
];

fn played(axis: &str, drawn: bool, root: u64, count: u64) -> Vec<Row> {
    let sheet = AxisConfig::load(axis).expect("built in").axis;
    let row = |number| {
        let variation = if drawn {
            Variation::Drawn(number)
        } else {
            Variation::Combination(number)
        };
        let case = Case::new(axis, &sheet, variation, 1).expect("runs");
        let (kind, motion) = (Kind::Predictive, Move::Step100);
        let played = case.play(kind, motion).expect("runs");
        assert!(
            played.is_some(),
            "{}: drawn to be feasible",
            case.id(kind, motion)
        );
        case.row(kind, motion, played.as_ref(), None)
    };
    (root..root + count).map(row).collect()
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn few_combinations_miss_on_the_four_axes() {
    let bench = number(COMBINATIONS_VARIABLE, 250);
    let root = number(ROOT_VARIABLE, judging_root());
    let mut told = Vec::new();
    for (axis, drawn, bar, known) in CASES {
        let count = if axis.starts_with("bench") {
            bench
        } else {
            bench * 2 / 5
        };
        let rows = played(axis, drawn, root, count);
        let missed: Vec<&Row> = rows.iter().filter(|row| !row.keeps()).collect();
        for row in &missed {
            let f = &row.figures;
            println!(
                "{}: error {:?} mm, overshoot {:?} mm, limit cycle {:?}, {}",
                row.case.id,
                f.steady_error_mm,
                f.overshoot_mm,
                f.limit_cycle,
                fault_names(f.faults)
            );
        }
        let misses = missed.len() as u64;
        let bound = failure_bound(misses as u32, count as u32);
        let p99 = |value: fn(&Row) -> Option<f64>| {
            let all: Vec<f64> = rows
                .iter()
                .map(|r| value(r).unwrap_or(f64::INFINITY))
                .collect();
            let [p99, most] = bounded_quantile(&all, 0.99);
            format!(
                "{:.2} (≤ {:.2})",
                p99.unwrap_or(f64::NAN),
                most.unwrap_or(f64::NAN)
            )
        };
        told.push(format!(
            "{axis} {} {misses} of {count} missed, bound {:.2} % (bar {:.1} %, {}), p99 error {} mm, overshoot {} mm",
            if drawn { "with unknown air" } else { "vented" },
            100.0 * bound,
            100.0 * bar,
            if bound <= bar { "met" } else { "not met" },
            p99(|r| r.figures.steady_error_mm.map(f64::abs)),
            p99(|r| r.figures.overshoot_mm),
        ));
        let told = &told[told.len() - 1];
        assert!(is_no_step_back(misses, count, known), "{told}");
    }
    // One line: it goes into the record of long checks.
    println!("combinations from number {root}: {}", told.join("; "));
}
