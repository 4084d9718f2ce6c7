//! The predictive law on random cylinders that it was not tuned for, with loads, masses, friction and valve
//! times off their data.
//!
//! One combination on each, because several on one are not independent: with unknown air in the chambers, and
//! from any tick of the law's period. A hash of the law's sources selects the cylinders, so that the law is
//! not tuned to them. 1,000 here; `cargo xtask deep cylinders` draws as many as a bar needs.

use crate::long_checks::number;
use crate::many::{self, Many};
use crate::random_cylinder::{drawn, is_coarse, played};
use crate::step_back::is_no_step_back;
use wheeleg_campaign::{Outcome, Status};
use wheeleg_report::stats::{failure_bound, quantile};
use wheeleg_studies::compare::judging_root;

/// How many cylinders are drawn, and the number of the first, instead of the hash.
const CYLINDERS_VARIABLE: &str = "WHEELEG_CYLINDERS";
const FIRST_VARIABLE: &str = "WHEELEG_CYLINDERS_FIRST";
/// Upper bounds of the rates that were measured, one-sided 95 %: of fine valves, of coarse ones, missed and by a fault.
const FINE_MISSED: f64 = 0.035;
const FINE_FAULTS: f64 = 0.003;
const COARSE_MISSED: f64 = 0.095;
const COARSE_FAULTS: f64 = 0.03;
/// Results of the cylinders of a class.
#[derive(Default)]
struct Tally {
    cylinders: u64,
    missed: u64,
    /// Of the missed, by a fault.
    faults: u64,
}

impl Tally {
    fn told(&self) -> String {
        let bound = |count: u64| 100.0 * failure_bound(count as u32, self.cylinders as u32);
        format!(
            "{} of {} missed, bound {:.2} %, {} by a fault, bound {:.2} %",
            self.missed,
            self.cylinders,
            bound(self.missed),
            self.faults,
            bound(self.faults)
        )
    }
}

/// The bars of the combinations on the bench axis, after one learning move, and no false alarm.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn few_combinations_miss_on_cylinders_drawn_at_random() {
    let (first, cylinders) = (
        number(FIRST_VARIABLE, judging_root()),
        number(CYLINDERS_VARIABLE, 1_000),
    );
    let many = Many {
        name: "cylinders",
        base: "axis = \"bench-vq110u\"",
        factors: "",
        seeds: first..first + cylinders,
    };
    let (rows, columns) = many.played(|case| {
        let outcome = played(&drawn(case.seed), case.seed);
        let settled = outcome.judged.iter().map(|m| m.settle_s);
        let settled: Option<Vec<f64>> = settled.collect();
        let slower_s = settled.and_then(|all| all.into_iter().reduce(f64::max));
        Outcome {
            // The cylinder was taken for a faulty one: it has no result.
            status: match outcome.alarm() {
                true => Status::Error,
                false => Status::Ok,
            },
            ..many::outcome(
                outcome.keeps(),
                (!outcome.keeps()).then(|| format!("{outcome:?}")),
                slower_s.map(|s| ("settling", s)),
            )
        }
    });
    let mut times = Vec::new();
    // Of fine and of coarse valves.
    let mut tallies = [Tally::default(), Tally::default()];
    for row in &rows {
        let coarse = is_coarse(&drawn(row.seed));
        times.push(
            row.figure(&columns, "settling")
                .value
                .unwrap_or(f64::INFINITY),
        );
        let tally = &mut tallies[usize::from(coarse)];
        tally.cylinders += 1;
        tally.faults += u64::from(row.status == Status::Error);
        if row.is_failed() {
            tally.missed += 1;
            let told = row.error.as_deref().unwrap_or_default();
            println!("cylinder {}, coarse valves: {coarse}: {told}", row.seed);
        }
    }
    let share = |share: f64| quantile(&times, share).unwrap_or(f64::NAN);
    let [fine, coarse] = tallies;
    // One line: it goes into the record of long checks.
    println!(
        "{cylinders} cylinders from number {first}; fine valves: {}; coarse valves: {}; settled in {:.2} s, nine tenths in {:.2} s (the slower of two moves)",
        fine.told(),
        coarse.told(),
        share(0.5),
        share(0.9)
    );
    assert!(is_no_step_back(fine.missed, fine.cylinders, FINE_MISSED));
    assert!(is_no_step_back(fine.faults, fine.cylinders, FINE_FAULTS));
    assert!(is_no_step_back(
        coarse.missed,
        coarse.cylinders,
        COARSE_MISSED
    ));
    assert!(is_no_step_back(
        coarse.faults,
        coarse.cylinders,
        COARSE_FAULTS
    ));
}
