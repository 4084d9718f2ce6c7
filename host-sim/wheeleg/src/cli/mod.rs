//! The command line: one file per command.

#[cfg(unix)]
mod boards;
mod campaign;
mod channels;
mod check;
mod commands;
mod commission;
mod compare;
mod ctl;
mod delay;
mod exit;
mod export;
mod faults;
mod field;
mod figures;
mod harmless;
mod identify;
mod interface;
mod list;
mod log;
mod params;
mod plant;
mod replay;
mod run;
mod serve;
mod tune;
mod usage;
mod view;

use std::fmt::Display;
use std::io::{IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand};

use terminal_size::{Width, terminal_size_of};
use wheeleg_config::builtin::DEFAULT_SCENARIO;
use wheeleg_report::plot::ensure_png;
use wheeleg_studies::StudyError;
use wheeleg_studies::export::write_new;
use wheeleg_studies::study::{Finished, Settings, Stop, outlive_file_limit};

use exit::{FAILED, TARGETS_MISSED};
use harmless::{fit, harmless};

/// Simulator and control stack of the hybrid robot Wheeleg.
///
/// Without a command, runs the three-step test of the 2003 paper, with the options of `run`.
#[derive(Debug, Parser)]
#[command(name = "wheeleg", version, about, after_help = exit::help(exit::PROGRAM), args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    options: run::RunOptions,
}

/// Parses a whole number from `low` to `high`; the error for anything else names this range.
fn whole<N>(low: N, high: N) -> impl Fn(&str) -> Result<N, String> + Clone + Send + Sync
where
    N: FromStr + PartialOrd + Display + Copy + Send + Sync,
{
    move |text| {
        let number = text.parse().ok().filter(|n| (low..=high).contains(n));
        number.ok_or_else(|| format!("allowed are whole numbers from {low} to {high}"))
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scenario; writes log, tables, figures, summary and report.
    Run(run::RunArgs),
    /// Run a robot live and serve the operator's console on this computer.
    Serve(serve::ServeArgs),
    /// Run the boards of a simulated robot behind a serial port without hardware.
    #[cfg(unix)]
    Boards(boards::BoardsArgs),
    /// Watch and drive the robot that `wheeleg serve` runs.
    Ctl(ctl::CtlArgs),
    /// Repeat a recording of `wheeleg serve`, and compare the result with the recording.
    Replay(replay::ReplayArgs),
    /// Run a scenario many times: factors, shards, one table, replay.
    Campaign(campaign::CampaignArgs),
    /// List what is built in: scenarios, robots, axes, plans, moves and controllers.
    List(list::ListArgs),
    /// Print every parameter of a robot: value, unit, range, source, meaning.
    Params(params::ParamsArgs),
    /// List the faults that can be injected, and run the fault matrix.
    Faults(faults::FaultsArgs),
    /// Print the telemetry channels: signals, units, rates, meaning.
    Channels(channels::ChannelsArgs),
    /// Print the commands that a scenario can give: arguments, units, ranges.
    Commands(commands::CommandsArgs),
    /// Export the robot, or a log, for other programs.
    Export(export::ExportArgs),
    /// Print the unique ids of a robot's boards, as a section for its file.
    Commission(commission::CommissionArgs),
    /// Draw Figs. 5 to 9 of the paper, show its misprints, and check the master's single precision.
    Figures(figures::FiguresArgs),
    /// Run the walks over terrain on several seeds, and compare them with the paper's claims.
    Field(field::FieldArgs),
    /// Measure and explain the start delay of a pneumatic joint; writes a report.
    Delay(delay::DelayArgs),
    /// Compare controllers on one or more axes; writes report, figures and tables.
    Compare(compare::CompareArgs),
    /// Find gains and delays of one axis; writes a report and parameters for a board.
    Tune(tune::TuneArgs),
    /// Identify an axis from measurements of a cylinder, with confidence intervals.
    Identify(identify::IdentifyArgs),
    /// Check the pneumatic plant of an axis, or export it for another integrator.
    Plant(plant::PlantArgs),
    /// Check the model against independently computed numbers.
    Check(check::CheckArgs),
    /// Turn a log into a page with an animated robot, or compare two logs.
    View(view::ViewArgs),
    /// Recover the log of a run that was killed.
    Log(log::LogArgs),
    /// Show how the bus interface of this program differs from another.
    Interface(interface::InterfaceArgs),
}

/// Parses the command line, carries it out, and returns the exit code.
#[must_use]
pub(crate) fn main() -> ExitCode {
    colourless_if_asked();
    let cli = usage::parse::<Cli>(std::env::args_os());
    let cli = cli.unwrap_or_else(|wrong| usage::refuse(&wrong));
    if let Err(error) = outlive_file_limit() {
        tell(&format!(
            "a file that reaches the limit on its size will end the program without a message: {error}"
        ));
    }
    run_command(cli).unwrap_or_else(|error| {
        tell_error(error);
        ExitCode::from(FAILED)
    })
}

/// Carries out the command line.
fn run_command(cli: Cli) -> miette::Result<ExitCode> {
    Ok(match cli.command {
        None => run::scenario(DEFAULT_SCENARIO, &cli.options)?,
        Some(Command::Run(args)) => run::command(&args)?,
        Some(Command::Replay(args)) => replay::command(&args)?,
        Some(Command::Serve(args)) => serve::command(&args)?,
        #[cfg(unix)]
        Some(Command::Boards(args)) => boards::command(&args)?,
        Some(Command::Campaign(args)) => campaign::command(&args)?,
        Some(Command::Ctl(args)) => ctl::command(&args)?,
        Some(Command::Faults(args)) => faults::command(&args)?,
        Some(Command::List(args)) => list::command(&args)?,
        Some(Command::Params(args)) => params::command(&args)?,
        Some(Command::Channels(args)) => channels::command(&args)?,
        Some(Command::Commands(args)) => commands::command(&args)?,
        Some(Command::Export(args)) => export::command(&args)?,
        Some(Command::Commission(args)) => commission::command(&args)?,
        Some(Command::Figures(args)) => figures::command(&args)?,
        Some(Command::Field(args)) => field::command(&args)?,
        Some(Command::Delay(args)) => delay::command(&args)?,
        Some(Command::Compare(args)) => compare::command(&args)?,
        Some(Command::Tune(args)) => tune::command(&args)?,
        Some(Command::Identify(args)) => identify::command(&args)?,
        Some(Command::Plant(args)) => plant::command(&args)?,
        Some(Command::Check(args)) => check::command(&args)?,
        Some(Command::View(args)) => view::command(&args)?,
        Some(Command::Log(args)) => log::command(&args)?,
        Some(Command::Interface(args)) => interface::command(&args)?,
    })
}

/// `NO_COLOR` takes precedence over variables that force colours.
fn colourless_if_asked() {
    if std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty()) {
        // This fails only if there is already a hook, and nobody else sets one.
        let _ = miette::set_hook(Box::new(|_| {
            Box::new(miette::MietteHandlerOpts::new().color(false).build())
        }));
    }
}

