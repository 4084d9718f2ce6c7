//! The self-contained HTML page.

use minijinja::{Value, context};
use serde::Serialize;

use super::Summary;
use super::boards::Boards;
use super::figures::Source;
use crate::StudyError;
use crate::analysis::StartDelay;
use wheeleg_protocol::NODE_NAMES;
use wheeleg_report::plot::Figure;
use wheeleg_report::{Picture, page, pictures};
use wheeleg_sim::START_UP;
use wheeleg_telemetry::{EventSample, LinkSample, Row};

const TEMPLATE: &str = include_str!("template.html");

/// Events as lines of a table: time, kind, text. What several boards report at
/// the same time in the same words becomes one line that names them all.
fn grouped(events: &[Row<EventSample>]) -> Vec<(f64, &str, String)> {
    // Time, kind, boards, words.
    let mut lines: Vec<(u64, &str, Vec<&str>, &str)> = Vec::new();
    for row in events {
        let (kind, text) = (row.v.kind.as_str(), row.v.text.as_str());
        let (board, words) = match text.split_once(": ") {
            Some((board, words)) if board.starts_with("joint ") || board.starts_with("wheel ") => {
                (Some(board), words)
            }
            _ => (None, text),
        };
        let same = lines.iter_mut().rev().take_while(|l| l.0 == row.t_ns);
        let mut same = same.filter(|l| l.1 == kind && l.3 == words && !l.2.is_empty());
        match (board, same.next()) {
            (Some(board), Some(line)) => line.2.push(board),
            _ => lines.push((row.t_ns, kind, board.into_iter().collect(), words)),
        }
    }
    lines
        .into_iter()
        .map(|(t_ns, kind, boards, words)| {
            let text = if boards.is_empty() {
                words.to_owned()
            } else {
                format!("{}: {words}", boards.join(", "))
            };
            (t_ns as f64 * 1e-9, kind, text)
        })
        .collect()
}

/// What each board heard on the bus, as it told last; without those that never told.
fn links(links: &[Vec<Row<LinkSample>>; 8]) -> Vec<Value> {
    let last = NODE_NAMES.iter().zip(links);
    let last = last.filter_map(|(name, rows)| Some((name, rows.last()?)));
    last.map(|(name, row)| {
        let v = &row.v;
        context! {
            node => *name,
            frames => v.frames,
            counts => [v.overflow, v.truncated, v.short, v.crc, v.version, v.length, v.address, v.unsent],
            drift => v.drift_ppm,
            parameters => format!("{:08x}", v.parameters),
        }
    })
    .collect()
}

/// What the template shows.
#[derive(Serialize)]
struct Page<'a> {
    summary: &'a Summary,
    verdict: String,
    scenario_text: &'a str,
    robot_text: &'a str,
    pil: Option<Boards<'a>>,
    required: usize,
    met: usize,
    shift_s: Option<f64>,
    messages: u64,
    start_s: f64,
    targets: Vec<Judged<'a>>,
    figures: Vec<Picture<'a>>,
    delays: &'a [StartDelay],
    events: Vec<Value>,
    links: Vec<Value>,
    start_up: Vec<String>,
    parameters: Vec<Parameter<'a>>,
}

/// A target as the page shows it.
#[derive(Serialize)]
struct Judged<'a> {
    id: &'a str,
    description: &'a str,
    value: String,
    unit: &'a str,
    band: String,
    verdict: &'static str,
}

/// A parameter of the robot as the page shows it.
#[derive(Serialize)]
struct Parameter<'a> {
    path: &'a str,
    value: String,
    unit: &'a str,
    source: &'a str,
    doc: &'a str,
}

