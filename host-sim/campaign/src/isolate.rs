//! Runs a case that is suspected of crashing its process in a separate process.

use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

use wheeleg_studies::study::Stop;

use crate::cases::Cases;
use crate::compute::{self, Simulate};
use crate::row::Row;
use crate::store::{Store, write_whole};

use crate::{CampaignError, part};

/// Exit code of a process that was asked to stop.
pub(crate) const STOPPED: i32 = 75;

/// What happened to the process.
pub(crate) enum Isolated {
    /// It computed a row.
    Row(Box<Row>),
    /// The case crashed it; how it ended.
    Ended(String),
    /// It was asked to stop.
    Stopped,
}

/// Runs a case in a separate process of `program`.
pub(crate) fn isolate(
    program: &Path,
    store: &Store,
    index: u64,
    stop: &Stop,
) -> Result<Isolated, CampaignError> {
    let block = index / store.plan().block;
    let file = store.new_partial(block);
    let child = Command::new(program)
        .args(["campaign", "case"])
        .arg(store.folder())
        .arg(index.to_string())
        .arg("--row")
        .arg(&file)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .output();
    let child = child.map_err(|e| {
        CampaignError::refused(
            format!("cannot start `{}`: {e}", program.display()),
            "put the program back to where it was, and run the same command again",
        )
    })?;
    let row = part::read(&file, &store.plan().hash);
    let _ = std::fs::remove_file(&file);
    if let Ok((rows, _)) = row
        && let [row] = &rows[..]
        && child.status.success()
    {
        return Ok(Isolated::Row(Box::new(row.clone())));
    }
    if stop.is_asked() || child.status.code() == Some(STOPPED) {
        return Ok(Isolated::Stopped);
    }
    if child.status.code() == Some(74) {
        let message = String::from_utf8_lossy(&child.stderr).trim().to_owned();
        let reason = std::io::Error::other(message);
        return Err(CampaignError::output("write", file, reason));
    }
    Ok(Isolated::Ended(how(child.status)))
}

/// How a process ended, in the same words on every computer.
fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!("signal {signal}");
    }
    match status.code() {
        Some(code) => format!("exit code {code}"),
        None => "an unknown end".to_owned(),
    }
}

/// The child's side: computes one row of a campaign into a file. Returns false if it was asked to stop.
///
/// # Errors
/// As for [`crate::run`].
pub fn isolated(
    store: &Store,
    index: u64,
    file: &Path,
    simulate: Simulate<'_>,
) -> Result<bool, CampaignError> {
    let plan = store.plan().plan()?;
    let cases = Cases::new(&plan)?;
    if index >= store.plan().cases {
        return Err(CampaignError::refused(
            format!(
                "there is no case {index}: the plan has {}",
                store.plan().cases
            ),
            format!("give a number from 0 to {}", store.plan().cases - 1),
        ));
    }
    let Some(row) = compute::row(&cases, index, store.plan().block, simulate) else {
        return Ok(false);
    };
    let bytes = part::bytes(cases.columns(), &store.plan().hash, &[row]);
    write_whole(file, &bytes)?;
    Ok(true)
}