/// Writes to stdout. A reader that has gone away (`| head`) is not an error.
fn print(text: &str) -> Result<ExitCode, StudyError> {
    print_on(text).map(|_| ExitCode::SUCCESS)
}

/// Writes a part of the output to stdout; returns whether there is still a reader.
fn print_on(text: &str) -> Result<bool, StudyError> {
    match say(text) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(StudyError::Stdout(e)),
    }
}

/// Prints a text for a person.
fn show(text: &str) -> Result<ExitCode, StudyError> {
    print(&fitted(text))
}

/// Formats a text for a person: on a terminal, its lines fit the width.
fn fitted(text: &str) -> String {
    match terminal_size_of(std::io::stdout()) {
        Some((Width(width), _)) => fit(text, width.into()),
        None => text.to_owned(),
    }
}

/// Writes to stdout: unchanged to a file or a pipe, but without anything that acts on a terminal.
fn say(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let shown = out.is_terminal().then(|| harmless(text));
    out.write_all(shown.as_deref().unwrap_or(text).as_bytes())?;
    out.flush()
}

/// Writes a line to standard error. After a hang-up there may be nobody to read it.
fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", harmless(line));
}

/// Prints an error in the common form: its code, what is wrong, and what can be done.
fn tell_error(error: impl Into<miette::Report>) {
    tell(&format!("{:?}", error.into()));
}

/// Options of every study that draws figures.
#[derive(Debug, Args)]
struct Drawing {
    /// Write the figures as PNG as well as SVG, if the program was built with `--features png`.
    #[arg(long)]
    png: bool,
}

/// Settings for the results of a study; from here on, signals stop it.
fn settings(out: &Path, png: bool) -> Result<Settings, StudyError> {
    if png {
        ensure_png()?;
    }
    Ok(Settings {
        out: out.to_owned(),
        png,
        stop: stop_on_signals()?,
    })
}

/// Writes a small file completely or not at all; a signal is held back until this is done. Writing to
/// something other than a file, such as a pipe, may never finish, so there signals are not held back.
fn write_file(path: &Path, content: impl AsRef<[u8]>, reads: &[&Path]) -> Result<(), StudyError> {
    if path.is_file() || !path.exists() {
        let _waits = stop_on_signals()?;
    }
    write_new(path, content, reads)
}

/// Ctrl-C, TERM and HUP stop a study, which then finishes its files.
fn stop_on_signals() -> Result<Stop, StudyError> {
    Stop::on_signals().map_err(|e| no_handler(&e))
}

fn no_handler(why: &std::io::Error) -> StudyError {
    StudyError::refused(
        format!("cannot install a signal handler: {why}"),
        "please report this",
    )
}

