//! Drawing of figures: stacked panels of lines, rasters, maps and bars, to PNG and SVG.

mod axes;
mod bars;
pub mod colour;
mod heat;
mod lines;
mod raster;

use std::path::Path;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

pub use bars::{Bars, Column};
pub use heat::Heat;
pub use lines::{Lines, Series, line};
pub use plotters::style::RGBColor;
pub use raster::{RasterRow, runs};

use crate::ReportError;

/// What a panel holds.
pub enum Content {
    /// Curves over a common abscissa.
    Lines(Lines),
    /// Rows of on and off, such as valves.
    Raster(Vec<RasterRow>),
    /// A map of values in colour.
    Heat(Heat),
    /// Bars, without an axis.
    Bars(Bars),
}

/// Label (with the unit) and range of an axis.
pub type Axis<'a> = (&'a str, (f64, f64));

impl Content {
    /// Lines over time.
    pub fn lines(y: Axis<'_>, series: Vec<Series>) -> Self {
        Self::curves(TIME, y, series)
    }

    /// Lines over anything.
    pub fn curves(x_label: &str, (y_label, y_range): Axis<'_>, series: Vec<Series>) -> Self {
        Self::Lines(Lines {
            series,
            limits: Vec::new(),
            x_label: x_label.to_owned(),
            y_label: y_label.to_owned(),
            y_range,
        })
    }

    /// With horizontal lines at `limits`.
    pub fn limited(mut self, limits: &[f64]) -> Self {
        if let Self::Lines(lines) = &mut self {
            lines.limits.extend(limits);
        }
        self
    }
}

/// One panel of a figure.
pub struct Panel {
    /// Heading above the panel.
    pub title: String,
    /// From and to, of the abscissa.
    pub x_range: (f64, f64),
    /// Vertical marks, such as the time of an event.
    pub marks: Vec<f64>,
    /// What is drawn.
    pub content: Content,
    /// Height in pixels at scale 1.
    pub height: u32,
    /// Label of the abscissa of a raster; lines have their own.
    raster_x: &'static str,
}

/// A figure: panels one below the other, with a common axis below the last before
/// bars or the end.
pub struct Figure {
    /// File name without extension.
    pub id: String,
    /// Heading of the figure.
    pub title: String,
    /// What the reader sees in it.
    pub caption: String,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// Width in pixels at scale 1.
const WIDTH: u32 = 940;
/// PNG files are drawn at this multiple.
const PNG_SCALE: u32 = 2;
const FONT: &str = "sans-serif";
const TITLE_HEIGHT: u32 = 26;
const AXIS_HEIGHT: u32 = 40;
const LEFT: u32 = 72;
const TIME: &str = "time [s]";

/// Makes the built-in font known to the drawing library, so that figures need
/// no font of the machine.
fn fonts() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // A font that the crate ships and that parses; failure would show as
        // an error of every text drawn.
        let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
    });
}

impl Figure {
    /// Height of the axis below panel `i`: bars have none.
    fn axis(&self, i: usize) -> u32 {
        let is_bars = |p: &Panel| matches!(p.content, Content::Bars(_));
        let last = self.panels.get(i + 1).is_none_or(is_bars);
        if last && !is_bars(&self.panels[i]) {
            AXIS_HEIGHT
        } else {
            0
        }
    }

    fn size(&self) -> (u32, u32) {
        let panels = self.panels.iter().enumerate();
        let heights = panels.map(|(i, p)| p.height + TITLE_HEIGHT + self.axis(i));
        (WIDTH, heights.sum())
    }

    /// The figure as SVG text.
    pub fn svg(&self) -> Result<String, ReportError> {
        fonts();
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, self.size()).into_drawing_area();
            self.draw(&root, 1).map_err(|e| self.failed(&e))?;
        }
        Ok(text)
    }

    /// Writes the figure as PNG. Lines of the bitmap backend have hard edges,
    /// so it is drawn at twice the size and averaged down.
    pub fn png(&self, path: &Path) -> Result<(), ReportError> {
        fonts();
        let (w, h) = self.size();
        let (w, h) = (w * PNG_SCALE, h * PNG_SCALE);
        let mut fine = vec![0; (2 * w * 2 * h * 3) as usize];
        {
            let root = BitMapBackend::with_buffer(&mut fine, (2 * w, 2 * h)).into_drawing_area();
            self.draw(&root, 2 * PNG_SCALE)
                .map_err(|e| self.failed(&e))?;
        }
        let smooth = halve(&fine, w as usize, h as usize);
        let mut file = BitMapBackend::new(path, (w, h));
        file.blit_bitmap((0, 0), (w, h), &smooth)
            .and_then(|()| file.present())
            .map_err(|e| self.failed(&text(e)))
    }

    fn failed(&self, error: &str) -> ReportError {
        ReportError::Plot {
            figure: self.title.clone(),
            reason: error.to_owned(),
        }
    }

    fn draw<B: DrawingBackend>(
        &self,
        root: &DrawingArea<B, Shift>,
        scale: u32,
    ) -> Result<(), String> {
        root.fill(&colour::PAPER).map_err(text)?;
        let mut rest = root.clone();
        for (i, panel) in self.panels.iter().enumerate() {
            let axis = self.axis(i);
            let height = (panel.height + TITLE_HEIGHT + axis) * scale;
            let (area, below) = rest.split_vertically(height);
            panel.draw(&area, scale, axis * scale)?;
            rest = below;
        }
        root.present().map_err(text)
    }
}

