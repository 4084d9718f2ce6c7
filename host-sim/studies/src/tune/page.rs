//! The page of a tuned axis: before and after.

use serde::Serialize;

use super::judge::all_stopped;
use super::{Parameter, Test, Tuned, Worse};
use crate::StudyError;
use crate::axis_sim::Delays;
use crate::axis_sim::Trace;
use crate::compare::{Figures, MARGIN, Move, panel};
use wheeleg_report::number::{fixed, or_dash};
use wheeleg_report::plot::{Figure, Series, colour, line};
use wheeleg_report::{Picture, page, pictures};

const TEMPLATE: &str = include_str!("page.html");

/// Points of a recording over the time from the start of its motion.
fn points(trace: &Trace, value: impl Fn(&crate::axis_sim::Row) -> f64) -> Vec<(f64, f64)> {
    let start_s = trace.motion.start_s();
    let rows = trace.rows.iter().enumerate();
    rows.map(|(k, r)| (k as f64 * 1e-3 - start_s, value(r)))
        .collect()
}

/// Stroke, or stroke less reference, before and after.
fn series(
    test: &Test,
    index: usize,
    value: impl Fn(&crate::axis_sim::Row) -> f64 + Copy,
) -> Vec<Series> {
    let points = |played: &super::Played| points(&played.measured[index], value);
    let [before, after] = &test.played;
    vec![
        line("before", colour::MODEL, 2, points(before)),
        line("after", colour::ROBOT, 3, points(after)),
    ]
}

/// Figures before and after.
pub(super) fn figures(tuned: &Tuned) -> Vec<Figure> {
    let stroke = |r: &crate::axis_sim::Row| r.stroke_m * 1e3;
    let error = |r: &crate::axis_sim::Row| (r.stroke_m - r.reference_m) * 1e3;
    let end = |test: &Test, index: usize| {
        let trace = &test.played[0].measured[index];
        trace.rows.len() as f64 * 1e-3 - trace.motion.start_s()
    };
    // The large step is the main figure.
    let mut tests: Vec<&Test> = tuned.tests.iter().collect();
    tests.retain(|test| test.motion != Move::Hold);
    tests.sort_by_key(|test| test.motion != Move::Step100);
    tests
        .into_iter()
        .map(|test| {
            let mut panels = Vec::new();
            for index in 0..test.played[0].measured.len() {
                let end_s = end(test, index).min(if test.motion == Move::Sine { 5.0 } else { 2.0 });
                let way = match (test.motion, index) {
                    (Move::Step20 | Move::Step100, 0) | (Move::SCurve, 1) => "Retracting",
                    (Move::Sine, _) => "Sinusoid",
                    _ => "Extending",
                };
                let (title, unit) = (format!("{way}: stroke"), "[mm]");
                panels.push(panel(&title, unit, end_s, series(test, index, stroke), None, &[]));
                panels.push(panel(
                    &format!("{way}: stroke less reference"),
                    unit,
                    end_s,
                    series(test, index, error),
                    Some((-5.0, 5.0)),
                    &[-1.0, 1.0],
                ));
            }
            Figure {
                id: test.motion.name().to_owned(),
                title: format!("{}: before and after", test.motion.name()),
                caption: "After the learning move. Limit lines at ±1 mm; larger errors lie beyond the edge.".to_owned(),
                panels,
            }
        })
        .collect()
}

type Cell = fn(&Figures) -> Option<f64>;

/// Whether a figure of a move is shown.
type Of = fn(Move) -> bool;

fn any(_: Move) -> bool {
    true
}

/// Whether it is the way that counts, as the move has no time to settle.
fn tracks(motion: Move) -> bool {
    !Figures::has(motion, |f| f.settle_s)
}

/// Figures of a test, the moves of which they are shown if these have them, and their digits.
const LINES: [(&str, Of, usize, Cell); 12] = [
    ("error at rest [mm]", any, 2, |f| {
        f.steady_error_mm.map(f64::abs)
    }),
    ("overshoot [mm]", any, 2, |f| f.overshoot_mm),
    ("rise [s]", any, 3, |f| f.rise_s),
    ("settled within ±1 mm [s]", any, 3, |f| f.settle_s),
    ("worst error [mm]", tracks, 2, |f| f.worst_mm),
    ("RMS error [mm]", tracks, 2, |f| f.rms_mm),
    ("switches per s", any, 0, |f| f.switches_per_s),
    ("switches in 10 s at rest", any, 0, |f| {
        f.rest_switches.map(|n| n as f64)
    }),
    ("air per move [l ANR]", any, 2, |f| f.air_nl),
    ("recovery after contact [s]", any, 2, |f| f.recovery_s),
    (
        "first move: overshoot [mm]",
        |m| m == Move::Step100,
        2,
        |f| f.first_overshoot_mm,
    ),
    (
        "first move: settled [s]",
        |m| m == Move::Step100,
        3,
        |f| f.first_settle_s,
    ),
];

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    /// Why the tuning stopped.
    stopped: Option<String>,
    version: &'static str,
    verdict: String,
    name: &'a str,
    description: &'a str,
    seed: u64,
    /// Force of the shortest opening over the range that friction holds, if any, and the limit for coarse.
    valve_resolution: Option<f64>,
    coarse: f64,
    advice: Option<String>,
    /// None without a load.
    margin: Option<f64>,
    least: f64,
    /// Delays of the sheet and those found \[s\].
    sheet_on_s: f64,
    sheet_off_s: f64,
    found: Option<Delays>,
    /// Figures that are worse than before.
    worse: Vec<String>,
    tests: Vec<Shown>,
    parameters: Vec<Described<'a>>,
    toml: &'a str,
    figures: Vec<Picture<'a>>,
}

