//! Rasters: one row per signal that is on or off, paler for a smaller share.

use super::axes::{Axes, Grid};
use super::svg::{Anchor, SMALL, Svg};
use super::{Colour, LEFT, Panel, colour};

/// One row of a raster: runs of (from, to, intensity 0..1).
pub struct RasterRow {
    /// Text beside the row.
    pub label: String,
    /// Colour of the "on" state.
    pub colour: Colour,
    /// Drawn in the upper half of the row.
    pub upper: Vec<(f64, f64, f64)>,
    /// Drawn in the lower half of the row; empty rows use the full height for
    /// the upper runs.
    pub lower: Option<Vec<(f64, f64, f64)>>,
}

/// Draws the rows from top to bottom; the ordinate of `axes` counts them.
pub(super) fn draw(rows: &[RasterRow], svg: &mut Svg, axes: &Axes, panel: &Panel) {
    let (x0, x1) = panel.x_range;
    axes.draw(svg, panel.raster_x, Grid::Upright);
    for (i, row) in rows.iter().enumerate() {
        let below = (rows.len() - i) as f64;
        let (top, bottom) = (below - 0.08, below - 0.92);
        let middle = 0.5 * (top + bottom);
        // The physical half is drawn in ink, the commanded in colour.
        let halves = match &row.lower {
            Some(lower) => vec![
                (&row.upper, middle, top, row.colour),
                (lower, bottom, middle - 0.04, colour::INK),
            ],
            None => vec![(&row.upper, bottom, top, row.colour)],
        };
        for (runs, low, high, colour) in halves {
            for (from, to, level) in runs {
                let (from, to) = (from.max(x0), to.min(x1));
                if from < to {
                    let opacity = 0.15 + 0.85 * level.clamp(0.0, 1.0);
                    svg.rectangle(axes.at((from, low)), axes.at((to, high)), colour, opacity);
                }
            }
        }
        let (_, y) = axes.at((x0, middle));
        let at = (f64::from(LEFT) - 8.0, y);
        svg.text(at, SMALL, Anchor::End, &row.label);
    }
    axes.marks(svg, &panel.marks);
}

/// Runs of equal level from a sampled signal, in bins of `bin` samples; levels
/// are means over a bin in eighths, runs of zero are left out.
pub fn runs(
    samples: impl Iterator<Item = (f64, f64)>,
    bin: usize,
    sample_s: f64,
) -> Vec<(f64, f64, f64)> {
    let samples: Vec<(f64, f64)> = samples.collect();
    let mut runs: Vec<(f64, f64, f64)> = Vec::new();
    for chunk in samples.chunks(bin.max(1)) {
        let level = chunk.iter().map(|s| s.1).sum::<f64>() / chunk.len() as f64;
        let level = (level * 8.0).ceil() / 8.0;
        if level <= 0.0 {
            continue;
        }
        let from = chunk[0].0;
        let to = chunk[chunk.len() - 1].0 + sample_s;
        match runs.last_mut() {
            Some(last) if last.2 == level && from - last.1 < 0.5 * sample_s => last.1 = to,
            _ => runs.push((from, to, level)),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_merge_and_leave_out_zero() {
        let samples = (0..10).map(|i| (f64::from(i), f64::from(u8::from((2..6).contains(&i)))));
        assert_eq!(runs(samples, 1, 1.0), vec![(2.0, 6.0, 1.0)]);
    }
}
