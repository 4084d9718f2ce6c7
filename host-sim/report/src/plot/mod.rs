//! Drawing of figures: stacked panels of lines, rasters, maps and bars, as SVG.

mod axes;
mod bars;
pub mod colour;
mod data;
mod heat;
mod lines;
#[cfg(feature = "png")]
mod png;
mod raster;
mod simplify;
mod svg;

use std::path::Path;

use axes::Axes;
pub use bars::{Bars, Column};
pub use colour::Colour;
pub(crate) use data::PanelData;
pub use heat::Heat;
pub use lines::{Lines, Series, line};
pub use raster::{RasterRow, runs};
use svg::{Stroke, Svg};

use crate::ReportError;

/// Contents of a panel.
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
            named: 0..series.len(),
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
    /// Meaning of the marks, for the legend.
    pub marked: &'static str,
    /// Its contents.
    pub content: Content,
    /// Height in pixels.
    pub height: u32,
    /// Whether the abscissa is the page's clock: then its cursor is shown there, too.
    pub on_clock: bool,
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
    /// Explanation for the reader.
    pub caption: String,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// Width in pixels.
const WIDTH: u32 = 940;
const TITLE_HEIGHT: u32 = 26;
const AXIS_HEIGHT: u32 = 40;
const LEFT: u32 = 72;
const TIME: &str = "time [s]";

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
    pub fn svg(&self) -> String {
        let (width, height) = self.size();
        let mut svg = Svg::new(width, height);
        let mut top = 0;
        for (i, panel) in self.panels.iter().enumerate() {
            let axis = self.axis(i);
            panel.draw(&mut svg, top, axis);
            top += TITLE_HEIGHT + panel.height + axis;
        }
        svg.finish()
    }

    /// Every panel as a picture of its own, with its axis.
    pub(crate) fn panel_svgs(&self) -> impl Iterator<Item = String> + '_ {
        self.panels.iter().map(|panel| {
            let axis = match panel.content {
                Content::Bars(_) => 0,
                _ => AXIS_HEIGHT,
            };
            let mut svg = Svg::new(WIDTH, TITLE_HEIGHT + panel.height + axis);
            panel.draw(&mut svg, 0, axis);
            svg.finish()
        })
    }

    /// Writes the figure as PNG, at twice the size.
    ///
    /// # Errors
    /// As [`ensure_png`]; [`ReportError::Plot`] if the file cannot be written.
    pub fn png(&self, path: &Path) -> Result<(), ReportError> {
        ensure_png()?;
        #[cfg(feature = "png")]
        png::write(&self.svg(), path).map_err(|reason| ReportError::Plot {
            figure: self.title.clone(),
            reason,
        })?;
        #[cfg(not(feature = "png"))]
        let _ = path;
        Ok(())
    }
}

