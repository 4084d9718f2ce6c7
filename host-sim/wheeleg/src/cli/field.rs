//! `wheeleg field`: the walks over terrain, with several seeds, compared with the paper's claims.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use clap::builder::PossibleValuesParser;
use wheeleg_campaign::field::{self, Options, SCENARIOS, Summary};
use wheeleg_studies::StudyError;
use wheeleg_studies::study::Finished;

use super::exit::FAILED;
use super::{end, place, settings, tell_error, whole};

/// Arguments of `wheeleg field`.
#[derive(Debug, Args)]
pub(super) struct FieldArgs {
    /// Scenarios to run [default: all]
    #[arg(value_parser = PossibleValuesParser::new(SCENARIOS), value_name = "SCENARIO")]
    scenarios: Vec<String>,
    /// Run all scenarios, as if none were named.
    #[arg(long, conflicts_with = "scenarios")]
    all: bool,
    /// Seeds of each scenario, 1 to 1000: of the noise and, on rocks, of the field.
    #[arg(long, default_value_t = 5, value_parser = whole(1_u32, 1000))]
    seeds: u32,
    /// Folder for page, pictures and summary, and in its subfolder `campaign` the runs, which are not repeated
    /// for the same scenarios and seeds. Results of an earlier run in it move to its subfolder `previous`.
    #[arg(long, value_name = "DIR", default_value = "runs/field")]
    out: PathBuf,
    /// Write the pictures as PNG as well as SVG, if the program was built with `--features png`.
    #[arg(long)]
    png: bool,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Exit with code 1 if a run misses a required bar.
    #[arg(long)]
    strict: bool,
}

/// Runs and writes everything.
pub(super) fn command(args: &FieldArgs) -> Result<ExitCode, StudyError> {
    let wanted = |name: &str| args.scenarios.is_empty() || args.scenarios.iter().any(|s| s == name);
    let options = Options {
        scenarios: SCENARIOS
            .iter()
            .copied()
            .filter(|name| wanted(name))
            .collect(),
        seeds: args.seeds,
        program: std::env::current_exe().ok(),
    };
    let finished = match field::write(&options, &settings(&args.out, args.png)?) {
        Ok(finished) => finished,
        Err(error) => {
            tell_error(error);
            // As of any other study, not as of a campaign that a scheduler restarts.
            return Ok(ExitCode::from(FAILED));
        }
    };
    let text = |finished: &Finished<Summary>| {
        let mut out = text(&finished.result);
        out.push_str(&place(&finished.report, 11));
        out
    };
    let passed = !args.strict || finished.result.passed();
    end(finished, args.json, text, passed)
}

fn text(summary: &Summary) -> String {
    let mut out = String::new();
    for c in &summary.claims {
        let mean = c
            .measured
            .mean
            .map_or_else(|| "-".to_owned(), |m| format!("{m:.2}"));
        let _ = writeln!(
            out,
            "{:12} {:32} {} {mean} {}, {} of {} runs pass",
            c.met.word(),
            c.paper,
            c.measured.measure,
            c.measured.unit,
            c.passed,
            c.runs
        );
    }
    for s in &summary.scenarios {
        let stretch = if s.stretch { " (stretch goal)" } else { "" };
        let _ = writeln!(
            out,
            "{:25} {} of {} pass{stretch}",
            s.scenario, s.passed, s.runs
        );
    }
    out
}
