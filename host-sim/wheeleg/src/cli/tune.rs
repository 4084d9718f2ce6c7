//! `wheeleg tune`: tunes one cylinder with a user's own parameters.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::{Drawing, end, place, stop_on_signals, whole};
use wheeleg_report::number::or_dash;
use wheeleg_report::results::BOARD_PARAMETERS;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::valve_resolution::COARSE;
use wheeleg_studies::study::Settings;
use wheeleg_studies::tune::{self, Section, Tuned};

/// Arguments of `wheeleg tune`.
#[derive(Debug, Args)]
pub(super) struct TuneArgs {
    /// Built-in axis or path of an axis file.
    axis: String,
    /// Folder for report, figures and parameters [default: runs/tune-<axis>]. Results of an earlier run in it
    /// move to its subfolder `previous`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of the ADC noise.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = whole(0_u64, u64::MAX))]
    seed: u64,
    /// Section of the robot file that the parameters are for.
    #[arg(long, value_name = "SECTION", default_value = "joint", value_parser = sections())]
    section: Section,
    #[command(flatten)]
    drawing: Drawing,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// Parses the name of a section.
fn sections() -> impl TypedValueParser<Value = Section> {
    let values = Section::ALL.map(|section| PossibleValue::new(section.name()).help(section.doc()));
    PossibleValuesParser::new(values).map(|name| {
        let mut all = Section::ALL.into_iter();
        all.find(|s| s.name() == name).unwrap_or(Section::Joint)
    })
}

/// Tunes, writes and prints.
pub(super) fn command(args: &TuneArgs) -> Result<ExitCode, StudyError> {
    let stop = stop_on_signals()?;
    let default = |axis: &str| PathBuf::from("runs").join(format!("tune-{axis}"));
    let finished = tune::tune(&args.axis, args.seed, args.section, |axis| Settings {
        out: args.out.clone().unwrap_or_else(|| default(axis)),
        png: args.drawing.png,
        stop,
    })?;
    let accepted = finished.result.is_accepted();
    end(
        finished,
        args.json,
        |f| text(&f.result, &f.report),
        accepted,
    )
}

/// The tests before and after, what supervision stopped, delays, and where the files are.
fn text(tuned: &Tuned, report: &Path) -> String {
    let mut text = format!(
        "{:<15}{:>20}{:>20}{:>20}{:>20}\n{:<15}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}\n",
        "",
        "error [mm]",
        "overshoot [mm]",
        "settled [s]",
        "worst error [mm]",
        "",
        "before",
        "after",
        "before",
        "after",
        "before",
        "after",
        "before",
        "after"
    );
    for test in &tuned.tests {
        let both = |f: fn(&wheeleg_studies::compare::Figures) -> Option<f64>, digits: usize| {
            [&test.before, &test.after].map(|figures| or_dash(f(figures), digits))
        };
        let cells = [
            both(|f| f.steady_error_mm.map(f64::abs), 2),
            both(|f| f.overshoot_mm, 2),
            both(|f| f.settle_s, 3),
            both(|f| f.worst_mm, 2),
        ];
        let _ = write!(text, "{:<15}", test.motion.name());
        for cell in cells.iter().flatten() {
            let _ = write!(text, "{cell:>10}");
        }
        text.push('\n');
    }
    for (when, names) in [
        ("before", tuned.stopped(|test| &test.before)),
        ("after", tuned.stopped(|test| &test.after)),
    ] {
        if !names.is_empty() {
            let _ = writeln!(text, "stopped by supervision {when}: {}", names.join(", "));
        }
    }
    if let Some(advice) = tuned.valve_resolution.advice() {
        let _ = writeln!(text, "{advice}");
    }
    let valve = &tuned.config.axis.cylinder.fill_valve;
    let found = tuned.delays.map_or_else(
        || "not found".to_owned(),
        |d| format!("{:.2} ms", d.t_on_s * 1e3),
    );
    let resolution = tuned.valve_resolution.ratio;
    let resolution = resolution.map_or_else(|| "n/a".to_owned(), |ratio| format!("{ratio:.2}"));
    let _ = writeln!(
        text,
        "opening delay  {found} (sheet {:.2} ms)\nresolution     {} (of the valves: force of the shortest opening over what friction holds; coarse above {COARSE})",
        valve.t_on_s * 1e3,
        resolution,
    );
    let parameters = report.with_file_name(BOARD_PARAMETERS);
    for worse in &tuned.worse {
        let _ = writeln!(text, "worse          {}", worse.message());
    }
    let parameters = if tuned.stopped.is_some() {
        "not written: not all tests were run".to_owned()
    } else if tuned.worse.is_empty() && !parameters.exists() {
        "not written".to_owned()
    } else if tuned.worse.is_empty() {
        parameters.display().to_string()
    } else {
        "refused, not written: the moves above are worse than with the board's defaults".to_owned()
    };
    let _ = write!(text, "parameters     {parameters}\n{}", place(report, 15));
    text
}
