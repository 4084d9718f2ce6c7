//! Horizontal bars: one row per thing compared, one column per quantity.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{FONT, LEFT, WIDTH, colour, text};

/// Rows and columns of bars.
pub struct Bars {
    /// Name and colour of each row.
    pub rows: Vec<(String, RGBColor)>,
    /// One column of bars a quantity.
    pub columns: Vec<Column>,
}

/// One quantity.
pub struct Column {
    /// What it is, with the unit.
    pub title: String,
    /// Length of each row's bar; longer than `full` is drawn as `full`.
    pub values: Vec<Option<f64>>,
    /// What stands behind each bar.
    pub texts: Vec<String>,
    /// Value of a bar over the whole column.
    pub full: f64,
    /// A limit to be kept.
    pub limit: Option<f64>,
}

/// Width of the names, pixels at scale 1.
const NAMES: u32 = LEFT + 22;
/// Space for the text behind the longest bar.
const TEXT: u32 = 62;
/// Height of a column's title.
const TITLE: u32 = 22;

impl Bars {
    /// Height that suits the rows, pixels at scale 1.
    pub fn height(&self) -> u32 {
        TITLE + 21 * self.rows.len() as u32 + 4
    }

    pub(super) fn draw<B: DrawingBackend>(
        &self,
        body: &DrawingArea<B, Shift>,
        scale: u32,
        height: u32,
    ) -> Result<(), String> {
        let s = f64::from(scale);
        let font = |size: u32| (FONT, size * scale).into_font().color(&colour::INK);
        let at = |x: f64, y: f64| ((x * s).round() as i32, (y * s).round() as i32);
        let row_height = f64::from(height - TITLE - 4) / self.rows.len().max(1) as f64;
        let top = |row: usize| f64::from(TITLE) + row as f64 * row_height;
        for (row, (name, _)) in self.rows.iter().enumerate() {
            let (w, h) = body.estimate_text_size(name, &font(13)).map_err(text)?;
            let (x, y) = at(f64::from(NAMES) - 8.0, top(row) + 0.5 * row_height);
            body.draw_text(name, &font(13), (x - w as i32, y - h as i32 / 2))
                .map_err(text)?;
        }
        let width = f64::from(WIDTH - NAMES - 8) / self.columns.len().max(1) as f64;
        for (i, column) in self.columns.iter().enumerate() {
            let left = f64::from(NAMES) + i as f64 * width;
            body.draw_text(&column.title, &font(13), at(left, 3.0))
                .map_err(text)?;
            let longest = width - f64::from(TEXT);
            let length = |value: f64| longest * (value / column.full).clamp(0.0, 1.0);
            for (row, (_, colour)) in self.rows.iter().enumerate() {
                let value = column.values.get(row).copied().flatten();
                let bar = length(value.unwrap_or(0.0));
                let corners = [
                    at(left, top(row) + 0.16 * row_height),
                    at(left + bar.max(1.0), top(row) + 0.84 * row_height),
                ];
                body.draw(&Rectangle::new(corners, colour.filled()))
                    .map_err(text)?;
                let label = column.texts.get(row).map_or("", String::as_str);
                let (_, h) = body.estimate_text_size(label, &font(13)).map_err(text)?;
                let (x, y) = at(left + bar + 5.0, top(row) + 0.5 * row_height);
                body.draw_text(label, &font(13), (x, y - h as i32 / 2))
                    .map_err(text)?;
            }
            if let Some(limit) = column.limit.filter(|l| *l <= column.full) {
                let x = left + length(limit);
                let ends = vec![at(x, f64::from(TITLE)), at(x, top(self.rows.len()))];
                let stroke = colour::LIMIT.stroke_width(scale);
                body.draw(&PathElement::new(ends, stroke)).map_err(text)?;
            }
        }
        Ok(())
    }
}
