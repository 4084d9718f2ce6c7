//! Quantile functions: the value below which a given share of a distribution lies.
//!
//! Every function comes from `libm` or is exact, so that a case is the same on every processor.

use std::f64::consts::FRAC_1_SQRT_2;

use wheeleg_config::plan::{Distribution, Value};

/// Inverse of the distribution function at a share strictly between 0 and 1.
///
/// # Panics
/// If a choice has no values.
#[must_use]
pub fn quantile(distribution: &Distribution, share: f64) -> Value {
    let number = match distribution {
        Distribution::Uniform { min, max } => within(min + share * (max - min), *min, *max),
        Distribution::LogUniform { min, max } => {
            let (low, high) = (libm::log(*min), libm::log(*max));
            within(libm::exp(low + share * (high - low)), *min, *max)
        }
        Distribution::Normal { mean, sd, min, max } => {
            let z = cut_normal(share, (min - mean) / sd, (max - mean) / sd);
            within(mean + sd * z, *min, *max)
        }
        Distribution::LogNormal {
            median,
            sigma,
            min,
            max,
        } => {
            let z_of = |x: f64| libm::log(x / median) / sigma;
            let z = cut_normal(share, z_of(*min), z_of(*max));
            within(median * libm::exp(sigma * z), *min, *max)
        }
        Distribution::Triangular { min, mode, max } => {
            let (rise, fall, span) = (mode - min, max - mode, max - min);
            let x = if share * span < rise {
                min + (share * span * rise).sqrt()
            } else {
                max - ((1.0 - share) * span * fall).sqrt()
            };
            within(x, *min, *max)
        }
        Distribution::Choice(list) => {
            let total: f64 = list.iter().map(|choice| choice.weight).sum();
            let mut left = share * total;
            for choice in list {
                left -= choice.weight;
                if left < 0.0 {
                    return choice.value.clone();
                }
            }
            let last = list.last().expect("a choice has values");
            return last.value.clone();
        }
    };
    Value::Number(number)
}

/// Keeps rounding from leaving the range.
fn within(x: f64, min: f64, max: f64) -> f64 {
    x.clamp(min, max)
}

/// Standard normal quantile of a distribution truncated to `low` … `high`.
fn cut_normal(share: f64, low: f64, high: f64) -> f64 {
    // Work in the smaller tail, so that significant digits remain.
    if low > 0.0 {
        return -cut_normal(1.0 - share, -high, -low);
    }
    let (from, to) = (below(low), below(high));
    normal(from + share * (to - from))
}

/// Probability that a standard normal number is below `z`.
fn below(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Standard normal quantile, by bisection of [`below`] down to its last bits.
fn normal(share: f64) -> f64 {
    if share > 0.5 {
        return -normal(1.0 - share);
    }
    // Below −38, the probability of a standard normal number vanishes in 64 bits.
    let (mut low, mut high) = (-39.0, 0.0);
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if below(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::plan::Choice;

    fn number(d: &Distribution, share: f64) -> f64 {
        match quantile(d, share) {
            Value::Number(x) => x,
            other => panic!("{other} is no number"),
        }
    }

    const INF: f64 = f64::INFINITY;

    /// Reference values from `scipy.stats` 1.17.1: `ppf` of norm, truncnorm, lognorm, loguniform and triang.
    #[test]
    fn quantiles_are_those_of_scipy() {
        let normal = |min, max| Distribution::Normal {
            mean: 1.0,
            sd: 2.0,
            min,
            max,
        };
        let lognormal = |min, max| Distribution::LogNormal {
            median: 1.0,
            sigma: 0.3,
            min,
            max,
        };
        let triangular = || Distribution::Triangular {
            min: 1.0,
            mode: 2.0,
            max: 5.0,
        };
        let log_uniform = || Distribution::LogUniform {
            min: 0.1,
            max: 10.0,
        };
        for (d, share, expected) in [
            (normal(-INF, INF), 1e-9, -10.995614030015373),
            (normal(-INF, INF), 0.025, -2.919927969080109),
            (normal(-INF, INF), 0.5, 1.0),
            (normal(-INF, INF), 0.9, 3.5631031310892007),
            (normal(0.0, 4.0), 0.01, 0.03533054885016562),
            (normal(0.0, 4.0), 0.5, 1.6155076422979913),
            (normal(0.0, 4.0), 0.99, 3.9068376147275767),
            (normal(9.0, INF), 0.5, 9.322208557195761),
            (lognormal(0.0, INF), 0.025, 0.5554430500266732),
            (lognormal(0.0, INF), 0.5, 1.0),
            (lognormal(0.0, INF), 0.975, 1.800364591747036),
            (lognormal(0.5, 2.0), 0.01, 0.540772699539126),
            (lognormal(0.5, 2.0), 0.5, 1.0),
            (lognormal(0.5, 2.0), 0.99, 1.8492057769414967),
            (triangular(), 0.1, 1.632455532033676),
            (triangular(), 0.25, 2.0),
            (triangular(), 0.9, 3.904554884989668),
            (log_uniform(), 0.1, 0.1584893192461114),
            (log_uniform(), 0.5, 1.0000000000000004),
            (log_uniform(), 0.75, 3.162277660168381),
        ] {
            let found = number(&d, share);
            let close = (found - expected).abs() <= 1e-12 * expected.abs().max(1.0);
            assert!(close, "{d:?} at {share}: {found}, not {expected}");
        }
    }

    #[test]
    fn choices_come_by_their_weights_and_cuts_hold_at_the_ends() {
        let choice = |value: f64, weight| Choice {
            value: Value::Number(value),
            weight,
        };
        let d = Distribution::Choice(vec![choice(1.0, 1.0), choice(2.0, 3.0)]);
        let found: Vec<f64> = [0.1, 0.249, 0.251, 0.999].map(|s| number(&d, s)).to_vec();
        assert_eq!(found, [1.0, 1.0, 2.0, 2.0]);
        let cut = Distribution::Normal {
            mean: 0.0,
            sd: 1.0,
            min: -0.5,
            max: 0.25,
        };
        let ends = [0.5 / 2_f64.powi(53), 1.0 - 1.0 / 2_f64.powi(53)];
        let [low, high] = ends.map(|share| number(&cut, share));
        assert!((-0.5..-0.499_999).contains(&low), "{low}");
        assert!((0.249_999..=0.25).contains(&high), "{high}");
    }
}
