//! Statistics, defined once for every study.
//!
//! A quantile is that of Hyndman and Fan's type 7 (the default of R, NumPy and Excel): the
//! sorted values stand at equal distances from share 0 to share 1, and between two of them it
//! is interpolated. So the median of an even number of values is the mean of the middle two.

/// Quantile of a share from 0 to 1; `None` of no values. Not a number sorts last.
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

/// Median; `None` of no values.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Arithmetic mean; `None` of no values.
#[must_use]
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Largest value; `None` of no values.
#[must_use]
pub fn largest(values: &[f64]) -> Option<f64> {
    values.iter().copied().reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn no_values_have_no_statistics() {
        assert_eq!((quantile(&[], 0.9), median(&[])), (None, None));
        assert_eq!((mean(&[]), largest(&[])), (None, None));
    }
}
