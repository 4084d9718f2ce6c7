//! The curves of a panel as data, so that a page can draw, zoom and read them itself.

use serde::Serialize;

use super::axes::seen;
use super::simplify::simplified;
use super::{Content, Panel, Series};

/// Most stretches of a curve, each drawn by its smallest and its largest value: no peak is lost, and a report
/// stays small.
const STRETCHES: usize = 500;
/// A curve may be off by this share of its axis: a quarter of a pixel of a high panel.
const INVISIBLE: f64 = 1e-3;

/// A panel of lines for `page/plot.js`.
#[derive(Debug, Serialize)]
pub(crate) struct PanelData<'a> {
    title: &'a str,
    unit: &'a str,
    x_label: &'a str,
    /// Whether the abscissa is the clock of the page.
    on_clock: bool,
    x: (f64, f64),
    y: (f64, f64),
    series: Vec<SeriesData<'a>>,
    limits: &'a [f64],
    marks: Vec<f64>,
    marked: &'a str,
    height: u32,
}

#[derive(Debug, Serialize)]
struct SeriesData<'a> {
    label: &'a str,
    /// As in [`Colour`](super::Colour); the page maps it for dark screens.
    colour: String,
    width: u32,
    x: Vec<f64>,
    /// None is a gap.
    y: Vec<Option<f64>>,
}

impl<'a> PanelData<'a> {
    /// The data of a panel of lines; none for other contents, which have only their picture.
    pub(crate) fn of(panel: &'a Panel) -> Option<Self> {
        let Content::Lines(lines) = &panel.content else {
            return None;
        };
        let tolerance = INVISIBLE * (lines.y_range.1 - lines.y_range.0);
        let series = lines.series.iter();
        let series = series.map(|s| SeriesData::new(s, panel.x_range, tolerance));
        Some(Self {
            title: &panel.title,
            unit: &lines.y_label,
            x_label: &lines.x_label,
            on_clock: panel.on_clock,
            x: panel.x_range,
            y: lines.y_range,
            series: series.collect(),
            limits: &lines.limits,
            marks: seen(&panel.marks, panel.x_range),
            marked: panel.marked,
            height: panel.height,
        })
    }
}

impl<'a> SeriesData<'a> {
    fn new(series: &'a Series, (from, to): (f64, f64), tolerance: f64) -> Self {
        let inside = series.points.iter().copied();
        let inside: Vec<(f64, f64)> = inside.filter(|(x, _)| (from..=to).contains(x)).collect();
        let (mut x, mut y) = (Vec::new(), Vec::new());
        // A value that does not exist is a gap.
        for piece in inside.split(|(_, y)| !y.is_finite()) {
            if piece.is_empty() {
                continue;
            }
            if let Some(end) = x.last().copied() {
                x.push(end);
                y.push(None);
            }
            for point in simplified(&thinned(piece), tolerance) {
                x.push(rounded(point.0));
                y.push(Some(rounded(point.1)));
            }
        }
        Self {
            label: &series.label,
            colour: series.colour.to_string(),
            width: series.width,
            x,
            y,
        }
    }
}

/// Smallest and largest value of every stretch, in their order.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= 2 * STRETCHES {
        return points.to_vec();
    }
    let stretch = points.len().div_ceil(STRETCHES);
    let mut kept = Vec::with_capacity(2 * STRETCHES + 2);
    for part in points.chunks(stretch) {
        let by_value = |a: &usize, b: &usize| part[*a].1.total_cmp(&part[*b].1);
        let (low, high) = (
            (0..part.len()).min_by(by_value).unwrap_or(0),
            (0..part.len()).max_by(by_value).unwrap_or(0),
        );
        kept.push(part[low.min(high)]);
        if low != high {
            kept.push(part[low.max(high)]);
        }
    }
    kept.extend(points.last());
    kept
}

/// Ten thousandths: finer than any figure shows.
fn rounded(value: f64) -> f64 {
    // Without a minus sign on zero.
    (value * 1e4).round() / 1e4 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(points: Vec<(f64, f64)>) -> Series {
        crate::plot::line("", crate::plot::colour::ROBOT, 1, points)
    }

    #[test]
    fn a_long_curve_keeps_its_peaks_and_its_order() {
        let mut points: Vec<(f64, f64)> = (0..50_000).map(|i| (f64::from(i), 0.0)).collect();
        points[12_345].1 = 9.0;
        points[33_333].1 = -7.0;
        let series = series(points);
        let data = SeriesData::new(&series, (0.0, 1e6), 0.01);
        let kept: Vec<_> = data
            .x
            .iter()
            .copied()
            .zip(data.y.iter().flatten().copied())
            .collect();
        assert!(kept.contains(&(12_345.0, 9.0)) && kept.contains(&(33_333.0, -7.0)));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(kept.len() < 20, "{}", kept.len());
        assert_eq!(kept.last(), Some(&(49_999.0, 0.0)));
    }

    #[test]
    fn a_gap_stays_a_gap() {
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0), (3.0, 3.5)];
        let series = series(points);
        let data = SeriesData::new(&series, (0.0, 9.0), 0.0);
        assert_eq!(data.x, [0.0, 0.0, 2.0, 3.0]);
        assert_eq!(data.y, [Some(1.0), None, Some(3.0), Some(3.5)]);
    }
}
