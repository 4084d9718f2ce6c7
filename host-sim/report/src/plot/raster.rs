//! Rasters: one row per signal that is on or off, paler for a smaller share.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::axes::Grid;
use super::{FONT, LEFT, Panel, colour, text};

/// One row of a raster: runs of (from, to, intensity 0..1).
pub struct RasterRow {
    /// Text beside the row.
    pub label: String,
    /// Colour of what is on.
    pub colour: RGBColor,
    /// Drawn in the upper half of the row.
    pub upper: Vec<(f64, f64, f64)>,
    /// Drawn in the lower half of the row; empty rows use the full height for
    /// the upper runs.
    pub lower: Option<Vec<(f64, f64, f64)>>,
}

impl Panel {
    pub(super) fn draw_raster<B: DrawingBackend>(
        &self,
        body: &DrawingArea<B, Shift>,
        scale: u32,
        axis_px: u32,
        rows: &[RasterRow],
    ) -> Result<(), String> {
        let (x0, x1) = self.x_range;
        let n = rows.len().max(1) as f64;
        let mut chart = self.chart(body, scale, axis_px, (0.0, n))?;
        let font = (FONT, 13 * scale).into_font().color(&colour::INK);
        self.draw_axes(&mut chart, scale, axis_px, self.raster_x, Grid::Upright)?;
        for (i, row) in rows.iter().enumerate() {
            let top = n - i as f64 - 0.08;
            let bottom = n - i as f64 - 0.92;
            let middle = 0.5 * (top + bottom);
            let halves = match &row.lower {
                Some(lower) => vec![(&row.upper, middle, top), (lower, bottom, middle - 0.04)],
                None => vec![(&row.upper, bottom, top)],
            };
            for (k, (runs, low, high)) in halves.into_iter().enumerate() {
                for (from, to, level) in runs {
                    // The physical half is drawn in ink, the commanded in colour.
                    let base = if k == 0 { row.colour } else { colour::INK };
                    let fill = base.mix(0.15 + 0.85 * level.clamp(0.0, 1.0)).filled();
                    let corners = [(from.max(x0), low), (to.min(x1), high)];
                    if corners[0].0 < corners[1].0 {
                        chart
                            .draw_series(std::iter::once(Rectangle::new(corners, fill)))
                            .map_err(text)?;
                    }
                }
            }
            let (_, y) = chart.backend_coord(&(x0, middle));
            let (_, by) = body.get_base_pixel();
            let (w, h) = body.estimate_text_size(&row.label, &font).map_err(text)?;
            let at = (
                LEFT as i32 * scale as i32 - w as i32 - 8 * scale as i32,
                y - by - h as i32 / 2 - scale as i32,
            );
            body.draw_text(&row.label, &font, at).map_err(text)?;
        }
        self.draw_marks(&mut chart, scale, (0.0, n))?;
        Ok(())
    }
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
