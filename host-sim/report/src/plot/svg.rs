//! The few SVG elements of a figure. Positions are in pixels from the upper left corner; `sans-serif` is a
//! font of the reader's machine.

use std::fmt::{self, Display, Write as _};

use super::colour::{self, Colour};

/// A picture under construction.
pub(super) struct Svg {
    text: String,
}

/// How a line is drawn.
#[derive(Clone, Copy)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: u32,
    /// 0 (invisible) to 1.
    pub(super) opacity: f64,
}

impl Stroke {
    pub(super) fn new(colour: Colour, width: u32) -> Self {
        Self {
            colour,
            width,
            opacity: 1.0,
        }
    }
}

/// The end of a text that is at its position.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Size of a text that is not a title.
pub(super) const SMALL: f64 = 11.0;
/// Size of a title.
pub(super) const LARGE: f64 = 12.5;

impl Svg {
    /// An empty sheet.
    pub(super) fn new(width: u32, height: u32) -> Self {
        let text = format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>\n",
            colour::PAPER
        );
        Self { text }
    }

    /// The whole picture.
    pub(super) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    fn put(&mut self, element: fmt::Arguments<'_>) {
        // Writing into a text cannot fail.
        let _ = self.text.write_fmt(element);
    }

    /// A line through `points`.
    pub(super) fn line(&mut self, points: &[(f64, f64)], stroke: Stroke) {
        self.put(format_args!(
            "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{} points=\"",
            stroke.colour,
            stroke.width,
            Opacity("stroke-opacity", stroke.opacity),
        ));
        for (i, (x, y)) in points.iter().enumerate() {
            let gap = if i == 0 { "" } else { " " };
            self.put(format_args!("{gap}{},{}", Tenths(*x), Tenths(*y)));
        }
        self.put(format_args!("\"/>\n"));
    }

    /// A filled rectangle between two corners, its edges sharp.
    pub(super) fn rectangle(
        &mut self,
        (x0, y0): (f64, f64),
        (x1, y1): (f64, f64),
        colour: Colour,
        opacity: f64,
    ) {
        // Edges are rounded, not widths: neighbours leave no gap.
        let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(|v| (10.0 * v).round() / 10.0);
        self.put(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{colour}\"{} shape-rendering=\"crispEdges\"/>\n",
            Tenths(x0.min(x1)),
            Tenths(y0.min(y1)),
            Tenths((x1 - x0).abs()),
            Tenths((y1 - y0).abs()),
            Opacity("fill-opacity", opacity),
        ));
    }

    /// A text with its middle at the height `y`.
    pub(super) fn text(&mut self, (x, y): (f64, f64), size: f64, anchor: Anchor, text: &str) {
        self.open_text((x, y), size, anchor);
        self.put(format_args!("{}</text>\n", Escaped(text)));
    }

    /// A title, followed by the meaning of each line. Each part begins where the one before it ends, so that
    /// the width of the reader's letters need not be known.
    pub(super) fn legend<'a>(
        &mut self,
        at: (f64, f64),
        title: &str,
        lines: impl Iterator<Item = (&'a str, Stroke)>,
    ) {
        self.open_text(at, LARGE, Anchor::Start);
        self.put(format_args!("{}", Escaped(title)));
        for (label, stroke) in lines {
            // A long dash in the line's colour and width.
            self.put(format_args!(
                "<tspan dx=\"18\" font-size=\"18\" fill=\"{0}\" stroke=\"{0}\" stroke-width=\"{1}\">—</tspan>\
                 <tspan dx=\"5\" font-size=\"{SMALL}\">{2}</tspan>",
                stroke.colour,
                stroke.width,
                Escaped(label),
            ));
        }
        self.put(format_args!("</text>\n"));
    }

    fn open_text(&mut self, (x, y): (f64, f64), size: f64, anchor: Anchor) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        // Digits and small letters reach about 0.7 of the size above their base line.
        let foot = y + 0.35 * size;
        self.put(format_args!(
            "<text x=\"{}\" y=\"{}\" font-size=\"{size}\" fill=\"{}\"{anchor}>",
            Tenths(x),
            Tenths(foot),
            colour::INK,
        ));
    }
}

/// A position: a tenth of a pixel is finer than a screen shows.
struct Tenths(f64);

impl Display for Tenths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tenths = (self.0 * 10.0).round() / 10.0;
        // Without a minus sign on zero.
        write!(f, "{}", tenths + 0.0)
    }
}

/// An attribute, left out if fully opaque.
struct Opacity(&'static str, f64);

impl Display for Opacity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(name, share) = self;
        if *share < 1.0 {
            write!(f, " {name}=\"{share:.2}\"")?;
        }
        Ok(())
    }
}

/// A text with the special characters of SVG escaped.
struct Escaped<'a>(&'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_short_and_zero_has_no_sign() {
        let text = |v: f64| Tenths(v).to_string();
        assert_eq!(
            [text(-0.01), text(12.0), text(3.1499), text(-7.25)],
            ["0", "12", "3.1", "-7.3"]
        );
    }

    #[test]
    fn words_cannot_break_the_picture() {
        let mut svg = Svg::new(10, 10);
        svg.text((1.0, 1.0), SMALL, Anchor::End, "a < b & \"c\" > d");
        let dash = Stroke::new(colour::MODEL, 2);
        svg.legend((1.0, 1.0), "p<q", [("r&s", dash)].into_iter());
        let text = svg.finish();
        assert!(
            text.contains(">a &lt; b &amp; \"c\" &gt; d</text>"),
            "{text}"
        );
        assert!(text.contains("p&lt;q<tspan") && text.contains("r&amp;s</tspan></text>"));
        assert!(text.starts_with("<svg ") && text.ends_with("</svg>\n"));
    }
}
