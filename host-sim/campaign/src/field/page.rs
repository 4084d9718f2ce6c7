//! The page: the paper's claims on top, then each scenario over its seeds.

use serde::Serialize;

use super::{Measured, Met, Summary};
use wheeleg_report::number::fixed;
use wheeleg_report::{Picture, page, pictures, plot::Figure};
use wheeleg_studies::StudyError;
use wheeleg_studies::analysis::band_text;
use wheeleg_studies::study::Stopped;

/// Characters of a case that are shown: enough for a replay.
const CASE: usize = 12;

const TEMPLATE: &str = include_str!("page.html");

/// Assumptions behind every number of this page.
const ASSUMED: &[&str] = &[
    "Soil: \"volcanic-sand\" was chosen where 20 degrees are near its limit, so climbing them there would be consistency, not evidence.",
    "Wheels: radius 0.15 m; for sand 0.10 m wide with lugs of 15 mm.",
    "Feet: soles of 120 mm with six nails of 60 mm for sand, plain ones on rock.",
    "Chassis: belly 0.12 m above the ground; centre of gravity 0.09 m ahead of the axle and 0.20 m high.",
    "Rocks do not move; wheels leave no ruts and push no sand; the paper names no soil, no duration and no number of rocks.",
];

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    version: &'static str,
    verdict: String,
    stopped: Option<String>,
    summary: &'a Summary,
    claims: Vec<ClaimRow<'a>>,
    controls: Vec<ControlRow<'a>>,
    scenarios: Vec<ScenarioRow<'a>>,
    failures: Vec<Failure<'a>>,
    figures: Vec<Picture<'a>>,
    assumed: &'static [&'static str],
}

#[derive(Serialize)]
struct ClaimRow<'a> {
    claim: &'a super::claims::Judged,
    class: &'static str,
    word: &'static str,
    value: String,
    interval: String,
    share: String,
}

#[derive(Serialize)]
struct ControlRow<'a> {
    ground: &'a str,
    sides: [SideRow<'a>; 2],
}

#[derive(Serialize)]
struct SideRow<'a> {
    scenario: &'a str,
    way: String,
    tail: String,
}

impl<'a> SideRow<'a> {
    fn of(side: &'a super::controls::Side) -> Self {
        let tail = match side.on_tail {
            Some(0) => "off the ground".to_owned(),
            Some(runs) => format!("on the ground in {runs} of {}", side.runs),
            None => "not looked at".to_owned(),
        };
        Self {
            scenario: side.scenario,
            way: value(&side.way),
            tail,
        }
    }
}

#[derive(Serialize)]
struct ScenarioRow<'a> {
    tried: &'a super::Tried,
    all: bool,
    interval: String,
    measured: Vec<MeasuredRow<'a>>,
}

#[derive(Serialize)]
struct MeasuredRow<'a> {
    measured: &'a Measured,
    class: &'static str,
    bar: String,
    value: String,
}

#[derive(Serialize)]
struct Failure<'a> {
    run: &'a super::Run,
    why: String,
    /// The beginning of its case.
    case: &'a str,
}

/// A mean with its range, at a useful number of digits.
fn value(m: &Measured) -> String {
    let Some((mean, low, high)) = m
        .mean
        .zip(m.lowest)
        .zip(m.highest)
        .map(|((a, b), c)| (a, b, c))
    else {
        return "not measured".to_owned();
    };
    let digits = match high.abs().max(low.abs()) {
        large if large >= 100.0 => 0,
        middle if middle >= 10.0 => 1,
        _ => 3,
    };
    format!(
        "{} ({} to {}) {}",
        fixed(mean, digits),
        fixed(low, digits),
        fixed(high, digits),
        unit(m)
    )
    .trim_end()
    .to_owned()
}

/// A pure number has none.
fn unit(m: &Measured) -> &str {
    if m.unit == "1" { "" } else { m.unit }
}

fn bar(m: &Measured) -> String {
    let band = band_text(m.min, m.max);
    format!("{band} {}", unit(m)).trim_end().to_owned()
}

fn interval([low, high]: [f64; 2]) -> String {
    format!("{} to {} %", fixed(1e2 * low, 0), fixed(1e2 * high, 0))
}

