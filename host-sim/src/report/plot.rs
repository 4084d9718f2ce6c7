//! Drawing of figures: stacked panels of lines, and rasters, to PNG and SVG.

mod bars;

use std::path::Path;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

pub(crate) use bars::{Bars, Column};

use crate::SimError;

/// Colours with a role; the report's style sheet maps them for dark screens.
pub(crate) mod colour {
    use plotters::style::RGBColor;
    pub(crate) const INK: RGBColor = RGBColor(0x2B, 0x33, 0x3D);
    pub(crate) const GRID: RGBColor = RGBColor(0xE4, 0xE7, 0xEB);
    pub(crate) const PAPER: RGBColor = RGBColor(0xFF, 0xFF, 0xFF);
    pub(crate) const MODEL: RGBColor = RGBColor(0x1F, 0x6F, 0xC4);
    pub(crate) const DELAYED: RGBColor = RGBColor(0x8F, 0xBC, 0xE6);
    pub(crate) const ROBOT: RGBColor = RGBColor(0xD9, 0x4F, 0x0B);
    pub(crate) const RAW: RGBColor = RGBColor(0xE6, 0xC3, 0xAE);
    pub(crate) const COMMAND: RGBColor = RGBColor(0x9A, 0xA3, 0xAD);
    pub(crate) const SECOND: RGBColor = RGBColor(0x12, 0x8A, 0x6B);
    pub(crate) const THIRD: RGBColor = RGBColor(0x8A, 0x4F, 0xBE);
    pub(crate) const LIMIT: RGBColor = RGBColor(0xC2, 0x2E, 0x3A);
    /// From light (0) over blue to dark violet (1), for maps.
    pub(crate) fn heat(share: f64) -> RGBColor {
        const STOPS: [[f64; 3]; 3] = [
            [236.0, 241.0, 247.0],
            [31.0, 111.0, 196.0],
            [74.0, 20.0, 92.0],
        ];
        let at = 2.0 * share.clamp(0.0, 1.0);
        let (from, to, part) = if at < 1.0 {
            (STOPS[0], STOPS[1], at)
        } else {
            (STOPS[1], STOPS[2], at - 1.0)
        };
        let mixed = |i: usize| (from[i] + (to[i] - from[i]) * part).round() as u8;
        RGBColor(mixed(0), mixed(1), mixed(2))
    }
    /// One colour per axis, joints 1 to 6, then wheels.
    pub(crate) const AXES: [RGBColor; 8] = [
        RGBColor(0x8A, 0x4F, 0xBE),
        RGBColor(0x1F, 0x6F, 0xC4),
        RGBColor(0xD9, 0x4F, 0x0B),
        RGBColor(0xB9, 0x8F, 0xDD),
        RGBColor(0x7F, 0xB2, 0xE5),
        RGBColor(0xEE, 0xA0, 0x74),
        RGBColor(0x12, 0x8A, 0x6B),
        RGBColor(0x6F, 0xC4, 0xAC),
    ];
}

/// One line.
pub(crate) struct Series {
    pub(crate) label: String,
    pub(crate) colour: RGBColor,
    pub(crate) width: u32,
    pub(crate) points: Vec<(f64, f64)>,
}

/// A horizontal line with a meaning.
pub(crate) struct Limit {
    pub(crate) y: f64,
}

/// One row of a raster: runs of (from, to, intensity 0..1).
pub(crate) struct RasterRow {
    pub(crate) label: String,
    pub(crate) colour: RGBColor,
    /// Drawn in the upper half of the row.
    pub(crate) upper: Vec<(f64, f64, f64)>,
    /// Drawn in the lower half of the row; empty rows use the full height for
    /// the upper runs.
    pub(crate) lower: Option<Vec<(f64, f64, f64)>>,
}

/// What a panel holds.
pub(crate) enum Content {
    Lines {
        series: Vec<Series>,
        limits: Vec<Limit>,
        y_label: String,
        y_range: (f64, f64),
    },
    Raster {
        rows: Vec<RasterRow>,
    },
    /// Lines over anything but time.
    Curves {
        series: Vec<Series>,
        limits: Vec<Limit>,
        x_label: String,
        y_label: String,
        y_range: (f64, f64),
    },
    /// A map: one colour per cell.
    Heat(Heat),
    /// Bars, without an axis.
    Bars(Bars),
}

