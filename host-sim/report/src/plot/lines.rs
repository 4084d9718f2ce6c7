//! Lines over time, or over anything else.

use std::ops::Range;

use super::axes::{Axes, Grid};
use super::simplify::simplified;
use super::svg::{Stroke, Svg};
use super::{Colour, LEFT, WIDTH, colour};

/// A line may be off by this, pixels.
const INVISIBLE_PX: f64 = 0.1;

/// One line.
pub struct Series {
    /// Text in the legend.
    pub label: String,
    /// Colour of the line.
    pub colour: Colour,
    /// Width of the line, pixels.
    pub width: u32,
    /// Abscissa and ordinate of each point.
    pub points: Vec<(f64, f64)>,
}

/// A line; without a label it is not in the legend.
pub fn line(label: &str, colour: Colour, width: u32, points: Vec<(f64, f64)>) -> Series {
    Series {
        label: label.to_owned(),
        colour,
        width,
        points,
    }
}

/// Lines with common axes.
pub struct Lines {
    /// The curves, drawn in this order.
    pub series: Vec<Series>,
    /// The lines named in the picture's legend; a page has room for all.
    pub(super) named: Range<usize>,
    /// Horizontal lines with a meaning.
    pub(super) limits: Vec<f64>,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) y_range: (f64, f64),
}

impl Lines {
    pub(super) fn draw(&self, svg: &mut Svg, axes: &Axes, x_range: (f64, f64), marks: &[f64]) {
        let (y0, y1) = self.y_range;
        axes.draw(svg, &self.x_label, Grid::Both);
        for limit in &self.limits {
            let opacity = 0.7;
            let stroke = Stroke {
                opacity,
                ..Stroke::new(colour::LIMIT, 1)
            };
            axes.level(svg, limit.clamp(y0, y1), stroke);
        }
        axes.marks(svg, marks);
        for line in &self.series {
            let stroke = Stroke::new(line.colour, line.width);
            let points = thin(&line.points, x_range, (WIDTH - LEFT) as usize);
            // A value that does not exist is a gap.
            for piece in points.split(|(_, y)| y.is_nan()) {
                let pixels = piece.iter().map(|(x, y)| axes.at((*x, y.clamp(y0, y1))));
                let pixels: Vec<(f64, f64)> = pixels.collect();
                if !pixels.is_empty() {
                    svg.line(&simplified(&pixels, INVISIBLE_PX), stroke);
                }
            }
        }
    }
}

/// Keeps the smallest and largest value of each of `columns` columns, so that
/// a long record draws quickly and no peak is lost.
fn thin(points: &[(f64, f64)], (x0, x1): (f64, f64), columns: usize) -> Vec<(f64, f64)> {
    let from = points.partition_point(|p| p.0 < x0);
    let to = points.partition_point(|p| p.0 <= x1);
    let points = &points[from..to];
    if points.len() <= 2 * columns {
        return points.to_vec();
    }
    let mut out = Vec::with_capacity(2 * columns);
    for chunk in points.chunks(points.len().div_ceil(columns)) {
        let lo = chunk.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let hi = chunk.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let (Some(lo), Some(hi)) = (lo, hi) {
            let (first, second) = if lo.0 <= hi.0 { (lo, hi) } else { (hi, lo) };
            out.push(*first);
            if first != second {
                out.push(*second);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 0.0)).collect();
        points[51_234].1 = 7.0;
        points[77_777].1 = -3.0;
        let thin = thin(&points, (0.0, 1e6), 900);
        assert!(thin.len() <= 1800);
        assert!(thin.contains(&(51_234.0, 7.0)) && thin.contains(&(77_777.0, -3.0)));
        assert!(thin.windows(2).all(|w| w[0].0 < w[1].0));
    }
}
