//! Intervals of a fit, and parameters that the data do not determine.

use nalgebra::{DMatrix, SymmetricEigen};

use super::bench::UNKNOWNS;
use super::free::{COUNT, FREE};
use super::point::{Z95, trust};

/// A parameter is determined if the data leave less than this share of the file's uncertainty.
const DETERMINED: f64 = 0.5;
/// Smallest share of a parameter that is named in a direction.
const SHARE: f64 = 0.3;

/// How well the data determine one factor.
#[derive(Debug, Clone, Copy)]
pub struct Interval {
    /// Standard deviation of the logarithm.
    pub deviation: f64,
    /// Whether the data determine it.
    pub determined: bool,
}

impl Interval {
    /// Smallest and largest factor, 95 %.
    #[must_use]
    pub fn factors(&self, log: f64) -> [f64; 2] {
        [-1.0, 1.0].map(|sign| (log + sign * Z95 * self.deviation).exp())
    }
}

/// Information of data about the logarithms: J'J of residuals over the noise that counts, less what the
/// unknowns of the measurement take of it (Schur's complement).
#[must_use]
pub fn information(jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let all = jacobian.tr_mul(jacobian);
    let factors = all.view((0, 0), (COUNT, COUNT));
    let both = all.view((COUNT, 0), (UNKNOWNS, COUNT));
    let unknowns =
        all.view((COUNT, COUNT), (UNKNOWNS, UNKNOWNS)) + DMatrix::identity(UNKNOWNS, UNKNOWNS);
    match unknowns.cholesky() {
        Some(unknowns) => factors - both.tr_mul(&unknowns.solve(&both)),
        None => factors * 0.0,
    }
}

/// Intervals under the information of data and file.
#[must_use]
pub fn intervals(information: &DMatrix<f64>) -> [Interval; COUNT] {
    let mut whole = information.clone();
    for i in 0..COUNT {
        whole[(i, i)] += trust(i).powi(-2);
    }
    let covariance = whole.cholesky().map(|c| c.inverse());
    std::array::from_fn(|i| {
        let variance = covariance.as_ref().map_or(f64::INFINITY, |c| c[(i, i)]);
        let deviation = variance.sqrt().min(trust(i));
        Interval {
            deviation,
            determined: deviation < DETERMINED * trust(i),
        }
    })
}

/// Parameters that can change together without an effect on the data, in words: directions in which the data
/// have less information than the file.
#[must_use]
pub fn undetermined(information: &DMatrix<f64>) -> Vec<String> {
    // In units of the trust in the file.
    let scaled = DMatrix::from_fn(COUNT, COUNT, |i, k| {
        trust(i) * information[(i, k)] * trust(k)
    });
    let eigen = SymmetricEigen::new(scaled);
    let limit = DETERMINED.powi(-2) - 1.0;
    let mut weak: Vec<usize> = (0..COUNT)
        .filter(|k| eigen.eigenvalues[*k] < limit)
        .collect();
    weak.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    weak.into_iter()
        .map(|k| {
            let direction = eigen.eigenvectors.column(k);
            let mut parts: Vec<usize> =
                (0..COUNT).filter(|i| direction[*i].abs() > SHARE).collect();
            parts.sort_by(|a, b| direction[*b].abs().total_cmp(&direction[*a].abs()));
            let lead = parts.first().map_or(1.0, |i| direction[*i].signum());
            let words: Vec<String> = parts
                .iter()
                .map(|i| {
                    let way = if direction[*i] * lead > 0.0 {
                        "up"
                    } else {
                        "down"
                    };
                    format!("{} {way}", FREE[*i].words)
                })
                .collect();
            match &words[..] {
                [_] => format!(
                    "{}: it has hardly any effect on the measurement",
                    FREE[parts[0]].words
                ),
                _ => format!("{} together give the same data", words.join(", ")),
            }
        })
        .collect()
}

/// Volume of the uncertainty, as the mean of the logarithms of the deviations over the file's along the main
/// directions: 0 is that of the file, smaller is better.
#[must_use]
pub fn ignorance(information: &DMatrix<f64>) -> f64 {
    let scaled = DMatrix::from_fn(COUNT, COUNT, |i, k| {
        let own = if i == k { 1.0 } else { 0.0 };
        own + trust(i) * information[(i, k)] * trust(k)
    });
    let values = SymmetricEigen::new(scaled).eigenvalues;
    -0.5 * values.iter().map(|v| v.max(1.0).ln()).sum::<f64>() / COUNT as f64
}

/// Whether a value lies in the interval of its parameter; for tests of the coverage.
#[must_use]
pub fn covers(interval: &Interval, log: f64, truth: f64) -> bool {
    (log - truth).abs() <= Z95 * interval.deviation
}
