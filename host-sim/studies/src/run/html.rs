//! The self-contained HTML page.

use minijinja::{Value, context};
use serde::Serialize;

use super::Summary;
use super::boards::Boards;
use super::figures::Source;
use super::motion::motion;
use crate::StudyError;
use crate::analysis::{Judgement, StartDelay, Target};
use crate::cause::{self, FaultEvent, Wrong};
use wheeleg_protocol::NODE_NAMES;
use wheeleg_report::number::minus;
use wheeleg_report::plot::Figure;
use wheeleg_report::{Picture, json, page, pictures};
use wheeleg_telemetry::event::BoardChange;
use wheeleg_telemetry::messages::after_power_up;
use wheeleg_telemetry::{Cause, Event, EventCode, EventKind, LinkSample, Row};

const TEMPLATE: &str = include_str!("template.html");

/// A line of the table of events.
struct Line {
    t_ns: u64,
    kind: EventKind,
    code: EventCode,
    text: String,
}

/// Events as lines of a table. The same change of several boards at the same time becomes one line that names
/// them all.
fn grouped<'a>(events: impl Iterator<Item = &'a Row<Event>>) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    // Changes of boards at one time, each with its boards and the place of its line.
    let mut changes: Vec<(BoardChange, Vec<String>, usize)> = Vec::new();
    for row in events {
        if lines.last().is_some_and(|last| last.t_ns != row.t_ns) {
            changes.clear();
        }
        let cause = &row.v.cause;
        if let Cause::Board { board, change } = cause {
            if let Some((_, boards, place)) = changes.iter_mut().find(|known| known.0 == *change) {
                boards.push(board.to_string());
                lines[*place].text = format!("{}: {change}", boards.join(", "));
                continue;
            }
            changes.push((*change, vec![board.to_string()], lines.len()));
        }
        lines.push(Line {
            t_ns: row.t_ns,
            kind: cause.kind(),
            code: cause.code(),
            text: cause.to_string(),
        });
    }
    lines
}

/// What each board heard on the bus, by its last report; without boards that never reported.
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

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    summary: &'a Summary,
    verdict: String,
    /// First failure.
    cause: Option<String>,
    remedy: Option<String>,
    wrong: Vec<Wrong>,
    /// Causes beyond those listed.
    more_wrong: usize,
    scenario_text: &'a str,
    robot_text: &'a str,
    pil: Option<Boards<'a>>,
    required: usize,
    met: usize,
    shift_s: Option<f64>,
    /// Residual of b5 and b6 against the shifted model, mm.
    residual_mm: Option<[f64; 2]>,
    messages: u64,
    /// Period of the rows of fast channels in the figures, ms.
    period_ms: u64,
    /// Events that only the log has.
    left_out: u64,
    start_s: f64,
    missed: Vec<Judged<'a>>,
    targets: Vec<Judged<'a>>,
    /// Data of the page's robot animation, as JSON.
    motion: Option<String>,
    figures: Vec<Picture<'a>>,
    delays: &'a [StartDelay],
    events: Vec<Value>,
    links: Vec<Value>,
    start_up: Vec<String>,
    parameters: Vec<Parameter<'a>>,
}

/// A target for the page.
#[derive(Serialize)]
struct Judged<'a> {
    id: &'a str,
    description: &'a str,
    value: String,
    unit: &'a str,
    band: String,
    /// Value and requirement, with their unit.
    measured: String,
    asked: String,
    /// None for a run that was cut short.
    judgement: Option<Judgement>,
    required: bool,
}

impl<'a> Judged<'a> {
    fn new(target: &'a Target, complete: bool) -> Self {
        Self {
            id: &target.id,
            description: &target.description,
            value: target.value_text(),
            unit: target.unit_text(),
            band: target.band_text(),
            measured: target.measured_text(),
            asked: target.asked_text(),
            judgement: complete.then(|| target.judgement()),
            required: target.required,
        }
    }
}

/// A parameter of the robot for the page.
#[derive(Serialize)]
struct Parameter<'a> {
    path: &'a str,
    value: String,
    unit: &'a str,
    source: &'a str,
    doc: &'a str,
}

