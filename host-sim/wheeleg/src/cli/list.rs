//! `wheeleg list`: what is built in.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;

use super::{print, show};
use wheeleg_config::builtin;
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

/// Prints the built-in scenarios and robots.
pub(super) fn command(args: &ListArgs) -> Result<ExitCode, StudyError> {
    let json = args.json;
    if args.channels {
        return super::channels::tell(json);
    }
    let mut scenarios = Vec::new();
    for (name, ..) in builtin::SCENARIOS {
        scenarios.push((*name, builtin::scenario(name)?.description));
    }
    let mut robots = Vec::new();
    for (name, ..) in builtin::ROBOTS {
        robots.push((*name, builtin::robot(name)?.description));
    }
    if json {
        let entries = |list: &[(&str, String)]| -> Vec<serde_json::Value> {
            list.iter()
                .map(|(name, text)| serde_json::json!({ "name": name, "description": text }))
                .collect()
        };
        let value = serde_json::json!({
            "scenarios": entries(&scenarios),
            "robots": entries(&robots),
        });
        return print(&format!("{value:#}\n"));
    }
    let width = scenarios
        .iter()
        .chain(&robots)
        .map(|(n, _)| n.len())
        .max()
        .unwrap_or(0);
    let mut out = String::from("Scenarios (wheeleg run NAME):\n");
    for (name, text) in &scenarios {
        let _ = writeln!(out, "  {name:width$}  {text}");
    }
    out.push_str("\nRobots (wheeleg run --robot NAME, wheeleg params NAME):\n");
    for (name, text) in &robots {
        let _ = writeln!(out, "  {name:width$}  {text}");
    }
    show(&out)
}
