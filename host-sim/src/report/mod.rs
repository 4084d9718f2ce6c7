//! What a run leaves behind: figures, tables, summary and one HTML page.

mod figures;
mod html;
mod plot;
mod summary;

pub use summary::{RunInfo, Summary};

use std::path::{Path, PathBuf};

use crate::SimError;
use crate::analysis::Analysis;
use crate::config::{RobotConfig, Scenario};
use crate::telemetry::{Recording, write_csv};

/// Samples per second in the CSV files; every sample is in memory, 500 per
/// second are in the MCAP log.
const CSV_RATE_HZ: u32 = 100;

/// Writes everything but the log into `folder`, which must exist; returns the
/// path of the report.
///
/// # Errors
/// [`SimError::Output`] if a file cannot be written, [`SimError::Plot`] or
/// [`SimError::Report`] if a figure or the page cannot be made.
pub fn write(
    folder: &Path,
    scenario: &Scenario,
    robot: &RobotConfig,
    recording: &Recording,
    analysis: &Analysis,
    summary: &Summary,
) -> Result<PathBuf, SimError> {
    let source = figures::Source {
        scenario,
        robot,
        recording,
        analysis,
    };
    let tables = subfolder(folder, "csv")?;
    write_csv(&tables, recording, CSV_RATE_HZ)?;
    let plots = subfolder(folder, "figures")?;
    let mut drawn = Vec::new();
    for figure in figures::figures(&source) {
        figure.png(&plots.join(format!("{}.png", figure.id)))?;
        let svg = figure.svg()?;
        let path = plots.join(format!("{}.svg", figure.id));
        std::fs::write(&path, &svg).map_err(|e| SimError::output("write the figure", &path, e))?;
        drawn.push((figure, svg));
    }
    let json = summary.to_json();
    let path = folder.join("summary.json");
    std::fs::write(&path, json).map_err(|e| SimError::output("write the summary", &path, e))?;
    let page = html::render(&source, summary, &drawn)?;
    let path = folder.join("report.html");
    std::fs::write(&path, page).map_err(|e| SimError::output("write the report", &path, e))?;
    Ok(path)
}

fn subfolder(folder: &Path, name: &str) -> Result<PathBuf, SimError> {
    let path = folder.join(name);
    std::fs::create_dir_all(&path).map_err(|e| SimError::output("create the folder", &path, e))?;
    Ok(path)
}
