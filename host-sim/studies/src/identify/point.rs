//! What is fitted, and what is known of it before.

use super::bench::{UNKNOWNS, Unknowns};
use super::free::{COUNT, FREE, Logs};

/// Everything that is fitted: factors, and unknowns of the measurement.
pub(super) const ALL: usize = COUNT + UNKNOWNS;
/// Two-sided 95 % of a normal distribution, in standard deviations.
pub(super) const Z95: f64 = 1.959_964;

/// A point of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Logarithms of the factors.
    pub logs: Logs,
    /// Unknowns of the measurement.
    pub unknowns: Unknowns,
}

impl Point {
    /// Factors, and nothing known of the measurement but what it says itself.
    #[must_use]
    pub fn of(logs: Logs) -> Self {
        Self {
            logs,
            unknowns: [0.0; UNKNOWNS],
        }
    }

    pub(super) fn value(&mut self, index: usize) -> &mut f64 {
        match index.checked_sub(COUNT) {
            None => &mut self.logs[index],
            Some(unknown) => &mut self.unknowns[unknown],
        }
    }

    /// All values over their standard deviations before the measurement.
    pub(super) fn expected(&self) -> impl Iterator<Item = f64> + '_ {
        let logs = self.logs.iter().enumerate();
        let logs = logs.map(|(i, log)| log / trust(i));
        logs.chain(self.unknowns.iter().copied())
    }
}

/// Standard deviation of a file's value by its trust, logarithm; of an unknown of the measurement 1.
#[must_use]
pub fn trust(index: usize) -> f64 {
    FREE.get(index).map_or(1.0, |free| free.trust.ln() / Z95)
}
