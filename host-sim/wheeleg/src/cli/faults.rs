//! `wheeleg faults`: what can go wrong, and how the robot responds.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{end, place, print, settings, show, whole};
use wheeleg_config::faults::{KINDS, KindInfo, NOT_IMPLEMENTED};
use wheeleg_studies::StudyError;
use wheeleg_studies::matrix::{self, Connection, Outcome, Verdict};
use wheeleg_studies::study::Finished;

/// Arguments of `wheeleg faults`.
#[derive(Debug, Args)]
pub(super) struct FaultsArgs {
    #[command(subcommand)]
    command: FaultsCommand,
}

#[derive(Debug, Subcommand)]
enum FaultsCommand {
    /// List the faults that a run accepts with --fault.
    List {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// List the rows of the fault matrix: what goes wrong, when, and what must follow.
    Rows,
    /// Run rows of the fault matrix and judge them by what must follow; writes report and
    /// summary. Exit code 1 if a row fails.
    Run(RunArgs),
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Run all rows; rows that are not implemented are listed but not counted.
    #[arg(long)]
    all: bool,
    /// Run one row, as named by `wheeleg faults rows`; may be given several times.
    #[arg(long, value_name = "ID", conflicts_with = "all")]
    row: Vec<String>,
    /// Seed of all noise, and of the instants.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole(0_u64, u64::MAX))]
    seed: u64,
    /// Folder for the results. Results of an earlier run in it move to its subfolder `previous`.
    #[arg(long, value_name = "DIR", default_value = "runs/faults")]
    out: PathBuf,
    /// Print every row with --all; otherwise rows that passed are only counted.
    #[arg(long)]
    verbose: bool,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// Lists faults and rows, or runs rows.
pub(super) fn command(args: &FaultsArgs) -> Result<ExitCode, StudyError> {
    match &args.command {
        FaultsCommand::List { json: true } => print(&listing(true)),
        FaultsCommand::List { json: false } => show(&listing(false)),
        FaultsCommand::Rows => show(&rows()),
        FaultsCommand::Run(args) => run(args),
    }
}

/// Width of a column with the ids of rows.
fn id_width() -> usize {
    let widths = matrix::ROWS.iter().map(|row| row.id.len());
    widths.max().unwrap_or(0)
}

fn rows() -> String {
    let mut out = String::from("Rows of the fault matrix (wheeleg faults run --row ID):\n\n");
    let width = id_width();
    for row in matrix::ROWS {
        let mut faults: Vec<&str> = row.faults.iter().map(|s| s.what).collect();
        if row.estop {
            faults.push("E-stop");
        }
        faults.extend(row.connection.map(Connection::label));
        let what = match row.not_implemented() {
            Some(reason) => format!("not implemented: {reason}"),
            None => format!("{}; {}", faults.join(", "), row.phase.label()),
        };
        let _ = writeln!(out, "  {:width$}  {what}", row.id);
    }
    out
}

fn run(args: &RunArgs) -> Result<ExitCode, StudyError> {
    if !args.all && args.row.is_empty() {
        return Err(StudyError::refused(
            "`wheeleg faults run` needs at least one row: use --row ID or --all",
            "`wheeleg faults rows` lists the rows; --row may be given several times",
        ));
    }
    let rows = matrix::select(&args.row)?;
    let finished = matrix::write(&rows, args.seed, &settings(&args.out, false)?)?;
    let passed = matrix::count(&finished.result, Verdict::Fail) == 0;
    // A user who names rows wants to see them.
    let all = args.verbose || !args.all;
    let text = |f: &Finished<Vec<Outcome>>| verdicts(&f.result, &f.report, all);
    end(finished, args.json, text, passed)
}

/// Rows that failed, then the others, if all are wanted.
fn verdicts(outcomes: &[Outcome], report: &Path, all: bool) -> String {
    let width = id_width();
    let (failed, others): (Vec<_>, Vec<_>) =
        outcomes.iter().partition(|o| o.verdict == Verdict::Fail);
    let others = others.into_iter().filter(|_| all);
    let mut out = format!(
        "{:15}  {:width$} {:>9} {:>9} {:>9} {:>9}  latched\n",
        "verdict", "row", "detected", "commanded", "telemetry", "physical"
    );
    let ms = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.1} ms"));
    for o in failed.into_iter().chain(others) {
        let m = &o.measured;
        let _ = write!(out, "{:15}  {:width$}", o.verdict.label(), o.row.id);
        if o.verdict != Verdict::NotImplemented {
            let times = [m.detected_ms, m.commanded_ms, m.sensed_ms, m.physical_ms].map(ms);
            let _ = write!(
                out,
                " {:>9} {:>9} {:>9} {:>9}",
                times[0], times[1], times[2], times[3]
            );
            let _ = write!(out, "  {}", if m.latched { "yes" } else { "no" });
        }
        out.push('\n');
        for failure in &o.failures {
            let _ = writeln!(out, "{:17}{failure}", "");
        }
    }
    let count = |verdict| matrix::count(outcomes, verdict);
    let _ = writeln!(
        out,
        "\n{} rows passed, {} failed, {} not implemented{}",
        count(Verdict::Pass),
        count(Verdict::Fail),
        count(Verdict::NotImplemented),
        if all {
            ""
        } else {
            "; --verbose shows them all"
        },
    );
    out.push_str(&place(report, 8));
    out
}

fn listing(json: bool) -> String {
    if json {
        let list: Vec<serde_json::Value> = KINDS.iter().map(row_json).collect();
        let missing: Vec<serde_json::Value> = NOT_IMPLEMENTED
            .iter()
            .map(|(name, reason)| serde_json::json!({ "name": name, "reason": reason }))
            .collect();
        let lists = serde_json::json!({ "faults": list, "not_implemented": missing });
        return format!("{lists:#}\n");
    }
    let mut out = String::from(
        "Faults (wheeleg run SCENARIO --fault NAME[:TARGET][=VALUE]@TIME[..TIME]);\nfaults that end by themselves take no second TIME:\n",
    );
    for row in KINDS {
        let _ = writeln!(out, "\n  {}", row.name);
        let _ = writeln!(out, "      {}", row.doc);
        let _ = writeln!(out, "      affects {}", row.place.expected());
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
    out.push_str("\nNot implemented, refused by name:\n\n");
    let width = id_width();
    for (name, reason) in NOT_IMPLEMENTED {
        let _ = writeln!(out, "  {name:width$}  {reason}");
    }
    out
}

fn row_json(row: &KindInfo) -> serde_json::Value {
    serde_json::json!({
        "name": row.name,
        "description": row.doc,
        "affects": row.place.expected(),
        "value": row.value.map(|v| serde_json::json!({
            "unit": v.unit, "min": v.min, "max": v.max, "gap": v.gap, "default": v.default, "description": v.doc,
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_studies::study::Progress;

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

    #[test]
    fn what_failed_comes_first_and_what_passed_is_told_if_it_is_wanted() {
        let missing = matrix::ROWS
            .iter()
            .find(|row| row.not_implemented().is_some());
        let missing = missing.expect("a row that is not implemented");
        let outcomes = matrix::run(&[missing], 1, &Progress::silent()).expect("listed");
        let [missing] = &outcomes[..] else {
            panic!("{} outcomes", outcomes.len());
        };
        let of = |row: usize, verdict, failures: Vec<String>| Outcome {
            row: matrix::ROWS[row],
            verdict,
            failures,
            ..missing.clone()
        };
        let outcomes = [
            of(0, Verdict::Pass, Vec::new()),
            missing.clone(),
            of(1, Verdict::Fail, vec!["never".to_owned()]),
        ];
        let rows = |all: bool| {
            let text = verdicts(&outcomes, Path::new("none/report.html"), all);
            let lines = text.lines().skip(1).take_while(|line| !line.is_empty());
            let starts = lines.map(|line| line.split("  ").next().unwrap_or("").to_owned());
            (starts.collect::<Vec<String>>(), text)
        };
        let (few, text) = rows(false);
        assert_eq!(few, ["FAIL", ""], "{text}");
        assert!(
            text.contains("1 rows passed, 1 failed, 1 not implemented; --verbose"),
            "{text}"
        );
        let (all, text) = rows(true);
        assert_eq!(all, ["FAIL", "", "PASS", "not implemented", ""], "{text}");
        assert!(!text.contains("--verbose"), "{text}");
    }

    #[test]
    fn rows_stand_in_two_columns_and_each_says_what_goes_wrong() {
        let text = rows();
        let lines = text.lines().skip(2);
        assert_eq!(lines.clone().count(), matrix::ROWS.len());
        for (line, row) in lines.zip(matrix::ROWS) {
            let (id, what) = line.split_at(2 + id_width() + 2);
            assert!(id.trim() == row.id && id.ends_with("  "), "{line}");
            assert!(
                what.starts_with(|c: char| c.is_ascii_alphabetic()),
                "{line}"
            );
        }
    }

    #[test]
    fn what_is_not_implemented_is_listed_apart() {
        let text = listing(false);
        let (faults, missing) = text.split_once("\nNot implemented").expect("a section");
        let json: serde_json::Value = serde_json::from_str(&listing(true)).expect("JSON");
        let list = json["not_implemented"].as_array().expect("a list");
        let rows = matrix::ROWS
            .iter()
            .filter(|r| r.not_implemented().is_some());
        let listed = |id: &str| list.iter().any(|fault| fault["name"] == id);
        // Seven more have a row with an operator, but no fault that a run could inject.
        assert!(list.len() == 8 && rows.clone().count() == 1, "{list:?}");
        for row in rows {
            let reason = row.not_implemented().unwrap_or("");
            let line = format!("  {:1$}  {reason}\n", row.id, id_width());
            assert!(
                listed(row.id) && missing.contains(&line) && !faults.contains(row.id),
                "{line}"
            );
        }
        let of_operator = matrix::ROWS.iter().filter(|r| r.connection.is_some());
        assert_eq!(of_operator.filter(|r| listed(r.id)).count(), 7);
    }
}
