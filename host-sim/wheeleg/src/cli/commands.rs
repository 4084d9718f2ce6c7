//! `wheeleg commands`: the commands of the master with their arguments, as text, JSON or the
//! page of the reference.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use wheeleg_master::argument::{Argument, ArgumentKind, Limits};
use wheeleg_master::command::{TABLE, write_markdown};

use super::print;
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
        // A text grows as long as there is memory.
        let _ = write_markdown(&mut page);
        return print(&page);
    }
    print(&text())
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
    let commands: Vec<Value> = TABLE
        .iter()
        .map(|row| {
            let arguments: Vec<Value> = row.arguments.iter().map(argument).collect();
            json!({
                "name": row.name,
                "code": row.code as u16,
                "layer": row.code.layer() as u8,
                "effect": row.effect,
                "arguments": arguments,
            })
        })
        .collect();
    json!({ "commands": commands })
}

/// An argument; its limits are in its unit.
fn argument(argument: &Argument) -> Value {
    let mut value = json!({
        "name": argument.name,
        "kind": argument.kind.name(),
        "unit": argument.kind.unit(),
        "description": argument.doc,
    });
    // The shortest decimal number that means the limit.
    let number = |text: String| text.parse::<f64>().map_or(Value::Null, Value::from);
    match argument.kind {
        ArgumentKind::Whole(Limits { min, max }) => {
            value["min"] = json!(min);
            value["max"] = json!(max);
        }
        ArgumentKind::Length(Limits { min, max })
        | ArgumentKind::Velocity(Limits { min, max })
        | ArgumentKind::Acceleration(Limits { min, max })
        | ArgumentKind::Rate(Limits { min, max }) => {
            value["min"] = number(min.to_string());
            value["max"] = number(max.to_string());
        }
        ArgumentKind::Time(Limits { min, max }) => {
            value["min"] = json!(f64::from(min) / 1e6);
            value["max"] = json!(f64::from(max) / 1e6);
        }
        ArgumentKind::Choice(words) => value["choices"] = json!(words),
        ArgumentKind::Flag | ArgumentKind::Parameter | ArgumentKind::Raw => {}
    }
    value
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
        let rate = &commands[25]["arguments"][4];
        let limits = (&rate["min"], &rate["max"], &rate["unit"]);
        assert_eq!(limits, (&json!(0.05), &json!(2.0), &json!("rad/s")));
        let period = &commands[24]["arguments"][1];
        assert_eq!(
            (&period["min"], &period["max"]),
            (&json!(0.5), &json!(60.0))
        );
    }
}