/// The page's first sentence: what came of the run, and what that is worth.
/// Where a required target is missed, the cause, if there is one, is taken in place of the first of them.
fn verdict(summary: &Summary, cause: &mut Option<String>) -> String {
    let required = summary.targets.iter().filter(|t| t.required);
    let count = required.clone().count();
    let missed: Vec<&Target> = required.filter(|t| !t.pass).collect();
    let differing = summary.pil.as_ref().map_or(0, |pil| pil.differing_bits);
    let name = &summary.scenario;
    if summary.failure.is_some() {
        format!("{name}: the run failed; nothing is judged.")
    } else if !summary.complete {
        format!("{name}: stopped before its end; nothing is judged.")
    } else if differing > 0 {
        format!("{name}: boards differ from the native application in {differing} bits.")
    } else if count == 0 {
        format!("{name}: ran to its end; the scenario requires nothing.")
    } else if let Some(first) = missed.first() {
        if let Some(cause) = cause.take() {
            return format!(
                "{name}: {} of {count} required targets missed. {cause}.",
                missed.len()
            );
        }
        let what = first.name_text();
        let [measured, asked] = [first.measured_text(), first.asked_text()].map(|t| minus(&t));
        let more = match missed.len() - 1 {
            0 => String::new(),
            n => format!("; {n} more below"),
        };
        format!(
            "{name}: {} of {count} required targets missed: {what}, {measured}, asked {asked}{more}.",
            missed.len()
        )
    } else {
        format!("{name}: all {count} required targets are met.")
    }
}

/// Renders the page, which links to nothing else. Its script draws figures and robot from the data in it;
/// without scripts, verdicts, tables and pictures are still there.
pub(super) fn render(
    source: &Source<'_>,
    summary: &Summary,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let judged = |target| Judged::new(target, summary.complete);
    let missed = summary
        .targets
        .iter()
        .filter(|t| summary.complete && t.judgement() == Judgement::Missed);
    let motion = motion(source);
    // The start-up is listed on its own, at time zero.
    let all = &source.recording.events;
    let start_up: Vec<String> = all
        .iter()
        .filter_map(|r| {
            let at = after_power_up(r.v.start_up_us?);
            Some(format!("{at}: {}", r.v.cause))
        })
        .collect();
    // The boards' own log messages are in the log and its tables.
    let later = all
        .iter()
        .filter(|r| r.v.start_up_us.is_none() && r.v.cause.kind() != EventKind::Log);
    let events: Vec<Value> = grouped(later)
        .into_iter()
        .map(|line| {
            context! {
                t => format!("{:.3}", line.t_ns as f64 * 1e-9),
                kind => line.kind.name(),
                name => line.code.name(),
                wrong => cause::goes_wrong(Some(line.kind), Some(line.code)),
                text => line.text,
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
    let faults = all
        .iter()
        .filter_map(|row| FaultEvent::of(row.t_ns, &row.v));
    let causes = cause::causes(faults);
    let mut cause = cause::first_sentence(&causes);
    let verdict = verdict(summary, &mut cause);
    let values = Page {
        summary,
        cause,
        verdict,
        remedy: causes.first().and_then(|first| first.remedy.clone()),
        wrong: cause::listed(&causes, |t_s| source.t(t_s)),
        more_wrong: causes.len().saturating_sub(cause::LISTED),
        scenario_text: &source.scenario.description,
        robot_text: &source.robot.description,
        pil: summary.pil.as_ref().map(Boards::new),
        required: required.count(),
        met,
        shift_s: source.analysis.fit.map(|fit| fit.shift_s),
        residual_mm: source.analysis.fit.map(|fit| fit.residual_mm),
        messages: source.recording.messages,
        period_ms: source.recording.period_ms,
        left_out: source.recording.events_left_out,
        start_s: source.analysis.start_s,
        missed: missed.map(judged).collect(),
        targets: summary.targets.iter().map(judged).collect(),
        motion: (!motion.is_empty()).then(|| json(&motion)),
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
    use wheeleg_master::event::Event as MasterEvent;
    use wheeleg_protocol::{Address, Fault, NodeMode};

    #[test]
    fn boards_that_change_alike_share_a_line() {
        let board = |number: u8, change| Cause::Board {
            board: Address::new(number).expect("a board"),
            change,
        };
        let holds = BoardChange::Mode {
            from: NodeMode::Tracking,
            to: NodeMode::Hold,
        };
        let lost = BoardChange::FaultLatched(Fault::LinkLost);
        let homed = || Cause::Master(MasterEvent::Homed);
        let events = [
            (10, board(1, holds)),
            (10, board(1, lost)),
            (10, board(7, holds)),
            (10, board(7, lost)),
            (10, homed()),
            (10, homed()),
            (11, board(2, holds)),
        ];
        let rows: Vec<Row<Event>> = events
            .into_iter()
            .map(|(ms, cause)| Row {
                t_ns: ms * 1_000_000,
                v: cause.into(),
            })
            .collect();
        let lines = grouped(rows.iter());
        let texts: Vec<&str> = lines.iter().map(|l| l.text.as_str()).collect();
        let lost = format!("joint 1, wheel 7: {}", Fault::LinkLost);
        let expected = [
            "joint 1, wheel 7: Tracking to Hold",
            &lost,
            "master: start pose reached",
            "master: start pose reached",
            "joint 2: Tracking to Hold",
        ];
        assert_eq!(texts, expected);
        assert_eq!(lines[1].kind, EventKind::Fault);
        assert_eq!(lines[4].t_ns, 11_000_000);
    }
}
