//! Two inputs and a full table of rules.

use super::partition::Partition;
use super::{FuzzyError, mean_i32, mean_i64};

/// A rule base of two inputs: `consequents[i][j]` is the singleton of the rule
/// "first input is set i AND second input is set j".
///
/// The table chooses the full scale of its consequents; the joint law reads ±32 767 as ±1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GridRules<const FIRST: usize, const SECOND: usize> {
    first: Partition<FIRST>,
    second: Partition<SECOND>,
    /// Both inputs are fans, so that at most four rules fire.
    fan: bool,
    consequents: [[i16; SECOND]; FIRST],
}

impl<const FIRST: usize, const SECOND: usize> GridRules<FIRST, SECOND> {
    /// A rule base; both partitions must use all their sets and the same
    /// number of membership levels.
    ///
    /// # Errors
    /// [`FuzzyError::Levels`], [`FuzzyError::SetCount`].
    pub const fn new(
        first: Partition<FIRST>,
        second: Partition<SECOND>,
        consequents: [[i16; SECOND]; FIRST],
    ) -> Result<Self, FuzzyError> {
        if first.levels() != second.levels() {
            return Err(FuzzyError::Levels);
        }
        if first.len() != FIRST || second.len() != SECOND {
            return Err(FuzzyError::SetCount);
        }
        Ok(Self {
            first,
            second,
            fan: first.is_fan() && second.is_fan(),
            consequents,
        })
    }

    /// The sets of the first input.
    #[must_use]
    pub const fn first(&self) -> &Partition<FIRST> {
        &self.first
    }

    /// The sets of the second input.
    #[must_use]
    pub const fn second(&self) -> &Partition<SECOND> {
        &self.second
    }

    /// The weighted mean of the singletons at a point, between the least and the
    /// greatest consequent. Inputs are limited to the domains. Never panics.
    #[inline]
    #[must_use]
    pub fn infer(&self, first: i16, second: i16) -> i16 {
        if self.fan {
            self.infer_fan(first, second)
        } else {
            self.infer_all(first, second)
        }
    }

    /// Whether at most four rules fire anywhere.
    #[must_use]
    pub const fn is_fan(&self) -> bool {
        self.fan
    }

    /// As [`Self::infer`], for a base that [is a fan](Self::is_fan): evaluates the four rules around the point.
    #[inline]
    pub(crate) fn infer_fan(&self, first: i16, second: i16) -> i16 {
        let a = self.first.pair(first);
        let b = self.second.pair(second);
        let rows = (
            self.consequents.get(a.index),
            self.consequents.get(a.index.wrapping_add(1)),
        );
        let (Some(low_row), Some(high_row)) = rows else {
            return 0;
        };
        let next = b.index.wrapping_add(1);
        let singletons = (
            low_row.get(b.index),
            low_row.get(next),
            high_row.get(b.index),
            high_row.get(next),
        );
        let (Some(&y00), Some(&y01), Some(&y10), Some(&y11)) = singletons else {
            return 0;
        };
        let weights = [
            a.lower.min(b.lower),
            a.lower.min(b.upper),
            a.upper.min(b.lower),
            a.upper.min(b.upper),
        ];
        let mut numerator = 0_i32;
        let mut denominator = 0_i32;
        // Neighbours in a fan add up to at most levels + 1. So the four weights add up to at most 2 × levels + 4, and
        // the sum stays below 2^31.
        for (weight, y) in weights.into_iter().zip([y00, y01, y10, y11]) {
            let weight = weight as i32;
            numerator = numerator.wrapping_add(weight.wrapping_mul(i32::from(y)));
            denominator = denominator.wrapping_add(weight);
        }
        mean_i32(numerator, denominator)
    }

    /// Evaluates all rules, for sets that overlap more than their neighbours.
    #[inline(never)]
    fn infer_all(&self, first: i16, second: i16) -> i16 {
        let mut second_levels = [0_u16; SECOND];
        self.second.memberships(second, &mut second_levels);
        let mut numerator = 0_i64;
        let mut denominator = 0_i64;
        let mut first_levels = [0_u16; FIRST];
        self.first.memberships(first, &mut first_levels);
        for (&level, row) in first_levels.iter().zip(&self.consequents) {
            if level == 0 {
                continue;
            }
            let (sum, weight) = weigh(level, &second_levels, row);
            numerator = numerator.wrapping_add(sum);
            denominator = denominator.wrapping_add(weight);
        }
        mean_i64(numerator, denominator)
    }
}

/// Weighted sum and weight of one row. It takes any length and exists once: unrolled, it would cost a kilobyte in an
/// image that may never use it.
#[inline(never)]
fn weigh(level: u16, others: &[u16], row: &[i16]) -> (i64, i64) {
    others
        .iter()
        .zip(row)
        .fold((0, 0), |(sum, total), (&other, &y)| {
            // Weights are below 2^16 and consequents 2^15.
            let weight = i64::from(level.min(other));
            (
                weight.wrapping_mul(i64::from(y)).wrapping_add(sum),
                weight.wrapping_add(total),
            )
        })
}
