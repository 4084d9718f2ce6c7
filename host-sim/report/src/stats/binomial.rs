//! The binomial distribution, and confidence bounds of a counted share.

/// Error probability: of both sides of an interval together, or of the one side of a bound.
pub const ALPHA: f64 = 0.05;
/// Standard normal quantile at 1 − α/2.
const Z: f64 = 1.959_963_984_540_054;

/// Probability of at most `k` successes in `n` trials of probability `p`.
///
/// # Panics
/// If `p` is not from 0 to 1.
#[must_use]
pub fn at_most(k: u64, n: u64, p: f64) -> f64 {
    assert!((0.0..=1.0).contains(&p), "probability {p}");
    if k >= n || p == 0.0 {
        return 1.0;
    }
    if p == 1.0 {
        return 0.0;
    }
    // Summed from the largest term away from the mean: terms only fall.
    let mean = n as f64 * p;
    if k as f64 <= mean {
        tail(k, n, p)
    } else {
        // At most k successes: not at most n − k − 1 failures.
        1.0 - tail(n - k - 1, n, 1.0 - p)
    }
}

/// Sum of the terms from `k` down to 0, for `k` not above the mean.
fn tail(k: u64, n: u64, p: f64) -> f64 {
    let (kf, nf) = (k as f64, n as f64);
    let choose = libm::lgamma(nf + 1.0) - libm::lgamma(kf + 1.0) - libm::lgamma(nf - kf + 1.0);
    let mut term = (choose + kf * p.ln() + (nf - kf) * (-p).ln_1p()).exp();
    let odds = (1.0 - p) / p;
    let (mut sum, mut at) = (term, kf);
    while at > 0.0 && term > sum * 1e-18 {
        // P(at − 1) / P(at).
        term *= at / (nf - at + 1.0) * odds;
        sum += term;
        at -= 1.0;
    }
    sum.min(1.0)
}

/// Interval of a share after `k` of `n`, 95 % two-sided, exact (Clopper and Pearson 1934): it holds the true
/// one in at least 95 of 100 experiments. From 0 to 1 without trials.
///
/// # Panics
/// If there are more successes than trials.
#[must_use]
pub fn clopper_pearson(k: u64, n: u64) -> [f64; 2] {
    assert!(k <= n, "{k} of {n}");
    let low = match k {
        0 => 0.0,
        // As likely as α/2 to see k or more.
        k => falling(|p| at_most(k - 1, n, p) - (1.0 - 0.5 * ALPHA)),
    };
    let high = match n - k {
        0 => 1.0,
        _ => falling(|p| at_most(k, n, p) - 0.5 * ALPHA),
    };
    [low, high]
}

