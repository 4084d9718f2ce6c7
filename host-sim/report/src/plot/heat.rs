//! Maps: one colour per cell.

use super::axes::{Axes, Grid};
use super::colour;
use super::svg::Svg;

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

impl Heat {
    pub(super) fn draw(&self, svg: &mut Svg, axes: &Axes, (x0, x1): (f64, f64)) {
        let (y0, y1) = self.y_range;
        let columns = self.columns.max(1);
        let rows = self.values.len().div_ceil(columns).max(1);
        let largest = self.values.iter().copied().fold(0.0, f64::max);
        let step = ((x1 - x0) / columns as f64, (y1 - y0) / rows as f64);
        for (i, value) in self.values.iter().enumerate() {
            let (column, row) = ((i % columns) as f64, (i / columns) as f64);
            let corner = (x0 + column * step.0, y0 + row * step.1);
            let other = (corner.0 + step.0, corner.1 + step.1);
            let share = if largest > 0.0 { value / largest } else { 0.0 };
            svg.rectangle(axes.at(corner), axes.at(other), colour::heat(share), 1.0);
        }
        axes.draw(svg, &self.x_label, Grid::Covered);
    }
}
