//! Every controller on the same plants, moves and inputs: `wheeleg compare`.
//!
//! A case is a controller, an axis, a move, a deviation from the axis's data sheet, and a seed. The joint
//! board's whole application ([`crate::axis_sim::Node`]) plays it from power-up, with gains that the builder
//! derives from the sheet. Cases are independent, so they give the same result on any number of threads, and
//! each can be played alone by its name.

mod case;
mod charts;
mod judged;
mod moves;
mod page;
mod single;
mod variation;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::{Axis, AxisParams};

pub use case::{BadCaseId, Case, CaseFacts, CaseId, Figures, MARGIN, Row};
pub(crate) use charts::panel;
pub use judged::{Before, ERROR_MM, Judged, OVERSHOOT_MM, Paired, Quantile, judging_root};
pub(crate) use moves::play_from_power_up;
pub use moves::{CONTACT_S, Move, Played, RECOVERY_S, REST_S, STEP_S, Sizes};
pub use single::{Single, play};
pub(crate) use single::{trace_csv, trace_figure};
pub use variation::{UnknownVariation, Variation};

use crate::StudyError;
use crate::axis_sim::suite::{AxisSimError, TestRig};
use crate::axis_sim::{Kind, design, optimal};
use crate::study::schema::json;
use crate::study::{self, Ended, Finished, Job, Progress, STACK, Settings, Stopped};
use wheeleg_config::AxisConfig;
use wheeleg_report::number::counted;
use wheeleg_report::results::CSV;

/// Options of a comparison.
#[derive(Debug, Clone)]
pub struct Options {
    /// Built-in axes or files.
    pub axes: Vec<String>,
    /// Controllers.
    pub kinds: Vec<Kind>,
    /// Moves; `None`: all as on the sheet, steps of 100 mm and S-curves with deviations from it.
    pub moves: Option<Vec<Move>>,
    /// Number of seeds.
    pub seeds: u64,
    /// The first of them.
    pub seed: u64,
    /// Random combinations per axis.
    pub combinations: u64,
    /// Number of the first of them: [`judging_root`], or the one used for another version.
    pub root: u64,
    /// `summary.json` of another version, to compare these combinations with.
    pub against: Option<PathBuf>,
    /// Fewer factors, a coarser bound.
    pub quick: bool,
    /// Threads; 0: as many as the machine has.
    pub threads: usize,
}

impl Options {
    /// The move by which random combinations are judged; `None` if those that were chosen have no target to arrive at.
    #[must_use]
    pub fn judged_move(&self) -> Option<Move> {
        let Some(moves) = &self.moves else {
            return Some(Move::Step100);
        };
        let mut judged = [Move::Step100, Move::FirstStep].into_iter();
        judged.find(|motion| moves.contains(motion))
    }
}

/// Moves under variations, unless chosen.
const VARIED: [Move; 2] = [Move::Step100, Move::SCurve];

/// An axis of the comparison.
#[derive(Debug, Clone)]
pub struct ComparedAxis {
    /// Its file.
    pub config: AxisConfig,
    /// Fastest times of the large and the small step with perfect knowledge,
    /// retracting and extending \[s\]; `None` if none was found.
    pub bound_s: [Option<[f64; 2]>; 2],
}

/// Stroke and reference of a measured move, 1 ms apart, for the overlays.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlay {
    /// Axis.
    pub axis: String,
    /// Controller.
    pub kind: Kind,
    /// Move; the last of its measured ones.
    pub motion: Move,
    /// Time from the start of the motion \[s\], reference and stroke \[mm\].
    pub points: Vec<[f64; 3]>,
}

/// The whole comparison.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// Its options.
    pub options: Options,
    /// Axes, in the requested order.
    pub axes: Vec<ComparedAxis>,
    /// One row per case.
    pub rows: Vec<Row>,
    /// Of the first seed, as on the sheet.
    pub overlays: Vec<Overlay>,
    /// Results of another version in the random combinations.
    pub before: Option<Before>,
    /// Why it stopped before all cases were played.
    pub stopped: Option<Stopped>,
}

