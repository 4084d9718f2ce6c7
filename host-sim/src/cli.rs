//! The command line.

use std::fmt::Write as _;
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::SimError;
use crate::analysis::Target;
use crate::config::{ParameterInfo, builtin};
use crate::run::{self, Finished, Options};
use crate::telemetry::channels;

/// Exit code when `--strict` is given and a required target is not met.
const TARGETS_MISSED: u8 = 1;
/// Exit code of any error (wrong input, unwritable output, failed simulation).
const FAILED: u8 = 2;
/// Exit code after Ctrl-C, as shells expect it.
const INTERRUPTED: u8 = 130;

/// Simulator and control stack of the hybrid robot Wheeleg.
///
/// Without a command, runs the three-step test of the 2003 paper.
#[derive(Debug, Parser)]
#[command(name = "wheeleg", version, about, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

const EXIT_CODES: &str = "Exit codes: 0 done (with --strict: and all required targets met); \
1 a required target is not met (--strict only); 2 error; 130 stopped with Ctrl-C.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scenario; writes log, tables, figures, summary and report.
    Run(RunArgs),
    /// List the built-in scenarios and robots.
    List {
        /// Print JSON.
        #[arg(long)]
        json: bool,
        /// List the telemetry channels instead.
        #[arg(long)]
        channels: bool,
    },
    /// Print every parameter of a robot: value, unit, range, source, meaning.
    Params {
        /// Built-in robot or path of a TOML file.
        #[arg(default_value = run::DEFAULT_ROBOT)]
        robot: String,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Print the telemetry channels: signals, units, rates, meaning.
    Channels {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Built-in scenario or path of a TOML file.
    #[arg(default_value = run::DEFAULT_SCENARIO)]
    scenario: String,
    /// Folder for the results [default: runs/<scenario>-seed<N>]. Results of an
    /// earlier run in it move to its folder `previous`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of all noise, instead of the scenario's.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: Option<u64>,
    /// Robot (built in, or path of a TOML file), instead of the scenario's.
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Exit with code 1 if a required target is not met.
    #[arg(long)]
    strict: bool,
}

/// Parses the command line, does what it says, and returns the exit code.
#[must_use]
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        None => run_command(&RunArgs {
            scenario: run::DEFAULT_SCENARIO.to_owned(),
            out: None,
            seed: None,
            robot: None,
            json: false,
            strict: false,
        }),
        Some(Command::Run(args)) => run_command(&args),
        Some(Command::List { json, channels }) => {
            if channels {
                print(&channels_text(json))
            } else {
                list(json)
            }
        }
        Some(Command::Params { robot, json }) => params(&robot, json),
        Some(Command::Channels { json }) => print(&channels_text(json)),
    };
    result.unwrap_or_else(|error| {
        eprintln!("{:?}", miette::Report::new(error));
        ExitCode::from(FAILED)
    })
}

fn parse_seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("a seed is a whole number from 0 to {}", u64::MAX))
}

fn run_command(args: &RunArgs) -> Result<ExitCode, SimError> {
    let options = Options {
        scenario: args.scenario.clone(),
        robot: args.robot.clone(),
        seed: args.seed,
        out: args.out.clone(),
    };
    let finished = run::run(&options)?;
    if args.json {
        print(&finished.summary.to_json())?;
    } else {
        print(&run_text(&finished))?;
    }
    Ok(if !finished.summary.complete {
        eprintln!("interrupted; the files hold what was recorded until then");
        ExitCode::from(INTERRUPTED)
    } else if args.strict && !finished.summary.passed {
        ExitCode::from(TARGETS_MISSED)
    } else {
        ExitCode::SUCCESS
    })
}

/// Writes to stdout. A reader that has gone away (`| head`) is no error.
fn print(text: &str) -> Result<ExitCode, SimError> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(SimError::output("write to", "standard output", e))
        }
        _ => Ok(ExitCode::SUCCESS),
    }
}

