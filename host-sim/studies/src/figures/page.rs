//! The page: one self-contained file in the style of a run's report.

use minijinja::{Value, context};

use super::Results;
use super::audit::Status;
use super::charts::short;
use super::precision::LIMIT_M;
use crate::StudyError;
use wheeleg_report::{page, pictures, plot::Figure};

const TEMPLATE: &str = include_str!("page.html");

pub(super) fn render(
    results: &Results,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let axes: Vec<Value> = results
        .checks
        .iter()
        .map(|c| {
            context! {
                id => c.id,
                figure => c.figure,
                reading => c.reading,
                quantity => c.quantity,
                unit => c.unit,
                axis => format!("{} to {}", short(c.axis_min), short(c.axis_max)),
                computed => format!("{} to {}", short(c.min), short(c.max)),
                fits => c.fits,
            }
        })
        .collect();
    let endless = |v: Option<f64>| v.map_or_else(|| "not finite".to_owned(), short);
    let triple = |v: [f64; 3]| v.map(short).join(", ");
    let misprints: Vec<Value> = results
        .misprints
        .iter()
        .map(|m| {
            context! {
                equation => m.equation,
                status => match m.status {
                    Status::Wrong => "wrong",
                    Status::Home => "right at home only",
                    Status::Ambiguous => "ambiguous",
                    Status::Singular => "0/0 at home",
                },
                class => if m.status == Status::Wrong { "fail" } else { "info" },
                printed => m.printed,
                corrected => m.corrected,
                component => m.component,
                unit => m.unit,
                worst => endless(m.worst),
                printed_value => endless(m.printed_value),
                corrected_value => short(m.corrected_value),
                lengths => triple(m.lengths_m),
                rates => triple(m.rates_m_s),
                accelerations => triple(m.accelerations_m_s2),
                share => format!("{:.0} %", 1e2 * m.differing_share),
                at_home => endless(m.at_home),
                in_figures => endless(m.in_figures),
            }
        })
        .collect();
    let map = &results.precision;
    let values = context! {
        version => env!("CARGO_PKG_VERSION"),
        figures => pictures(figures),
        axes => axes,
        misprints => misprints,
        equations => results
            .misprints
            .iter()
            .map(|m| m.equation)
            .collect::<std::collections::BTreeSet<_>>()
            .len(),
        argument_fits => fitting(results, "argument"),
        literal_fits => fitting(results, "literal"),
        worst_um => short(1e6 * map.worst_m()),
        precise => map.worst_m() < LIMIT_M,
        poses => map.poses,
    };
    Ok(page(TEMPLATE, values)?)
}

/// "8 of 10" axes of a reading.
fn fitting(results: &Results, reading: &str) -> String {
    let rows = results.checks.iter().filter(|c| c.reading == reading);
    let fits = rows.clone().filter(|c| c.fits).count();
    format!("{fits} of {}", rows.count())
}