/// Contents of `summary.json`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Cases<'a> {
    /// One object per case that was played or is not feasible.
    pub(crate) cases: &'a [Row],
    /// Statistics of the random combinations, one object per axis and controller.
    pub(crate) judged: &'a [Judged],
    /// Why cases failed that could not be simulated to their end; they are not among `cases`.
    pub(crate) failure: Option<String>,
}

impl study::Summary for Cases<'_> {
    const SCHEMA: &'static str = "wheeleg.compare/2";
}

/// An axis that cannot be compared: names the file, field, value and range.
pub(crate) fn axis_error(file: &str, e: &AxisSimError) -> StudyError {
    let help = match e {
        AxisSimError::Unphysical { help, .. } => help,
        _ => "change the axis file to data within these limits",
    };
    StudyError::refused(format!("the axis `{file}` cannot be used: {e}"), help)
}

/// Loads an axis and derives its gains for every controller.
pub(crate) fn load(name: &str, kinds: &[Kind]) -> Result<AxisConfig, StudyError> {
    let config = AxisConfig::load(name)?;
    for kind in kinds {
        TestRig::new(&config.axis, &design(&config.axis, *kind), 0)
            .map_err(|e| axis_error(name, &e))?;
    }
    Ok(config)
}

/// Plays all cases and writes report, figures, tables and `summary.json`.
///
/// # Errors
/// [`StudyError`] if an axis cannot be read or used, or a result cannot be drawn or written.
pub fn compare(options: &Options, settings: &Settings) -> Result<Finished<Comparison>, StudyError> {
    let configs = configs(options)?;
    let before = judged::read(options)?;
    let axes = options.axes.iter().map(Path::new);
    let reads: Vec<&Path> = axes.chain(options.against.as_deref()).collect();
    let job = Job::begin("compare", settings, &reads)?;
    let (comparison, unplayed) = Comparison::play(options, configs, before, &job.progress)?;
    Ok(comparison.write(job, unplayed))
}

/// Reads the axes of a comparison.
fn configs(options: &Options) -> Result<Vec<AxisConfig>, StudyError> {
    let mut configs = Vec::new();
    for name in &options.axes {
        let config = load(name, &options.kinds)?;
        if configs.iter().any(|c: &AxisConfig| c.name == config.name) {
            return Err(StudyError::refused(
                format!("the axis name `{}` is given twice", config.name),
                "give each axis file a `name` of its own",
            ));
        }
        configs.push(config);
    }
    // Before the first case: an impossible one would cost all the others.
    for (axis, variation, _) in plan(options, &configs) {
        let config = &configs[axis];
        let plant = variation.factors(&config.axis).plant(&config.axis);
        if let Err(e) = Axis::new(&plant) {
            variation.ensure_possible(config)?;
            return Err(axis_error(&config.name, &e.into()));
        }
    }
    Ok(configs)
}

impl Comparison {
    /// Plays all cases, until it is stopped.
    ///
    /// # Errors
    /// [`StudyError`] if an axis cannot be read or used, or a case leaves the plant's model.
    pub fn run(options: &Options, progress: &Progress) -> Result<Self, StudyError> {
        let before = judged::read(options)?;
        let (comparison, unplayed) = Self::play(options, configs(options)?, before, progress)?;
        unplayed.map_or(Ok(comparison), Err)
    }