/// The page's first sentence. Chosen scenarios may not belong to any claim of the paper.
fn verdict(summary: &Summary) -> String {
    let met = summary.claims.iter().filter(|c| c.met == Met::Met).count();
    let passed = summary.judged().filter(|run| run.passed).count();
    let runs = format!("{passed} of {} runs pass.", summary.judged().count());
    match summary.claims.len() {
        0 => runs,
        claims => {
            format!("{met} of {claims} claims of the paper are met on the assumed ground; {runs}")
        }
    }
}

pub(super) fn render(
    summary: &Summary,
    stopped: Option<&Stopped>,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let claims = summary.claims.iter().map(|claim| ClaimRow {
        claim,
        class: match claim.met {
            Met::Met => "pass",
            Met::InPart => "info",
            Met::NotMet => "fail",
        },
        word: claim.met.word(),
        value: value(&claim.measured),
        interval: interval(claim.interval),
        share: format!("{} %", fixed(1e2 * claim.share, 0)),
    });
    let scenarios = summary.scenarios.iter().map(|tried| ScenarioRow {
        tried,
        all: tried.passed == tried.runs,
        interval: interval(tried.interval),
        measured: tried
            .measured
            .iter()
            .map(|measured| MeasuredRow {
                measured,
                class: match (measured.met == tried.runs, measured.required) {
                    (true, _) => "pass",
                    (false, true) => "fail",
                    (false, false) => "info",
                },
                bar: bar(measured),
                value: value(measured),
            })
            .collect(),
    });
    let controls = summary.controls.iter().map(|control| ControlRow {
        ground: control.ground,
        sides: [&control.legs, &control.idle].map(SideRow::of),
    });
    let failures = summary.judged().filter(|run| !run.passed).map(|run| {
        // A run that ended early has measured nothing: why it ended says it all.
        let whole = run.error.is_none();
        let missed = run.bars.iter().filter(|b| whole && b.required && !b.pass);
        let missed = missed.map(|b| {
            let (measured, asked) = (b.measured_text(), b.asked_text());
            format!("{} {measured} (asked {asked})", b.id)
        });
        let why: Vec<String> = run.error.iter().cloned().chain(missed).collect();
        Failure {
            run,
            why: why.join("; "),
            case: run.case.get(..CASE).unwrap_or(&run.case),
        }
    });
    let values = Page {
        version: env!("CARGO_PKG_VERSION"),
        verdict: verdict(summary),
        stopped: stopped.map(ToString::to_string),
        summary,
        claims: claims.collect(),
        controls: controls.collect(),
        scenarios: scenarios.collect(),
        failures: failures.collect(),
        figures: pictures(figures),
        assumed: ASSUMED,
    };
    Ok(page(TEMPLATE, values)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For scenarios without a claim of the paper, and for one seed, nothing is empty.
    #[test]
    fn a_page_without_claims_has_no_section_of_them() {
        let summary = Summary {
            seeds: 1,
            claims: Vec::new(),
            controls: Vec::new(),
            scenarios: Vec::new(),
            runs: Vec::new(),
        };
        let figures = super::super::charts::figures(&summary);
        assert!(figures.is_empty());
        let page = render(&summary, None, &[]).expect("a page");
        assert!(page.contains("0 of 0 runs pass."), "{page}");
        assert!(!page.contains("claims of the paper") && !page.contains("id=\"claims\""));
        assert!(page.contains("What is assumed"));
    }

    /// It is marked as a stretch goal, and a run that misses it fails nothing.
    #[test]
    fn a_stretch_goal_that_is_missed_is_no_failure() {
        let name = super::super::STRETCH[0];
        assert!(super::super::SCENARIOS.contains(&name));
        let run = |scenario| super::super::Run {
            scenario,
            seed: 1,
            case: String::new(),
            error: None,
            passed: false,
            hash: String::new(),
            bars: Vec::new(),
        };
        let summary = |scenario| {
            let run = run(scenario);
            let tried = super::super::Tried::of(scenario, &[&run]).expect("built in");
            Summary {
                seeds: 1,
                claims: Vec::new(),
                controls: Vec::new(),
                scenarios: vec![tried],
                runs: vec![run],
            }
        };
        let (stretch, plain) = (summary(name), summary("rocks-30"));
        assert!(stretch.passed() && !plain.passed());
        let page = |summary| render(summary, None, &[]).expect("a page");
        let (stretch, plain) = (page(&stretch), page(&plain));
        assert!(stretch.contains("Stretch goal") && !stretch.contains("id=\"failures\""));
        assert!(!plain.contains("Stretch goal") && plain.contains("id=\"failures\""));
    }
}