/// Cells of a map, from the lower left, row by row upwards.
pub(crate) struct Heat {
    pub(crate) columns: usize,
    pub(crate) values: Vec<f64>,
    pub(crate) y_range: (f64, f64),
    pub(crate) x_label: String,
    /// What the colours mean, with the unit.
    pub(crate) legend: String,
}

/// One panel of a figure.
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) x_range: (f64, f64),
    /// Vertical marks, such as the time of an event.
    pub(crate) marks: Vec<f64>,
    pub(crate) content: Content,
    /// Height in pixels at scale 1.
    pub(crate) height: u32,
}

/// A figure: panels one below the other, with a common axis below the last before
/// bars or the end.
pub(crate) struct Figure {
    /// File name without extension.
    pub(crate) id: String,
    pub(crate) title: String,
    pub(crate) caption: String,
    pub(crate) panels: Vec<Panel>,
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
    pub(crate) fn svg(&self) -> Result<String, SimError> {
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
    pub(crate) fn png(&self, path: &Path) -> Result<(), SimError> {
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

    fn failed(&self, error: &str) -> SimError {
        SimError::Plot {
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

type Chart<'a, B> = ChartContext<'a, B, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn text<E: std::fmt::Display>(error: E) -> String {
    error.to_string()
}

impl Panel {
    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        scale: u32,
        axis_px: u32,
    ) -> Result<(), String> {
        let (head, body) = area.split_vertically(TITLE_HEIGHT * scale);
        self.head(&head, scale)?;
        match &self.content {
            Content::Lines {
                series,
                limits,
                y_range,
                ..
            } => self.lines(&body, scale, (axis_px, TIME), series, limits, *y_range),
            Content::Raster { rows } => self.raster(&body, scale, axis_px, rows),
            Content::Curves {
                series,
                limits,
                x_label,
                y_range,
                ..
            } => self.lines(&body, scale, (axis_px, x_label), series, limits, *y_range),
            Content::Heat(heat) => self.heat(&body, scale, axis_px, heat),
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
            Content::Lines { y_label, .. } | Content::Curves { y_label, .. } => {
                format!("{} {y_label}", self.title)
            }
            Content::Raster { .. } | Content::Bars(_) => self.title.clone(),
            Content::Heat(heat) => format!("{}: {}", self.title, heat.legend),
        };
        head.draw_text(&words, &title, (LEFT as i32 * s, y))
            .map_err(text)?;
        let (Content::Lines { series, .. } | Content::Curves { series, .. }) = &self.content else {
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

    /// A chart over the panel's abscissa.
    fn chart<'a, B: DrawingBackend>(
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
    fn draw_marks<B: DrawingBackend>(
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

    fn lines<B: DrawingBackend>(
        &self,
        body: &DrawingArea<B, Shift>,
        scale: u32,
        (axis_px, x_label): (u32, &str),
        series: &[Series],
        limits: &[Limit],
        (y0, y1): (f64, f64),
    ) -> Result<(), String> {
        let (x0, x1) = self.x_range;
        let mut chart = self.chart(body, scale, axis_px, (y0, y1))?;
        let font = (FONT, 13 * scale).into_font().color(&colour::INK);
        let mut mesh = chart.configure_mesh();
        mesh.bold_line_style(colour::GRID.stroke_width(scale))
            .light_line_style(TRANSPARENT)
            .axis_style(colour::INK.stroke_width(scale))
            .label_style(font.clone())
            .axis_desc_style(font)
            .x_labels(11)
            .y_labels((self.height / 28).clamp(3, 11) as usize)
            .y_label_formatter(&|v| tick(*v))
            .x_label_formatter(&|v| tick(*v));
        if axis_px > 0 {
            mesh.x_desc(x_label);
        }
        mesh.draw().map_err(text)?;
        let clamp = |y: f64| y.clamp(y0, y1);
        for limit in limits {
            let stroke = colour::LIMIT.mix(0.7).stroke_width(scale);
            chart
                .draw_series(std::iter::once(PathElement::new(
                    vec![(x0, clamp(limit.y)), (x1, clamp(limit.y))],
                    stroke,
                )))
                .map_err(text)?;
        }
        self.draw_marks(&mut chart, scale, (y0, y1))?;
        for line in series {
            let columns = 2 * (WIDTH - LEFT) as usize;
            let points: Vec<(f64, f64)> = thin(&line.points, self.x_range, columns)
                .into_iter()
                .map(|(x, y)| (x, clamp(y)))
                .collect();
            let stroke = line.colour.stroke_width(line.width * scale);
            if scale == 1 {
                chart
                    .draw_series(LineSeries::new(points, stroke))
                    .map_err(text)?;
            } else {
                // The bitmap backend's joints shoot far out at sharp turns.
                let segments = points.windows(2);
                chart
                    .draw_series(segments.map(|p| PathElement::new(p.to_vec(), stroke)))
                    .map_err(text)?;
            }
        }
        Ok(())
    }

    fn raster<B: DrawingBackend>(
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
        let mut mesh = chart.configure_mesh();
        mesh.bold_line_style(colour::GRID.stroke_width(scale))
            .light_line_style(TRANSPARENT)
            .disable_y_mesh()
            .axis_style(colour::INK.stroke_width(scale))
            .label_style(font.clone())
            .axis_desc_style(font.clone())
            .x_labels(11)
            .x_label_formatter(&|v| tick(*v))
            .y_labels(0);
        if axis_px > 0 {
            mesh.x_desc("time [s]");
        }
        mesh.draw().map_err(text)?;
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
            let (bx, by) = body.get_base_pixel();
            let (w, h) = body.estimate_text_size(&row.label, &font).map_err(text)?;
            let at = (
                LEFT as i32 * scale as i32 - w as i32 - 8 * scale as i32,
                y - by - h as i32 / 2 - scale as i32,
            );
            let _ = bx;
            body.draw_text(&row.label, &font, at).map_err(text)?;
        }
        self.draw_marks(&mut chart, scale, (0.0, n))?;
        Ok(())
    }
}

impl Panel {
    fn heat<B: DrawingBackend>(
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
        let font = (FONT, 13 * scale).into_font().color(&colour::INK);
        let mut mesh = chart.configure_mesh();
        mesh.disable_mesh()
            .axis_style(colour::INK.stroke_width(scale))
            .label_style(font.clone())
            .axis_desc_style(font)
            .x_labels(11)
            .y_labels((self.height / 28).clamp(3, 11) as usize)
            .y_label_formatter(&|v| tick(*v))
            .x_label_formatter(&|v| tick(*v));
        if axis_px > 0 {
            mesh.x_desc(heat.x_label.as_str());
        }
        mesh.draw().map_err(text)
    }
}

fn tick(v: f64) -> String {
    let rounded = (v * 1e6).round() / 1e6;
    // No minus sign on zero.
    format!("{}", rounded + 0.0).replace('-', "−")
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

/// Keeps the smallest and largest value of each of `columns` columns, so that
/// a long record draws quickly and no peak is lost.
fn thin(points: &[(f64, f64)], (x0, x1): (f64, f64), columns: usize) -> Vec<(f64, f64)> {
    let from = points.partition_point(|p| p.0 < x0);
    let to = points.partition_point(|p| p.0 <= x1);
    let points = &points[from..to];
    if points.len() <= 2 * columns {
        return points.to_vec();
    }
    let mut out = Vec::with_capacity(2 * columns);
    for chunk in points.chunks(points.len().div_ceil(columns)) {
        let lo = chunk.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let hi = chunk.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let (Some(lo), Some(hi)) = (lo, hi) {
            let (first, second) = if lo.0 <= hi.0 { (lo, hi) } else { (hi, lo) };
            out.push(*first);
            if first != second {
                out.push(*second);
            }
        }
    }
    out
}

/// Runs of equal level from a sampled signal, in bins of `bin` samples; levels
/// are means over a bin in eighths, runs of zero are left out.
pub(crate) fn runs(
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
    fn thinning_keeps_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 0.0)).collect();
        points[51_234].1 = 7.0;
        points[77_777].1 = -3.0;
        let thin = thin(&points, (0.0, 1e6), 900);
        assert!(thin.len() <= 1800);
        assert!(thin.contains(&(51_234.0, 7.0)) && thin.contains(&(77_777.0, -3.0)));
        assert!(thin.windows(2).all(|w| w[0].0 < w[1].0));
    }

    #[test]
    fn halving_averages_each_block() {
        // Two by two pixels become one.
        let fine = [0, 10, 20, 40, 10, 20, 80, 10, 20, 120, 10, 20];
        assert_eq!(halve(&fine, 1, 1), [60, 10, 20]);
        assert_eq!(halve(&[7; 4 * 6 * 3], 3, 2), [7; 18]);
    }

    #[test]
    fn runs_merge_and_leave_out_zero() {
        let samples = (0..10).map(|i| (f64::from(i), f64::from(u8::from((2..6).contains(&i)))));
        assert_eq!(runs(samples, 1, 1.0), vec![(2.0, 6.0, 1.0)]);
    }
}
