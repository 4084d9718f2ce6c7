//! `wheeleg check`: compares the model with independently computed numbers.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{print, show};
use wheeleg_studies::StudyError;
use wheeleg_studies::check::vectors::{self, Comparison};

/// Exit code if a quantity is beyond its tolerance.
const DISAGREES: u8 = 1;

/// Arguments of `wheeleg check`.
#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Compare kinematics and dynamics with a file of reference vectors.
    ///
    /// Prints the largest absolute error of every quantity next to its tolerance. Dimensions and masses are
    /// those of the file. Exit codes: 0 all within tolerance, 1 a quantity is beyond it, 2 the file cannot be
    /// compared.
    Vectors(VectorsArgs),
}

#[derive(Debug, Args)]
struct VectorsArgs {
    /// JSON file of schema wheeleg-reference-vectors/1 (MODEL.md section 13).
    file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the check and prints its table.
pub(super) fn command(args: &CheckArgs) -> Result<ExitCode, StudyError> {
    let What::Vectors(args) = &args.what;
    let comparison = vectors::check(&args.file)?;
    if args.json {
        let json = serde_json::to_value(&comparison)
            .map_err(|e| StudyError::refused(e.to_string(), "please report this"))?;
        print(&format!("{json:#}\n"))?;
    } else {
        show(&table(&comparison))?;
    }
    Ok(if comparison.passed {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(DISAGREES)
    })
}

fn table(comparison: &Comparison) -> String {
    let quantities = &comparison.quantities;
    let width = quantities.iter().map(|q| q.name.len()).max().unwrap_or(0);
    let mut out = format!(
        "verdict  {:width$}  {:>6}  {:>11}  {:>9}  worst in\n",
        "quantity", "values", "worst error", "tolerance"
    );
    for q in quantities {
        let place = match q.case {
            Some(case) => format!("case {case} [{}]", q.index),
            None => "parameters".to_owned(),
        };
        let detail = if q.pass {
            String::new()
        } else {
            format!(": file {:e}, computed {:e}", q.expected, q.computed)
        };
        let verdict = if q.pass { "PASS" } else { "FAIL" };
        let _ = writeln!(
            out,
            "{verdict:7}  {:width$}  {:>6}  {:>11.2e}  {:>9.0e}  {place}{detail}",
            q.name, q.values, q.worst_error, q.tolerance
        );
    }
    let met = quantities.iter().filter(|q| q.pass).count();
    let _ = writeln!(
        out,
        "\n{met} of {} quantities within tolerance over {} cases of {} (seed {}); errors absolute, in SI units",
        quantities.len(),
        comparison.cases,
        comparison.file,
        comparison.seed,
    );
    if !comparison.unused_parameters.is_empty() {
        let _ = writeln!(
            out,
            "not checked, because no quantity depends on them: params.{}",
            comparison.unused_parameters.join(", params.")
        );
    }
    out
}
