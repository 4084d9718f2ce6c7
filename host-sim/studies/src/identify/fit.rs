//! Least squares: the factors that bring the plant closest to the measurement.
//!
//! Levenberg–Marquardt in Marquardt's form (Nocedal, Wright: Numerical Optimization, ch. 10), on logarithms
//! of the factors. The file counts as a measurement, too: each logarithm has its trust as a standard
//! deviation, so that parameters that the data does not determine stay close to the file's value.

use nalgebra::{DMatrix, DVector};
use wheeleg_plant::axis::AxisParams;

use super::free::{COUNT, FREE, Logs, applied};
use super::lab::Lab;
use super::predict::{Predicted, predict};

/// Step of the differences, in logarithms.
const DIFFERENCE: f64 = 2e-3;
/// Most steps.
const STEPS: usize = 60;
/// A step that lowers the cost by less than this share is the last.
const ENOUGH: f64 = 1e-7;
/// Two-sided 95 % of a normal distribution, in standard deviations.
pub(super) const Z95: f64 = 1.959_964;

/// Standard deviations of the measurements.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Of positions \[m\].
    pub position_m: f64,
    /// Of pressures \[Pa\].
    pub pressure_pa: f64,
}

/// A measurement to be fitted: the axis of its file, and the number of ticks that count.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// File of the axis, as named in messages.
    pub file: &'a str,
    /// The axis.
    pub axis: &'a AxisParams,
    /// The measurement.
    pub lab: &'a Lab,
    /// Ticks that are fitted.
    pub ticks: usize,
    /// Noise.
    pub noise: Noise,
    /// Limits of the logarithms.
    pub limits: [[f64; 2]; COUNT],
}

/// A fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Logarithms of the factors.
    pub logs: Logs,
    /// Half the sum of the squares, trust included.
    pub cost: f64,
    /// Residuals of the data over their standard deviation.
    pub residuals: DVector<f64>,
}

/// Standard deviation of a file's value by its trust, logarithm.
#[must_use]
pub fn trust(index: usize) -> f64 {
    FREE[index].trust.ln() / Z95
}

impl Problem<'_> {
    /// Residuals over their standard deviation; `None` if the plant is impossible.
    #[must_use]
    pub fn residuals(&self, logs: &Logs) -> Option<DVector<f64>> {
        let predicted = predict(&applied(self.axis, logs), self.lab, self.ticks).ok()?;
        Some(self.compared(&predicted))
    }

    fn compared(&self, predicted: &[Predicted]) -> DVector<f64> {
        let mut all = Vec::with_capacity(3 * predicted.len());
        for (sample, predicted) in self.lab.samples.iter().zip(predicted) {
            all.push((predicted.position_m - sample.position_m) / self.noise.position_m);
            for (model, measured) in predicted
                .pressure_pa
                .iter()
                .zip(sample.pressure_pa.iter().flatten())
            {
                all.push((model - measured) / self.noise.pressure_pa);
            }
        }
        DVector::from_vec(all)
    }

    /// Derivatives of the residuals by each logarithm; `None` if the plant is impossible.
    #[must_use]
    pub fn jacobian(&self, logs: &Logs) -> Option<DMatrix<f64>> {
        self.jacobian_while(logs, &|| true)
    }

    /// The same, `None` also if `go_on` ends it early.
    fn jacobian_while(&self, logs: &Logs, go_on: &dyn Fn() -> bool) -> Option<DMatrix<f64>> {
        let columns = (0..COUNT).map(|i| {
            if !go_on() {
                return None;
            }
            let at = |by: f64| {
                let mut moved = *logs;
                moved[i] += by;
                self.residuals(&moved)
            };
            let [low, high] = self.limits[i];
            if low >= high {
                return Some(self.residuals(logs)? * 0.0);
            }
            // Within the limits on both sides.
            let up = DIFFERENCE.min(high - logs[i]).max(0.0);
            let down = DIFFERENCE.min(logs[i] - low).max(0.0);
            Some((at(up)? - at(-down)?) / (up + down))
        });
        let columns: Vec<DVector<f64>> = columns.collect::<Option<_>>()?;
        Some(DMatrix::from_columns(&columns))
    }

    /// The smallest cost from a start with some factors held at the file's value.
    pub(super) fn held(
        &self,
        start: &Logs,
        held: &[usize],
        go_on: &dyn Fn() -> bool,
    ) -> Option<Fit> {
        let mut problem = *self;
        for i in held {
            problem.limits[*i] = [0.0; 2];
        }
        let start =
            std::array::from_fn(|i| start[i].clamp(problem.limits[i][0], problem.limits[i][1]));
        problem.fit(&start, go_on)
    }

    fn cost(&self, residuals: &DVector<f64>, logs: &Logs) -> f64 {
        let trusted: f64 = (0..COUNT).map(|i| (logs[i] / trust(i)).powi(2)).sum();
        0.5 * (residuals.norm_squared() + trusted)
    }

    /// The smallest cost from a start; `None` if the plant is impossible there. `go_on` ends it early.
    #[must_use]
    pub fn fit(&self, start: &Logs, go_on: &dyn Fn() -> bool) -> Option<Fit> {
        let residuals = self.residuals(start)?;
        let mut now = Fit {
            logs: *start,
            cost: self.cost(&residuals, start),
            residuals,
        };
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            if !go_on() {
                break;
            }
            let Some(jacobian) = self.jacobian_while(&now.logs, go_on) else {
                break;
            };
            let mut normal = jacobian.tr_mul(&jacobian);
            let mut gradient = jacobian.tr_mul(&now.residuals);
            for i in 0..COUNT {
                let weight = trust(i).powi(-2);
                normal[(i, i)] += weight;
                gradient[i] += weight * now.logs[i];
            }
            let before = now.cost;
            let mut better = None;
            while better.is_none() && damping < 1e8 && go_on() {
                better = self.step(&now, &normal, &gradient, damping);
                damping *= if better.is_some() { 0.2 } else { 5.0 };
            }
            match better {
                Some(fit) => now = fit,
                None => break,
            }
            damping = damping.max(1e-9);
            if before - now.cost < ENOUGH * before {
                break;
            }
        }
        Some(now)
    }

    /// One damped step, if it lowers the cost.
    fn step(
        &self,
        now: &Fit,
        normal: &DMatrix<f64>,
        gradient: &DVector<f64>,
        damping: f64,
    ) -> Option<Fit> {
        let mut damped = normal.clone();
        for i in 0..COUNT {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(gradient);
        let mut logs = now.logs;
        for ((log, by), [low, high]) in logs.iter_mut().zip(&step).zip(self.limits) {
            *log = (*log - by).clamp(low, high);
        }
        let residuals = self.residuals(&logs)?;
        let cost = self.cost(&residuals, &logs);
        (cost < now.cost).then_some(Fit {
            logs,
            cost,
            residuals,
        })
    }
}

/// Standard deviation and correlation of neighbouring position residuals of a fit, relative.
#[must_use]
pub fn scatter(residuals: &DVector<f64>) -> (f64, f64) {
    let n = residuals.len().max(2) as f64;
    let square = residuals.norm_squared() / n;
    let pairs = residuals.as_slice().windows(2).map(|w| w[0] * w[1]);
    let neighbours = pairs.sum::<f64>() / (n - 1.0);
    (
        square.sqrt(),
        (neighbours / square.max(1e-300)).clamp(0.0, 0.99),
    )
}
