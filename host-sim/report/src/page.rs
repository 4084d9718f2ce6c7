//! The frame of every report page: one self-contained HTML file.

use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, Value};
use serde::Serialize;

use crate::plain::acts_in_lines;
use crate::plot::{Figure, PanelData};
use crate::{ReportError, number, script};

/// A page of the program from its own template, which extends `base.html`: frame, style sheet and figures are
/// the same on all of them, and the filters of [`number`] format numbers. A missing value that a template
/// prints or loops over is an error, not an empty place; `if` may ask for it. Control characters in foreign
/// texts are taken out ([`acts_in_lines`]).
///
/// # Errors
/// [`ReportError::Template`] if the template does not fit its values.
pub fn page(template: &str, values: impl Serialize) -> Result<String, ReportError> {
    let mut env = Environment::new();
    env.set_undefined_behavior(UndefinedBehavior::SemiStrict);
    number::add_filters(&mut env);
    env.add_filter("code", |text: String| Value::from_safe_string(code(&text)));
    env.add_template("tokens.css", include_str!("../page/tokens.css"))?;
    env.add_template("ui.css", include_str!("../page/ui.css"))?;
    env.add_template("report.css", include_str!("../page/report.css"))?;
    env.add_global("script", Value::from_safe_string(script::report()));
    env.add_template("figure.html", include_str!("figure.html"))?;
    env.add_template("base.html", include_str!("base.html"))?;
    env.add_template("page.html", template)?;
    let values = Value::from(Serde(values));
    let text = env.get_template("page.html")?.render(values)?;
    Ok(text.replace(acts_in_lines, "\u{fffd}"))
}

/// A text whose parts between backticks are code.
fn code(text: &str) -> String {
    let mut out = String::new();
    for (i, part) in text.split('`').enumerate() {
        if i > 0 {
            out.push_str(if i % 2 == 1 { "<code>" } else { "</code>" });
        }
        let part = part.replace('&', "&amp;");
        out.push_str(&part.replace('<', "&lt;").replace('>', "&gt;"));
    }
    if !text.matches('`').count().is_multiple_of(2) {
        out.push_str("</code>");
    }
    out
}

/// A figure for a template.
#[derive(Debug, Serialize)]
pub struct Picture<'a> {
    id: &'a str,
    title: &'a str,
    /// The title up to its colon, for links.
    short: &'a str,
    caption: &'a str,
    panels: Vec<PanelPicture>,
}

/// A panel: its picture, and the data from which the page's script draws it instead.
#[derive(Debug, Serialize)]
struct PanelPicture {
    svg: String,
    data: Option<String>,
}

/// Figures for a template. Their SVG text is as in the files; a page shows every panel with an axis of its
/// own.
pub fn pictures(figures: &[(Figure, String)]) -> Vec<Picture<'_>> {
    let pictures = figures.iter().map(|(figure, _)| Picture {
        id: &figure.id,
        title: &figure.title,
        short: figure.title.split(':').next().unwrap_or(&figure.title),
        caption: &figure.caption,
        panels: figure
            .panel_svgs()
            .zip(&figure.panels)
            .map(|(svg, panel)| PanelPicture {
                svg,
                data: PanelData::of(panel).as_ref().map(json),
            })
            .collect(),
    });
    pictures.collect()
}

/// A value as JSON for a `script` element: nothing in it ends the element.
///
/// # Panics
/// If the value cannot be JSON, as a map whose keys are not texts.
pub fn json(value: &impl Serialize) -> String {
    let text = serde_json::to_string(value).expect("plain data is JSON");
    text.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plain::acts;

    #[test]
    fn what_a_text_would_tell_a_reader_to_do_is_taken_out_of_a_page() {
        let template = "{% extends \"base.html\" %}{% block main %}{{ text }}{% endblock %}";
        let text = "a\u{0}b\u{1b}[31mc\u{202e}d\u{2066}e\tf\ng";
        let made = page(template, minijinja::context! { text => text }).expect("a page");
        let shown = "a\u{fffd}b\u{fffd}[31mc\u{fffd}d\u{fffd}e\tf\ng";
        assert!(made.contains(shown), "it is shown");
        assert!(!made.contains(|c: char| acts(c) && !"\n\t".contains(c)));
    }

    #[test]
    fn backticks_become_code_and_nothing_else_markup() {
        assert_eq!(code("a (event `stuck`)"), "a (event <code>stuck</code>)");
        assert_eq!(code("<b> & `x"), "&lt;b&gt; &amp; <code>x</code>");
    }
}
