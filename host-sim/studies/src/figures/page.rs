//! The page: one self-contained file in the style of a run's report.

use serde::Serialize;

use super::Results;
use super::audit::Misprint;
use super::precision::LIMIT_M;
use super::section6::AxisCheck;
use crate::StudyError;
use wheeleg_report::number::short;
use wheeleg_report::{Picture, page, pictures, plot::Figure};

const TEMPLATE: &str = include_str!("page.html");

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    version: &'static str,
    verdict: String,
    figures: Vec<Picture<'a>>,
    axes: &'a [AxisCheck],
    /// Axes that do not hold the computed values.
    misfits: Vec<&'a AxisCheck>,
    misprints: &'a [Misprint],
    equations: usize,
    argument_fits: String,
    literal_fits: String,
    worst_um: f64,
    precise: bool,
    poses: usize,
}

pub(super) fn render(
    results: &Results,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let equations = results.equations();
    let worst_m = results.precision.worst_m();
    let values = Page {
        version: env!("CARGO_PKG_VERSION"),
        verdict: format!(
            "Read with the abscissa as time/8, {} axes of Figs. 5 to 8 hold what is computed, read as seconds {}; {equations} equations are misprinted or ambiguous; single precision is off by at most {} µm.",
            fitting(results, "argument"),
            fitting(results, "literal"),
            short(1e6 * worst_m)
        ),
        figures: pictures(figures),
        axes: &results.checks,
        misfits: results.checks.iter().filter(|c| !c.fits).collect(),
        misprints: &results.misprints,
        equations,
        argument_fits: fitting(results, "argument"),
        literal_fits: fitting(results, "literal"),
        worst_um: 1e6 * worst_m,
        precise: worst_m < LIMIT_M,
        poses: results.precision.poses,
    };
    Ok(page(TEMPLATE, values)?)
}

/// "8 of 10" axes of a reading.
fn fitting(results: &Results, reading: &str) -> String {
    let rows = results.checks.iter().filter(|c| c.reading == reading);
    let fits = rows.clone().filter(|c| c.fits).count();
    format!("{fits} of {}", rows.count())
}
