//! Every controller on the same plants, moves and inputs: `wheeleg compare`.
//!
//! A case is a controller, an axis, a move, what differs from the axis's data
//! sheet, and a seed. It is played from power-up by the joint board's whole
//! application ([`crate::bench::Node`]) with gains that the builder derives from the
//! sheet. Cases know nothing of each other, so they run on any number of threads
//! with the same result, and each can be played alone by its name.

mod case;
mod charts;
mod moves;
mod page;
mod single;
mod variation;

use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use wheeleg_plant::axis::AxisParams;

pub use case::{BadCaseId, CaseFacts, CaseId, Figures, MARGIN, Row, Scene};
pub(crate) use charts::panel;
pub use moves::{CONTACT_S, Move, Played, RECOVERY_S, REST_S, STEP_S, Sizes};
pub use single::{Single, play};
pub use variation::{KNOWN as VARIATIONS, UnknownVariation, Variation};

use crate::StudyError;
use crate::bench::suite::{BenchError, Rig};
use crate::bench::{Kind, design, optimal};
use wheeleg_config::AxisConfig;
use wheeleg_report::output;
use wheeleg_report::subfolder;

/// What is compared.
#[derive(Debug, Clone)]
pub struct Options {
    /// Built-in axes or files.
    pub axes: Vec<String>,
    /// Controllers.
    pub kinds: Vec<Kind>,
    /// Moves; `None`: all as on the sheet, steps of 100 mm and S-curves with what
    /// differs from it.
    pub moves: Option<Vec<Move>>,
    /// Number of seeds.
    pub seeds: u64,
    /// The first of them.
    pub seed: u64,
    /// Random combinations per axis.
    pub combinations: u64,
    /// Fewer factors, a coarser bound.
    pub quick: bool,
    /// Threads; 0: as many as the machine has.
    pub threads: usize,
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
    /// What was asked for.
    pub options: Options,
    /// Axes, in the order asked for.
    pub axes: Vec<ComparedAxis>,
    /// One row per case.
    pub rows: Vec<Row>,
    /// Of the first seed, as on the sheet.
    pub overlays: Vec<Overlay>,
}

/// Files that were written.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The page.
    pub report: PathBuf,
    /// What was compared.
    pub comparison: Comparison,
}

/// An axis that cannot be compared: names the file, field, value and range.
pub(crate) fn axis_error(file: &str, e: &BenchError) -> StudyError {
    StudyError::refused(
        format!("the axis `{file}` cannot be used: {e}"),
        "change the axis file to data within these limits",
    )
}

/// Loads an axis and has its gains derived for every controller.
pub(crate) fn load(name: &str, kinds: &[Kind]) -> Result<AxisConfig, StudyError> {
    let config = AxisConfig::load(name)?;
    for kind in kinds {
        Rig::new(&config.axis, &design(&config.axis, *kind), 0)
            .map_err(|e| axis_error(name, &e))?;
    }
    Ok(config)
}

impl Comparison {
    /// Plays all cases.
    ///
    /// # Errors
    /// [`StudyError`] if an axis cannot be read or used.
    pub fn run(options: &Options) -> Result<Self, StudyError> {
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
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads)
            .build()
            .map_err(|e| {
                StudyError::refused(format!("cannot start threads: {e}"), "try --threads 1")
            })?;
        pool.install(|| Self::play(options, configs))
    }

    fn play(options: &Options, configs: Vec<AxisConfig>) -> Result<Self, StudyError> {
        let file = |axis: &str| axis.to_owned();
        let bar = progress_bar("bounds");
        let wanted = options
            .moves
            .as_ref()
            .is_none_or(|m| m.iter().any(|m| matches!(m, Move::Step20 | Move::Step100)));
        let axes: Vec<ComparedAxis> = configs
            .into_par_iter()
            .map(|config| {
                let bound_s = if wanted {
                    bounds(&config.axis, if options.quick { 480 } else { 1500 })
                } else {
                    Ok([None; 2])
                };
                let bound_s = bound_s.map_err(|e| axis_error(&config.name, &e))?;
                Ok(ComparedAxis { config, bound_s })
            })
            .collect::<Result<_, StudyError>>()?;

        bar.set_message("start-up");
        let scenes: Vec<(usize, Variation, u64)> = plan(options, &axes);
        bar.set_length(scenes.len() as u64);
        let scenes: Vec<(usize, Scene)> = scenes
            .into_par_iter()
            .map(|(i, variation, seed)| {
                let axis = &axes[i].config;
                let scene = Scene::new(&axis.name, &axis.axis, variation, seed);
                bar.inc(1);
                scene
                    .map(|scene| (i, scene))
                    .map_err(|e| axis_error(&file(&axis.name), &e))
            })
            .collect::<Result<_, _>>()?;

        let cases: Vec<(usize, &Scene, Kind, Move)> = scenes
            .iter()
            .flat_map(|(i, scene)| {
                let moves = moves_of(options, scene.variation);
                options.kinds.iter().flat_map(move |kind| {
                    moves
                        .clone()
                        .into_iter()
                        .map(move |m| (*i, scene, *kind, m))
                })
            })
            .collect();
        bar.set_message("cases");
        bar.set_position(0);
        bar.set_length(cases.len() as u64);
        let played: Vec<(Row, Option<Overlay>)> = cases
            .into_par_iter()
            .map(|(i, scene, kind, motion)| {
                let played = scene
                    .play(kind, motion)
                    .map_err(|e| axis_error(&scene.axis, &e))?;
                let nominal = scene.variation == Variation::Nominal;
                let bound_s = match motion {
                    Move::Step100 if nominal => axes[i].bound_s[0],
                    Move::Step20 if nominal => axes[i].bound_s[1],
                    _ => None,
                };
                let row = scene.row(kind, motion, played.as_ref(), bound_s);
                let shown = nominal && scene.seed == options.seed;
                let overlay = played
                    .filter(|_| shown)
                    .map(|p| Overlay::of(scene, kind, motion, &p));
                bar.inc(1);
                Ok((row, overlay))
            })
            .collect::<Result<_, StudyError>>()?;
        bar.finish_and_clear();
        let (rows, overlays): (Vec<Row>, Vec<Option<Overlay>>) = played.into_iter().unzip();
        Ok(Self {
            options: options.clone(),
            axes,
            rows,
            overlays: overlays.into_iter().flatten().collect(),
        })
    }

    /// All rows as JSON: an array of one object per case.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Numbers and texts always serialise.
        let mut text = serde_json::to_string_pretty(&self.rows).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Writes report, figures, tables and `summary.json` into `folder`; earlier
    /// results in it are set aside.
    ///
    /// # Errors
    /// [`StudyError`] if something cannot be drawn or written.
    pub fn write(self, folder: &Path) -> Result<Finished, StudyError> {
        output::prepare(folder)?;
        save(&folder.join("summary.json"), &self.to_json())?;
        table(&subfolder(folder, "csv")?.join("cases.csv"), &self.rows)?;
        let drawn = draw(&subfolder(folder, "figures")?, charts::figures(&self))?;
        let report = folder.join("report.html");
        save(&report, &page::render(&self, &drawn)?)?;
        Ok(Finished {
            report,
            comparison: self,
        })
    }
}

