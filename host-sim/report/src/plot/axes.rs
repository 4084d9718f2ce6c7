//! From values to pixels, and the common parts of lines, rasters and maps: frame, grid, numbers and marks.

use std::collections::BTreeSet;

use super::svg::{Anchor, SMALL, Stroke, Svg};
use super::{LEFT, Panel, WIDTH, colour};

/// Lines behind the content, and numbers at its left.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Grid {
    /// At the numbers of both axes.
    Both,
    /// At those of the abscissa; the ordinate has no numbers.
    Upright,
    /// None; the content covers the panel.
    Covered,
}

/// The drawing area of a panel.
pub(super) struct Axes {
    x: Scale,
    y: Scale,
    /// Height of numbers and label below, pixels; zero without them.
    below: u32,
}

/// An axis: values to pixels.
struct Scale {
    values: (f64, f64),
    pixels: (f64, f64),
}

impl Scale {
    fn at(&self, value: f64) -> f64 {
        let ((v0, v1), (p0, p1)) = (self.values, self.pixels);
        // A range without length, or too large for numbers, has everything in its middle.
        let share = (value - v0) / (v1 - v0);
        let share = if v1 > v0 && share.is_finite() {
            share
        } else {
            0.5
        };
        p0 + share * (p1 - p0)
    }

    /// Values that get a number: at most `most` multiples of 1, 2 or 5 times a power of ten.
    fn ticks(&self, most: usize) -> Vec<f64> {
        let (lo, hi) = self.values;
        if hi <= lo {
            return Vec::new();
        }
        let count = |step: f64| (hi / step).floor() - (lo / step).ceil() + 1.0;
        // A range beyond all limits has no such multiples.
        let decade = (hi - lo).log10().floor().clamp(-300.0, 300.0) as i32;
        let decades = (decade - 2..=decade + 1).map(|k| 10_f64.powi(k));
        let steps = decades.flat_map(|ten| [1.0, 2.0, 5.0].map(|m| m * ten));
        let mut fitting = steps.filter(|step| count(*step) <= most as f64);
        fitting.next().map_or_else(Vec::new, |step| {
            let first = (lo / step).ceil();
            (0..count(step) as usize)
                .map(|k| (first + k as f64) * step)
                .collect()
        })
    }
}

impl Axes {
    /// Axes of a panel whose content begins at `top` and is `height` high, with the
    /// axis of the abscissa `below` it.
    pub(super) fn new(panel: &Panel, y_range: (f64, f64), top: u32, below: u32) -> Self {
        let bottom = top + panel.height;
        Self {
            x: Scale {
                values: panel.x_range,
                pixels: (f64::from(LEFT), f64::from(WIDTH - 15)),
            },
            y: Scale {
                values: y_range,
                pixels: (f64::from(bottom - 5), f64::from(top + 3)),
            },
            below,
        }
    }

    /// The pixel of a point.
    pub(super) fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    /// A line from left to right.
    pub(super) fn level(&self, svg: &mut Svg, y: f64, stroke: Stroke) {
        let (x0, x1) = self.x.values;
        svg.line(&[self.at((x0, y)), self.at((x1, y))], stroke);
    }

    fn upright(&self, svg: &mut Svg, x: f64, stroke: Stroke) {
        let (y0, y1) = self.y.values;
        svg.line(&[self.at((x, y0)), self.at((x, y1))], stroke);
    }

    /// Marks the panel's times.
    pub(super) fn marks(&self, svg: &mut Svg, marks: &[f64]) {
        for mark in seen(marks, self.x.values) {
            self.upright(svg, mark, Stroke::new(colour::LIMIT, 1));
        }
    }

