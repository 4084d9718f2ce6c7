//! The frame of every report page: one self-contained HTML file.

use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, Value};
use serde::Serialize;

use crate::plot::Figure;
use crate::{ReportError, number};

/// A page of the program from its own template, which extends `base.html`: frame,
/// style sheet and figures are the same on all of them, and numbers are formatted there
/// by the filters of [`number`]. A value that a template prints or goes through and
/// nobody gives is an error, not an empty place; `if` may ask.
///
/// # Errors
/// [`ReportError::Template`] if the template does not fit its values.
pub fn page(template: &str, values: impl Serialize) -> Result<String, ReportError> {
    let mut env = Environment::new();
    env.set_undefined_behavior(UndefinedBehavior::SemiStrict);
    number::add_filters(&mut env);
    env.add_template("style.css", include_str!("style.css"))?;
    env.add_template("figure.html", include_str!("figure.html"))?;
    env.add_template("base.html", include_str!("base.html"))?;
    env.add_template("page.html", template)?;
    let values = Value::from(Serde(values));
    Ok(env.get_template("page.html")?.render(values)?)
}

/// A figure for a template.
#[derive(Debug, Serialize)]
pub struct Picture<'a> {
    id: &'a str,
    title: &'a str,
    /// The title up to its colon, for links.
    short: &'a str,
    caption: &'a str,
    svg: &'a str,
}

/// Figures with their SVG text for a template.
pub fn pictures(figures: &[(Figure, String)]) -> Vec<Picture<'_>> {
    let pictures = figures.iter().map(|(figure, svg)| Picture {
        id: &figure.id,
        title: &figure.title,
        short: figure.title.split(':').next().unwrap_or(&figure.title),
        caption: &figure.caption,
        svg,
    });
    pictures.collect()
}
