//! Distributions of a factor's value, and their ends.
//!
//! Densities are those of the text books; a normal and a log-normal one may be truncated by `min` and `max`,
//! and the rest then has probability 1.

use std::cmp::Ordering;

use super::value::{Value, list};
use crate::quantity::{brief, pretty};
use crate::reader::{Entry, Reader};

/// A value with its probability.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The value.
    pub value: Value,
    /// Its weight, above 0; probabilities are weights over their sum.
    pub weight: f64,
}

/// A distribution, in the unit of its factor.
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// Equal density from `min` to `max`.
    Uniform {
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
    },
    /// The logarithm has equal density.
    LogUniform {
        /// Smallest, above 0.
        min: f64,
        /// Largest.
        max: f64,
    },
    /// Gaussian.
    Normal {
        /// Mean of the untruncated distribution.
        mean: f64,
        /// Standard deviation of the untruncated distribution, above 0.
        sd: f64,
        /// Lower limit; −∞ without one.
        min: f64,
        /// Upper limit; ∞ without one.
        max: f64,
    },
    /// The logarithm is Gaussian.
    LogNormal {
        /// Median of the untruncated distribution, above 0.
        median: f64,
        /// Standard deviation of the logarithm, above 0.
        sigma: f64,
        /// Lower limit; 0 without one.
        min: f64,
        /// Upper limit; ∞ without one.
        max: f64,
    },
    /// Density that rises from `min` to `mode` and falls to `max`.
    Triangular {
        /// Smallest.
        min: f64,
        /// Most likely.
        mode: f64,
        /// Largest.
        max: f64,
    },
    /// One of a list.
    Choice(Vec<Choice>),
}

/// Names of the distributions, as keys of a factor.
pub(super) const NAMES: [&str; 6] = [
    "uniform",
    "loguniform",
    "normal",
    "lognormal",
    "triangular",
    "choice",
];

impl Distribution {
    /// Smallest and largest value; infinite without a limit. `None` for a choice.
    #[must_use]
    pub fn ends(&self) -> Option<[f64; 2]> {
        match *self {
            Self::Uniform { min, max }
            | Self::LogUniform { min, max }
            | Self::Normal { min, max, .. }
            | Self::LogNormal { min, max, .. }
            | Self::Triangular { min, max, .. } => Some([min, max]),
            Self::Choice(_) => None,
        }
    }

    /// A middle value, used while other factors are checked.
    #[must_use]
    pub fn middle(&self) -> Value {
        match self {
            Self::Uniform { min, max } => Value::Number(0.5 * (min + max)),
            Self::LogUniform { min, max } => Value::Number((min * max).sqrt()),
            Self::Normal { mean, min, max, .. } => Value::Number(mean.clamp(*min, *max)),
            Self::LogNormal {
                median, min, max, ..
            } => Value::Number(median.clamp(*min, *max)),
            Self::Triangular { mode, .. } => Value::Number(*mode),
            Self::Choice(list) => list[0].value.clone(),
        }
    }
}

impl std::fmt::Display for Distribution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ends = |min: f64, max: f64| match (min.is_finite(), max.is_finite()) {
            (true, true) => format!(", from {} to {}", pretty(min), pretty(max)),
            (true, false) => format!(", from {}", pretty(min)),
            (false, true) => format!(", up to {}", pretty(max)),
            (false, false) => String::new(),
        };
        match self {
            Self::Uniform { min, max } => write!(f, "uniform{}", ends(*min, *max)),
            Self::LogUniform { min, max } => write!(f, "loguniform{}", ends(*min, *max)),
            Self::Normal { mean, sd, min, max } => {
                write!(
                    f,
                    "normal, mean {}, sd {}{}",
                    pretty(*mean),
                    pretty(*sd),
                    ends(*min, *max)
                )
            }
            Self::LogNormal {
                median,
                sigma,
                min,
                max,
            } => {
                let ends = ends(*min, *max);
                write!(
                    f,
                    "lognormal, median {}, sigma {}{ends}",
                    pretty(*median),
                    pretty(*sigma)
                )
            }
            Self::Triangular { min, mode, max } => {
                write!(f, "triangular, mode {}{}", pretty(*mode), ends(*min, *max))
            }
            Self::Choice(list) => {
                let equal = list.iter().all(|one| one.weight == list[0].weight);
                let one = |one: &Choice| match equal {
                    true => one.value.to_string(),
                    false => format!("{} (weight {})", one.value, pretty(one.weight)),
                };
                let list: Vec<String> = list.iter().map(one).collect();
                write!(f, "choice of {}", list.join(", "))
            }
        }
    }
}

