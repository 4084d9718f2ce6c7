//! `wheeleg list`: what is built in.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;

use super::{print, show};
use wheeleg_config::axis::AXES;
use wheeleg_config::bench::{Kind, Move};
use wheeleg_config::{AxisConfig, builtin};
use wheeleg_studies::StudyError;

/// Arguments of `wheeleg list`.
#[derive(Debug, Args)]
pub(super) struct ListArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// List the telemetry channels instead.
    #[arg(long)]
    channels: bool,
}

/// Built-in items of one kind: key in JSON, heading with the command that takes them, names with
/// descriptions.
struct Section {
    key: &'static str,
    heading: &'static str,
    entries: Vec<(&'static str, String)>,
}

fn sections() -> Result<[Section; 6], StudyError> {
    let mut scenarios = Vec::new();
    for (name, ..) in builtin::SCENARIOS {
        scenarios.push((*name, builtin::scenario(name)?.description));
    }
    let mut robots = Vec::new();
    for (name, ..) in builtin::ROBOTS {
        robots.push((*name, builtin::robot(name)?.description));
    }
    let mut axes = Vec::new();
    for (name, ..) in AXES {
        axes.push((*name, AxisConfig::load(name)?.description));
    }
    let plans = builtin::PLANS
        .iter()
        .map(|(name, _, text)| (*name, question(text)));
    let described = |about: &str| about.trim_end_matches('.').to_owned();
    Ok([
        Section {
            key: "scenarios",
            heading: "Scenarios (wheeleg run NAME)",
            entries: scenarios,
        },
        Section {
            key: "robots",
            heading: "Robots (wheeleg run --robot NAME, wheeleg params NAME)",
            entries: robots,
        },
        Section {
            key: "axes",
            heading: "Axes (wheeleg compare --axis NAME; `axis` in the [base] of a plan)",
            entries: axes,
        },
        Section {
            key: "plans",
            heading: "Plans (wheeleg campaign run NAME)",
            entries: plans.collect(),
        },
        Section {
            key: "moves",
            heading: "Moves of an axis (wheeleg compare --move NAME; `move` in a plan)",
            entries: Move::ALL.map(|m| (m.name(), described(m.about()))).to_vec(),
        },
        Section {
            key: "controllers",
            heading: "Controllers of an axis (wheeleg compare --controller NAME; `controller` in a plan)",
            entries: Kind::ALL.map(|k| (k.name(), described(k.about()))).to_vec(),
        },
    ])
}

/// The question that a plan answers: the first sentence of its opening comment.
fn question(text: &str) -> String {
    let comment = text.lines().map_while(|line| line.strip_prefix('#'));
    let comment: Vec<&str> = comment.map(str::trim).collect();
    let comment = comment.join(" ");
    let end = comment
        .find(['?', '.', ':'])
        .map_or(comment.len(), |end| end + 1);
    comment[..end].trim_end_matches(['.', ':']).to_owned()
}

/// Prints what is built in.
pub(super) fn command(args: &ListArgs) -> Result<ExitCode, StudyError> {
    if args.channels {
        return super::channels::tell(args.json);
    }
    let sections = sections()?;
    if args.json {
        let entries = |section: &Section| -> Vec<serde_json::Value> {
            let entries = section.entries.iter();
            entries
                .map(|(name, text)| serde_json::json!({ "name": name, "description": text }))
                .collect()
        };
        let value: serde_json::Map<String, serde_json::Value> = (sections.iter())
            .map(|section| (section.key.to_owned(), entries(section).into()))
            .collect();
        return print(&format!("{:#}\n", serde_json::Value::from(value)));
    }
    let entries = sections.iter().flat_map(|section| &section.entries);
    let width = entries.map(|(name, _)| name.len()).max().unwrap_or(0);
    let texts = sections.iter().map(|section| {
        let mut out = format!("{}:\n", section.heading);
        for (name, text) in &section.entries {
            let _ = writeln!(out, "  {name:width$}  {text}");
        }
        out
    });
    show(&texts.collect::<Vec<_>>().join("\n"))
}
