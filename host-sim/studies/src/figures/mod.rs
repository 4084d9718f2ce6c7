//! Figs. 5 to 9 of the paper, its misprints, and the precision of the master's kinematics: computed
//! and drawn by `wheeleg figures`.

pub mod audit;
mod charts;
pub mod force;
mod page;
pub mod precision;
pub mod section6;
pub(crate) mod tables;

use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};

use audit::Misprint;
use force::Force;
use precision::PrecisionMap;
use section6::{ARGUMENT, AxisCheck, Instant, LITERAL, Reading};
use wheeleg_kinematics::{LegGeometry, LegParameters};

use crate::StudyError;
use wheeleg_config::builtin;
use wheeleg_config::builtin::DEFAULT_ROBOT;
use wheeleg_report::output;
use wheeleg_report::subfolder;

/// Instants of a curve, less one.
const INSTANTS: usize = 2000;
/// Steps of the precision map along s2 and s5: 1 mm.
const MAP_STEPS: usize = 180;
/// Steps along s6: 10 mm.
const MAP_LEVELS: usize = 18;

/// Everything that is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Results {
    /// Both readings of the trajectory of section 6 with their motions.
    pub readings: [(Reading, Vec<Instant>); 2],
    /// Fig. 9.
    pub force: Force,
    /// Axes of the paper beside what was computed.
    pub checks: Vec<AxisCheck>,
    /// Equations as printed beside the corrected ones.
    pub misprints: Vec<Misprint>,
    /// Single against double precision.
    pub precision: PrecisionMap,
}

/// Files that were written.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// The page.
    pub report: PathBuf,
    /// Contents of `summary.json`.
    pub summary: serde_json::Value,
    /// What was computed.
    pub results: Results,
}

impl Results {
    /// Computes everything; `progress` is told the share that is done and what is being done.
    ///
    /// # Errors
    /// [`StudyError::Refused`]; the motions of the paper are inside the leg's reach.
    pub fn compute(progress: &mut dyn FnMut(f64, &'static str)) -> Result<Self, StudyError> {
        let failed = |e: &dyn std::fmt::Display| {
            StudyError::refused(
                format!("cannot compute the figures: {e}"),
                "please report this",
            )
        };
        progress(0.0, "trajectories");
        let geometry = LegGeometry::new(LegParameters::wheeleg_2003()).map_err(|e| failed(&e))?;
        let motion = |reading: Reading| {
            let motion = reading.motion(&geometry, INSTANTS);
            motion.map(|m| (reading, m)).map_err(|e| failed(&e))
        };
        let readings = [motion(ARGUMENT)?, motion(LITERAL)?];
        let robot = builtin::robot(DEFAULT_ROBOT)?;
        let force = Force::new(&robot, INSTANTS).map_err(|e| failed(&e))?;
        let mut checks: Vec<AxisCheck> = readings
            .iter()
            .flat_map(|(reading, motion)| section6::checks(reading, motion))
            .collect();
        checks.push(force.check());
        let misprints = audit::misprints(&mut |share| progress(0.02 + 0.18 * share, "misprints"));
        let misprints = misprints.map_err(|e| failed(&e))?;
        let precision = PrecisionMap::new(MAP_STEPS, MAP_LEVELS, &mut |share| {
            progress(0.2 + 0.5 * share, "single precision");
        });
        Ok(Self {
            readings,
            force,
            checks,
            misprints,
            precision: precision.map_err(|e| failed(&e))?,
        })
    }

    /// What `summary.json` holds.
    #[must_use]
    pub fn summary(&self) -> serde_json::Value {
        serde_json::json!({
            "axes": self.checks,
            "fig9": {
                "maximum_at_s": self.force.maximum_at_s,
                "worst_difference_n": self.force.worst_difference_n,
            },
            "misprints": self.misprints,
            "single_precision": {
                "poses": self.precision.poses,
                "worst_forward_m": self.precision.worst_forward_m,
                "worst_inverse_m": self.precision.worst_inverse_m,
                "limit_m": precision::LIMIT_M,
                "pass": self.precision.worst_m() < precision::LIMIT_M,
            },
        })
    }
}

/// Computes and writes everything into `folder`. Results of an earlier run in it are set aside in
/// its folders `previous`, `previous-2`, …
///
/// # Errors
/// [`StudyError`] if something cannot be computed, drawn or written.
pub fn write(folder: &Path) -> Result<Finished, StudyError> {
    output::prepare(folder)?;
    let bar = progress_bar();
    let results = Results::compute(&mut |share, what| {
        bar.set_position((1e3 * share) as u64);
        bar.set_message(what);
    })?;
    tables::write(&subfolder(folder, "csv")?, &results)?;
    let plots = subfolder(folder, "figures")?;
    let figures = charts::figures(&results);
    let mut drawn = Vec::with_capacity(figures.len());
    bar.set_message("drawing");
    for (i, figure) in figures.into_iter().enumerate() {
        let svg = figure.svg();
        let path = plots.join(format!("{}.svg", figure.id));
        save(&path, &svg)?;
        drawn.push((figure, svg));
        bar.set_position(700 + 25 * i as u64);
    }
    let summary = results.summary();
    save(&folder.join("summary.json"), &format!("{summary:#}\n"))?;
    let report = folder.join("report.html");
    save(&report, &page::render(&results, &drawn)?)?;
    bar.finish_and_clear();
    Ok(Finished {
        report,
        summary,
        results,
    })
}

fn save(path: &Path, text: &str) -> Result<(), StudyError> {
    std::fs::write(path, text).map_err(|e| StudyError::output("write", path, e))
}

fn progress_bar() -> ProgressBar {
    // Draws on stderr, and only if that is a terminal.
    let bar = ProgressBar::new(1000);
    let style = ProgressStyle::with_template("figures {wide_bar} {percent:>3} %  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
