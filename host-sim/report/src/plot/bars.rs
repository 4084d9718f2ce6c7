//! Horizontal bars: one row per compared item, one column per quantity.

use super::svg::{Anchor, SMALL, Stroke, Svg};
use super::{Colour, LEFT, WIDTH, colour};

/// Rows and columns of bars.
pub struct Bars {
    /// Name and colour of each row.
    pub rows: Vec<(String, Colour)>,
    /// One column of bars per quantity.
    pub columns: Vec<Column>,
}

/// One quantity.
pub struct Column {
    /// The quantity, with its unit.
    pub title: String,
    /// Length of each row's bar; longer than `full` is drawn as `full`.
    pub values: Vec<Option<f64>>,
    /// Text behind each bar.
    pub texts: Vec<String>,
    /// Value of a bar across the whole column.
    pub full: f64,
    /// A limit to be kept.
    pub limit: Option<f64>,
}

/// Width of the names, pixels.
const NAMES: u32 = LEFT + 22;
/// Space for the text behind the longest bar.
const TEXT: u32 = 62;
/// Height of a column's title.
const TITLE: u32 = 22;
/// Height of a row.
const ROW: u32 = 21;

impl Bars {
    /// Height that suits the rows, pixels.
    pub fn height(&self) -> u32 {
        TITLE + ROW * self.rows.len() as u32 + 4
    }

    pub(super) fn draw(&self, svg: &mut Svg, top: u32, height: u32) {
        let row_height = f64::from(height - TITLE - 4) / self.rows.len().max(1) as f64;
        let row_top = |row: usize| f64::from(top + TITLE) + row as f64 * row_height;
        let middle = |row: usize| row_top(row) + 0.5 * row_height;
        for (row, (name, _)) in self.rows.iter().enumerate() {
            let at = (f64::from(NAMES) - 8.0, middle(row));
            svg.text(at, SMALL, Anchor::End, name);
        }
        let width = f64::from(WIDTH - NAMES - 8) / self.columns.len().max(1) as f64;
        for (i, column) in self.columns.iter().enumerate() {
            let left = f64::from(NAMES) + i as f64 * width;
            let title = (left, f64::from(top) + 10.0);
            svg.text(title, SMALL, Anchor::Start, &column.title);
            let longest = width - f64::from(TEXT);
            let length = |value: f64| longest * (value / column.full).clamp(0.0, 1.0);
            for (row, (_, colour)) in self.rows.iter().enumerate() {
                let value = column.values.get(row).copied().flatten();
                let bar = length(value.unwrap_or(0.0));
                let from = (left, row_top(row) + 0.16 * row_height);
                let to = (left + bar.max(1.0), row_top(row) + 0.84 * row_height);
                svg.rectangle(from, to, *colour, 1.0);
                let label = column.texts.get(row).map_or("", String::as_str);
                let behind = (left + bar + 5.0, middle(row));
                svg.text(behind, SMALL, Anchor::Start, label);
            }
            if let Some(limit) = column.limit.filter(|l| *l <= column.full) {
                let x = left + length(limit);
                let ends = [(x, row_top(0)), (x, row_top(self.rows.len()))];
                svg.line(&ends, Stroke::new(colour::LIMIT, 1));
            }
        }
    }
}