/// Refuses PNG in a program that cannot write it, before any figure is computed.
///
/// # Errors
/// [`ReportError::NoPng`] in a program that was built without the feature `png`.
pub const fn ensure_png() -> Result<(), ReportError> {
    if cfg!(feature = "png") {
        Ok(())
    } else {
        Err(ReportError::NoPng)
    }
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
            marked: "mark",
            content,
            height,
            on_clock: false,
            raster_x: TIME,
        }
    }

    /// Labels the abscissa of lines and rasters whose time has its own zero.
    pub fn over(mut self, x_label: &'static str) -> Self {
        if let Content::Lines(lines) = &mut self.content {
            lines.x_label = x_label.to_owned();
        }
        self.raster_x = x_label;
        self
    }

    /// Leaves the picture's legend to another panel, except for the lines `named`.
    pub fn name_only(&mut self, named: std::ops::Range<usize>) {
        if let Content::Lines(lines) = &mut self.content {
            lines.named = named;
        }
    }

    /// Draws the panel below `top`, with `axis` pixels for the abscissa's numbers.
    fn draw(&self, svg: &mut Svg, top: u32, axis: u32) {
        self.head(svg, top);
        let top = top + TITLE_HEIGHT;
        let axes = |y_range| Axes::new(self, y_range, top, axis);
        match &self.content {
            Content::Lines(lines) => {
                lines.draw(svg, &axes(lines.y_range), self.x_range, &self.marks);
            }
            Content::Raster(rows) => {
                raster::draw(rows, svg, &axes((0.0, rows.len().max(1) as f64)), self);
            }
            Content::Heat(heat) => heat.draw(svg, &axes(heat.y_range), self.x_range),
            Content::Bars(bars) => bars.draw(svg, top, self.height),
        }
    }

    /// Title at the left, legend after it.
    fn head(&self, svg: &mut Svg, top: u32) {
        let at = (f64::from(LEFT), f64::from(top) + 14.0);
        let (series, in_legend): (&[Series], _) = match &self.content {
            Content::Lines(lines) => (&lines.series, lines.named.clone()),
            _ => (&[], 0..0),
        };
        let title = match &self.content {
            Content::Lines(lines) => format!("{} {}", self.title, lines.y_label),
            Content::Raster(_) | Content::Bars(_) => self.title.clone(),
            Content::Heat(heat) => format!("{}: {}", self.title, heat.legend),
        };
        let named = series.iter().enumerate();
        let named = named.filter(|(i, l)| in_legend.contains(i) && !l.label.is_empty());
        let named = named.map(|(_, l)| (l.label.as_str(), Stroke::new(l.colour, l.width)));
        svg.legend(at, &title, named);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure() -> Figure {
        let wave = (0..500).map(|i| f64::from(i) * 0.02);
        // Too quick for any of its points to be dropped.
        let wave = wave.map(|t| (t, 3.0 * (40.0 * t).sin())).collect();
        let lines = vec![line("a < b", colour::MODEL, 2, wave)];
        let row = RasterRow {
            label: "fill".to_owned(),
            colour: colour::ROBOT,
            upper: vec![(-1.0, 4.0, 1.0)],
            lower: Some(vec![(5.0, 99.0, 0.5)]),
        };
        let heat = Heat {
            columns: 2,
            values: vec![0.0, 1.0, 2.0, 3.0],
            y_range: (0.0, 1.0),
            x_label: "x".to_owned(),
            legend: "dark is more".to_owned(),
        };
        let column = Column {
            title: "time [s]".to_owned(),
            values: vec![Some(9.0), None],
            texts: vec!["9.0".to_owned(), "never".to_owned()],
            full: 5.0,
            limit: Some(2.0),
        };
        let names = ["one", "two"].map(|n| (n.to_owned(), colour::THIRD));
        let bars = Bars {
            rows: names.into(),
            columns: vec![column],
        };
        let height = bars.height();
        let contents = [
            (
                Content::lines(("[mm]", (-2.0, 2.0)), lines).limited(&[9.0]),
                100,
            ),
            (Content::Raster(vec![row]), 40),
            (Content::Heat(heat), 80),
            (Content::Bars(bars), height),
        ];
        let panels = contents.map(|(content, height)| {
            let mut panel = Panel::new("panel", (0.0, 10.0), height, content);
            panel.marks = vec![3.0, 11.0];
            panel
        });
        Figure {
            id: "all".to_owned(),
            title: "All kinds".to_owned(),
            caption: String::new(),
            panels: panels.into(),
        }
    }

    /// Every number of every attribute `name`.
    fn numbers<'a>(svg: &'a str, name: &str) -> impl Iterator<Item = f64> + 'a {
        let start = format!(" {name}=\"");
        let texts: Vec<&str> = svg.split(&start).skip(1).collect();
        let values = texts.into_iter().filter_map(|t| t.split('"').next());
        let numbers = values.flat_map(|v| v.split([',', ' ']));
        numbers.map(|n| n.parse().expect("a number"))
    }

    #[test]
    fn every_kind_of_panel_is_drawn_on_the_sheet() {
        let (figure, mut drawn) = (figure(), 0);
        let svg = figure.svg();
        let (width, height) = figure.size();
        let most = f64::from(width.max(height));
        for name in ["x", "y", "width", "height", "points"] {
            for number in numbers(&svg, name) {
                assert!((0.0..=most).contains(&number), "{name} {number}");
                drawn += 1;
            }
        }
        assert!(drawn > 1000, "{drawn}");
        for text in [
            "a &lt; b",
            "panel [mm]",
            "fill",
            "dark is more",
            "never",
            TIME,
        ] {
            assert_eq!(svg.matches(&format!("{text}<")).count(), 1, "{text}");
        }
        // One of the two marks is outside, and bars have none; the limit of the bars.
        let mark = format!(
            "stroke=\"{}\" stroke-width=\"1\" stroke-linejoin=\"round\" points",
            colour::LIMIT
        );
        assert_eq!(svg.matches(&mark).count(), 3);
    }

    #[test]
    #[cfg(feature = "png")]
    fn a_picture_is_twice_the_size_of_the_figure_and_not_blank() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("all.png");
        figure().png(&path).expect("written");
        let bytes = std::fs::read(&path).expect("written");
        assert_eq!(&bytes[1..4], b"PNG");
        let size = [&bytes[16..20], &bytes[20..24]]
            .map(|b| u32::from_be_bytes(b.try_into().expect("four")));
        let (width, height) = figure().size();
        assert_eq!(size, [2 * width, 2 * height]);
        assert!(bytes.len() > 10_000, "{}", bytes.len());
    }

    #[test]
    #[cfg(not(feature = "png"))]
    fn a_program_without_png_says_how_to_get_it() {
        let error = figure().png(Path::new("a.png")).expect_err("not built in");
        let help = miette::Diagnostic::help(&error).expect("help").to_string();
        assert!(help.contains("--features png"), "{help}");
        assert!(error.to_string().contains("`--png`"), "{error}");
    }
}
