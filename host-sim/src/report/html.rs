//! The self-contained HTML page.

use minijinja::{Environment, Value, context};

use super::Summary;
use super::figures::Source;
use super::plot::Figure;
use crate::SimError;

const TEMPLATE: &str = include_str!("template.html");

/// Renders the page: no scripts, no links to anywhere else.
pub(super) fn render(
    source: &Source<'_>,
    summary: &Summary,
    figures: &[(Figure, String)],
) -> Result<String, SimError> {
    let mut env = Environment::new();
    env.add_template("report.html", TEMPLATE)?;
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
    let figures: Vec<Value> = figures
        .iter()
        .map(|(figure, svg)| {
            context! {
                id => &*figure.id,
                title => &*figure.title,
                short => figure.title.split(':').next(),
                caption => &*figure.caption,
                svg => Value::from_safe_string(svg.clone()),
            }
        })
        .collect();
    let start = source.analysis.start_s;
    let delays: Vec<Value> = source
        .analysis
        .start_delays
        .iter()
        .map(|d| {
            context! {
                step => d.step,
                name => d.move_name,
                at => format!("{:.3}", d.at_s - start),
                delay => d.delay_s.map_or_else(|| "did not move".to_owned(), |v| format!("{:.0}", v * 1e3)),
            }
        })
        .collect();
    let events: Vec<Value> = source
        .recording
        .events
        .iter()
        .map(|r| {
            context! {
                t => format!("{:.3}", r.t_s() - start).replace('-', "−"),
                kind => &*r.v.kind,
                text => &*r.v.text,
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
    let page = env.get_template("report.html")?.render(context! {
        summary => context! {
            scenario => &*summary.scenario,
            robot => &*summary.robot,
            version => summary.version,
            seed => summary.seed,
            hash => &*summary.hash,
            complete => summary.complete,
        },
        scenario_text => &*source.scenario.description,
        robot_text => &*source.robot.description,
        factor => format!("{:.1}", summary.realtime_factor),
        simulated => format!("{:.2}", summary.simulated_s),
        wall => format!("{:.2}", summary.wall_s),
        required => required.count(),
        met => met,
        shift => source.analysis.shift_s.map(|s| format!("{:.0}", s * 1e3)),
        messages => source.recording.messages,
        start => format!("{start:.3}"),
        targets => targets,
        figures => figures,
        delays => delays,
        events => events,
        parameters => parameters,
    })?;
    Ok(page)
}
