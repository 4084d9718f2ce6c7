//! Least squares: the factors that bring the plant closest to the measurement.
//!
//! Levenberg–Marquardt in Marquardt's form (Nocedal, Wright: Numerical Optimization, ch. 10), on logarithms
//! of the factors and on what is not known of the measurement ([`bench`]). The file counts as a measurement,
//! too: each logarithm has its trust as a standard deviation, so that parameters that the data does not determine
//! stay close to the file's value.

use nalgebra::{DMatrix, DVector};
use wheeleg_plant::axis::AxisParams;

use super::bench::{self, UNKNOWNS};
use super::free::COUNT;
use super::lab::Lab;
use super::noise::Noise;
use super::point::ALL;
pub use super::point::{Point, trust};
use super::predict::{Predicted, predict};

/// Step of the differences, in logarithms and standard deviations.
const DIFFERENCE: f64 = 2e-3;
/// Most steps.
const STEPS: usize = 60;

/// A start that misses a part of the measurement by more than this many times the sensor's noise is given up.
const HOPELESS: f64 = 9.0;
/// A step that lowers the cost by less than this share is the last.
const ENOUGH: f64 = 1e-7;

/// How exact a fit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exact {
    /// With the start as it was measured: to compare starts, and for the noise that it leaves. Far from the truth
    /// the unknowns of the measurement lead into local minima.
    Roughly,
    /// With everything that is unknown.
    Fully,
}

impl Exact {
    /// Steps down and up of the differences. One side is not exact in directions that the data hardly determine.
    fn sides(self) -> [f64; 2] {
        match self {
            Self::Roughly => [0.0, DIFFERENCE],
            Self::Fully => [DIFFERENCE; 2],
        }
    }
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
    /// Where it is.
    pub point: Point,
    /// Half the sum of the squares, trust included.
    pub cost: f64,
    /// Residuals of the data over their standard deviation.
    pub residuals: DVector<f64>,
}

impl Fit {
    /// Root mean square of the position's error over its standard deviation; a sample has `channels` residuals.
    pub(super) fn position_error(&self, channels: usize) -> f64 {
        let errors = self.residuals.iter().step_by(channels);
        let (count, sum) = errors.fold((0.0, 0.0), |(n, sum), r| (n + 1.0, sum + r * r));
        (sum / f64::max(count, 1.0)).sqrt()
    }
}