/// Prints the result of a study and what could not be written, and returns the exit code: that of an error if
/// a file is missing; otherwise that of the signal that stopped it; otherwise that of whether it `passed`.
fn end<T>(
    finished: Finished<T>,
    json: bool,
    text: impl FnOnce(&Finished<T>) -> String,
    passed: bool,
) -> Result<ExitCode, StudyError> {
    let printed = if json {
        print(&finished.summary)
    } else {
        show(&text(&finished))
    };
    let whole = tell_unwritten(finished.unwritten);
    if let Some(stopped) = &finished.stopped {
        // The files are what matters; a terminal that hung up takes no text.
        tell(&match whole {
            true => format!(
                "{stopped}; summary and report hold the results up to that point: {}",
                finished.report.display()
            ),
            false => stopped.to_string(),
        });
    }
    if !whole {
        return Ok(ExitCode::from(FAILED));
    }
    if let Some(stopped) = &finished.stopped {
        return Ok(ExitCode::from(stopped.signal.exit_code()));
    }
    printed?;
    Ok(if passed {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(TARGETS_MISSED)
    })
}

/// The line that says where the report is or, if a full disk has left none, where the results are. Its first
/// column is `width` wide.
fn place(report: &Path, width: usize) -> String {
    match (report.exists(), report.parent()) {
        (false, Some(folder)) => format!("{:width$}{}\n", "results", folder.display()),
        _ => format!("{:width$}{}\n", "report", report.display()),
    }
}

/// Reports what a study could not write; returns whether everything was written.
fn tell_unwritten(unwritten: Vec<StudyError>) -> bool {
    let whole = unwritten.is_empty();
    // A refusal in the middle of a study is not a missing file.
    let is_part = |error: &StudyError| matches!(error, StudyError::Refused { .. });
    let (part, file) = (
        unwritten.iter().any(is_part),
        unwritten.iter().any(|error| !is_part(error)),
    );
    for error in unwritten {
        tell_error(error);
    }
    if part {
        tell(
            "the study ended there: its summary names this as `failure`; summary and report hold what was measured before",
        );
    }
    if file {
        tell("the values above are valid; the files named here are missing or truncated");
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_line_is_consistent() {
        use clap::CommandFactory as _;
        let command = Cli::command();
        assert!(command.get_subcommands().count() > 10);
        command.debug_assert();
    }

    /// The first range `A to B` in a text.
    fn range(text: &str) -> Option<[f64; 2]> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let number = |word: &str| {
            let word = word.trim_end_matches(|c: char| ".,;:)".contains(c));
            word.replace('−', "-").parse::<f64>().ok()
        };
        words.windows(3).find_map(|three| {
            let ends = [number(three[0])?, number(three[2])?];
            (three[1] == "to").then_some(ends)
        })
    }

    /// Whether the command line accepts a value, regardless of what else is missing from it.
    fn takes(path: &[String], arg: &clap::Arg, value: f64) -> bool {
        use clap::CommandFactory as _;
        use clap::error::ErrorKind::{InvalidValue, ValueValidation};
        let mut line = path.to_vec();
        match arg.get_long() {
            Some(long) => line.push(format!("--{long}={value}")),
            None => line.extend(["--".to_owned(), value.to_string()]),
        }
        let parsed = Cli::command().try_get_matches_from(line);
        let kind = parsed.err().map(|e| e.kind());
        !matches!(kind, Some(InvalidValue | ValueValidation))
    }

    /// A range stated in a help text is the range that the command line accepts: its ends, and nothing
    /// beyond.
    #[test]
    fn ranges_in_help_texts_are_those_that_are_taken() {
        use clap::CommandFactory as _;
        fn walk(command: &clap::Command, path: &[String], found: &mut Vec<String>) {
            let path = [path, &[command.get_name().to_owned()]].concat();
            for arg in command
                .get_arguments()
                .filter(|arg| arg.get_action().takes_values())
            {
                let help = arg.get_long_help().or(arg.get_help());
                let help = help.map(ToString::to_string).unwrap_or_default();
                let Some([low, high]) = range(&help) else {
                    continue;
                };
                let name = format!("{} {}", path.join(" "), arg.get_id());
                // The next value beyond: 1 away for whole numbers, a hundredth for others.
                let whole = !takes(&path, arg, low + 0.5 * (high - low).min(1.0));
                let step = if whole { 1.0 } else { 0.01 };
                for inside in [low, high] {
                    assert!(takes(&path, arg, inside), "{name} refuses {inside}: {help}");
                }
                for beyond in [low - step, high + step] {
                    assert!(!takes(&path, arg, beyond), "{name} takes {beyond}: {help}");
                }
                found.push(name);
            }
            for below in command.get_subcommands() {
                walk(below, &path, found);
            }
        }
        let mut root = Cli::command();
        root.build();
        let mut found = Vec::new();
        walk(&root, &[], &mut found);
        for wanted in [
            "wheeleg ctl param get board",
            "wheeleg ctl step cycles",
            "wheeleg ctl speed speed",
            "wheeleg ctl watch hz",
            "wheeleg serve speed",
            "wheeleg field seeds",
            "wheeleg delay mass",
            "wheeleg delay load",
            "wheeleg identify hold_out",
        ] {
            assert!(
                found.iter().any(|name| name == wanted),
                "{wanted}: {found:?}"
            );
        }
    }
}
