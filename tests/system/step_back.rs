//! What of the misses of a long check is a step back.

use wheeleg_report::stats::at_most;

/// Whether `misses` of `of` cases are no step back from a known rate: at that rate so many or more have a chance above 1 in
/// 1000.
pub(crate) fn is_no_step_back(misses: u64, of: u64, known: f64) -> bool {
    let fewer = misses.checked_sub(1).map_or(0.0, |k| at_most(k, of, known));
    1.0 - fewer > 1e-3
}
