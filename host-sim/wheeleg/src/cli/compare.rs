//! `wheeleg compare`: every controller on the same plants, moves and inputs.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::exit::FAILED;
use super::{Drawing, end, place, settings, tell_error, whole};
use wheeleg_campaign::CampaignError;
use wheeleg_campaign::compare::{self, Comparison, Options};
use wheeleg_config::axis::AXES;
use wheeleg_config::plan::SEED_MOST;
use wheeleg_report::number::p_equals;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::{Kind, ValveResolution};
use wheeleg_studies::compare::{CaseId, Move, fault_names, judging_root, play};
use wheeleg_studies::study::Finished;

/// Number of false alarms that are listed; the report has all of them.
const ALARMS_LISTED: usize = 5;

/// Arguments of `wheeleg compare`.
#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// Built-in axis or path of an axis file; may be given several times
    /// [default: all built-in axes].
    #[arg(long = "axis", value_name = "AXIS")]
    axes: Vec<String>,
    /// Controller; may be given several times [default: all].
    #[arg(long = "controller", value_name = "NAME", value_parser = controller())]
    controllers: Vec<Kind>,
    /// Move; may be given several times [default: all but first-step with the data-sheet values;
    /// step-100 and s-curve with changed factors].
    #[arg(long = "move", value_name = "MOVE", value_parser = motion())]
    moves: Vec<Move>,
    /// Number of seeds for the cases with the data-sheet values [default: 3; 1 with --quick].
    #[arg(long, value_name = "N", value_parser = whole(1_u64, 1000))]
    seeds: Option<u64>,
    /// First seed.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole(0_u64, SEED_MOST - 1000))]
    seed: u64,
    /// Random combinations of factors per axis [default: 200; 20 with --quick].
    #[arg(long, value_name = "N", value_parser = whole(0_u64, 10_000))]
    combinations: Option<u64>,
    /// Number of the first random combination. Fix it to compare two versions [default: from a hash of the
    /// sources of firmware/control, so that no law is tuned to it].
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(0_u64, SEED_MOST - 10_000))]
    root: Option<u64>,
    /// `summary.json` of another version, run with the same --root; counts the random
    /// combinations in which this version is better or worse.
    #[arg(long, value_name = "FILE", requires = "root")]
    against: Option<PathBuf>,
    /// Fewer factors, a coarser bound, and unless they are given one seed and fewer combinations.
    #[arg(long)]
    quick: bool,
    /// Number of threads [default: as many as the machine has].
    #[arg(long, value_name = "N", value_parser = whole(1_u16, 1024))]
    threads: Option<u16>,
    /// Folder for report, figures and tables, and in its subfolder `campaign` the cases, which are not repeated for
    /// the same options. Results of an earlier run in it move to its subfolder `previous` [default: runs/compare;
    /// with --case runs/case].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Run only one case, by its id in the tables:
    /// AXIS/CONTROLLER/MOVE/VARIATION/SEED.
    #[arg(long, value_name = "ID", conflicts_with_all = ["controllers", "moves", "seeds", "seed", "combinations", "root", "against", "quick"])]
    case: Option<CaseId>,
    #[command(flatten)]
    drawing: Drawing,
    /// Print every false alarm, not only the first few.
    #[arg(long)]
    verbose: bool,
    /// Print the summary as JSON on stdout: all cases, one object each.
    #[arg(long)]
    json: bool,
}

/// Parses the name of a controller; the help lists the names.
pub(super) fn controller() -> impl TypedValueParser<Value = Kind> {
    let names = PossibleValuesParser::new(Kind::ALL.map(Kind::name));
    names.map(|name| Kind::of_name(&name).expect("one of the names"))
}

fn motion() -> impl TypedValueParser<Value = Move> {
    let names = PossibleValuesParser::new(Move::ALL.map(Move::name));
    names.map(|name| Move::of_name(&name).expect("one of the names"))
}

/// The given items without repetitions; all items if none were given.
fn chosen<T: Clone + PartialEq>(given: &[T], all: &[T]) -> Vec<T> {
    let mut list = Vec::new();
    for item in if given.is_empty() { all } else { given } {
        if !list.contains(item) {
            list.push(item.clone());
        }
    }
    list
}

/// Columns on the terminal: the heading, the cell of [`Comparison::table`], and whether the column is shown
/// if no moves were chosen.
const COLUMNS: [(&str, usize, bool); 15] = [
    ("error mm", 0, true),
    ("20 mm", 1, false),
    ("overshoot", 2, true),
    ("settled s", 4, true),
    ("worst s", 5, true),
    ("ratio", 6, true),
    ("S-curve", 7, true),
    ("sinusoid", 9, false),
    ("rest sw.", 11, true),
    ("recovery", 13, true),
    ("helped", 14, false),
    ("cycles", 15, false),
    ("first mm", 16, false),
    ("overshoot", 17, false),
    ("settled s", 18, false),
];

