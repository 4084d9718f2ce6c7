//! Maps: one colour per cell.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::axes::Grid;
use super::{Panel, colour, text};

/// Cells of a map, from the lower left, row by row upwards.
pub struct Heat {
    /// Columns of the map.
    pub columns: usize,
    /// Values, row by row from below.
    pub values: Vec<f64>,
    /// From and to, of the ordinate.
    pub y_range: (f64, f64),
    /// Label of the abscissa, with its unit.
    pub x_label: String,
    /// What the colours mean, with the unit.
    pub legend: String,
}

impl Panel {
    pub(super) fn draw_heat<B: DrawingBackend>(
        &self,
        body: &DrawingArea<B, Shift>,
        scale: u32,
        axis_px: u32,
        heat: &Heat,
    ) -> Result<(), String> {
        let ((x0, x1), (y0, y1)) = (self.x_range, heat.y_range);
        let mut chart = self.chart(body, scale, axis_px, (y0, y1))?;
        let columns = heat.columns.max(1);
        let rows = heat.values.len().div_ceil(columns).max(1);
        let largest = heat.values.iter().copied().fold(0.0, f64::max);
        let step = ((x1 - x0) / columns as f64, (y1 - y0) / rows as f64);
        for (i, value) in heat.values.iter().enumerate() {
            let (column, row) = ((i % columns) as f64, (i / columns) as f64);
            let corner = (x0 + column * step.0, y0 + row * step.1);
            let share = if largest > 0.0 { value / largest } else { 0.0 };
            let cell = Rectangle::new(
                [corner, (corner.0 + step.0, corner.1 + step.1)],
                colour::heat(share).filled(),
            );
            chart.draw_series(std::iter::once(cell)).map_err(text)?;
        }
        self.draw_axes(&mut chart, scale, axis_px, &heat.x_label, Grid::Covered)
    }
}
