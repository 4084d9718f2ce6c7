//! The frame of every report page: one self-contained HTML file.

use minijinja::{Environment, UndefinedBehavior, Value, context};

use crate::ReportError;
use crate::plot::Figure;

/// A page of the program from its own template, which extends `base.html`: frame,
/// style sheet and figures are the same on all of them. A value that a template
/// prints or goes through and nobody gives is an error, not an empty place; `if` may ask.
///
/// # Errors
/// [`ReportError::Template`] if the template does not fit its values.
pub fn page(template: &str, values: Value) -> Result<String, ReportError> {
    let mut env = Environment::new();
    env.set_undefined_behavior(UndefinedBehavior::SemiStrict);
    env.add_template("style.css", include_str!("style.css"))?;
    env.add_template("figure.html", include_str!("figure.html"))?;
    env.add_template("base.html", include_str!("base.html"))?;
    env.add_template("page.html", template)?;
    Ok(env.get_template("page.html")?.render(values)?)
}

/// Figures with their SVG text as values of a template.
pub fn pictures(figures: &[(Figure, String)]) -> Vec<Value> {
    let value = |(figure, svg): &(Figure, String)| {
        context! {
            id => &*figure.id,
            title => &*figure.title,
            short => figure.title.split(':').next(),
            caption => &*figure.caption,
            svg => Value::from_safe_string(svg.clone()),
        }
    };
    figures.iter().map(value).collect()
}