impl Overlay {
    fn of(scene: &Scene, kind: Kind, motion: Move, played: &Played) -> Self {
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
            axis: scene.axis.clone(),
            kind,
            motion,
            points: points.collect(),
        }
    }
}

/// Scenes in their order: as on the sheet for all seeds, then factors, then
/// combinations.
fn plan(options: &Options, axes: &[ComparedAxis]) -> Vec<(usize, Variation, u64)> {
    let mut list = Vec::new();
    for (i, axis) in axes.iter().enumerate() {
        for k in 0..options.seeds {
            list.push((i, Variation::Nominal, options.seed + k));
        }
        for variation in Variation::one_at_a_time(&axis.config.axis, options.quick) {
            list.push((i, variation, options.seed));
        }
        for number in 0..options.combinations {
            list.push((i, Variation::Combination(number), options.seed));
        }
    }
    list
}

fn moves_of(options: &Options, variation: Variation) -> Vec<Move> {
    match (&options.moves, variation) {
        (Some(moves), _) => moves.clone(),
        (None, Variation::Nominal) => Move::ALL.to_vec(),
        (None, Variation::Combination(_)) => vec![Move::Step100],
        (None, _) => VARIED.to_vec(),
    }
}

/// The fastest large and small step of an axis, retracting and extending, from the
/// rest in which the predictive controller begins them.
fn bounds(sheet: &AxisParams, runs: u32) -> Result<[Option<[f64; 2]>; 2], BenchError> {
    let sizes = Sizes::of(sheet);
    let [low_m, high_m] = sizes.large_m;
    let pairs = [[low_m, high_m], [high_m - sizes.small_m, high_m]];
    let mut found = [None; 2];
    for (bound_s, [from_m, to_m]) in found.iter_mut().zip(pairs) {
        let mut rig = Rig::new(sheet, &design(sheet, Kind::Predictive), 1)?;
        rig.step(to_m, STEP_S)?;
        let mut fastest = |target_m: f64| -> Result<f64, BenchError> {
            let bench = rig.bench();
            let bound = optimal::fastest(bench.axis(), &bench.state, target_m, 1, runs)?;
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

pub(crate) fn save(path: &Path, text: &str) -> Result<(), StudyError> {
    std::fs::write(path, text).map_err(|e| StudyError::output("write", path, e))
}

/// Writes rows as CSV with a head line.
fn table(path: &Path, rows: &[Row]) -> Result<(), StudyError> {
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

/// Names and values of a struct of numbers and texts. (The library writes no head
/// line for a struct within a struct.)
fn record<T: serde::Serialize>(value: &T) -> Result<[csv::StringRecord; 2], StudyError> {
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

/// Draws figures as SVG; gives them back with their SVG text.
pub(crate) fn draw(
    folder: &Path,
    figures: Vec<wheeleg_report::plot::Figure>,
) -> Result<Vec<(wheeleg_report::plot::Figure, String)>, StudyError> {
    figures
        .into_par_iter()
        .map(|figure| {
            let svg = figure.svg();
            save(&folder.join(format!("{}.svg", figure.id)), &svg)?;
            Ok((figure, svg))
        })
        .collect()
}

fn progress_bar(what: &'static str) -> ProgressBar {
    // Draws on stderr, and only if that is a terminal.
    let bar = ProgressBar::new(1);
    let style = ProgressStyle::with_template("compare {wide_bar} {pos} of {len} {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(what);
    bar
}