    /// The comparison, and an error for cases that could not be played: the others are kept.
    fn play(
        options: &Options,
        configs: Vec<AxisConfig>,
        before: Option<Before>,
        progress: &Progress,
    ) -> Result<(Self, Option<StudyError>), StudyError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads)
            .stack_size(STACK)
            .build()
            .map_err(|e| {
                StudyError::refused(format!("cannot start threads: {e}"), "try --threads 1")
            })?;
        pool.install(|| Self::play_here(options, configs, before, progress))
    }

    fn play_here(
        options: &Options,
        configs: Vec<AxisConfig>,
        before: Option<Before>,
        progress: &Progress,
    ) -> Result<(Self, Option<StudyError>), StudyError> {
        let planned: Vec<(usize, Variation, u64)> = plan(options, &configs);
        let cases_of = |variation| options.kinds.len() * moves_of(options, variation).len();
        let of: usize = planned.iter().map(|&(_, v, _)| cases_of(v)).sum();

        let wanted = options
            .moves
            .as_ref()
            .is_none_or(|m| m.iter().any(|m| matches!(m, Move::Step20 | Move::Step100)));
        let runs = if options.quick { 480 } else { 1500 };
        let found = progress.all("bounds", &configs, |config| {
            if !wanted {
                return Ok([None; 2]);
            }
            bounds(&config.axis, runs, progress).map_err(|e| axis_error(&config.name, &e))
        });
        let found = Ended::kept(found)?.unwrap_or_else(|| vec![[None; 2]; configs.len()]);
        let axes: Vec<ComparedAxis> = configs
            .into_iter()
            .zip(found)
            .map(|(config, bound_s)| ComparedAxis { config, bound_s })
            .collect();

        progress.begin("cases", of as u64);
        let played = progress.map(&planned, |&(i, variation, seed)| {
            play_case(options, &axes[i], variation, seed, progress)
        })?;
        let (mut rows, mut overlays, mut unplayed) = (Vec::new(), Vec::new(), Vec::new());
        for case in played.into_iter().flatten().flatten() {
            match case {
                Ok((row, overlay)) => {
                    rows.push(row);
                    overlays.extend(overlay);
                }
                Err(error) => unplayed.push(error),
            }
        }
        let done = (rows.len() + unplayed.len()) as u64;
        let comparison = Self {
            options: options.clone(),
            axes,
            before,
            stopped: progress.stopped(done, of as u64, "cases"),
            rows,
            overlays,
        };
        Ok((comparison, unplayed_error(&unplayed, done)))
    }

    /// Writes report, figures, tables and `summary.json`.
    fn write(self, job: Job, unplayed: Option<StudyError>) -> Finished<Self> {
        let stopped = self.stopped.clone();
        let judged = self.judged();
        let cases = Cases {
            cases: &self.rows,
            judged: &judged,
            failure: unplayed.as_ref().map(ToString::to_string),
        };
        let summary = json(&cases, stopped.as_ref());
        job.keep::<()>(unplayed.map_or(Ok(()), Err));
        job.finish(self, summary, stopped, |job, comparison| {
            let folder = job.subfolder(CSV);
            job.keep(folder.and_then(|folder| table(&folder.join("cases.csv"), &comparison.rows)));
            let drawn = job.draw(charts::figures(comparison));
            (page::render(comparison, &drawn), drawn)
        })
    }
}

/// A played case, or why it could not be played.
type PlayedCase = Result<(Row, Option<Overlay>), Unplayed>;

/// A case that left the model of the plant.
#[derive(Debug)]
struct Unplayed {
    /// Its name.
    id: String,
    /// When and how.
    error: AxisSimError,
}

/// The error for unplayed cases, if there are any: their number, and details of the first.
fn unplayed_error(unplayed: &[Unplayed], of: u64) -> Option<StudyError> {
    let first = unplayed.first()?;
    let help = match &first.error {
        AxisSimError::Unphysical { help, .. } => help,
        _ => "change the axis file so that its variations can be simulated",
    };
    Some(StudyError::refused(
        format!(
            "{} of {of} could not be played and are counted nowhere; the first is `{}`: {}",
            counted(unplayed.len(), "case", "cases"),
            first.id,
            first.error
        ),
        help,
    ))
}

