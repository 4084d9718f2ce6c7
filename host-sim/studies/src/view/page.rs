//! The page of one log, or of two.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::Serialize;
use wheeleg_report::plot::{Content as Drawn, Figure, Panel, line};
use wheeleg_report::{Picture, json, page, pictures};
use wheeleg_telemetry::EventKind;

use super::Named;
use super::difference::Difference;
use super::judged::Missed;
use super::signals::{Curve, Group, Plot};
use crate::StudyError;
use crate::cause::{LISTED, Wrong, first_sentence, listed};
use crate::motion::Motion;

const TIME: &str = "time of the log [s]";
/// Most marks of faults in a panel.
const MARKS: usize = 20;
/// Share of an axis that stays free above and below.
const MARGIN: f64 = 0.05;

/// Mark of a log's page, near its start.
const OURS: &str = "<meta name=\"generator\" content=\"wheeleg view\">";

/// Whether a file is such a page, which may be remade.
pub(super) fn is_ours(page: &Path) -> bool {
    // Reading a pipe would block.
    if !page.symlink_metadata().is_ok_and(|page| page.is_file()) {
        return false;
    }
    let mut begin = [0; 256];
    let read = File::open(page).and_then(|mut file| file.read(&mut begin));
    let begin = begin.get(..read.unwrap_or(0)).unwrap_or_default();
    String::from_utf8_lossy(begin).contains(OURS)
}

#[derive(Serialize)]
struct Line {
    t: f64,
    kind: &'static str,
    /// Whether it is a failure.
    fault: bool,
    /// Stable name, as in the log.
    name: &'static str,
    text: String,
    log: usize,
}

/// Facts about a log.
#[derive(Serialize)]
struct About {
    name: String,
    robot: String,
    scenario: String,
    program: String,
    seed: String,
    from: f64,
    to: f64,
    messages: u64,
    others: u64,
    whole: bool,
    more_events: u64,
    /// Faults that were injected.
    injected: Vec<String>,
    wrong: Vec<Wrong>,
    /// Causes beyond those listed.
    more_wrong: usize,
    /// Which required targets its run missed, and how many, if that is known.
    missed: Vec<Missed>,
    missed_told: String,
}

#[derive(Serialize)]
struct DifferenceLine {
    joint: &'static str,
    largest_mm: f64,
    at: f64,
    apart: Option<f64>,
    times: u64,
}

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    verdict: String,
    /// Remedy for the verdict.
    remedy: Option<String>,
    logs: Vec<About>,
    motion: Option<String>,
    drawn_as: Option<&'a str>,
    figures: Vec<Picture<'a>>,
    events: Vec<Line>,
    start_up: &'a [String],
    differences: Vec<DifferenceLine>,
    head: &'a [(String, String)],
    version: &'a str,
}

fn figure(group: &Group, logs: &[Named]) -> Figure {
    let panels = group.plots.iter().map(|plot| panel(plot, logs)).collect();
    Figure {
        id: group.id.to_owned(),
        title: group.title.to_owned(),
        caption: group.caption.to_owned(),
        panels,
    }
}

fn panel(plot: &Plot, logs: &[Named]) -> Panel {
    let ends = logs.iter().map(|log| log.content.range());
    let x_range = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| {
        (a.0.min(b.0), a.1.max(b.1))
    });
    let mut y_range = plot.least;
    let mut lines = Vec::new();
    for (i, log) in logs.iter().enumerate() {
        for curve in &plot.curves {
            let Some(thin) = log.content.signals.get(&curve.signal) else {
                continue;
            };
            if let Some((low, high)) = thin.range() {
                y_range = (y_range.0.min(low), y_range.1.max(high));
            }
            let colour = if i == 0 { curve.colour } else { curve.other };
            lines.push(line(&label(curve, i, logs), colour, 1, thin.points()));
        }
    }
    let margin = MARGIN * (y_range.1 - y_range.0).max(1e-6);
    let y_range = (y_range.0 - margin, y_range.1 + margin);
    let content = Drawn::lines((plot.unit, y_range), lines);
    let x_range = (x_range.0, x_range.1.max(x_range.0 + 1e-3));
    let mut panel = Panel::new(plot.title.clone(), x_range, 120, content).over(TIME);
    for log in logs {
        let faults = log.content.faults().map(|event| event.t_ns as f64 * 1e-9);
        panel.marks.extend(faults.take(MARKS));
    }
    panel.marked = "went wrong";
    panel.on_clock = true;
    panel
}

/// Text of the legend: for two logs, also which one.
fn label(curve: &Curve, log: usize, logs: &[Named]) -> String {
    let which = match (logs.len(), log) {
        (1, _) => "",
        (_, 0) => "first log",
        _ => "second log",
    };
    match (curve.label.as_str(), which) {
        (label, "") => label.to_owned(),
        ("", which) => which.to_owned(),
        (label, which) => format!("{label}, {which}"),
    }
}

fn about(log: &Named) -> About {
    let content = &log.content;
    let known = |kind| content.about(kind).unwrap_or("not said").to_owned();
    let (from, to) = content.range();
    let causes = content.causes();
    let injected = content.events.iter().filter(|event| event.injects());
    About {
        name: log.name.clone(),
        robot: known("robot"),
        scenario: known("scenario"),
        program: known("program"),
        seed: known("seed"),
        from,
        to,
        messages: content.end.messages,
        others: content.end.others,
        whole: content.end.whole,
        more_events: content.more_events,
        more_wrong: causes.len().saturating_sub(LISTED),
        injected: injected.map(|event| event.text()).collect(),
        wrong: listed(&causes, |t_s| t_s),
        missed: log.judged.missed.clone(),
        missed_told: log.judged.sentence(),
    }
}

