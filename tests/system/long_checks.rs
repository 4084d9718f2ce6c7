//! What the long checks share: how many cases they play, and what of their counts is a step back.

use wheeleg_report::stats::at_most;

/// A number from an environment variable, by which `cargo xtask deep` asks for more than the suite plays.
pub(crate) fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |n| n.parse().expect("a number"))
}

/// Whether `misses` of `of` cases are no step back from a known rate: at that rate so many or more have a chance above 1 in
/// 1000.
pub(crate) fn is_no_step_back(misses: u64, of: u64, known: f64) -> bool {
    let fewer = misses.checked_sub(1).map_or(0.0, |k| at_most(k, of, known));
    1.0 - fewer > 1e-3
}
