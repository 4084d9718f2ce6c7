//! The self-contained HTML page.

use minijinja::{Value, context};

use super::Summary;
use super::figures::Source;
use crate::StudyError;
use wheeleg_protocol::NODE_NAMES;
use wheeleg_report::plot::Figure;
use wheeleg_report::{page, pictures};
use wheeleg_telemetry::event::BoardChange;
use wheeleg_telemetry::messages::after_power_up;
use wheeleg_telemetry::{Cause, Event, EventKind, LinkSample, Row};

const TEMPLATE: &str = include_str!("template.html");

/// A line of the table of events.
struct Line {
    t_ns: u64,
    kind: EventKind,
    text: String,
}

/// Events as lines of a table. What happens to several boards at the same time becomes one line
/// that names them all.
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
            text: cause.to_string(),
        });
    }
    lines
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
            drift => v.drift_ppm.to_string().replace('-', "−"),
            parameters => format!("{:08x}", v.parameters),
        }
    })
    .collect()
}

/// Renders the page: no scripts, no links to anywhere else.
pub(super) fn render(
    source: &Source<'_>,
    summary: &Summary,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let targets: Vec<Value> = summary
        .targets
        .iter()
        .map(|t| {
            let verdict = t.verdict();
            context! {
                id => &*t.id,
                description => &*t.description,
                value => t.value_text().replace('-', "−"),
                unit => t.unit,
                band => t.band_text().replace('-', "−"),
                verdict => verdict,
                class => match verdict {
                    "PASS" => "pass",
                    "FAIL" => "fail",
                    _ => "info",
                },
            }
        })
        .collect();
    let figures = pictures(figures);
    let delays: Vec<Value> = source
        .analysis
        .start_delays
        .iter()
        .map(|d| {
            context! {
                step => d.step,
                name => d.move_name,
                at => format!("{:.3}", d.at_s),
                delay => d.delay_s.map_or_else(|| "did not move".to_owned(), |v| format!("{:.0}", v * 1e3)),
            }
        })
        .collect();
    // The start-up is a story of its own, told at time zero.
    let all = &source.recording.events;
    let start_up: Vec<String> = all
        .iter()
        .filter_map(|r| {
            let at = after_power_up(r.v.start_up_us?);
            Some(format!("{at}: {}", r.v.cause))
        })
        .collect();
    // What the boards logged themselves stands in the log and its tables.
    let later = all
        .iter()
        .filter(|r| r.v.start_up_us.is_none() && r.v.cause.kind() != EventKind::Log);
    let events: Vec<Value> = grouped(later)
        .into_iter()
        .map(|line| {
            context! {
                t => format!("{:.3}", line.t_ns as f64 * 1e-9),
                kind => line.kind.name(),
                text => line.text,
            }
        })
        .collect();
    let parameters: Vec<Value> = source
        .robot
        .parameters
        .iter()
        .map(|p| {
            context! {
                path => &*p.path,
                value => p.value_text(),
                unit => &*p.unit,
                source => &*p.source,
                doc => p.doc,
            }
        })
        .collect();
    let required = summary.targets.iter().filter(|t| t.required);
    let met = required.clone().filter(|t| t.pass).count();
    let values = context! {
        summary => context! {
            scenario => &*summary.scenario,
            robot => &*summary.robot,
            version => summary.version,
            seed => summary.seed,
            hash => &*summary.hash,
            complete => summary.complete,
            dropped => summary.dropped_messages,
            faults => &summary.faults,
        },
        scenario_text => &*source.scenario.description,
        robot_text => &*source.robot.description,
        pil => summary.pil.as_ref().map(super::boards::context),
        factor => format!("{:.1}", summary.realtime_factor),
        simulated => format!("{:.2}", summary.simulated_s),
        wall => format!("{:.2}", summary.wall_s),
        required => required.count(),
        met => met,
        shift => source.analysis.shift_s.map(|s| format!("{:.0}", s * 1e3)),
        messages => source.recording.messages,
        unwritten => &summary.unwritten,
        period_ms => source.recording.period_ms,
        left_out => source.recording.events_left_out,
        start => format!("{:.3}", source.analysis.start_s),
        targets => targets,
        figures => figures,
        delays => delays,
        events => events,
        links => links(&source.recording.links),
        start_up => start_up,
        parameters => parameters,
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
