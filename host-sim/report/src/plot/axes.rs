//! Axes, grid and marks, which lines, rasters and maps have in common.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::{FONT, LEFT, Panel, colour, text};

pub(super) type Chart<'a, B> = ChartContext<'a, B, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

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

impl Panel {
    /// A chart over the panel's abscissa.
    pub(super) fn chart<'a, B: DrawingBackend>(
        &self,
        body: &'a DrawingArea<B, Shift>,
        scale: u32,
        axis_px: u32,
        (y0, y1): (f64, f64),
    ) -> Result<Chart<'a, B>, String> {
        let (x0, x1) = self.x_range;
        ChartBuilder::on(body)
            .margin_right(14 * scale)
            .margin_top(3 * scale)
            .margin_bottom(5 * scale)
            .set_label_area_size(LabelAreaPosition::Left, LEFT * scale)
            .set_label_area_size(LabelAreaPosition::Bottom, axis_px)
            .build_cartesian_2d(x0..x1, y0..y1)
            .map_err(text)
    }

    /// Marks the panel's times from `y0` to `y1`.
    pub(super) fn draw_marks<B: DrawingBackend>(
        &self,
        chart: &mut Chart<'_, B>,
        scale: u32,
        (y0, y1): (f64, f64),
    ) -> Result<(), String> {
        let (x0, x1) = self.x_range;
        for mark in self.marks.iter().filter(|m| (x0..=x1).contains(*m)) {
            let stroke = colour::LIMIT.stroke_width(scale);
            let line = PathElement::new(vec![(*mark, y0), (*mark, y1)], stroke);
            chart.draw_series(std::iter::once(line)).map_err(text)?;
        }
        Ok(())
    }

    /// Draws the grid and the numbers of the axes; below the last panel
    /// (`axis_px` above zero) also `x_label`.
    pub(super) fn draw_axes<B: DrawingBackend>(
        &self,
        chart: &mut Chart<'_, B>,
        scale: u32,
        axis_px: u32,
        x_label: &str,
        grid: Grid,
    ) -> Result<(), String> {
        let font = (FONT, 13 * scale).into_font().color(&colour::INK);
        let y_labels = match grid {
            Grid::Both | Grid::Covered => (self.height / 28).clamp(3, 11) as usize,
            Grid::Upright => 0,
        };
        let mut mesh = chart.configure_mesh();
        mesh.bold_line_style(colour::GRID.stroke_width(scale))
            .light_line_style(TRANSPARENT)
            .axis_style(colour::INK.stroke_width(scale))
            .label_style(font.clone())
            .axis_desc_style(font)
            .x_labels(11)
            .y_labels(y_labels)
            .y_label_formatter(&|v| tick(*v))
            .x_label_formatter(&|v| tick(*v));
        match grid {
            Grid::Both => {}
            Grid::Upright => {
                mesh.disable_y_mesh();
            }
            Grid::Covered => {
                mesh.disable_mesh();
            }
        }
        if axis_px > 0 {
            mesh.x_desc(x_label);
        }
        mesh.draw().map_err(text)
    }
}

fn tick(v: f64) -> String {
    let rounded = (v * 1e6).round() / 1e6;
    // No minus sign on zero.
    format!("{}", rounded + 0.0).replace('-', "−")
}
