//! The page: one self-contained file in the style of a run's report.

use serde::Serialize;

use super::predictions::Prediction;
use super::preview::Previewed;
use super::starts::Distribution;
use super::trial::{Law, Start};
use super::{PAPER_BAND_S, PAPER_DELAY_S, Study};
use crate::StudyError;
use wheeleg_report::number::fixed;
use wheeleg_report::{Picture, page, pictures, plot::Figure};

const TEMPLATE: &str = include_str!("page.html");

/// Seconds to the millisecond.
const DIGITS: usize = 3;

fn seconds(value: f64) -> String {
    fixed(value, DIGITS)
}

fn maybe(value: Option<f64>) -> String {
    value.map_or_else(|| "never".to_owned(), seconds)
}

/// Whether a start delay is the paper's.
fn is_papers(delay_s: f64) -> bool {
    (PAPER_DELAY_S - PAPER_BAND_S..=PAPER_DELAY_S + PAPER_BAND_S).contains(&delay_s)
}

/// Below "In short", in one sentence each.
pub(super) fn findings(study: &Study) -> Vec<String> {
    let a = &study.ablation;
    let mut list = vec![format!(
        "Filling and venting of the chambers make {:.0} % of the {} s that pass from the command in the master to the first millimetre; without them {} s are left.",
        1e2 * a.swap_share,
        seconds(a.base_s),
        seconds(a.without_swap_s)
    )];
    for start in [Start::HomeHeld, Start::HomeRest] {
        let last = study.preview.of(Law::Default, start).last();
        list.push(match (study.preview.enough_s(start), last) {
            (Some(0.0), Some(last)) => format!(
                "Default law, {}: it starts within {} s without preview; with 0.4 s within {} s.",
                start.name(),
                super::PREVIEW_LIMIT_S,
                maybe(last.delay_s)
            ),
            (Some(preview_s), _) => format!(
                "Default law, {}: announced {preview_s} s before or earlier, it starts within {} s, and has not moved 1 mm before.",
                start.name(),
                super::PREVIEW_LIMIT_S
            ),
            (None, last) => format!(
                "Default law, {}: no preview up to 0.4 s brings every start within {} s; with 0.4 s the median is {} s and the worst {} s.",
                start.name(),
                super::PREVIEW_LIMIT_S,
                maybe(last.and_then(|l| l.median_s)),
                maybe(last.and_then(|l| l.delay_s))
            ),
        });
    }
    list
}

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    version: &'static str,
    verdict: String,
    study: &'a Study,
    figures: Vec<Picture<'a>>,
    findings: Vec<String>,
    kinds: Vec<Kind<'a>>,
    predictions: Vec<Predicted<'a>>,
    /// Predictions that do not hold, and rivals that are not ruled out.
    rejected: Vec<Predicted<'a>>,
    previews: Vec<Announced<'a>>,
    /// Medians \[s\].
    paper_home: Option<f64>,
    paper_reached: bool,
    default_home: Option<f64>,
    /// The longest preview.
    announced: Option<Announced<'a>>,
    announced_rest: Option<Announced<'a>>,
}

/// A kind of move, with its distributions under the two laws.
#[derive(Serialize)]
struct Kind<'a> {
    name: &'static str,
    text: &'static str,
    laws: Vec<&'a Distribution>,
    /// Whether the median is the paper's delay, for each law.
    papers: Vec<bool>,
}

#[derive(Serialize)]
struct Predicted<'a> {
    rival: bool,
    prediction: &'a Prediction,
}

#[derive(Serialize)]
struct Announced<'a> {
    law: &'static str,
    start: &'static str,
    meets: bool,
    row: &'a Previewed,
}

impl<'a> Announced<'a> {
    fn new(row: &'a Previewed) -> Self {
        Self {
            law: row.law.name(),
            start: row.start.name(),
            meets: row.meets(),
            row,
        }
    }
}

/// The page's first sentence.
fn verdict(study: &Study) -> String {
    let home = study.starts.of(Law::Paper, Start::HomeHeld);
    format!(
        "The paper's law starts {} s after its command from the held home, {} the paper's 0.25 ± 0.05 s, and the swap of the chambers' pressures makes {:.0} % of that.",
        maybe(home.map(|d| d.median_s)),
        if home.is_some_and(|d| is_papers(d.median_s)) {
            "within"
        } else {
            "outside of"
        },
        1e2 * study.ablation.swap_share
    )
}

pub(super) fn render(study: &Study, figures: &[(Figure, String)]) -> Result<String, StudyError> {
    let kinds = Start::ALL.map(|start| {
        let laws = Law::ALL.into_iter();
        let laws: Vec<&Distribution> = laws.filter_map(|law| study.starts.of(law, start)).collect();
        Kind {
            name: start.name(),
            text: start.text(),
            papers: laws.iter().map(|d| is_papers(d.median_s)).collect(),
            laws,
        }
    });
    let predictions = || {
        let list = study.predictions.list.iter();
        list.map(|prediction| Predicted {
            rival: prediction.rival,
            prediction,
        })
    };
    let rejected = predictions().filter(|row| row.prediction.holds == row.rival);
    let previews = study.preview.rows.iter().map(Announced::new);
    let home = |law| study.starts.of(law, Start::HomeHeld).map(|d| d.median_s);
    let announced = |start| {
        study
            .preview
            .of(Law::Default, start)
            .last()
            .map(Announced::new)
    };
    let values = Page {
        version: env!("CARGO_PKG_VERSION"),
        verdict: verdict(study),
        study,
        figures: pictures(figures),
        findings: findings(study),
        kinds: kinds.into(),
        predictions: predictions().collect(),
        rejected: rejected.collect(),
        previews: previews.collect(),
        paper_home: home(Law::Paper),
        paper_reached: home(Law::Paper).is_some_and(is_papers),
        default_home: home(Law::Default),
        announced: announced(Start::HomeHeld),
        announced_rest: announced(Start::HomeRest),
    };
    Ok(page(TEMPLATE, values)?)
}