/// Root in 0 … 1 of a falling function, to the last bit or so.
pub(super) fn falling(f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Interval of a share after `k` of `n`, 95 % two-sided, by the score test (Wilson 1927): shorter than the
/// exact one, and right on average. From 0 to 1 without trials.
///
/// # Panics
/// If there are more successes than trials.
#[must_use]
pub fn wilson(k: u64, n: u64) -> [f64; 2] {
    assert!(k <= n, "{k} of {n}");
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, k) = (n as f64, k as f64);
    let (p, z2) = (k / n, Z * Z);
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

/// Ranks, from 1, between which a quantile of `n` sorted values lies with 95 %; `None` if there are too few
/// values to bound it on that side. For any distribution.
#[must_use]
pub fn quantile_ranks(n: u64, share: f64) -> [Option<u64>; 2] {
    let half = 0.5 * ALPHA;
    // The largest rank that this many values reach with a probability of α/2 at most.
    let low = largest(n, |rank| at_most(rank - 1, n, share) <= half);
    // The mirror image: the same for the largest values.
    let high = largest(n, |rank| at_most(rank - 1, n, 1.0 - share) <= half);
    [low, high.map(|rank| n + 1 - rank)]
}

/// Rank, from 1, of the value that is an upper bound of a quantile of `n` sorted values: one-sided 95 %;
/// `None` if there are too few values to bound it. For any distribution.
#[must_use]
pub fn quantile_bound_rank(n: u64, share: f64) -> Option<u64> {
    let rank = largest(n, |rank| at_most(rank - 1, n, 1.0 - share) <= ALPHA)?;
    Some(n + 1 - rank)
}

/// Largest rank from 1 to `n` that satisfies a condition that also holds for all lower ranks.
fn largest(n: u64, holds: impl Fn(u64) -> bool) -> Option<u64> {
    let (mut low, mut high) = (0, n);
    while low < high {
        let middle = low + (high - low).div_ceil(2);
        if holds(middle) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    (low > 0).then_some(low)
}

/// Two-sided exact test of McNemar: probability of such an unequal split of the cases in which two programs
/// differ, `b` one way and `c` the other, if both ways are equally likely.
#[must_use]
pub fn mcnemar(b: u64, c: u64) -> f64 {
    let few = b.min(c);
    if b == c {
        return 1.0;
    }
    (2.0 * at_most(few, b + c, 0.5)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) -> bool {
        (found - expected).abs() <= 1e-9
    }

    /// `scipy.stats.binomtest(k, n).proportion_ci` of SciPy 1.17.1.
    #[test]
    fn intervals_of_shares_are_those_of_scipy() {
        for (k, n, exact, score) in [
            (
                65,
                74,
                [0.7816389033308695, 0.9428504456773248],
                [0.7847341343323124, 0.9346768434217738],
            ),
            (
                0,
                300,
                [0.0, 0.012220974694296421],
                [0.0, 0.012642971224546036],
            ),
            (
                1000,
                1000,
                [0.9963179161033608, 1.0],
                [0.9961732415144449, 1.0],
            ),
            (
                3,
                10,
                [0.06673951117773447, 0.652452850060008],
                [0.10779126740630102, 0.6032218525388546],
            ),
            (
                5000,
                1000000,
                [0.004862691820452884, 0.005140187265528673],
                [0.004863645231132737, 0.005140157798490569],
            ),
            (
                999999,
                1000000,
                [0.9999944283693444, 0.9999999746821948],
                [0.9999943350881957, 0.9999998234754233],
            ),
            (
                1,
                1,
                [0.025000000000000022, 1.0],
                [0.20654931437723745, 1.0],
            ),
        ] {
            for (found, expected) in [(clopper_pearson(k, n), exact), (wilson(k, n), score)] {
                for (found, expected) in found.into_iter().zip(expected) {
                    assert!(
                        close(found, expected),
                        "{k} of {n}: {found}, not {expected}"
                    );
                }
            }
        }
        assert_eq!(
            (clopper_pearson(0, 0), wilson(0, 0)),
            ([0.0, 1.0], [0.0, 1.0])
        );
    }

    /// `scipy.stats.binomtest(b, b + c, 0.5).pvalue` of SciPy 1.17.1.
    #[test]
    fn mcnemar_is_that_of_scipy() {
        for (b, c, expected) in [
            (1, 9, 0.021484375),
            (0, 5, 0.0625),
            (7, 7, 1.0),
            (120, 90, 0.045114087864840696),
            (2, 0, 0.5),
            (0, 0, 1.0),
        ] {
            let found = mcnemar(b, c);
            assert!(close(found, expected), "{b}, {c}: {found}");
            assert_eq!(found.to_bits(), mcnemar(c, b).to_bits());
        }
    }

    /// Searched rank by rank with `scipy.stats.binom` of SciPy 1.17.1.
    #[test]
    fn ranks_of_quantiles_are_those_of_the_binomial_distribution() {
        for (n, share, expected) in [
            (10, 0.5, [Some(2), Some(9)]),
            (100, 0.5, [Some(40), Some(61)]),
            (100, 0.9, [Some(84), Some(96)]),
            (1000, 0.99, [Some(983), Some(997)]),
            (5, 0.5, [None, None]),
            (20, 0.9, [Some(15), None]),
            (0, 0.5, [None, None]),
        ] {
            assert_eq!(quantile_ranks(n, share), expected, "{share} of {n}");
        }
    }
}
