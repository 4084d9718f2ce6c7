//! `wheeleg channels`: the telemetry registry, as text or JSON.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;

use super::{print, show};
use wheeleg_studies::StudyError;
use wheeleg_telemetry::{channels, derived};

/// Arguments of `wheeleg channels`.
#[derive(Debug, Args)]
pub(super) struct ChannelsArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints the telemetry channels.
pub(super) fn command(args: &ChannelsArgs) -> Result<ExitCode, StudyError> {
    tell(args.json)
}

/// Prints the listing.
pub(super) fn tell(json: bool) -> Result<ExitCode, StudyError> {
    match json {
        true => print(&text(true)),
        false => show(&text(false)),
    }
}

/// The listing.
fn text(json: bool) -> String {
    if json {
        let list: Vec<serde_json::Value> = channels()
            .iter()
            .map(|c| {
                let fields: Vec<serde_json::Value> = c
                    .fields
                    .iter()
                    .map(|f| {
                        serde_json::json!({
                            "name": f.name,
                            "unit": f.unit,
                            "type": f.ty.json(),
                            "layer": f.layer.name(),
                            "description": f.doc,
                        })
                    })
                    .collect();
                serde_json::json!({
                    "topic": c.topic,
                    "schema": c.schema,
                    "rate_hz": c.rate_hz,
                    "written": c.written.name(),
                    "description": c.doc,
                    "fields": fields,
                })
            })
            .collect();
        let derived: Vec<serde_json::Value> = derived()
            .iter()
            .map(|d| {
                serde_json::json!({
                    "topic": d.topic,
                    "schema": d.schema,
                    "rate_hz": d.rate_hz,
                    "written": d.written().name(),
                    "description": d.doc,
                })
            })
            .collect();
        let all = serde_json::json!({ "channels": list, "derived": derived });
        return format!("{all:#}\n");
    }
    let mut out = String::new();
    let mut described: Vec<&str> = Vec::new();
    for c in channels() {
        let rate = c.rate();
        let _ = writeln!(out, "{:13} {rate:15} {:18} {}", c.topic, c.schema, c.doc);
        if described.contains(&c.schema) {
            continue;
        }
        described.push(c.schema);
        for f in c.fields {
            let _ = writeln!(
                out,
                "    {:22} {:6} {:8} {:7} {}",
                f.name,
                f.unit,
                f.ty.json(),
                f.layer.name(),
                f.doc
            );
        }
    }
    // Topics for viewers; their fields follow Foxglove's schemas.
    for d in derived() {
        let rate = d.rate();
        let _ = writeln!(out, "{:16} {rate:10} {:24} {}", d.topic, d.schema, d.doc);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listing_names_every_field_once() {
        let text = text(false);
        assert_eq!(text.matches("force_net_raw_n").count(), 1);
        assert!(text.contains("/joint/6") && text.contains("500 Hz"));
    }
}