/// The table of an axis. If moves were chosen, it has the columns that contain figures.
fn axis_table(comparison: &Comparison, axis: &str) -> String {
    let table = comparison.table(axis);
    let is_played = |index: usize| table.iter().any(|(_, cells)| cells[index] != "–");
    let by_default = comparison.options.moves.is_none();
    let columns: Vec<(&str, usize)> = COLUMNS
        .into_iter()
        .filter(|&(_, index, default)| {
            if by_default {
                default
            } else {
                is_played(index)
            }
        })
        .map(|(heading, index, _)| (heading, index))
        .collect();
    let line = |name: &str, cells: &mut dyn Iterator<Item = &str>| {
        let cells: String = cells.map(|cell| format!("{cell:>10}")).collect();
        format!("  {name:<12}{cells}\n")
    };
    let mut text = format!("{axis}\n");
    text += &line("", &mut columns.iter().map(|(heading, _)| *heading));
    for (kind, cells) in &table {
        text += &line(
            kind.name(),
            &mut columns.iter().map(|&(_, index)| &*cells[index]),
        );
    }
    text
}

/// Runs the comparison, writes the report and prints the result.
pub(super) fn command(args: &CompareArgs) -> Result<ExitCode, StudyError> {
    let built_in: Vec<String> = AXES.iter().map(|(name, ..)| (*name).to_owned()).collect();
    let axes = chosen(&args.axes, &built_in);
    if let Some(id) = &args.case {
        return case(id, &axes, args);
    }
    let options = Options {
        axes,
        kinds: chosen(&args.controllers, &Kind::ALL),
        moves: (!args.moves.is_empty()).then(|| chosen(&args.moves, &[])),
        seeds: args.seeds.unwrap_or(if args.quick { 1 } else { 3 }),
        seed: args.seed,
        combinations: args
            .combinations
            .unwrap_or(if args.quick { 20 } else { 200 }),
        root: args.root.unwrap_or_else(judging_root),
        against: args.against.clone(),
        quick: args.quick,
        threads: args.threads.map_or(0, usize::from),
        program: std::env::current_exe().ok(),
    };
    let out = args.out.clone().unwrap_or_else(|| "runs/compare".into());
    let settings = settings(&out, args.drawing.png)?;
    let finished = match compare::compare(&options, &settings) {
        Ok(finished) => finished,
        Err(CampaignError::Study(error)) => return Err(*error),
        Err(CampaignError::Config(error)) => return Err((*error).into()),
        Err(error) => {
            tell_error(error);
            // As of any other study, not as of a campaign that a scheduler restarts.
            return Ok(ExitCode::from(FAILED));
        }
    };
    end(
        finished,
        args.json,
        |f| text(&f.result, &f.report, args.verbose),
        true,
    )
}

/// The tables of the axes, false alarms, and where the report is.
fn text(comparison: &Comparison, report: &Path, all: bool) -> String {
    let mut out = format!("{}\n", comparison.verdict());
    for axis in &comparison.axes {
        out.push_str(&axis_table(comparison, &axis.config.name));
        if let Some(advice) = ValveResolution::of(&axis.config.axis).advice() {
            let _ = writeln!(out, "  {advice}");
        }
    }
    out += &combinations(comparison);
    let options = &comparison.options;
    if options.combinations > 0 && options.judged_move().is_none() {
        out.push_str(
            "judged      none of the combinations: only those of step-100 and first-step are\n",
        );
    }
    let alarms = comparison.false_alarms();
    let mut told = String::new();
    let shown = if all { usize::MAX } else { ALARMS_LISTED };
    for row in alarms.clone().take(shown) {
        let _ = writeln!(
            told,
            "  {}: {}",
            row.case.id,
            fault_names(row.figures.faults)
        );
    }
    let alarms = alarms.count();
    if let Some(more) = alarms.checked_sub(shown).filter(|more| *more > 0) {
        let _ = writeln!(told, "  and {more} more: with --verbose, and in the report");
    }
    let beyond_force = comparison.beyond_force().len();
    let found = match comparison.found {
        0 => String::new(),
        found => format!(" ({found} found from before)"),
    };
    let _ = write!(
        out,
        "cases       {}{found}, false alarms {alarms}, beyond the force available {beyond_force}\n{told}{}",
        comparison.rows.len(),
        place(report, 12)
    );
    out
}

/// The verdicts of the random combinations, one per line.
fn combinations(comparison: &Comparison) -> String {
    let mut out = String::new();
    for judged in comparison.judged() {
        let _ = write!(
            out,
            "missed      {} of {} combinations on {} by {}, at most {:.2} %",
            judged.missed,
            judged.combinations,
            judged.axis,
            judged.controller.name(),
            100.0 * judged.missed_at_most
        );
        if let Some(paired) = judged.paired {
            let _ = write!(
                out,
                "; against the other version {} worse, {} better of {}, {}",
                paired.worse,
                paired.better,
                paired.pairs,
                p_equals(paired.p)
            );
        }
        out.push('\n');
    }
    out
}

fn case(id: &CaseId, axes: &[String], args: &CompareArgs) -> Result<ExitCode, StudyError> {
    let out = args.out.clone().unwrap_or_else(|| "runs/case".into());
    let settings = settings(&out, args.drawing.png)?;
    let single = play(id, axes)?;
    let finished = single.write(&settings)?;
    let text = |finished: &Finished<Vec<PathBuf>>| {
        let mut out = finished.summary.clone();
        for figure in &finished.result {
            let _ = writeln!(out, "{}", figure.display());
        }
        out
    };
    end(finished, args.json, text, true)
}
