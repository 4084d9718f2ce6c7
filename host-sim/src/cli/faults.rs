//! `wheeleg faults`: what can go wrong, and what the robot does about it.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::print;
use crate::SimError;
use crate::faults::{KINDS, KindInfo};

/// Arguments of `wheeleg faults`.
#[derive(Debug, Args)]
pub(super) struct FaultsArgs {
    #[command(subcommand)]
    command: FaultsCommand,
}

#[derive(Debug, Subcommand)]
enum FaultsCommand {
    /// List the faults that a run can be given with --fault.
    List {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
}

/// Lists faults.
pub(super) fn command(args: &FaultsArgs) -> Result<ExitCode, SimError> {
    match args.command {
        FaultsCommand::List { json } => print(&listing(json)),
    }
}

fn listing(json: bool) -> String {
    if json {
        let list: Vec<serde_json::Value> = KINDS.iter().map(row_json).collect();
        return format!("{:#}\n", serde_json::json!({ "faults": list }));
    }
    let mut out =
        String::from("Faults (wheeleg run SCENARIO --fault NAME[:TARGET][=VALUE]@TIME[..TIME]):\n");
    for row in KINDS {
        let _ = writeln!(out, "\n  {}", row.name);
        let _ = writeln!(out, "      {}", row.doc);
        let _ = writeln!(out, "      strikes {}", row.place.expected());
        if let Some(v) = row.value {
            let _ = writeln!(
                out,
                "      value {}, default {}: {}",
                v.range(),
                v.default,
                v.doc
            );
        }
    }
    out
}

fn row_json(row: &KindInfo) -> serde_json::Value {
    serde_json::json!({
        "name": row.name,
        "description": row.doc,
        "strikes": row.place.expected(),
        "value": row.value.map(|v| serde_json::json!({
            "unit": v.unit, "min": v.min, "max": v.max, "default": v.default, "description": v.doc,
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_listed_with_its_state() {
        let text = listing(false);
        for row in KINDS {
            assert!(
                text.contains(&format!("\n  {}\n", row.name)),
                "{}",
                row.name
            );
        }
        let json: serde_json::Value = serde_json::from_str(&listing(true)).expect("JSON");
        assert_eq!(json["faults"].as_array().map(Vec::len), Some(KINDS.len()));
    }
}