    /// Draws the grid and the numbers of the axes; below the last panel also `x_label`.
    pub(super) fn draw(&self, svg: &mut Svg, x_label: &str, grid: Grid) {
        let (left, right) = self.x.pixels;
        let (bottom, top) = self.y.pixels;
        let grey = Stroke::new(colour::GRID, 1);
        let ink = Stroke::new(colour::INK, 1);
        let numbers = ((bottom - top) / 28.0).clamp(3.0, 11.0) as usize;
        if grid != Grid::Upright {
            for y in self.y.ticks(numbers) {
                if grid == Grid::Both {
                    self.level(svg, y, grey);
                }
                svg.text((left - 6.0, self.y.at(y)), SMALL, Anchor::End, &tick(y));
            }
        }
        for x in self.x.ticks(11) {
            if grid != Grid::Covered {
                self.upright(svg, x, grey);
            }
            if self.below > 0 {
                let at = (self.x.at(x), bottom + 11.0);
                svg.text(at, SMALL, Anchor::Middle, &tick(x));
            }
        }
        svg.line(&[(left, top), (left, bottom), (right, bottom)], ink);
        if self.below > 0 {
            let at = (0.5 * (left + right), bottom + 30.0);
            svg.text(at, SMALL, Anchor::Middle, x_label);
        }
    }
}

/// The marks that can be distinguished: inside `range`, and the first of each pixel. A run may have a hundred
/// thousand.
pub(super) fn seen(marks: &[f64], range: (f64, f64)) -> Vec<f64> {
    let scale = Scale {
        values: range,
        pixels: (0.0, f64::from(WIDTH - 15 - LEFT)),
    };
    let (from, to) = range;
    let inside = marks.iter().copied().filter(|m| (from..=to).contains(m));
    let mut pixels = BTreeSet::new();
    inside
        .filter(|mark| pixels.insert(scale.at(*mark).round() as u32))
        .collect()
}

fn tick(v: f64) -> String {
    let rounded = (v * 1e6).round() / 1e6;
    // No minus sign on zero.
    format!("{}", rounded + 0.0).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(values: (f64, f64), most: usize) -> Vec<String> {
        let pixels = (0.0, 100.0);
        let all = Scale { values, pixels }.ticks(most);
        all.into_iter().map(tick).collect()
    }

    #[test]
    fn numbers_are_round_few_and_inside() {
        assert_eq!(ticks((0.0, 10.0), 11).len(), 11);
        assert_eq!(
            ticks((-0.05, 1.5), 11),
            ["0", "0.2", "0.4", "0.6", "0.8", "1", "1.2", "1.4"]
        );
        assert_eq!(
            ticks((-60.0, 60.0), 10),
            ["−60", "−40", "−20", "0", "20", "40", "60"]
        );
        assert_eq!(ticks((3.31, 3.37), 3), ["3.32", "3.34", "3.36"]);
        assert_eq!(ticks((1e-7, 2.0), 3), ["1", "2"]);
    }

    #[test]
    fn marks_are_drawn_once_a_pixel_and_few_are_all_kept() {
        let few = [-1.0, 0.0, 2.5, 2.6, 10.0, 11.0];
        assert_eq!(seen(&few, (0.0, 10.0)), [0.0, 2.5, 2.6, 10.0]);
        let many: Vec<f64> = (0..100_000).map(|k| f64::from(k) * 1e-4).collect();
        let drawn = seen(&many, (0.0, 10.0));
        assert!((800..=900).contains(&drawn.len()), "{}", drawn.len());
        let gaps = drawn.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(gaps.fold(0.0, f64::max) < 0.013);
        assert_eq!(seen(&many, (1.0, 1.0)), [1.0]);
    }

    #[test]
    fn a_range_without_length_has_no_numbers() {
        assert!(ticks((1.0, 1.0), 5).is_empty());
    }

    #[test]
    fn values_grow_upwards_from_the_lower_left() {
        let scale = Scale {
            values: (10.0, 20.0),
            pixels: (200.0, 100.0),
        };
        assert_eq!(
            [scale.at(10.0), scale.at(15.0), scale.at(20.0)],
            [200.0, 150.0, 100.0]
        );
    }
}
