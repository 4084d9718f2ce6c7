//! Lines over time, or over anything else.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::axes::Grid;
use super::{LEFT, Panel, WIDTH, colour, text};

/// One line.
pub struct Series {
    /// Text in the legend.
    pub label: String,
    /// Colour of the line.
    pub colour: RGBColor,
    /// Width of the line, pixels at scale 1.
    pub width: u32,
    /// Abscissa and ordinate of each point.
    pub points: Vec<(f64, f64)>,
}

/// A line; without a label it is not in the legend.
pub fn line(label: &str, colour: RGBColor, width: u32, points: Vec<(f64, f64)>) -> Series {
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
    /// Horizontal lines with a meaning.
    pub(super) limits: Vec<f64>,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) y_range: (f64, f64),
}

impl Panel {
    pub(super) fn draw_lines<B: DrawingBackend>(
        &self,
        body: &DrawingArea<B, Shift>,
        scale: u32,
        axis_px: u32,
        lines: &Lines,
    ) -> Result<(), String> {
        let ((x0, x1), (y0, y1)) = (self.x_range, lines.y_range);
        let mut chart = self.chart(body, scale, axis_px, (y0, y1))?;
        self.draw_axes(&mut chart, scale, axis_px, &lines.x_label, Grid::Both)?;
        let clamp = |y: f64| y.clamp(y0, y1);
        for limit in &lines.limits {
            let stroke = colour::LIMIT.mix(0.7).stroke_width(scale);
            chart
                .draw_series(std::iter::once(PathElement::new(
                    vec![(x0, clamp(*limit)), (x1, clamp(*limit))],
                    stroke,
                )))
                .map_err(text)?;
        }
        self.draw_marks(&mut chart, scale, (y0, y1))?;
        for line in &lines.series {
            let columns = 2 * (WIDTH - LEFT) as usize;
            let points: Vec<(f64, f64)> = thin(&line.points, self.x_range, columns)
                .into_iter()
                .map(|(x, y)| (x, clamp(y)))
                .collect();
            let stroke = line.colour.stroke_width(line.width * scale);
            if scale == 1 {
                chart
                    .draw_series(LineSeries::new(points, stroke))
                    .map_err(text)?;
            } else {
                // The bitmap backend's joints shoot far out at sharp turns.
                let segments = points.windows(2);
                chart
                    .draw_series(segments.map(|p| PathElement::new(p.to_vec(), stroke)))
                    .map_err(text)?;
            }
        }
        Ok(())
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
