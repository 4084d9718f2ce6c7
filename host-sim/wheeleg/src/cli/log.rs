//! `wheeleg log`: works on logs of runs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{FAILED, print, stop_on_signals, tell};
use wheeleg_report::results::RECOVERED;
use wheeleg_studies::StudyError;
use wheeleg_studies::export::log_of;
use wheeleg_studies::study::Signal;
use wheeleg_telemetry::recover;

/// Arguments of `wheeleg log`.
#[derive(Debug, Args)]
pub(super) struct LogArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Restore a complete log from a truncated one (the run was killed, or the disk was full).
    Recover {
        /// Log, or the folder of its run; it is not changed.
        log: PathBuf,
        /// New file, which must not exist [default: NAME-recovered.mcap next to the log].
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
}

/// Recovers a log and reports how much of it was recovered.
pub(super) fn command(args: &LogArgs) -> Result<ExitCode, StudyError> {
    let Action::Recover { log, out } = &args.action;
    let log = &log_of(log);
    let out = out.clone().unwrap_or_else(|| beside(log));
    let stop = stop_on_signals()?;
    stop.begin();
    let recovered = recover(log, &out, &|| stop.is_asked())?;
    let Some(recovered) = recovered else {
        tell("stopped; no recovered log is left, and the log stays as it is");
        let code = stop.signal().map_or(FAILED, Signal::exit_code);
        return Ok(ExitCode::from(code));
    };
    let note = match (recovered.was_whole, recovered.behind) {
        (true, 0) => "; the log was whole already".to_owned(),
        (true, bytes) => format!(
            "; the log was whole already, and the {bytes} bytes behind its end, such as another log, \
             are left out: cut them off and recover them by themselves"
        ),
        (false, _) => String::new(),
    };
    print(&format!(
        "{} messages recovered, up to {:.3} s, and read back from {}{note}\n",
        recovered.messages,
        recovered.last_ns as f64 * 1e-9,
        out.display()
    ))
}

fn beside(log: &Path) -> PathBuf {
    let stem = log.file_stem().unwrap_or_default().to_string_lossy();
    log.with_file_name(format!("{stem}{RECOVERED}"))
}
