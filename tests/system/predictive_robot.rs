//! The robot on the predictive law, over several seeds: the failure probability that they leave.

use crate::sil;
use wheeleg_config::builtin;
use wheeleg_report::stats::failure_bound;

/// Seeds of a suite; `cargo xtask deep` takes many more (`WHEELEG_SEEDS`).
const SEEDS: u64 = 8;

fn seeds() -> u64 {
    let asked = std::env::var("WHEELEG_SEEDS").ok();
    asked.map_or(SEEDS, |number| number.parse().expect("WHEELEG_SEEDS is a number"))
}
