//! Figs. 5 to 9 of the paper, its misprints, and the precision of the master's kinematics: computed and drawn
//! by `wheeleg figures`.

pub mod audit;
mod charts;
pub mod force;
mod page;
pub mod precision;
pub mod section6;
pub(crate) mod tables;

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::Serialize;

use audit::Misprint;
use force::Force;
use precision::PrecisionMap;
use section6::{ARGUMENT, AxisCheck, Instant, LITERAL, Reading};
use wheeleg_kinematics::{LegGeometry, LegParameters};

use crate::StudyError;
use crate::study::schema::json;
use crate::study::{self, Finished, Job, Progress, Settings};
use wheeleg_config::builtin;
use wheeleg_config::builtin::DEFAULT_ROBOT;
use wheeleg_report::results::CSV;

/// Instants of a curve, less one.
const INSTANTS: usize = 2000;
/// Steps of the precision map along s2 and s5: 1 mm.
const MAP_STEPS: usize = 180;
/// Steps along s6: 10 mm.
const MAP_LEVELS: usize = 18;

/// All results.
#[derive(Debug, Clone, PartialEq)]
pub struct Results {
    /// Both readings of the trajectory of section 6 with their motions.
    pub readings: [(Reading, Vec<Instant>); 2],
    /// Fig. 9.
    pub force: Force,
    /// Axes of the paper beside the computed values.
    pub checks: Vec<AxisCheck>,
    /// Equations as printed beside the corrected ones.
    pub misprints: Vec<Misprint>,
    /// Single against double precision.
    pub precision: PrecisionMap,
}

impl Results {
    /// Equations that are misprinted or ambiguous: one may differ in several components.
    #[must_use]
    pub fn equations(&self) -> usize {
        let equations = self.misprints.iter().map(|m| m.equation);
        equations.collect::<BTreeSet<_>>().len()
    }
}

/// Results until the study ended or was stopped.
struct Collected {
    readings: [(Reading, Vec<Instant>); 2],
    force: Force,
    checks: Vec<AxisCheck>,
    misprints: Option<Vec<Misprint>>,
    precision: Option<PrecisionMap>,
}

impl Collected {
    fn compute(progress: &Progress) -> Result<Self, StudyError> {
        let failed = |e: &dyn std::fmt::Display| {
            StudyError::refused(
                format!("cannot compute the figures: {e}"),
                "please report this",
            )
        };
        // Steps of the progress bar: thousandths of a part.
        let at = |share: f64| progress.at((1e3 * share) as u64);
        progress.begin("trajectories", 1000);
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
        let mut misprints = None;
        if !progress.is_stopped() {
            progress.begin("misprints", 1000);
            misprints = Some(audit::misprints(&mut |share| at(share)).map_err(|e| failed(&e))?);
        }
        let mut precision = None;
        if !progress.is_stopped() {
            progress.begin("single precision", 1000);
            let map = PrecisionMap::new(MAP_STEPS, MAP_LEVELS, &mut |share| at(share));
            precision = Some(map.map_err(|e| failed(&e))?);
        }
        Ok(Self {
            readings,
            force,
            checks,
            misprints,
            precision,
        })
    }

    /// The parts of the study, and which of them are done.
    fn parts(&self) -> [(String, bool); 3] {
        [
            ("motions and forces", true),
            ("misprints", self.misprints.is_some()),
            ("single precision", self.precision.is_some()),
        ]
        .map(|(name, done)| (name.to_owned(), done))
    }

    /// Contents of `summary.json`.
    fn summary(&self) -> Summary<'_> {
        Summary {
            axes: &self.checks,
            fig9: Fig9 {
                maximum_at_s: self.force.maximum_at_s,
                worst_difference_n: self.force.worst_difference_n,
            },
            misprints: self.misprints.as_deref(),
            single_precision: self.precision.as_ref().map(|map| SinglePrecision {
                poses: map.poses,
                worst_forward_m: map.worst_forward_m,
                worst_inverse_m: map.worst_inverse_m,
                limit_m: precision::LIMIT_M,
                pass: map.worst_m() < precision::LIMIT_M,
            }),
        }
    }

    /// All results, if all are there.
    fn results(self) -> Option<Results> {
        Some(Results {
            readings: self.readings,
            force: self.force,
            checks: self.checks,
            misprints: self.misprints?,
            precision: self.precision?,
        })
    }
}

/// Contents of `summary.json`. A part is null if the study was stopped before it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Summary<'a> {
    /// Axes of the paper beside the computed values.
    axes: &'a [AxisCheck],
    /// Fig. 9.
    fig9: Fig9,
    /// Equations as printed beside the corrected ones.
    misprints: Option<&'a [Misprint]>,
    /// Single against double precision.
    single_precision: Option<SinglePrecision>,
}

impl study::Summary for Summary<'_> {
    const SCHEMA: &'static str = "wheeleg.figures/1";
}

/// Fig. 9.
#[derive(Debug, Serialize, JsonSchema)]
struct Fig9 {
    /// Time of the largest force (s).
    maximum_at_s: f64,
    /// Largest difference between the inverse dynamics and the paper's formula (N).
    worst_difference_n: f64,
}

/// Single against double precision.
#[derive(Debug, Serialize, JsonSchema)]
struct SinglePrecision {
    /// Poses computed both ways.
    poses: usize,
    /// Worst distance of the foot (m).
    worst_forward_m: f64,
    /// Worst difference of a stroke (m).
    worst_inverse_m: f64,
    /// Largest difference allowed (m).
    limit_m: f64,
    /// Whether both are below it.
    pass: bool,
}

/// Computes and writes everything; returns the results if the study was not stopped.
///
/// # Errors
/// [`StudyError`] if a result cannot be computed, drawn or written.
pub fn write(settings: &Settings) -> Result<Finished<Option<Results>>, StudyError> {
    let job = Job::begin("figures", settings, &[])?;
    let collected = Collected::compute(&job.progress)?;
    let parts = collected.parts();
    let done = parts.iter().filter(|(_, done)| *done).count() as u64;
    let stopped = job.progress.stopped(done, parts.len() as u64, "parts");
    let summary = json(&collected.summary(), stopped.as_ref());
    if let Some(stopped) = stopped {
        let page = Job::stopped_page("Figures of the paper", &stopped.to_string(), &parts);
        let rest = |_: &Job, _: &_| (page, Vec::new());
        return Ok(job.finish(None, summary, Some(stopped), rest));
    }
    let results = collected.results();
    let results = results.ok_or_else(|| StudyError::refused("a part is missing", ""))?;
    let finished = job.finish(results, summary, None, |job, results| {
        let folder = job.subfolder(CSV);
        job.keep(folder.and_then(|folder| tables::write(&folder, results)));
        let drawn = job.draw(charts::figures(results));
        (page::render(results, &drawn), drawn)
    });
    Ok(finished.map(Some))
}