fn run_text(finished: &Finished) -> String {
    let s = &finished.summary;
    let mut out = String::new();
    // A part of a run meets or misses nothing.
    if s.complete && !s.targets.is_empty() {
        out.push_str(&target_table(&s.targets));
        let required = s.targets.iter().filter(|t| t.required);
        let met = required.clone().filter(|t| t.pass).count();
        let _ = writeln!(out, "\n{met} of {} required targets met", required.count());
    }
    if !s.complete {
        let _ = writeln!(
            out,
            "\nstopped after {:.2} s of simulated time; what was recorded is complete up to there",
            s.simulated_s
        );
    }
    let _ = writeln!(out, "robot   {}, parameters {:.16}", s.robot, s.robot_hash);
    let _ = writeln!(out, "hash    {}", s.hash);
    let _ = writeln!(
        out,
        "time    {:.2} s simulated in {:.2} s, {:.1} times faster than real time",
        s.simulated_s, s.wall_s, s.realtime_factor
    );
    let _ = writeln!(out, "report  {}", finished.report.display());
    out
}

fn target_table(targets: &[Target]) -> String {
    let colour = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let cells: Vec<[String; 5]> = targets
        .iter()
        .map(|t| {
            [
                t.verdict().to_owned(),
                t.id.clone(),
                t.value_text(),
                t.unit.to_owned(),
                t.band_text(),
            ]
        })
        .collect();
    let head = ["verdict", "target", "value", "unit", "band"].map(str::to_owned);
    let width = |i: usize| {
        let widths = cells
            .iter()
            .chain([&head])
            .map(|row| row[i].chars().count());
        widths.max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..5).map(width).collect();
    let mut out = String::new();
    let mut row = |c: &[String; 5], description: &str| {
        let verdict = format!("{:w$}", c[0], w = widths[0]);
        let verdict = match (colour, c[0].as_str()) {
            (true, "PASS") => format!("\x1b[32m{verdict}\x1b[0m"),
            (true, "FAIL") => format!("\x1b[1;31m{verdict}\x1b[0m"),
            _ => verdict,
        };
        let _ = writeln!(
            out,
            "{verdict}  {:b$}  {:>c$} {:d$}  {:e$}  {description}",
            c[1],
            c[2],
            c[3],
            c[4],
            b = widths[1],
            c = widths[2],
            d = widths[3],
            e = widths[4],
        );
    };
    row(&head, "what");
    for (c, t) in cells.iter().zip(targets) {
        row(c, &t.description);
    }
    out
}

fn list(json: bool) -> Result<ExitCode, SimError> {
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
    print(&out)
}

fn params(robot: &str, json: bool) -> Result<ExitCode, SimError> {
    let robot = builtin::robot(robot)?;
    if json {
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
    print(&out)
}

fn channels_text(json: bool) -> String {
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
                    "description": c.doc,
                    "fields": fields,
                })
            })
            .collect();
        return format!("{:#}\n", serde_json::json!({ "channels": list }));
    }
    let mut out = String::new();
    let mut described: Vec<&str> = Vec::new();
    for c in channels() {
        let rate = match c.rate_hz {
            0 => "on change".to_owned(),
            r => format!("{r} Hz"),
        };
        let _ = writeln!(out, "{:13} {rate:10} {:16} {}", c.topic, c.schema, c.doc);
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
    out
}

/// Default folder of a run.
pub(crate) fn default_out(scenario: &str, seed: u64) -> PathBuf {
    Path::new("runs").join(format!("{scenario}-seed{seed}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_line_is_consistent() {
        use clap::CommandFactory as _;
        Cli::command().debug_assert();
    }

    #[test]
    fn channel_listing_names_every_field_once() {
        let text = channels_text(false);
        assert_eq!(text.matches("force_net_raw_n").count(), 1);
        assert!(text.contains("/joint/6") && text.contains("500 Hz"));
    }
}
