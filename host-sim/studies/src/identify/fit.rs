//! Least squares: the factors under which the plant comes closest to what was measured.
//!
//! Levenberg–Marquardt in Marquardt's form (Nocedal, Wright: Numerical Optimization, ch. 10), on
//! logarithms of the factors. The file is a measurement, too: each logarithm has its trust as a
//! standard deviation, so that what the data cannot tell stays where the file has it.
//!
//! What the piston starts from is measured with noise, and that noise is in every later sample: the
//! start is fitted along, and its uncertainty is in every interval.

use nalgebra::{DMatrix, DVector};
use wheeleg_plant::axis::AxisParams;

use super::free::{COUNT, FREE, Logs, applied};
use super::lab::Lab;
use super::predict::{Offset, Predicted, predict};

/// Step of the differences, in logarithms.
const DIFFERENCE: f64 = 2e-3;
/// That of the start, whose unit is a standard deviation, beside it.
const START_STEP: f64 = 100.0;
/// Most steps.
const STEPS: usize = 60;
/// A step that lowers the cost by less than this share is the last.
const ENOUGH: f64 = 1e-7;
/// Two-sided 95 % of a normal distribution, in standard deviations.
pub(super) const Z95: f64 = 1.959_964;

/// What is fitted: logarithms of the factors, then the start's stroke and pressures beside what was
/// measured of them, in their standard deviations.
pub const ALL: usize = COUNT + 3;
/// A place in what is fitted.
pub type Point = [f64; ALL];
/// Limits of the start, in standard deviations.
const START_LIMITS: [f64; 2] = [-5.0, 5.0];

/// A place with these factors, at the start that was measured.
#[must_use]
pub fn point(logs: &Logs) -> Point {
    std::array::from_fn(|i| logs.get(i).copied().unwrap_or(0.0))
}

/// Standard deviations of what was measured.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Of positions \[m\].
    pub position_m: f64,
    /// Of pressures \[Pa\].
    pub pressure_pa: f64,
}

/// A measurement to be fitted: the axis as its file has it, and how many ticks count.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The axis.
    pub axis: &'a AxisParams,
    /// What was measured.
    pub lab: &'a Lab,
    /// Ticks that are fitted.
    pub ticks: usize,
    /// Noise.
    pub noise: Noise,
    /// Standard deviations of the start's stroke and pressures.
    pub start: Offset,
    /// Limits of the logarithms.
    pub limits: [[f64; 2]; COUNT],
}

/// A fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Logarithms of the factors.
    pub logs: Logs,
    /// How the start differs from what was measured of it.
    pub start: Offset,
    point: Point,
    /// Half the sum of the squares, trust included.
    pub cost: f64,
    /// Residuals of the data over their standard deviation.
    pub residuals: DVector<f64>,
}

/// Standard deviation before the data: of a logarithm what the file is trusted to.
#[must_use]
pub fn trust(index: usize) -> f64 {
    FREE.get(index).map_or(1.0, |free| free.trust.ln() / Z95)
}

impl Problem<'_> {
    /// Residuals over their standard deviation; `None` where there is no such plant.
    #[must_use]
    pub fn residuals(&self, point: &Point) -> Option<DVector<f64>> {
        let (logs, offset) = self.parts(point);
        let axis = applied(self.axis, &logs);
        let predicted = predict(&axis, self.lab, self.ticks, &offset).ok()?;
        Some(self.compared(&predicted))
    }

    fn parts(&self, point: &Point) -> (Logs, Offset) {
        let [stroke, a, b] = [COUNT, COUNT + 1, COUNT + 2].map(|i| point[i]);
        let offset = Offset {
            stroke_m: stroke * self.start.stroke_m,
            pressure_pa: [a * self.start.pressure_pa[0], b * self.start.pressure_pa[1]],
        };
        (std::array::from_fn(|i| point[i]), offset)
    }

    fn limits(&self, index: usize) -> [f64; 2] {
        self.limits.get(index).copied().unwrap_or(START_LIMITS)
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

    /// How the residuals change with each of what is fitted; `None` where there is no such plant.
    #[must_use]
    pub fn jacobian(&self, point: &Point) -> Option<DMatrix<f64>> {
        let columns = (0..ALL).map(|i| {
            let at = |by: f64| {
                let mut moved = *point;
                moved[i] += by;
                self.residuals(&moved)
            };
            let [low, high] = self.limits(i);
            if low >= high {
                return Some(self.residuals(point)? * 0.0);
            }
            // Within the limits on both sides.
            let step = DIFFERENCE * if i < COUNT { 1.0 } else { START_STEP };
            let up = step.min(high - point[i]).max(0.0);
            let down = step.min(point[i] - low).max(0.0);
            Some((at(up)? - at(-down)?) / (up + down))
        });
        let columns: Vec<DVector<f64>> = columns.collect::<Option<_>>()?;
        Some(DMatrix::from_columns(&columns))
    }

    fn at(&self, point: &Point, residuals: DVector<f64>) -> Fit {
        let (logs, start) = self.parts(point);
        Fit {
            logs,
            start,
            point: *point,
            cost: Self::cost(&residuals, point),
            residuals,
        }
    }

    fn cost(residuals: &DVector<f64>, point: &Point) -> f64 {
        let trusted: f64 = (0..ALL).map(|i| (point[i] / trust(i)).powi(2)).sum();
        0.5 * (residuals.norm_squared() + trusted)
    }

    /// The least cost from a start; `None` if there is no plant there. `go_on` ends it early.
    #[must_use]
    pub fn fit(&self, start: &Point, go_on: &dyn Fn() -> bool) -> Option<Fit> {
        let mut now = self.at(start, self.residuals(start)?);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            if !go_on() {
                break;
            }
            let Some(jacobian) = self.jacobian(&now.point) else {
                break;
            };
            let mut normal = jacobian.tr_mul(&jacobian);
            let mut gradient = jacobian.tr_mul(&now.residuals);
            for i in 0..ALL {
                let weight = trust(i).powi(-2);
                normal[(i, i)] += weight;
                gradient[i] += weight * now.point[i];
            }
            let before = now.cost;
            let mut better = None;
            while better.is_none() && damping < 1e8 {
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
        for i in 0..ALL {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(gradient);
        let mut point = now.point;
        for (i, by) in step.iter().enumerate() {
            let [low, high] = self.limits(i);
            point[i] = (point[i] - by).clamp(low, high);
        }
        let fit = self.at(&point, self.residuals(&point)?);
        (fit.cost < now.cost).then_some(fit)
    }
}

impl Fit {
    /// Where it is.
    #[must_use]
    pub fn point(&self) -> &Point {
        &self.point
    }
}

/// Standard deviation and correlation of neighbours of positions in a fit's residuals, relative.
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
