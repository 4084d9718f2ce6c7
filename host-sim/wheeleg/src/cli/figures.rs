//! `wheeleg figures`: Figs. 5 to 9, misprints, single precision.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::{Drawing, end, place, settings};
use wheeleg_studies::StudyError;
use wheeleg_studies::figures::{self, Results};
use wheeleg_studies::study::Finished;

/// Arguments of `wheeleg figures`.
#[derive(Debug, Args)]
pub(super) struct FiguresArgs {
    /// Folder for page, pictures and tables. Results of an earlier run in it move to its subfolder
    /// `previous`.
    #[arg(long, value_name = "DIR", default_value = "runs/figures")]
    out: PathBuf,
    #[command(flatten)]
    drawing: Drawing,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// Computes and writes everything.
pub(super) fn command(args: &FiguresArgs) -> Result<ExitCode, StudyError> {
    let finished = figures::write(&settings(&args.out, args.drawing.png)?)?;
    let text = |finished: &Finished<Option<Results>>| {
        let mut out = finished.result.as_ref().map(text).unwrap_or_default();
        out.push_str(&place(&finished.report, 11));
        out
    };
    end(finished, args.json, text, true)
}

fn text(results: &Results) -> String {
    let mut out = String::from("axes of the paper\n");
    // Three decimals, with no sign on a zero.
    let shown = |v: f64| if v.abs() < 5e-4 { 0.0 } else { v };
    for c in &results.checks {
        let verdict = if c.fits { "fits" } else { "does not fit" };
        let _ = writeln!(
            out,
            "  Fig. {} {:8} {:8} {:>10.3} to {:>8.3} {:5} on {:>6} to {:>4}  {verdict}",
            c.figure,
            c.reading,
            c.quantity,
            shown(c.min),
            shown(c.max),
            c.unit,
            c.axis_min,
            c.axis_max
        );
    }
    let _ = writeln!(
        out,
        "misprints  {} equations, in {} lines of csv/printed-versus-corrected.csv",
        results.equations(),
        results.misprints.len()
    );
    let map = &results.precision;
    let _ = writeln!(
        out,
        "f32        foot {:.2e} mm, strokes {:.2e} mm worst of {} poses (allowed 0.02 mm)",
        1e3 * map.worst_forward_m,
        1e3 * map.worst_inverse_m,
        map.poses
    );
    out
}
