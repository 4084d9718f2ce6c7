//! `wheeleg run`: one scenario on one robot.

use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::{Drawing, end, place, stop_on_signals, tell};
use wheeleg_config::LawChoice;
use wheeleg_config::faults::FaultSpec;
use wheeleg_remote_host::{self as pil, NodeChoice, NodeKind, Nodes, PilSummary};
use wheeleg_report::results::{LOG, NATIVE};
use wheeleg_studies::StudyError;
use wheeleg_studies::analysis::{Judgement, Target};
use wheeleg_studies::run::{self, Options, Run, Summary};
use wheeleg_studies::study::{Finished, Stop, Stopped};
use wheeleg_telemetry as telemetry;

/// Arguments of `wheeleg run`.
#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Built-in scenario or path of a TOML file.
    #[arg(default_value = wheeleg_config::builtin::DEFAULT_SCENARIO)]
    scenario: String,
    #[command(flatten)]
    options: RunOptions,
}

/// Options of `wheeleg run`, and of `wheeleg` without a command.
#[derive(Debug, Args)]
pub(super) struct RunOptions {
    /// Folder for the results [default: runs/<scenario>-seed<N>]. Results of an earlier run in it move to its
    /// subfolder `previous`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of all noise, instead of the scenario's.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: Option<u64>,
    /// Robot (built in, or path of a TOML file), instead of the scenario's.
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Law of all joints, instead of the robot's: `fuzzy` (the paper's), `on-off`, `p`, `pid`,
    /// `sliding`, `predictive`.
    #[arg(long, value_name = "NAME")]
    law: Option<LawChoice>,
    /// Inject a fault, for example `master-silent@3.2s`; may be given several times. `wheeleg faults list`
    /// lists them all.
    #[arg(long = "fault", value_name = "FAULT")]
    faults: Vec<FaultSpec>,
    /// Where the nodes run: `sil` in this program, `pil` as the firmware images on
    /// emulated boards, `qemu` as the same applications on QEMU.
    #[arg(long, value_name = "KIND", default_value = "sil")]
    nodes: NodeKind,
    /// Where a single node runs instead: `joint3=pil`, `wheel7=qemu`, `joint1=hil:/dev/ttyACM0`; may be given
    /// several times.
    #[arg(long = "node", value_name = "NODE=KIND")]
    node: Vec<NodeChoice>,
    /// Run the scenario once more with all nodes in this program; exit with code
    /// 2 unless both logs are bit-identical. Images built from other firmware sources
    /// than this program's are refused, as are faults of the line.
    #[arg(long)]
    compare_sil: bool,
    #[command(flatten)]
    drawing: Drawing,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Exit with code 1 if a required target is not met, not only if boards differ.
    #[arg(long)]
    strict: bool,
    /// Print every target, not only the first 20 of each verdict.
    #[arg(long)]
    verbose: bool,
}

fn parse_seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("a seed is a whole number from 0 to {}", u64::MAX))
}

/// Runs the scenario and prints its verdicts.
pub(super) fn command(args: &RunArgs) -> Result<ExitCode, StudyError> {
    scenario(&args.scenario, &args.options)
}

/// Runs a scenario, by name or path, and prints its verdicts.
pub(super) fn scenario(scenario: &str, args: &RunOptions) -> Result<ExitCode, StudyError> {
    let options = Options {
        scenario: scenario.to_owned(),
        robot: args.robot.clone(),
        law: args.law,
        seed: args.seed,
        out: args.out.clone(),
        faults: args.faults.clone(),
        nodes: Nodes::new(&args.nodes, &args.node)?,
        png: args.drawing.png,
        compared: args.compare_sil,
    };
    if args.compare_sil {
        pil::ensure_same_sources(&options.nodes)?;
    }
    let stop = stop_on_signals()?;
    let mut finished = run::run(&options, &stop)?;
    let mut native = None;
    // A partial run never equals a complete one.
    if args.compare_sil && finished.result.summary.complete {
        native = compare_sil(&options, &stop, &finished)?;
    }
    let summary = &finished.result.summary;
    let differ = differing_bits(summary) > 0;
    let passed = !differ && (!args.strict || summary.passed);
    let whole = finished.unwritten.is_empty();
    let stopped = finished.stopped.is_some();
    let failure = finished.result.failure.take();
    let report = finished.report.display().to_string();
    let most = if args.verbose {
        usize::MAX
    } else {
        TARGETS_SHOWN
    };
    let code = end(finished, args.json, |run| run_text(run, most), passed)?;
    if differ && !stopped {
        tell("boards differ from their native twins");
    }
    if let Some(failure) = failure {
        tell(&format!("what was recorded until then: {report}"));
        return Err(StudyError::from(failure));
    }
    let native = native.filter(|_| whole);
    Ok(native.map_or(code, |stopped| ExitCode::from(stopped.signal.exit_code())))
}