/// Reads the distribution `key` of a factor, with its unit, empty if none is given.
pub(super) fn read(r: &mut Reader, factor: &Entry, key: &str) -> Option<(Distribution, String)> {
    let path = factor.field_path(key);
    let holds = fields(key);
    let entry = r.optional_table(&path, holds)?;
    r.reject_unknown(&entry, holds);
    let unit = match entry.get("unit") {
        Some(_) => r.text(&entry, "unit")?,
        None => String::new(),
    };
    if key == "choice" {
        return Some((choice(r, &entry)?, unit));
    }
    let mut number = |key: &str, default: Option<f64>| match (entry.get(key), default) {
        (None, Some(default)) => Some(default),
        (None, None) => {
            r.problem(
                Some(entry.span.clone()),
                format!("`{path}.{key}` is missing"),
                "expected here",
                Some(format!("it holds: {}", holds.join(", "))),
            );
            None
        }
        (Some(_), _) => r.plain_number(&entry, key),
    };
    let (lowest, highest) = (Some(f64::NEG_INFINITY), Some(f64::INFINITY));
    let read = match key {
        "uniform" => {
            let (min, max) = (number("min", None), number("max", None));
            Distribution::Uniform {
                min: min?,
                max: max?,
            }
        }
        "loguniform" => {
            let (min, max) = (number("min", None), number("max", None));
            Distribution::LogUniform {
                min: min?,
                max: max?,
            }
        }
        "normal" => {
            let (mean, sd) = (number("mean", None), number("sd", None));
            let (min, max) = (number("min", lowest), number("max", highest));
            Distribution::Normal {
                mean: mean?,
                sd: sd?,
                min: min?,
                max: max?,
            }
        }
        "lognormal" => {
            let (median, sigma) = (number("median", None), number("sigma", None));
            let (min, max) = (number("min", Some(0.0)), number("max", highest));
            Distribution::LogNormal {
                median: median?,
                sigma: sigma?,
                min: min?,
                max: max?,
            }
        }
        _ => {
            let (min, mode) = (number("min", None), number("mode", None));
            let max = number("max", None);
            Distribution::Triangular {
                min: min?,
                mode: mode?,
                max: max?,
            }
        }
    };
    if let Some(why) = contradiction(&read) {
        r.problem(
            Some(entry.span.clone()),
            format!("`{path}`: {why}"),
            "not a distribution",
            ordered(&read),
        );
        return None;
    }
    Some((read, unit))
}

fn fields(key: &str) -> &'static [&'static str] {
    match key {
        "uniform" | "loguniform" => &["min", "max", "unit"],
        "normal" => &["mean", "sd", "min", "max", "unit"],
        "lognormal" => &["median", "sigma", "min", "max", "unit"],
        "triangular" => &["min", "mode", "max", "unit"],
        _ => &["values", "weights", "unit"],
    }
}

/// Standard deviations beyond which a bell has almost nothing left: 6e-16 of its probability.
const FAR: f64 = 8.0;

/// Reports a window far from the bell that it is cut from; its ends are in standard deviations.
fn empty(low: f64, high: f64) -> Option<String> {
    let (end, beyond) = match (low > FAR, high < -FAR) {
        (true, _) => ("min", low),
        (_, true) => ("max", high),
        _ => return None,
    };
    Some(format!(
        "from min to max it has no probability: {end} lies {} standard deviations from the middle, \
         allowed are {FAR}",
        brief(beyond.abs())
    ))
}

/// What to write instead of ends in the wrong order.
fn ordered(d: &Distribution) -> Option<String> {
    let [min, max] = d.ends()?;
    match min.total_cmp(&max) {
        Ordering::Less => None,
        Ordering::Equal => Some(format!("for one value write `grid = [{}]`", pretty(min))),
        Ordering::Greater => Some(format!(
            "exchange the two: `min = {}`, `max = {}`",
            pretty(max),
            pretty(min)
        )),
    }
}

/// Why numbers do not make a distribution.
fn contradiction(d: &Distribution) -> Option<String> {
    let above = |name: &str, value: f64| {
        (value <= 0.0).then(|| format!("{name} = {} must be above 0", pretty(value)))
    };
    let order = |min: f64, max: f64| {
        (min >= max).then(|| format!("min = {} must be below max = {}", pretty(min), pretty(max)))
    };
    match *d {
        Distribution::Uniform { min, max } => order(min, max),
        Distribution::LogUniform { min, max } => above("min", min).or(order(min, max)),
        Distribution::Normal { mean, sd, min, max } => above("sd", sd)
            .or(order(min, max))
            .or_else(|| empty((min - mean) / sd, (max - mean) / sd)),
        Distribution::LogNormal {
            median,
            sigma,
            min,
            max,
        } => above("median", median)
            .or(above("sigma", sigma))
            .or((min < 0.0).then(|| format!("min = {} must be 0 or above", pretty(min))))
            .or(order(min, max))
            .or_else(|| empty((min / median).ln() / sigma, (max / median).ln() / sigma)),
        Distribution::Triangular { min, mode, max } => {
            order(min, max).or((!(min..=max).contains(&mode)).then(|| {
                format!(
                    "mode = {} must be from min = {} to max = {}",
                    pretty(mode),
                    pretty(min),
                    pretty(max)
                )
            }))
        }
        Distribution::Choice(_) => None,
    }
}

fn choice(r: &mut Reader, entry: &Entry) -> Option<Distribution> {
    let values = list(r, entry, "values")?;
    let Some((span, item)) = entry.get("weights") else {
        let equal = values
            .into_iter()
            .map(|value| Choice { value, weight: 1.0 });
        return Some(Distribution::Choice(equal.collect()));
    };
    let weights: Vec<f64> = item
        .as_array()
        .into_iter()
        .flat_map(|list| list.iter())
        .filter_map(|v| v.as_float().or(v.as_integer().map(|n| n as f64)))
        .filter(|w| *w > 0.0 && w.is_finite())
        .collect();
    let given = item.as_array().map_or(0, toml_edit::Array::len);
    let sum: f64 = weights.iter().sum();
    if weights.len() != values.len() || given != values.len() || !sum.is_finite() {
        r.problem(
            Some(span),
            format!(
                "`{}` = {} must be a list of {} numbers above 0 with a finite sum, one for each value",
                entry.field_path("weights"),
                item.to_string().trim(),
                values.len()
            ),
            "not the weights",
            None,
        );
        return None;
    }
    let pairs = values.into_iter().zip(weights);
    let pairs = pairs.map(|(value, weight)| Choice { value, weight });
    Some(Distribution::Choice(pairs.collect()))
}