/// The page's first sentence.
fn verdict(summary: &Summary) -> String {
    let required = summary.targets.iter().filter(|t| t.required);
    let (count, missed) = (required.clone().count(), required.filter(|t| !t.pass));
    let missed: Vec<&str> = missed.map(|t| t.id.as_str()).collect();
    let differing = summary.pil.as_ref().map_or(0, |pil| pil.differing_bits);
    if !summary.complete {
        "Stopped before its end: nothing is judged.".to_owned()
    } else if differing > 0 {
        format!("Boards differ from the native application in {differing} bits.")
    } else if count == 0 {
        "Ran to its end; the scenario has no required target.".to_owned()
    } else if missed.is_empty() {
        format!("Passed: all {count} required targets are met.")
    } else {
        format!(
            "Failed: {} of {count} required targets missed ({}).",
            missed.len(),
            missed.join(", ")
        )
    }
}

/// Renders the page: no scripts, no links to anywhere else.
pub(super) fn render(
    source: &Source<'_>,
    summary: &Summary,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let targets = summary.targets.iter().map(|target| Judged {
        id: &target.id,
        description: &target.description,
        value: target.value_text(),
        unit: target.unit,
        band: target.band_text(),
        verdict: target.verdict(),
    });
    // The start-up is a story of its own, told at time zero.
    let all = &source.recording.events;
    let begin = all.partition_point(|r| r.v.text.starts_with(START_UP));
    let start_up: Vec<String> = all[..begin]
        .iter()
        .map(|r| r.v.text.trim_start_matches(START_UP).to_owned())
        .collect();
    // What the boards logged themselves stands in the log and its tables.
    let told = all[begin..].iter().filter(|r| r.v.kind != "log").cloned();
    let told: Vec<Row<EventSample>> = told.collect();
    let events: Vec<Value> = grouped(&told)
        .into_iter()
        .map(|(t_s, kind, text)| {
            context! {
                t => format!("{t_s:.3}"),
                kind => kind,
                text => text,
            }
        })
        .collect();
    let parameters = source.robot.parameters.iter().map(|p| Parameter {
        path: &p.path,
        value: p.value_text(),
        unit: &p.unit,
        source: &p.source,
        doc: p.doc,
    });
    let required = summary.targets.iter().filter(|t| t.required);
    let met = required.clone().filter(|t| t.pass).count();
    let values = Page {
        summary,
        verdict: verdict(summary),
        scenario_text: &source.scenario.description,
        robot_text: &source.robot.description,
        pil: summary.pil.as_ref().map(Boards::new),
        required: required.count(),
        met,
        shift_s: source.analysis.shift_s,
        messages: source.recording.messages,
        start_s: source.analysis.start_s,
        targets: targets.collect(),
        figures: pictures(figures),
        delays: &source.analysis.start_delays,
        events,
        links: links(&source.recording.links),
        start_up,
        parameters: parameters.collect(),
    };
    Ok(page(TEMPLATE, values)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boards_that_say_the_same_share_a_line() {
        let row = |ms: u64, kind: &str, text: &str| Row {
            t_ns: ms * 1_000_000,
            v: EventSample {
                kind: kind.to_owned(),
                text: text.to_owned(),
            },
        };
        let events = [
            row(10, "mode", "joint 1: Tracking to Hold"),
            row(10, "fault", "joint 1: no SYNC: check the cable"),
            row(10, "mode", "wheel 7: Tracking to Hold"),
            row(10, "fault", "wheel 7: no SYNC: check the cable"),
            row(10, "info", "master: a thing"),
            row(10, "info", "master: a thing"),
            row(11, "mode", "joint 2: Tracking to Hold"),
        ];
        let lines = grouped(&events);
        let texts: Vec<&str> = lines.iter().map(|l| l.2.as_str()).collect();
        let expected = [
            "joint 1, wheel 7: Tracking to Hold",
            "joint 1, wheel 7: no SYNC: check the cable",
            "master: a thing",
            "master: a thing",
            "joint 2: Tracking to Hold",
        ];
        assert_eq!(texts, expected);
        assert!((lines[4].0 - 0.011).abs() < 1e-12);
    }
}