/// Number of bits in which boards outside this program differ from the application here.
fn differing_bits(summary: &Summary) -> u64 {
    let pil = summary.pil.as_ref();
    pil.map_or(0, |pil| pil.differing_bits)
}

/// Repeats a run with all nodes in this program. The logs hold every input, output, frame and internal value
/// at its time, so equal hashes mean equal runs. Boards here are down whenever the boards outside were,
/// because that time depends on the hardware. Returns what stopped the native run, if anything did.
fn compare_sil(
    options: &Options,
    stop: &Stop,
    finished: &Finished<Run>,
) -> Result<Option<Stopped>, StudyError> {
    let folder = finished.report.parent().unwrap_or(Path::new("."));
    let run = &finished.result;
    let native = run::repeat_natively(options, stop, run, folder.join(NATIVE))?;
    if let Some(stopped) = native.stopped {
        tell(&format!(
            "the logs are not compared: the native run was {stopped}"
        ));
        return Ok(Some(stopped));
    }
    let (here_hash, there_hash) = (&native.result.summary.hash, &run.summary.hash);
    if here_hash == there_hash {
        tell("the log is bit-identical to that of the native run");
        return Ok(None);
    }
    let here = folder.join(NATIVE).join(LOG);
    let first = telemetry::first_difference(&here, &folder.join(LOG))?;
    let first = match first {
        Some(first) => format!("first difference: {first}"),
        None => "no difference in the parts that could be written".to_owned(),
    };
    let pil = run.summary.pil.as_ref();
    let pins = match pil.and_then(|p| p.first_difference.as_ref()) {
        Some(pins) => format!("; first at a board's pins: {pins}"),
        None => "; no board differed from its native twin".to_owned(),
    };
    Err(StudyError::refused(
        format!(
            "the logs differ: {here_hash} on the host, {there_hash} with the boards; {first}{pins}"
        ),
        format!("both logs are below {}", folder.display()),
    ))
}

/// Comparison and figures of boards outside this program.
fn pil_text(pil: &PilSummary) -> String {
    let mut out = format!(
        "boards  {} bits of {} ticks and {} frames compared with the native application, {} differ\n",
        pil.compared_bits, pil.compared_ticks, pil.compared_frames, pil.differing_bits
    );
    if let Some(first) = &pil.first_difference {
        let _ = writeln!(out, "        first difference: {first}");
    }
    for board in &pil.boards {
        let _ = write!(out, "        {} on {}:", board.node, board.host);
        // Figures that nobody measures where the board runs are left out.
        let ticks = (
            board.tick_instructions_worst,
            board.tick_instructions_median,
        );
        if let (Some(worst), Some(median)) = ticks {
            let _ = write!(out, " tick {worst} instructions (median {median}),");
        }
        if let (Some(used), Some(size)) = (board.stack_used_bytes, board.stack_size_bytes) {
            let _ = write!(out, " stack {used} of {size} B,");
        }
        let _ = writeln!(out, " {} resets", board.resets);
    }
    out
}

/// Number of messages printed; the report has all of them.
const MESSAGES: usize = 40;

/// What went wrong, with the remedies.
fn messages_text(messages: &[String]) -> String {
    let mut out = String::new();
    for message in messages.iter().take(MESSAGES) {
        let _ = writeln!(out, "event   {message}");
    }
    if let Some(more) = messages.len().checked_sub(MESSAGES).filter(|n| *n > 0) {
        let _ = writeln!(out, "event   and {more} more, in the report");
    }
    out
}