/// Plays the cases of a variation, until the comparison is stopped. They are played right after its start-up,
/// not after those of all variations, so that there are rows from the beginning.
fn play_case(
    options: &Options,
    axis: &ComparedAxis,
    variation: Variation,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<PlayedCase>, StudyError> {
    let moves = moves_of(options, variation);
    let cases: Vec<(Kind, Move)> = options
        .kinds
        .iter()
        .flat_map(|kind| moves.iter().map(move |motion| (*kind, *motion)))
        .collect();
    let name = &axis.config.name;
    let unplayed = |kind, motion, error| Unplayed {
        id: CaseId {
            axis: name.clone(),
            kind,
            motion,
            variation,
            seed,
        }
        .to_string(),
        error,
    };
    let case = match Case::new(name, &axis.config.axis, variation, seed) {
        Ok(case) => case,
        // All its cases share its start-up.
        Err(error) => {
            let all = cases
                .iter()
                .map(|&(kind, motion)| Err(unplayed(kind, motion, error.clone())));
            return Ok(all.collect());
        }
    };
    let nominal = variation == Variation::Nominal;
    let rows = progress.map(&cases, |&(kind, motion)| {
        let played = case.play(kind, motion);
        progress.step();
        let played = match played {
            Ok(played) => played,
            Err(error) => return Ok(Err(unplayed(kind, motion, error))),
        };
        let bound_s = match motion {
            Move::Step100 if nominal => axis.bound_s[0],
            Move::Step20 if nominal => axis.bound_s[1],
            _ => None,
        };
        let row = case.row(kind, motion, played.as_ref(), bound_s);
        let shown = nominal && seed == options.seed;
        let overlay = played
            .filter(|_| shown)
            .map(|p| Overlay::of(&case, kind, motion, &p));
        Ok::<_, StudyError>(Ok((row, overlay)))
    })?;
    Ok(rows.into_iter().flatten().collect())
}

impl Overlay {
    fn of(case: &Case, kind: Kind, motion: Move, played: &Played) -> Self {
        let trace = &played.measured[played.measured.len() - 1];
        let start_s = trace.motion.start_s();
        let points = trace.rows.iter().enumerate().map(|(k, r)| {
            [
                k as f64 * 1e-3 - start_s,
                r.reference_m * 1e3,
                r.stroke_m * 1e3,
            ]
        });
        Self {
            axis: case.axis.clone(),
            kind,
            motion,
            points: points.collect(),
        }
    }
}

/// Cases in their order: as on the sheet for all seeds, then factors, then
/// combinations.
fn plan(options: &Options, axes: &[AxisConfig]) -> Vec<(usize, Variation, u64)> {
    let mut list = Vec::new();
    for (i, axis) in axes.iter().enumerate() {
        for k in 0..options.seeds {
            list.push((i, Variation::Nominal, options.seed + k));
        }
        for variation in Variation::one_at_a_time(&axis.axis, options.quick) {
            list.push((i, variation, options.seed));
        }
        for number in 0..options.combinations {
            let number = options.root.wrapping_add(number);
            list.push((i, Variation::Drawn(number), options.seed));
        }
    }
    list
}

fn moves_of(options: &Options, variation: Variation) -> Vec<Move> {
    match (&options.moves, variation) {
        (Some(moves), _) => moves.clone(),
        (None, Variation::Nominal) => Move::LEARNT.to_vec(),
        (None, Variation::Combination(_) | Variation::Drawn(_)) => vec![Move::Step100],
        (None, _) => VARIED.to_vec(),
    }
}

/// The fastest large and small step of an axis, retracting and extending, from the rest in which the
/// predictive controller begins them. Useless once the comparison is stopped.
fn bounds(
    sheet: &AxisParams,
    runs: u32,
    progress: &Progress,
) -> Result<[Option<[f64; 2]>; 2], AxisSimError> {
    let go_on = || !progress.is_stopped();
    let sizes = Sizes::of(sheet);
    let [low_m, high_m] = sizes.large_m;
    let pairs = [[low_m, high_m], [high_m - sizes.small_m, high_m]];
    let mut found = [None; 2];
    for (bound_s, [from_m, to_m]) in found.iter_mut().zip(pairs) {
        let mut rig = TestRig::new(sheet, &design(sheet, Kind::Predictive), 1)?;
        rig.step(to_m, STEP_S)?;
        let mut fastest = |target_m: f64| -> Result<f64, AxisSimError> {
            let bench = rig.bench();
            let bound =
                optimal::fastest_while(bench.axis(), &bench.state, target_m, 1, runs, &go_on)?;
            rig.step(target_m, STEP_S)?;
            Ok(bound.settle_s)
        };
        let both = [fastest(from_m)?, fastest(to_m)?];
        // A search that never settled found no bound.
        *bound_s = both
            .iter()
            .all(|s| *s < optimal::HORIZON_S - 0.1)
            .then_some(both);
    }
    Ok(found)
}

/// Writes rows as CSV with a header line.
fn table(path: &Path, rows: &[Row]) -> Result<(), StudyError> {
    write_table(path, rows).inspect_err(|_| {
        // A part of a table would be taken for the whole.
        let _ = std::fs::remove_file(path);
    })
}

fn write_table(path: &Path, rows: &[Row]) -> Result<(), StudyError> {
    let failed = |e: csv::Error| StudyError::output("write the table", path, e.into());
    let mut out = csv::Writer::from_path(path).map_err(failed)?;
    for (i, row) in rows.iter().enumerate() {
        let (head, figures) = (record(&row.case)?, record(&row.figures)?);
        if i == 0 {
            out.write_record(head[0].iter().chain(&figures[0]))
                .map_err(failed)?;
        }
        out.write_record(head[1].iter().chain(&figures[1]))
            .map_err(failed)?;
    }
    out.flush()
        .map_err(|e| StudyError::output("write the table", path, e))
}

/// Names and values of a struct of numbers and texts. (The library writes no header line for a struct within
/// a struct.)
fn record<T: Serialize>(value: &T) -> Result<[csv::StringRecord; 2], StudyError> {
    let failed = |e: csv::Error| StudyError::output("write", "a table", e.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.serialize(value).map_err(failed)?;
    let bytes = writer
        .into_inner()
        .map_err(|e| StudyError::output("write", "a table", e.into_error()))?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(bytes.as_slice());
    let mut lines = reader.records();
    let mut next = || lines.next().unwrap_or_else(|| Ok(csv::StringRecord::new()));
    Ok([next().map_err(failed)?, next().map_err(failed)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_that_leave_the_plants_model_cost_none_of_the_others() {
        let options = Options {
            axes: Vec::new(),
            kinds: vec![Kind::PwmP],
            moves: Some(vec![Move::SCurve, Move::Hold]),
            seeds: 1,
            seed: 1,
            combinations: 0,
            root: 0,
            against: None,
            quick: true,
            threads: 1,
        };
        let sound = AxisConfig::load("bench-vq110u").expect("built in");
        // So light that the step cannot follow its bristles: reading such a file would refuse it.
        let mut light = sound.clone();
        light.name = "light".to_owned();
        light.axis.moving_mass_kg = 0.02;
        let played = |configs| {
            let progress = Progress::silent();
            Comparison::play(&options, configs, None, &progress).expect("played")
        };
        let (alone, none) = played(vec![sound.clone()]);
        assert!(none.is_none() && !alone.rows.is_empty(), "{none:?}");
        let (both, unplayed) = played(vec![sound, light]);
        let of_sound = both.rows.iter().filter(|row| row.case.axis != "light");
        assert!(of_sound.eq(&alone.rows));
        assert!(both.stopped.is_none());
        let told = unplayed.expect("cases left the model").to_string();
        let missing = 2 * alone.rows.len() - both.rows.len();
        assert!(
            missing > 0 && told.starts_with(&format!("{missing} case")),
            "{told}"
        );
        assert!(told.contains("light/pwm-p/"), "{told}");
    }
}
