//! What share of a result's variance each of several factors causes (Sobol 1993), from results of the design
//! of Saltelli.

use super::{bootstrap, mean};

/// Most sets of results that intervals are drawn from; of more they are narrow.
const DRAWN_MOST: usize = 10_000;

/// A share with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// Estimate; noise may make it less than 0 or more than 1.
    pub value: f64,
    /// Interval, 95 %, by drawing sets of results; none of very many.
    pub interval: Option<[f64; 2]>,
}

/// Shares of one factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shares {
    /// By the factor alone: what would be gone if it were known (Saltelli et al. 2010).
    pub first: Share,
    /// With all that it does together with others: what would be left if they were known (Jansen 1999).
    pub total: Share,
}

/// Shares of each factor. A set of results is of the first point of two, of that with each factor in turn taken
/// from the other, and of the other. None of fewer than two sets, or if all results are the same.
///
/// # Panics
/// If a set has not as many results as the first.
#[must_use]
pub fn shares(sets: &[Vec<f64>]) -> Option<Vec<Shares>> {
    let size = sets.first()?.len();
    assert!(sets.iter().all(|set| set.len() == size), "sets of results");
    let factors = size.checked_sub(2)?;
    let all: Vec<f64> = sets.iter().flatten().copied().collect();
    let centre = mean(&all)?;
    let spread = all.iter().any(|y| *y != all[0]);
    if sets.len() < 2 || !spread {
        return None;
    }
    // Centred, because a large mean would drown the products.
    let at = |set: f64, place: usize| sets[set as usize][place] - centre;
    let rows: Vec<f64> = (0..sets.len()).map(|set| set as f64).collect();
    let share = |term: &dyn Fn(f64) -> f64| {
        let of = |rows: &[f64]| {
            let terms: Vec<f64> = rows.iter().map(|set| term(*set)).collect();
            let points = rows
                .iter()
                .flat_map(|set| [at(*set, 0), at(*set, size - 1)]);
            let points: Vec<f64> = points.collect();
            let middle = mean(&points).unwrap_or(f64::NAN);
            let squares: Vec<f64> = points.iter().map(|y| (y - middle).powi(2)).collect();
            mean(&terms).unwrap_or(f64::NAN) / mean(&squares).unwrap_or(f64::NAN)
        };
        let few = rows.len() <= DRAWN_MOST;
        Share {
            value: of(&rows),
            interval: few.then(|| bootstrap(&rows, 1, of)).flatten(),
        }
    };
    let of_factor = |factor: usize| Shares {
        first: share(&|set| at(set, size - 1) * (at(set, factor + 1) - at(set, 0))),
        total: share(&|set| 0.5 * (at(set, 0) - at(set, factor + 1)).powi(2)),
    };
    Some((0..factors).map(of_factor).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Multiples of irrational numbers less their whole part: even in every dimension, and the same everywhere.
    fn share(set: usize, dimension: usize) -> f64 {
        const OF: [f64; 6] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0];
        ((set + 1) as f64 * OF[dimension].sqrt()).fract()
    }

    /// Results of Saltelli's design.
    fn sets(count: usize, factors: usize, result: fn(&[f64]) -> f64) -> Vec<Vec<f64>> {
        let of = |set| {
            let point = |from: usize| -> Vec<f64> {
                let dimensions = from..from + factors;
                dimensions.map(|dimension| share(set, dimension)).collect()
            };
            let (first, other) = (point(0), point(factors));
            let mixed = |factor: usize| {
                let mut x = first.clone();
                x[factor] = other[factor];
                result(&x)
            };
            let mut results = vec![result(&first)];
            results.extend((0..factors).map(mixed));
            results.push(result(&other));
            results
        };
        (0..count).map(of).collect()
    }

    /// `SALib.analyze.sobol.analyze(…, calc_second_order=False)` of SALib 1.6.0.
    #[test]
    fn shares_are_those_of_salib() {
        const SALIB: [[f64; 2]; 3] = [
            [0.7097422452399271, 0.8199471063166748],
            [0.12097193709430054, 0.12505760221821205],
            [0.22319400339087755, 0.28109229632059124],
        ];
        let result = |x: &[f64]| 10.0 + x[0] + 2.0 * x[1] + 3.0 * x[0] * x[2] - x[1].powi(2);
        let found = shares(&sets(64, 3, result)).expect("they differ");
        assert_eq!(found.len(), SALIB.len());
        for (found, [first, total]) in found.iter().zip(SALIB) {
            assert!(
                (found.first.value - first).abs() < 1e-6,
                "{found:?} {first}"
            );
            assert!(
                (found.total.value - total).abs() < 1e-6,
                "{found:?} {total}"
            );
        }
    }

    /// Of a sum of independent factors each causes its own variance, alone as with the others.
    #[test]
    fn a_sum_is_shared_out_by_its_variances() {
        let found = shares(&sets(1024, 2, |x| 3.0 * x[0] + 4.0 * x[1])).expect("they differ");
        for (found, wanted) in found.iter().zip([0.36, 0.64]) {
            for Share { value, interval } in [found.first, found.total] {
                assert!((value - wanted).abs() < 0.05, "{value} {wanted}");
                let [low, high] = interval.expect("drawn");
                assert!(
                    low < value && value < high && high - low < 0.2,
                    "{low} {high}"
                );
            }
        }
    }

    #[test]
    fn what_does_not_differ_has_no_shares() {
        assert_eq!(shares(&[]), None);
        assert_eq!(shares(&[vec![1.0, 2.0, 3.0, 4.0]]), None);
        assert_eq!(shares(&vec![vec![1.0; 4]; 5]), None);
    }
}