#[derive(Serialize)]
struct Shown {
    name: &'static str,
    lines: Vec<Line>,
}

/// One figure of a test.
#[derive(Serialize)]
struct Line {
    name: &'static str,
    before: String,
    after: String,
}

#[derive(Serialize)]
struct Described<'a> {
    parameter: &'a Parameter,
    text: &'static str,
}

fn lines(test: &Test) -> Vec<Line> {
    let note = |f: &Figures| match (f.stopped, f.limit_cycle) {
        (Some(true), _) => "stopped by supervision",
        (_, Some(true)) => "limit cycle",
        _ => "stable",
    };
    let mut list: Vec<Line> = LINES
        .iter()
        .filter(|(_, of, _, value)| of(test.motion) && Figures::has(test.motion, *value))
        .map(|(name, _, digits, value)| {
            let shown = |figures| or_dash(value(figures), *digits);
            Line {
                name,
                before: shown(&test.before),
                after: shown(&test.after),
            }
        })
        .collect();
    list.push(Line {
        name: "behaviour",
        before: note(&test.before).to_owned(),
        after: note(&test.after).to_owned(),
    });
    list
}

/// The page's first sentence: the large step before and after, or why the parameters are refused.
fn verdict(tuned: &Tuned, large: Option<&Test>) -> String {
    if all_stopped(&tuned.tests) {
        return "Refused: after tuning the supervision stops every move.".to_owned();
    }
    if let Some(first) = tuned.worse.first() {
        return format!(
            "Refused: {} worse than before tuning. {}.",
            match tuned.worse.len() {
                1 => "1 figure is".to_owned(),
                n => format!("{n} figures are"),
            },
            first.message()
        );
    }
    let Some(test) = large else {
        return "The large step was not played.".to_owned();
    };
    let told = |f: &Figures| {
        let settled = f.settle_s.map_or_else(
            || "never settles".to_owned(),
            |s| format!("settles in {} s", fixed(s, 3)),
        );
        let overshoot = f.overshoot_mm;
        let overshoot = overshoot.map(|mm| format!(", overshoot {} mm", fixed(mm, 2)));
        settled + &overshoot.unwrap_or_default()
    };
    format!(
        "Tuned, the large step {}; with the board's defaults it {}.",
        told(&test.after),
        told(&test.before)
    )
}

pub(super) fn render(tuned: &Tuned, figures: &[(Figure, String)]) -> Result<String, StudyError> {
    let tests = tuned.tests.iter().map(|t| Shown {
        name: t.motion.name(),
        lines: lines(t),
    });
    let parameters = tuned.parameters.iter().map(|parameter| Described {
        parameter,
        text: parameter.text,
    });
    let valve = &tuned.config.axis.cylinder.fill_valve;
    let large = tuned.tests.iter().find(|t| t.motion == Move::Step100);
    let values = Page {
        stopped: tuned.stopped.as_ref().map(ToString::to_string),
        version: env!("CARGO_PKG_VERSION"),
        verdict: verdict(tuned, large),
        worse: tuned.worse.iter().map(Worse::message).collect(),
        name: &tuned.config.name,
        description: &tuned.config.description,
        seed: tuned.seed,
        valve_resolution: tuned.valve_resolution.ratio,
        coarse: crate::axis_sim::valve_resolution::COARSE,
        advice: tuned.valve_resolution.advice(),
        margin: (tuned.margin < 1e3).then_some(tuned.margin),
        least: MARGIN,
        sheet_on_s: valve.t_on_s,
        sheet_off_s: valve.t_off_s,
        found: tuned.delays,
        tests: tests.collect(),
        parameters: parameters.collect(),
        toml: &tuned.toml,
        figures: pictures(figures),
    };
    Ok(page(TEMPLATE, values)?)
}
