//! `wheeleg replay`: repeats a recorded live session.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::json;
use wheeleg_console::replay::{Replayed, recorded, replay};
use wheeleg_studies::StudyError;
use wheeleg_studies::export::make_room;
use wheeleg_studies::study::Progress;
use wheeleg_studies::view::plain;

use super::exit::{self, FAILED, TARGETS_MISSED};
use super::{print, show, stop_on_signals, tell, tell_unwritten};

/// Arguments of `wheeleg replay`.
#[derive(Debug, Args)]
#[command(after_help = exit::help(exit::REPLAY))]
pub(super) struct ReplayArgs {
    /// Folder of a recording, such as runs/live/0001.
    folder: PathBuf,
    /// Write the log, from power-up on, to this file.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Refuses a log in the folder of the recording, whose contents are what is repeated.
fn outside(log: &Path, recording: &Path) -> Result<(), StudyError> {
    let folder = log.parent().filter(|folder| !folder.as_os_str().is_empty());
    let place = std::fs::canonicalize(folder.unwrap_or(Path::new(".")));
    let (Ok(place), Ok(recording)) = (place, std::fs::canonicalize(recording)) else {
        // If one of them does not exist, the code that needs it reports this.
        return Ok(());
    };
    if place.starts_with(&recording) {
        return Err(StudyError::refused(
            format!(
                "the log {} would be inside the recording itself",
                log.display()
            ),
            "name a place outside of the recording with --log",
        ));
    }
    Ok(())
}

/// Repeats the recording and compares.
pub(super) fn command(args: &ReplayArgs) -> miette::Result<ExitCode> {
    let stop = stop_on_signals()?;
    let progress = Progress::new("replay", stop.clone());
    if let Some(log) = &args.log {
        outside(log, &args.folder)?;
    }
    let recorded = recorded(&args.folder)?;
    // Only now, so that a recording that cannot be repeated costs no earlier log.
    if let Some(log) = &args.log {
        make_room(log, &[])?;
    }
    let mut begun = false;
    let replayed = replay(recorded, args.log.as_deref(), &mut |ms, of_ms| {
        if !begun {
            begun = true;
            progress.begin(format!("{:.0} s", of_ms as f64 * 1e-3), of_ms);
        }
        progress.at(ms);
        if stop.is_asked() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    progress.clear();
    let mut replayed = replayed?;
    let unwritten = replayed.unwritten.take().map(StudyError::from);
    let printed = if args.json {
        print(&format!("{:#}\n", as_json(&replayed)))
    } else {
        show(&as_text(&replayed))
    };
    let whole = tell_unwritten(unwritten.into_iter().collect());
    if let Some(signal) = stop.signal().filter(|_| replayed.stopped) {
        tell(match replayed.compared {
            0 => "stopped before anything could be compared",
            _ => "stopped; the part replayed so far was compared",
        });
        return Ok(ExitCode::from(signal.exit_code()));
    }
    if !whole {
        return Ok(ExitCode::from(FAILED));
    }
    printed?;
    Ok(if replayed.is_same() {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(TARGETS_MISSED)
    })
}

fn as_json(replayed: &Replayed) -> serde_json::Value {
    json!({
        "recording": replayed.summary,
        "end_s": replayed.end_ms as f64 * 1e-3,
        "inputs": replayed.inputs,
        "hash": replayed.hash,
        "hashes_compared": replayed.compared,
        "same": replayed.is_same(),
        "parted_between_s": replayed.parted.map(|(a, b)| [a as f64 * 1e-3, b as f64 * 1e-3]),
        "stopped": replayed.stopped,
        "cut_short": replayed.cut_short,
    })
}

fn as_text(replayed: &Replayed) -> String {
    let summary = &replayed.summary;
    let s = |ms: u64| ms as f64 * 1e-3;
    let verdict = match replayed.parted {
        None if replayed.compared == 0 && replayed.stopped => {
            "stopped before the first hash: nothing was compared".to_owned()
        }
        None if replayed.compared == 0 => "the recording has no hash to compare with".to_owned(),
        None => format!(
            "the replay is bit-identical: {} hashes compared",
            replayed.compared
        ),
        Some((from, to)) => {
            let why = if summary.program == concat!("wheeleg ", env!("CARGO_PKG_VERSION")) {
                "the program may have been built from other sources"
            } else {
                "another program recorded it"
            };
            format!(
                "the replay differs, from between {:.3} s and {:.3} s on; {why}: {}",
                s(from),
                s(to),
                plain(&summary.program)
            )
        }
    };
    let cut_short = if replayed.cut_short || summary.end_us.is_none() {
        "the recording was cut short; it is repeated as far as it goes\n"
    } else {
        ""
    };
    format!(
        "{cut_short}{verdict}\nrecording {}: {} on {}, seed {}\ntime    {:.3} s since power-up, {} inputs\nhash    {}\n",
        plain(&summary.id),
        plain(&summary.robot),
        plain(&summary.scenario),
        summary.seed,
        s(replayed.end_ms),
        replayed.inputs,
        replayed.hash
    )
}
