//! Statistics of ranks.

/// Spearman's rank correlation: Pearson's of the ranks, where equal values share their mean rank. Pairs with
/// a value that is not a number are left out. `None` for fewer than three pairs, or if all values are equal.
///
/// # Panics
/// If the lists differ in length.
#[must_use]
pub fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    assert_eq!(x.len(), y.len(), "pairs");
    let pairs = x.iter().zip(y).filter(|(x, y)| !x.is_nan() && !y.is_nan());
    let (x, y): (Vec<f64>, Vec<f64>) = pairs.map(|(x, y)| (*x, *y)).unzip();
    if x.len() < 3 {
        return None;
    }
    let (x, y) = (ranks(&x), ranks(&y));
    let mean = 0.5 * (x.len() as f64 + 1.0);
    let sum = |a: &[f64], b: &[f64]| -> f64 {
        let products = a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean));
        products.sum()
    };
    let scale = (sum(&x, &x) * sum(&y, &y)).sqrt();
    (scale > 0.0).then(|| sum(&x, &y) / scale)
}

/// Ranks from 1.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut below = 0;
    for equal in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let rank = below as f64 + 0.5 * (equal.len() as f64 + 1.0);
        equal.iter().for_each(|i| ranks[*i] = rank);
        below += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.stats.spearmanr` of SciPy 1.17.1.
    #[test]
    fn correlations_are_those_of_scipy() {
        let x = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0];
        let y = [2.0, 7.0, 1.0, 8.0, 2.0, 8.0, 1.0, 8.0];
        let found = spearman(&x, &y).expect("a number");
        assert!((found - 0.19885368120992467).abs() < 1e-9, "{found}");
        let against = x.map(|x| -x);
        let found = spearman(&x, &against).expect("a number");
        assert!((found + 1.0).abs() < 1e-12, "{found}");
    }

    #[test]
    fn what_has_no_order_has_no_correlation() {
        assert_eq!(spearman(&[1.0; 4], &[1.0, 2.0, 3.0, 4.0]), None);
        assert_eq!(spearman(&[1.0, 2.0], &[1.0, 2.0]), None);
        let nan = f64::NAN;
        assert_eq!(spearman(&[1.0, 2.0, nan], &[1.0, 2.0, 3.0]), None);
    }
}