fn text<E: std::fmt::Display>(error: E) -> String {
    error.to_string()
}

impl Panel {
    /// A panel without marks.
    pub fn new(
        title: impl Into<String>,
        x_range: (f64, f64),
        height: u32,
        content: Content,
    ) -> Self {
        Self {
            title: title.into(),
            x_range,
            marks: Vec::new(),
            content,
            height,
            raster_x: TIME,
        }
    }

    /// Names the abscissa of lines and rasters, where time has a zero of its own.
    pub fn over(mut self, x_label: &'static str) -> Self {
        if let Content::Lines(lines) = &mut self.content {
            lines.x_label = x_label.to_owned();
        }
        self.raster_x = x_label;
        self
    }

    /// Leaves the legend to another panel, but for the lines `named`.
    pub fn name_only(&mut self, named: std::ops::Range<usize>) {
        if let Content::Lines(lines) = &mut self.content {
            let unnamed = lines.series.iter_mut().enumerate();
            for (_, line) in unnamed.filter(|(i, _)| !named.contains(i)) {
                line.label.clear();
            }
        }
    }

    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        scale: u32,
        axis_px: u32,
    ) -> Result<(), String> {
        let (head, body) = area.split_vertically(TITLE_HEIGHT * scale);
        self.head(&head, scale)?;
        match &self.content {
            Content::Lines(lines) => self.draw_lines(&body, scale, axis_px, lines),
            Content::Raster(rows) => self.draw_raster(&body, scale, axis_px, rows),
            Content::Heat(heat) => self.draw_heat(&body, scale, axis_px, heat),
            Content::Bars(bars) => bars.draw(&body, scale, self.height),
        }
    }

    /// Title at the left, legend after it.
    fn head<B: DrawingBackend>(
        &self,
        head: &DrawingArea<B, Shift>,
        scale: u32,
    ) -> Result<(), String> {
        let s = scale as i32;
        let style = |size: u32| (FONT, size * scale).into_font().color(&colour::INK);
        let title = style(15);
        let y = 6 * s;
        let words = match &self.content {
            Content::Lines(lines) => format!("{} {}", self.title, lines.y_label),
            Content::Raster(_) | Content::Bars(_) => self.title.clone(),
            Content::Heat(heat) => format!("{}: {}", self.title, heat.legend),
        };
        head.draw_text(&words, &title, (LEFT as i32 * s, y))
            .map_err(text)?;
        let Content::Lines(Lines { series, .. }) = &self.content else {
            return Ok(());
        };
        let (width, _) = head.estimate_text_size(&words, &title).map_err(text)?;
        let mut x = LEFT as i32 * s + width as i32 + 24 * s;
        let label = style(13);
        for line in series.iter().filter(|l| !l.label.is_empty()) {
            let stroke = line.colour.stroke_width((line.width + 1) * scale);
            let mid = y + 7 * s;
            head.draw(&PathElement::new(vec![(x, mid), (x + 18 * s, mid)], stroke))
                .map_err(text)?;
            x += 23 * s;
            head.draw_text(&line.label, &label, (x, y + s))
                .map_err(text)?;
            let (w, _) = head.estimate_text_size(&line.label, &label).map_err(text)?;
            x += w as i32 + 16 * s;
        }
        Ok(())
    }
}

/// Averages blocks of two by two pixels; `w` and `h` are those of the result.
fn halve(fine: &[u8], w: usize, h: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(w * h * 3);
    for rows in fine.chunks_exact(2 * w * 6).take(h) {
        let (upper, lower) = rows.split_at(w * 6);
        for (a, b) in upper.chunks_exact(6).zip(lower.chunks_exact(6)) {
            for c in 0..3 {
                let sum =
                    u16::from(a[c]) + u16::from(a[c + 3]) + u16::from(b[c]) + u16::from(b[c + 3]);
                out.push((sum / 4) as u8);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_averages_each_block() {
        // Two by two pixels become one.
        let fine = [0, 10, 20, 40, 10, 20, 80, 10, 20, 120, 10, 20];
        assert_eq!(halve(&fine, 1, 1), [60, 10, 20]);
        assert_eq!(halve(&[7; 4 * 6 * 3], 3, 2), [7; 18]);
    }
}
