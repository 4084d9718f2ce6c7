//! `wheeleg params`: the parameters of a robot with unit, range and source.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;

use super::{print, show};
use wheeleg_config::{ParameterInfo, builtin};
use wheeleg_studies::StudyError;

/// Arguments of `wheeleg params`.
#[derive(Debug, Args)]
pub(super) struct ParamsArgs {
    /// Built-in robot or path of a TOML file.
    #[arg(default_value = builtin::DEFAULT_ROBOT)]
    robot: String,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints every parameter of a robot.
pub(super) fn command(args: &ParamsArgs) -> Result<ExitCode, StudyError> {
    let robot = builtin::robot(&args.robot)?;
    if args.json {
        let list: Vec<serde_json::Value> = robot
            .parameters
            .iter()
            .map(|p| {
                serde_json::json!({
                    "name": p.path,
                    "value": if p.value.len() == 1 {
                        serde_json::json!(p.value[0])
                    } else {
                        serde_json::json!(p.value)
                    },
                    "unit": p.unit,
                    "min": p.min,
                    "max": p.max,
                    "source": p.source,
                    "description": p.doc,
                })
            })
            .collect();
        let value = serde_json::json!({ "robot": robot.name, "parameters": list });
        return print(&format!("{value:#}\n"));
    }
    let mut out = format!("{}: {}\n", robot.name, robot.description);
    let section = |p: &ParameterInfo| match p.path.rsplit_once('.') {
        Some((section, key)) => (section.to_owned(), key.to_owned()),
        None => (String::new(), p.path.clone()),
    };
    let mut last = String::new();
    for p in &robot.parameters {
        let (heading, key) = section(p);
        if heading != last {
            let _ = writeln!(out, "\n[{heading}]");
            last = heading;
        }
        let value = format!("{} {}", p.value_text(), p.unit);
        let range = format!("({})", p.range_text());
        let _ = writeln!(out, "  {key:22} {value:24} {range:26} {}", p.doc);
        let _ = writeln!(out, "  {:22} {}", "", p.source);
    }
    show(&out)
}
