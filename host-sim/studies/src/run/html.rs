//! The self-contained HTML page.

use minijinja::{Value, context};

use super::Summary;
use super::figures::Source;
use crate::StudyError;
use wheeleg_protocol::NODE_NAMES;
use wheeleg_report::plot::Figure;
use wheeleg_report::{page, pictures};
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