impl Problem<'_> {
    /// Residuals over their standard deviation; `None` if the plant is impossible.
    #[must_use]
    pub fn residuals(&self, point: &Point) -> Option<DVector<f64>> {
        let predicted = predict(self.axis, self.lab, point, self.ticks).ok()?;
        Some(self.compared(&predicted))
    }

    /// Smallest and largest value of everything that is fitted.
    fn all_limits(&self, exact: Exact) -> [[f64; 2]; ALL] {
        let unknowns = match exact {
            Exact::Roughly => [[0.0; 2]; UNKNOWNS],
            Exact::Fully => bench::limits(self.axis, self.lab),
        };
        std::array::from_fn(|i| match i.checked_sub(COUNT) {
            None => self.limits[i],
            Some(unknown) => unknowns[unknown],
        })
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

    /// Derivatives of the residuals by each logarithm and each unknown; `None` if the plant is impossible.
    #[must_use]
    pub fn jacobian(&self, point: &Point) -> Option<DMatrix<f64>> {
        let residuals = self.residuals(point)?;
        self.jacobian_while(point, &residuals, Exact::Fully, &|| true)
    }

    /// The same, `None` also if `go_on` ends it early.
    fn jacobian_while(
        &self,
        point: &Point,
        residuals: &DVector<f64>,
        exact: Exact,
        go_on: &dyn Fn() -> bool,
    ) -> Option<DMatrix<f64>> {
        let limits = self.all_limits(exact);
        let columns = (0..ALL).map(|i| {
            if !go_on() {
                return None;
            }
            let at = |by: f64| {
                let mut moved = *point;
                *moved.value(i) += by;
                self.residuals(&moved)
            };
            let [low, high] = limits[i];
            if low >= high {
                return Some(residuals * 0.0);
            }
            // Within the limits on both sides.
            let value = *point.clone().value(i);
            let [down, up] = exact.sides();
            let up = up.min(high - value).max(0.0);
            let down = down.min(value - low).max(0.0);
            match (down > 0.0, up > 0.0) {
                (true, true) => Some((at(up)? - at(-down)?) / (up + down)),
                (false, true) => Some((at(up)? - residuals) / up),
                _ => {
                    let down = DIFFERENCE.min(value - low);
                    Some((residuals - at(-down)?) / down)
                }
            }
        });
        let columns: Vec<DVector<f64>> = columns.collect::<Option<_>>()?;
        Some(DMatrix::from_columns(&columns))
    }

    /// The smallest cost from a start with some factors held at the file's value.
    pub(super) fn held(
        &self,
        start: &Point,
        held: &[usize],
        go_on: &dyn Fn() -> bool,
    ) -> Option<Fit> {
        let mut problem = *self;
        for i in held {
            problem.limits[*i] = [0.0; 2];
        }
        let mut start = *start;
        for (log, [low, high]) in start.logs.iter_mut().zip(problem.limits) {
            *log = log.clamp(low, high);
        }
        problem.fit(&start, Exact::Fully, go_on)
    }

    fn cost(&self, residuals: &DVector<f64>, point: &Point) -> f64 {
        let trusted: f64 = point.expected().map(|value| value * value).sum();
        0.5 * (residuals.norm_squared() + trusted)
    }

    /// The smallest cost from a start, by way of the beginning of the measurement, and then of ever more of it: the
    /// error of a plant that is far from the truth grows with time, and with it the number of local minima. `None` if a
    /// part is missed by more than [`HOPELESS`]; a sample has `channels` residuals.
    #[must_use]
    pub(super) fn fit_growing(
        &self,
        start: &Point,
        channels: usize,
        go_on: &dyn Fn() -> bool,
    ) -> Option<Fit> {
        let driven = self.lab.first_driven().unwrap_or(0).min(self.ticks);
        let mut point = *start;
        for part in [8, 4, 2] {
            let ticks = driven + (self.ticks - driven) / part;
            let part = Self { ticks, ..*self };
            let fit = part.fit(&point, Exact::Fully, go_on)?;
            if fit.position_error(channels) > HOPELESS {
                return None;
            }
            point = fit.point;
        }
        self.fit(&point, Exact::Fully, go_on)
    }

    /// The smallest cost from a start; `None` if the plant is impossible there. `go_on` ends it early.
    #[must_use]
    pub fn fit(&self, start: &Point, exact: Exact, go_on: &dyn Fn() -> bool) -> Option<Fit> {
        let residuals = self.residuals(start)?;
        let mut now = Fit {
            point: *start,
            cost: self.cost(&residuals, start),
            residuals,
        };
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            if !go_on() {
                break;
            }
            let jacobian = self.jacobian_while(&now.point, &now.residuals, exact, go_on);
            let Some(jacobian) = jacobian else {
                break;
            };
            let mut normal = jacobian.tr_mul(&jacobian);
            let mut gradient = jacobian.tr_mul(&now.residuals);
            for (i, expected) in now.point.expected().enumerate() {
                normal[(i, i)] += trust(i).powi(-2);
                gradient[i] += expected / trust(i);
            }
            let before = now.cost;
            let mut better = None;
            while better.is_none() && damping < 1e8 && go_on() {
                better = self.step(&now, &normal, &gradient, damping, exact);
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
        exact: Exact,
    ) -> Option<Fit> {
        let mut damped = normal.clone();
        for i in 0..ALL {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(gradient);
        let mut point = now.point;
        for (i, (by, [low, high])) in step.iter().zip(self.all_limits(exact)).enumerate() {
            let value = point.value(i);
            *value = (*value - by).clamp(low, high);
        }
        let residuals = self.residuals(&point)?;
        let cost = self.cost(&residuals, &point);
        (cost < now.cost).then_some(Fit {
            point,
            cost,
            residuals,
        })
    }
}
