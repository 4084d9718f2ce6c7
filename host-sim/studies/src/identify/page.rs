//! The page of an identified axis.

use serde::Serialize;

use super::experiment::Experiment;
use super::{Identified, Parameter};
use crate::StudyError;
use crate::compare::panel;
use wheeleg_report::plot::{Figure, colour, line};
use wheeleg_report::{Picture, page, pictures};

const TEMPLATE: &str = include_str!("page.html");
/// Most points of a line.
const POINTS: usize = 4000;

/// Measured and simulated stroke, and the difference.
pub(super) fn figures(identified: &Identified) -> Vec<Figure> {
    let samples = &identified.lab.samples;
    let every = samples.len().div_ceil(POINTS).max(1);
    let points = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        let each = samples.iter().enumerate().step_by(every);
        each.map(|(k, sample)| (sample.tick as f64 * 1e-3, value(k)))
            .collect()
    };
    let measured_mm = |k: usize| samples[k].position_m * 1e3;
    let [file, fit] = &identified.played;
    let end_s = identified.lab.on_us.len() as f64 * 1e-3;
    let stroke = vec![
        line("measured", colour::ROBOT, 2, points(&measured_mm)),
        line(
            "by the file",
            colour::MODEL,
            2,
            points(&|k| file[k].position_m * 1e3),
        ),
        line(
            "identified",
            colour::ROBOT,
            3,
            points(&|k| fit[k].position_m * 1e3),
        ),
    ];
    let error = vec![line(
        "identified less measured",
        colour::ROBOT,
        2,
        points(&|k| fit[k].position_m * 1e3 - measured_mm(k)),
    )];
    let noise_mm = 3.0 * identified.noise_mm;
    vec![Figure {
        id: "stroke".to_owned(),
        title: "Stroke: measured, by the file, identified".to_owned(),
        caption: format!(
            "The first {:.2} s were fitted; the rest the fit has not seen. Limit lines at three times the sensor's noise.",
            identified.ticks as f64 * 1e-3
        ),
        panels: vec![
            panel("Stroke", "[mm]", end_s, stroke, None, &[]),
            panel(
                "Identified less measured",
                "[mm]",
                end_s,
                error,
                None,
                &[-noise_mm, noise_mm],
            ),
        ],
    }]
}

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    stopped: Option<String>,
    version: &'static str,
    name: &'a str,
    verdict: String,
    before_mm: f64,
    after_mm: f64,
    noise_mm: f64,
    parameters: Vec<Shown<'a>>,
    doubts: Vec<String>,
    explained: bool,
    undetermined: &'a [String],
    experiments: Vec<Next<'a>>,
    figures: Vec<Picture<'a>>,
}

#[derive(Serialize)]
struct Shown<'a> {
    parameter: &'a Parameter,
    note: &'static str,
    paths: String,
}

#[derive(Serialize)]
struct Next<'a> {
    name: &'a str,
    words: &'a str,
    left_percent: f64,
}

pub(super) fn render(
    identified: &Identified,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let determined = identified
        .parameters
        .iter()
        .filter(|p| p.determined && !p.kept)
        .count();
    let explained = if identified.is_explained() {
        "the held-out data are matched within three times the sensor's noise"
    } else if identified.is_worse_than_the_file() {
        "the file's values match the held-out data and the fit's do not: it is not written, measure for longer"
    } else {
        "the held-out data are not matched: do not trust the intervals"
    };
    let next = |experiment: &'_ Experiment| experiment.ignorance.exp() * 100.0;
    let values = Page {
        stopped: identified.stopped.as_ref().map(ToString::to_string),
        version: env!("CARGO_PKG_VERSION"),
        name: &identified.config.name,
        verdict: format!(
            "{determined} of {} parameters are determined; {explained}.",
            identified.parameters.len()
        ),
        before_mm: identified.before.held_out_mm,
        after_mm: identified.after.held_out_mm,
        noise_mm: identified.noise_mm,
        parameters: identified
            .parameters
            .iter()
            .map(|parameter| Shown {
                parameter,
                note: parameter.note(),
                paths: parameter.paths.join(", "),
            })
            .collect(),
        doubts: identified.doubts.iter().map(ToString::to_string).collect(),
        explained: identified.is_explained(),
        undetermined: &identified.undetermined,
        experiments: identified
            .experiments
            .iter()
            .map(|experiment| Next {
                name: experiment.name,
                words: experiment.words,
                left_percent: next(experiment),
            })
            .collect(),
        figures: pictures(figures),
    };
    Ok(page(TEMPLATE, values)?)
}