/// The result of a run, with at most `most` targets of each verdict.
fn run_text(finished: &Finished<Run>, most: usize) -> String {
    let s = &finished.result.summary;
    let mut out = String::new();
    for (i, line) in s.cause.iter().enumerate() {
        let word = if i == 0 { "cause" } else { "" };
        let _ = writeln!(out, "{word:<8}{line}");
    }
    // A partial run meets or misses nothing.
    if s.complete && !s.targets.is_empty() {
        let required = s.targets.iter().filter(|t| t.required);
        let met = required.clone().filter(|t| t.pass).count();
        let _ = writeln!(out, "{met} of {} required targets met\n", required.count());
        out.push_str(&target_table(&s.targets, most));
        out.push('\n');
    }
    if !s.complete {
        let _ = writeln!(
            out,
            "\nstopped after {:.2} s of simulated time; what was recorded is complete up to there",
            s.simulated_s
        );
    }
    if s.dropped_messages > 0 {
        let _ = writeln!(
            out,
            "\n{} messages could not be written to the log",
            s.dropped_messages
        );
    }
    if let Some(pil) = &s.pil {
        out.push('\n');
        out.push_str(&pil_text(pil));
    }
    let _ = writeln!(out, "robot   {}, parameters {:.16}", s.robot, s.robot_hash);
    for fault in s.faults.iter().take(FAULTS_SHOWN) {
        let _ = writeln!(out, "fault   {fault}");
    }
    if let Some(more @ 1..) = s.faults.len().checked_sub(FAULTS_SHOWN) {
        let _ = writeln!(out, "fault   {more} more are in summary.json");
    }
    out.push_str(&messages_text(&s.messages));
    let _ = writeln!(out, "hash    {}", s.hash);
    let _ = writeln!(
        out,
        "time    {:.2} s simulated in {:.2} s, {:.1} times faster than real time",
        s.simulated_s, s.wall_s, s.realtime_factor
    );
    out.push_str(&place(&finished.report, 8));
    out
}

/// Number of injected faults listed; any others are only counted.
const FAULTS_SHOWN: usize = 20;

/// Number of targets listed per verdict.
const TARGETS_SHOWN: usize = 20;

/// Order in which targets are listed: missed ones come first.
const ORDER: [Judgement; 5] = [
    Judgement::Missed,
    Judgement::Met,
    Judgement::Outside,
    Judgement::Within,
    Judgement::Value,
];

/// The table of the first targets of each verdict, with the number of any others.
fn target_table(targets: &[Target], most: usize) -> String {
    let mut shown: Vec<&Target> = Vec::new();
    let mut more: Vec<String> = Vec::new();
    for judgement in ORDER {
        let of = targets.iter().filter(|t| t.judgement() == judgement);
        shown.extend(of.clone().take(most));
        if let Some(left @ 1..) = of.count().checked_sub(most) {
            more.push(format!("{left} {}", judgement.word()));
        }
    }
    let mut out = table_of(&shown);
    if !more.is_empty() {
        let _ = writeln!(
            out,
            "and more: {} (see report.html, or give --verbose)",
            more.join(", ")
        );
    }
    out
}

fn table_of(targets: &[&Target]) -> String {
    let colour = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let cells: Vec<[String; 5]> = targets
        .iter()
        .map(|t| {
            [
                t.judgement().word().to_owned(),
                t.id.clone(),
                t.value_text(),
                t.unit_text().to_owned(),
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
    let mut row = |c: &[String; 5], judgement: Option<Judgement>, description: &str| {
        let verdict = format!("{:w$}", c[0], w = widths[0]);
        let verdict = match judgement.filter(|_| colour) {
            Some(Judgement::Met) => format!("\x1b[32m{verdict}\x1b[0m"),
            Some(Judgement::Missed) => format!("\x1b[1;31m{verdict}\x1b[0m"),
            _ => verdict,
        };
        let _ = writeln!(
            out,
            "{verdict}  {:b$}  {:>c$} {:d$}  {:e$}  {}",
            c[1],
            c[2],
            c[3],
            c[4],
            description,
            b = widths[1],
            c = widths[2],
            d = widths[3],
            e = widths[4],
        );
    };
    row(&head, None, "what");
    for (c, t) in cells.iter().zip(targets) {
        row(c, Some(t.judgement()), &t.description);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_very_many_targets_the_first_are_listed_and_the_others_counted() {
        let target = |i: usize| Target {
            id: format!("bar-{i}"),
            description: "a bar".to_owned(),
            value: Some(1.0),
            unit: "mm",
            min: None,
            max: Some(1.0),
            pass: i % 25 != 24,
            required: true,
        };
        let text = |count: usize, most: usize| {
            let targets: Vec<Target> = (0..count).map(target).collect();
            target_table(&targets, most)
        };
        let some = text(2000, TARGETS_SHOWN);
        let first: Vec<&str> = some.lines().collect();
        assert_eq!(first.len(), 2 + 2 * TARGETS_SHOWN, "{some}");
        let fails = |line: &&&str| line.starts_with("FAIL");
        let missed = first[1..=TARGETS_SHOWN].iter().filter(fails).count();
        assert_eq!(missed, TARGETS_SHOWN, "what was missed comes first: {some}");
        let told = "and more: 60 FAIL, 1900 PASS (see report.html, or give --verbose)";
        assert_eq!(first.last(), Some(&told), "{some}");
        // A short list is complete, and so is any list on request.
        assert_eq!(text(20, TARGETS_SHOWN).lines().count(), 21);
        assert_eq!(text(2000, usize::MAX).lines().count(), 2001);
    }
}
