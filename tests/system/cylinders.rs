//! The predictive law on random cylinders that it was not tuned for, with loads, masses, friction and valve
//! times off their data.
//!
//! One combination on each, because several on one are not independent: with unknown air in the chambers, and
//! from any tick of the law's period. A hash of the law's sources selects the cylinders, so that the law is
//! not tuned to them. 1,000 here; `cargo xtask deep cylinders` draws as many as a bar needs.

use crate::long_checks::number;
use crate::many::{found, many};
use crate::random_cylinder::{drawn, is_coarse, played as moves};
use crate::step_back::is_no_step_back;
use wheeleg_report::stats::failure_bound;
use wheeleg_studies::compare::judging_root;

/// How many cylinders are drawn, and the number of the first, instead of the hash.
const CYLINDERS_VARIABLE: &str = "WHEELEG_CYLINDERS";
const FIRST_VARIABLE: &str = "WHEELEG_CYLINDERS_FIRST";
/// Upper bounds of the rates that were measured, one-sided 95 %: of fine valves, of coarse ones, missed and by a fault.
const FINE_MISSED: f64 = 0.018;
const FINE_FAULTS: f64 = 0.003;
const COARSE_MISSED: f64 = 0.065;
const COARSE_FAULTS: f64 = 0.01;
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
    let seeds = first..first + cylinders;
    let played = many("[base]\naxis = \"bench-vq110u\"\n", &seeds, |case| {
        let outcome = moves(&drawn(case.seed), case.seed);
        let settled: Option<Vec<f64>> = outcome.judged.iter().map(|m| m.settle_s).collect();
        let slower_s = settled.and_then(|both| both.into_iter().reduce(f64::max));
        let alarm = f64::from(u8::from(outcome.alarm()));
        let figures = [("settling", slower_s), ("faults", Some(alarm))];
        found(outcome.keeps(), None, &figures)
    });
    let mut times = Vec::new();
    // Of fine and of coarse valves.
    let mut tallies = [Tally::default(), Tally::default()];
    for row in &played.rows {
        let which = row.seed;
        let sheet = drawn(which);
        let coarse = is_coarse(&sheet);
        times.push(played.figure(row, "settling").unwrap_or(f64::INFINITY));
        let tally = &mut tallies[usize::from(coarse)];
        tally.cylinders += 1;
        tally.faults += u64::from(played.figure(row, "faults") != Some(0.0));
        if row.is_failed() {
            tally.missed += 1;
            let outcome = moves(&sheet, which);
            println!("cylinder {which}, coarse valves: {coarse}: {outcome:?}");
        }
    }
    times.sort_by(f64::total_cmp);
    let share = |percent: usize| times[times.len() * percent / 100];
    let [fine, coarse] = tallies;
    // One line: it goes into the record of long checks.
    println!(
        "{cylinders} cylinders from number {first}; fine valves: {}; coarse valves: {}; settled in {:.2} s, nine tenths in {:.2} s (the slower of two moves)",
        fine.told(),
        coarse.told(),
        share(50),
        share(90)
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