/// Failures in the two logs: which one fails first, and how.
fn faults(logs: &[Named]) -> String {
    let both = ["First", "Second"].into_iter().zip(logs);
    let told = both.filter_map(|(which, log)| {
        let told = first_sentence(&log.content.causes())?;
        Some(format!(". {which} log: {told}"))
    });
    told.collect()
}

/// The sentence at the head.
pub(super) fn verdict(logs: &[Named], differences: &[Difference]) -> String {
    let largest = differences
        .iter()
        .filter(|d| d.times > 0)
        .max_by(|a, b| a.largest_mm.total_cmp(&b.largest_mm));
    let told = match (logs, largest) {
        ([_, _], None) => format!("The two logs have no time in common{}", faults(logs)),
        ([_, _], Some(d)) if d.largest_mm == 0.0 => {
            format!(
                "The strokes of the two logs are equal up to {:.2} s, the last time that both have{}",
                d.until_s,
                faults(logs)
            )
        }
        ([_, _], Some(d)) => format!(
            "The strokes of the two logs {}differ by up to {:.3} mm: {}, at {:.2} s{}",
            parting(differences),
            d.largest_mm,
            d.joint.to_lowercase(),
            d.largest_s,
            faults(logs)
        ),
        _ => return single(&logs[0]),
    };
    format!("{}{told}{}", unlike(logs), longer(logs))
}

/// Reasons why two logs cannot be alike.
fn unlike(logs: &[Named]) -> String {
    let [one, other] = logs else {
        return String::new();
    };
    let about = |kind, what: &str| {
        let [a, b] = [one, other].map(|log| log.content.about(kind).unwrap_or("not said"));
        (a != b).then(|| format!("different {what} ({a}, {b})"))
    };
    match (about("robot", "robots"), about("scenario", "scenarios")) {
        (None, None) => String::new(),
        (Some(a), Some(b)) => format!("The logs are of {a} and {b}. "),
        (Some(one), None) | (None, Some(one)) => format!("The logs are of {one}. "),
    }
}

/// Logs whose lengths differ by less than this differ only in their last samples, s.
const AS_LONG_S: f64 = 0.05;

/// The part of one of two logs beyond the end of the other.
fn longer(logs: &[Named]) -> String {
    let [one, other] = logs else {
        return String::new();
    };
    let [(_, one_s), (_, other_s)] = [one, other].map(|log| log.content.range());
    let which = if one_s > other_s { "first" } else { "second" };
    match (one_s - other_s).abs() {
        more_s if more_s < AS_LONG_S => String::new(),
        more_s => format!(". The {which} log goes on for {more_s:.2} s more"),
    }
}

/// Where the logs first differ.
fn parting(differences: &[Difference]) -> String {
    let apart = differences
        .iter()
        .filter_map(|d| Some((d.apart_s?, d.joint)));
    let first = apart.min_by(|a, b| a.0.total_cmp(&b.0));
    first.map_or_else(String::new, |(t_s, joint)| {
        format!("part at {t_s:.2} s, {}, and ", joint.to_lowercase())
    })
}

fn single(log: &Named) -> String {
    let content = &log.content;
    let (from, to) = content.range();
    let name = |kind| content.about(kind).unwrap_or("an unnamed one");
    let what = format!(
        "{:.2} s of {} on {}",
        to - from,
        name("robot"),
        name("scenario")
    );
    let missed = log.judged.sentence();
    match first_sentence(&content.causes()) {
        Some(told) => told,
        None if missed.is_empty() => format!("{what}: no fault"),
        None => format!("{what}: no fault, but {missed}"),
    }
}

/// Makes the page.
pub(super) fn make(
    logs: &[Named],
    groups: &[Group],
    differences: &[Difference],
    motion: &Motion,
    drawn_as: Option<&str>,
) -> Result<String, StudyError> {
    let verdict = verdict(logs, differences);
    let causes = logs[0].content.causes();
    let first = causes.first().filter(|_| logs.len() == 1);
    let remedy = first.and_then(|cause| cause.remedy.clone());
    let figures: Vec<(Figure, String)> = groups
        .iter()
        .map(|group| (figure(group, logs), String::new()))
        .collect();
    let mut events: Vec<Line> = Vec::new();
    for (i, log) in logs.iter().enumerate() {
        events.extend(log.content.events.iter().map(|event| Line {
            t: event.t_ns as f64 * 1e-9,
            kind: event.kind.map_or("", EventKind::name),
            fault: event.goes_wrong(),
            name: event.name(),
            text: event.text(),
            log: i + 1,
        }));
    }
    events.sort_by(|a, b| a.t.total_cmp(&b.t));
    let differences: Vec<DifferenceLine> = differences
        .iter()
        .map(|d| DifferenceLine {
            joint: d.joint,
            largest_mm: d.largest_mm,
            at: d.largest_s,
            apart: d.apart_s,
            times: d.times,
        })
        .collect();
    let values = Page {
        verdict,
        remedy,
        logs: logs.iter().map(about).collect(),
        motion: (!motion.is_empty()).then(|| json(motion)),
        drawn_as,
        figures: pictures(&figures),
        events,
        start_up: &logs[0].content.start_up,
        differences,
        head: &logs[0].content.head,
        version: env!("CARGO_PKG_VERSION"),
    };
    Ok(page(include_str!("template.html"), values)?)
}
