//! `wheeleg commands`: the master's commands with their arguments, as text, JSON or the page of the
//! reference.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use wheeleg_console::command_list;
use wheeleg_master::command::{TABLE, write_markdown};

use super::{print, show};
use wheeleg_studies::StudyError;

/// Arguments of `wheeleg commands`.
#[derive(Debug, Args)]
pub(super) struct CommandsArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Print the page docs/reference/commands.md.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
}

/// Prints the commands that a scenario can give.
pub(super) fn command(args: &CommandsArgs) -> Result<ExitCode, StudyError> {
    if args.json {
        return print(&format!("{:#}\n", as_json()));
    }
    if args.markdown {
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = write_markdown(&mut page);
        return print(&page);
    }
    show(&text())
}

fn text() -> String {
    let mut out = String::from(
        "Commands of scenario files ([[events]] with action = \"command\"), and their arguments:\n",
    );
    for row in TABLE {
        let _ = writeln!(out, "\n{:19} {}", row.name, row.effect);
        for argument in row.arguments {
            let range = argument.range().to_string();
            let _ = writeln!(out, "  {:17} {range:24} {}", argument.name, argument.doc);
        }
    }
    out
}

fn as_json() -> Value {
    json!({ "commands": command_list() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_and_argument_is_listed() {
        let text = text();
        let value = as_json();
        let commands = value["commands"].as_array().expect("a list");
        assert_eq!(commands.len(), TABLE.len());
        for (row, shown) in TABLE.iter().zip(commands) {
            assert!(text.contains(&format!("\n{} ", row.name)), "{}", row.name);
            assert_eq!(shown["name"], row.name);
            let arguments = shown["arguments"].as_array().expect("a list");
            assert_eq!(arguments.len(), row.arguments.len());
        }
        let named = |name: &str| {
            let found = commands.iter().find(|c| c["name"] == name);
            found.expect("listed")
        };
        let rate = &named("FootTrajectory")["arguments"][4];
        let limits = (&rate["min"], &rate["max"], &rate["unit"]);
        assert_eq!(limits, (&json!(0.05), &json!(2.0), &json!("rad/s")));
        let period = &named("SetGait")["arguments"][1];
        assert_eq!(
            (&period["min"], &period["max"]),
            (&json!(0.5), &json!(60.0))
        );
    }
}
