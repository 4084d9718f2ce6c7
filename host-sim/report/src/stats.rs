//! Statistics, defined once for every study.
//!
//! Quantiles are of Hyndman and Fan's type 7 (the default of R, NumPy and Excel): the sorted values are at
//! equal distances from share 0 to share 1, with linear interpolation between them. So the median of an even
//! number of values is the mean of the middle two.

mod binomial;
mod rank;
mod resample;
mod sensitivity;

pub use binomial::{
    ALPHA, at_most, clopper_pearson, mcnemar, quantile_bound_rank, quantile_ranks, wilson,
};
pub use rank::spearman;
pub use resample::bootstrap;
pub use sensitivity::{Share, Shares, shares};

/// Quantile of a share from 0 to 1; `None` without values. Not a number sorts last.
///
/// # Panics
/// If `share` is not from 0 to 1.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    assert!((0.0..=1.0).contains(&share), "share {share}");
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = share * last as f64;
    let low = sorted.get(at.floor() as usize)?;
    let high = sorted.get(at.ceil() as usize)?;
    Some(low + (high - low) * at.fract())
}

/// A quantile with its upper bound, one-sided 95 %, for any distribution: the order statistic that the
/// quantile does not exceed. `None` if there are too few values for either.
#[must_use]
pub fn bounded_quantile(values: &[f64], share: f64) -> [Option<f64>; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = quantile_bound_rank(sorted.len() as u64, share);
    let bound = rank.and_then(|rank| sorted.get(rank as usize - 1).copied());
    [quantile(values, share), bound]
}

/// Median; `None` without values.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Arithmetic mean; `None` without values.
#[must_use]
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Largest value; `None` without values.
#[must_use]
pub fn largest(values: &[f64]) -> Option<f64> {
    values.iter().copied().reduce(f64::max)
}

/// Upper bound of a failure probability after `failures` in `trials`: one-sided 95 %, exact (Clopper and
/// Pearson 1934): the p at which this few failures have a probability of 5 %. 1 without trials.
///
/// # Panics
/// If there are more failures than trials.
#[must_use]
pub fn failure_bound(failures: u32, trials: u32) -> f64 {
    assert!(failures <= trials, "{failures} of {trials}");
    if failures == trials {
        return 1.0;
    }
    binomial::falling(|p| at_most(failures.into(), trials.into(), p) - ALPHA)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_bounds_are_those_of_clopper_and_pearson() {
        // No failure: 1 - 0.05^(1/n). Others: summed with the logarithm of gamma, in Python.
        for (failures, trials, bound) in [
            (0, 8, 0.312_344),
            (0, 60, 0.048_703),
            (0, 300, 0.009_936),
            (1, 10, 0.394_163),
            (10, 5000, 0.003_390),
            (44, 1000, 0.056_215),
        ] {
            let found = failure_bound(failures, trials);
            assert!(
                (found - bound).abs() < 2e-5,
                "{failures} of {trials}: {found}"
            );
        }
        assert_eq!((failure_bound(3, 3), failure_bound(0, 0)), (1.0, 1.0));
    }

    #[test]
    fn quantiles_are_those_of_type_7() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(quantile(&values, 0.0), Some(1.0));
        assert_eq!(quantile(&values, 0.25), Some(1.75));
        assert_eq!(median(&values), Some(2.5));
        assert_eq!(quantile(&values, 1.0), Some(4.0));
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(quantile(&[7.0], 0.9), Some(7.0));
        assert_eq!((mean(&values), largest(&values)), (Some(2.5), Some(4.0)));
    }

    /// 0.99^299 < 5 % < 0.99^298, and 0.999^2995 < 5 %: then the largest value bounds the quantile.
    #[test]
    fn a_quantile_is_bounded_by_an_order_statistic() {
        let bound = |n: u32, share: f64| {
            let values: Vec<f64> = (1..=n).rev().map(f64::from).collect();
            bounded_quantile(&values, share)[1]
        };
        assert_eq!((bound(298, 0.99), bound(299, 0.99)), (None, Some(299.0)));
        assert_eq!(
            (bound(2994, 0.999), bound(2995, 0.999)),
            (None, Some(2995.0))
        );
        // Of 5000 values 39 or fewer beyond p99 have 5 %: the 39th from above.
        assert_eq!(bound(5000, 0.99), Some(4962.0));
        // The bound of a median of a hundred: SciPy's binom.ppf(0.95, 100, 0.5) + 1.
        assert_eq!(bound(100, 0.5), Some(59.0));
    }

    #[test]
    fn no_values_have_no_statistics() {
        assert_eq!((quantile(&[], 0.9), median(&[])), (None, None));
        assert_eq!((mean(&[]), largest(&[])), (None, None));
    }
}
