//! `wheeleg view`: one log, or two, as a single page.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use wheeleg_report::results::REPORT;
use wheeleg_studies::StudyError;
use wheeleg_studies::export::log_of;
use wheeleg_studies::study::Progress;
use wheeleg_studies::view::{Options, plain, view};

use super::{print, stop_on_signals, tell};

/// Arguments of `wheeleg view`.
#[derive(Debug, Args)]
pub(super) struct ViewArgs {
    /// A log, or the folder of its run or recording; two are overlaid.
    #[arg(required = true, num_args = 1.., value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Start of the part to show, in seconds of the log.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        value_parser = seconds
    )]
    from: f64,
    /// End of the part to show [default: end of the log].
    #[arg(
        long,
        value_name = "S",
        allow_negative_numbers = true,
        value_parser = seconds
    )]
    to: Option<f64>,
    /// Another signal to draw, such as /joint/3.force_net_n; may be given several times.
    /// `wheeleg channels` lists them.
    #[arg(long = "signal", value_name = "CHANNEL.FIELD")]
    signals: Vec<String>,
    /// Robot whose dimensions the drawing uses (built in, or path of a TOML file), instead of the log's.
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Page to write [default: log.html next to the first log].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Parses a time of a log.
fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|s| s.is_finite());
    number.ok_or_else(|| "allowed are seconds with a decimal point, such as 0.1".to_owned())
}

/// The log at a given path, which may be a folder.
fn log_in(given: &Path) -> Result<PathBuf, StudyError> {
    let log = log_of(given);
    if given.is_dir() && !log.exists() {
        let page = given.join(REPORT);
        let help = match page.is_file() {
            true => format!(
                "open its page, `{}`; a log is in the folder of a run or of a recording",
                plain(&page.display().to_string())
            ),
            false => "give a log, or the folder of a run or of a recording".to_owned(),
        };
        return Err(StudyError::refused(
            format!(
                "there is no log.mcap in `{}`",
                plain(&given.display().to_string())
            ),
            help,
        ));
    }
    Ok(log)
}

/// Makes the page and prints where it is.
pub(super) fn command(args: &ViewArgs) -> Result<ExitCode, StudyError> {
    let logs = args.logs.iter().map(|log| log_in(log));
    let logs = logs.collect::<Result<Vec<PathBuf>, _>>()?;
    if logs.len() > 2 {
        return Err(StudyError::refused(
            format!(
                "{} logs are given, and at most two can be compared",
                logs.len()
            ),
            "give one log, or two",
        ));
    }
    let stop = stop_on_signals()?;
    let progress = Progress::new("view", stop.clone());
    let options = Options {
        logs,
        robot: args.robot.clone(),
        from_s: args.from,
        to_s: args.to.unwrap_or(f64::INFINITY),
        signals: args.signals.clone(),
        out: args.out.clone(),
    };
    let viewed = view(&options, &progress);
    progress.clear();
    match (viewed?, stop.signal()) {
        (Some(viewed), _) => {
            for log in &viewed.broken_off {
                tell(&format!(
                    "{} is truncated: the part up to there is shown",
                    plain(&log.display().to_string())
                ));
            }
            for (log, end_s) in &viewed.ended {
                tell(&format!(
                    "{} ends at {end_s:.2} s, before the end of the part that was asked for: only the part up to there is shown",
                    plain(&log.display().to_string())
                ));
            }
            print(&format!(
                "{}\npage    {}\n",
                viewed.verdict,
                plain(&viewed.page.display().to_string())
            ))
        }
        (None, Some(signal)) => {
            tell("stopped; no page is written, and the log stays as it is");
            Ok(ExitCode::from(signal.exit_code()))
        }
        (None, None) => Ok(ExitCode::SUCCESS),
    }
}
