//! Up to four inputs and a free list of rules.

use super::partition::Partition;
use super::{FuzzyError, mean_i64};

/// Largest number of inputs (ST52x301 data sheet p. 1).
pub const MAX_INPUTS: usize = 4;

/// Largest number of rules (ST52x301 data sheet p. 1).
pub const MAX_RULES: usize = 300;

/// In a rule: this input does not matter.
pub const ANY: u8 = u8::MAX;

/// One rule: the index of a set for each input, or [`ANY`], and the singleton.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rule<const INPUTS: usize> {
    /// Set of each input.
    pub sets: [u8; INPUTS],
    /// Singleton.
    pub consequent: i16,
}

/// A rule base of up to four inputs with up to `SETS` sets each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RuleList<const INPUTS: usize, const SETS: usize, const RULES: usize> {
    partitions: [Partition<SETS>; INPUTS],
    rules: [Rule<INPUTS>; RULES],
}

impl<const INPUTS: usize, const SETS: usize, const RULES: usize> RuleList<INPUTS, SETS, RULES> {
    /// A rule base.
    ///
    /// # Errors
    /// [`FuzzyError::InputCount`], [`FuzzyError::RuleCount`],
    /// [`FuzzyError::Levels`], [`FuzzyError::UnknownSet`].
    #[allow(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        reason = "`const fn` has no iterators; indices are below the array lengths"
    )]
    pub const fn new(
        partitions: [Partition<SETS>; INPUTS],
        rules: [Rule<INPUTS>; RULES],
    ) -> Result<Self, FuzzyError> {
        if INPUTS == 0 || INPUTS > MAX_INPUTS {
            return Err(FuzzyError::InputCount);
        }
        if RULES == 0 || RULES > MAX_RULES {
            return Err(FuzzyError::RuleCount);
        }
        let mut input = 0;
        while input < INPUTS {
            if partitions[input].levels() != partitions[0].levels() {
                return Err(FuzzyError::Levels);
            }
            let mut rule = 0;
            while rule < RULES {
                let set = rules[rule].sets[input];
                if set != ANY && set as usize >= partitions[input].len() {
                    return Err(FuzzyError::UnknownSet);
                }
                rule += 1;
            }
            input += 1;
        }
        Ok(Self { partitions, rules })
    }

    /// The weighted mean of the singletons at a point; 0 if no rule fires. Inputs are limited to the domains. Never
    /// panics.
    #[must_use]
    pub fn infer(&self, inputs: [i16; INPUTS]) -> i16 {
        let mut levels = [[0_u16; SETS]; INPUTS];
        for ((row, partition), input) in levels.iter_mut().zip(&self.partitions).zip(inputs) {
            for (index, level) in (0..SETS).zip(row) {
                *level = partition.membership(index, input);
            }
        }
        let full = self.partitions.first().map_or(0, Partition::levels);
        let mut numerator = 0_i64;
        let mut denominator = 0_i64;
        for rule in &self.rules {
            let mut weight = full;
            for (&set, row) in rule.sets.iter().zip(&levels) {
                if set != ANY {
                    weight = weight.min(row.get(usize::from(set)).copied().unwrap_or(0));
                }
            }
            // 300 rules × 2^14 × 2^15 is far below 64 bits.
            let weight = i64::from(weight);
            numerator = numerator.wrapping_add(weight.wrapping_mul(i64::from(rule.consequent)));
            denominator = denominator.wrapping_add(weight);
        }
        mean_i64(numerator, denominator)
    }
}
