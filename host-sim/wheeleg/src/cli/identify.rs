//! `wheeleg identify`: identifies a user's cylinder from measurements.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::{Drawing, end, place, stop_on_signals, whole};
use wheeleg_studies::StudyError;
use wheeleg_studies::identify::map::Mapped;
use wheeleg_studies::identify::{self, AXIS, Identified, NEXT, Options};
use wheeleg_studies::study::Settings;

/// Arguments of `wheeleg identify`.
#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// Measurement: a CSV file with time_s, position_mm and the valves as on-times (fill_a_us, vent_a_us,
    /// fill_b_us, vent_b_us) or states (fill_a, …: 0, 1); if available, also pressure_a_bar, pressure_b_bar
    /// (absolute) and load_n.
    lab: PathBuf,
    /// Built-in axis or path of an axis file: the data sheet.
    #[arg(long, value_name = "AXIS")]
    axis: String,
    /// Column with another name or unit in the file: NAME=COLUMN, or NAME=COLUMN*FACTOR+OFFSET, such as
    /// `position_mm=x (m)*1000`; may be given several times. Columns with a name of that list are read as they
    /// are; all others are then ignored.
    #[arg(long, value_name = "NAME=COLUMN")]
    map: Vec<Mapped>,
    /// Fraction of the measurement, at its end, that is held out from the fit, 0.1 to 0.9.
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, value_parser = share)]
    hold_out: f64,
    /// Folder for report, figures and axis file [default: runs/identify-<axis>]. Results of an earlier run in
    /// it move to its subfolder `previous`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of the fit's starting points.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole(0_u64, u64::MAX))]
    seed: u64,
    #[command(flatten)]
    drawing: Drawing,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.1..=0.9).contains(&value) {
        Ok(value)
    } else {
        Err("allowed: 0.1 to 0.9".to_owned())
    }
}

/// Identifies, writes and prints. A measurement that the fit does not explain counts as a missed target.
pub(super) fn command(args: &IdentifyArgs) -> Result<ExitCode, StudyError> {
    let stop = stop_on_signals()?;
    let default = |axis: &str| PathBuf::from("runs").join(format!("identify-{axis}"));
    let options = Options {
        lab: &args.lab,
        axis: &args.axis,
        map: &args.map,
        hold_out: args.hold_out,
        seed: args.seed,
    };
    let finished = identify::identify(&options, |axis| Settings {
        out: args.out.clone().unwrap_or_else(|| default(axis)),
        png: args.drawing.png,
        stop,
    })?;
    let passed = finished.result.is_explained() && finished.stopped.is_none();
    end(finished, args.json, |f| text(&f.result, &f.report), passed)
}

fn text(identified: &Identified, report: &Path) -> String {
    let mut text = format!("{:<34}{:>9}{:>9}{:>9}\n", "", "factor", "from", "to");
    for p in &identified.parameters {
        let line = format!(
            "{:<34}{:>9.4}{:>9.4}{:>9.4}  {}",
            p.words,
            p.factor,
            p.low,
            p.high,
            p.note()
        );
        let _ = writeln!(text, "{}", line.trim_end());
    }
    for direction in &identified.undetermined {
        let _ = writeln!(text, "undetermined   {direction}");
    }
    let _ = writeln!(
        text,
        "held out       error {:.3} mm, with the file's values {:.3} mm; sensor noise {:.3} mm",
        identified.after.held_out_mm, identified.before.held_out_mm, identified.noise_mm
    );
    if identified.is_worse_than_the_file() {
        text.push_str("               the fit is worse than the file: measure for longer\n");
    } else if !identified.is_explained() {
        text.push_str("               do not trust the intervals; possible reasons:\n");
        for doubt in &identified.doubts {
            let _ = writeln!(text, "               - {doubt}");
        }
        text.push_str(
            "               - the bench has something that the model lacks, such as a leak\n",
        );
    }
    if let Some(next) = identified.experiments.first() {
        let path = report.with_file_name(NEXT);
        let _ = writeln!(text, "next           {}: {}", path.display(), next.words);
    }
    let axis = if identified.stopped.is_some() {
        "not written: the fit was stopped".to_owned()
    } else {
        let path = report.with_file_name(AXIS);
        let written = path.exists().then(|| path.display().to_string());
        written.unwrap_or_else(|| "not written".to_owned())
    };
    let _ = write!(text, "axis           {axis}\n{}", place(report, 15));
    text
}
