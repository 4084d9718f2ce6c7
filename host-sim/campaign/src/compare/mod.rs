//! Every controller on the same plants, moves and inputs: `wheeleg compare`.
//!
//! The cases are those of three campaigns in the folder `campaign` of the results: all seeds on the data sheet,
//! one factor at a time, and random combinations. Whoever stops or kills a comparison runs it again, and the page is
//! made of the rows that are there.

mod bounds;
mod charts;
mod overlays;
mod page;
mod plans;
mod results;

use std::path::{Path, PathBuf};

use wheeleg_config::{AxisConfig, plain_text};
use wheeleg_report::results::CSV;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{
    Before, Cases as Form, Judged, Move, Row, Variation, ensure_playable, load, read_before,
};
use wheeleg_studies::study::schema::json;
use wheeleg_studies::study::{Finished, Job, STACK, Settings, Stopped};

pub use overlays::Overlay;

use crate::run::run_in;
use crate::{CampaignError, Cases, Options as RunOptions, PlanFile, Store};

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
    /// Number of the first of them: [`wheeleg_studies::compare::judging_root`], or the one used for another version.
    pub root: u64,
    /// `summary.json` of another version, to compare these combinations with.
    pub against: Option<PathBuf>,
    /// Fewer factors, a coarser bound.
    pub quick: bool,
    /// Threads; 0: as many as the machine has.
    pub threads: usize,
    /// This program, to run cases that may crash the process; if `None`, they run in this process.
    pub program: Option<PathBuf>,
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

/// An axis of the comparison.
#[derive(Debug, Clone)]
pub struct ComparedAxis {
    /// Its file.
    pub config: AxisConfig,
    /// Fastest times of the large and the small step with perfect knowledge,
    /// retracting and extending \[s\]; `None` if none was found.
    pub bound_s: [Option<[f64; 2]>; 2],
}

/// A single factor that one of the axes cannot have, and which is therefore played on none.
#[derive(Debug, Clone)]
pub struct LeftOut {
    /// The factor.
    pub variation: Variation,
    /// Why.
    pub why: String,
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "left out: `{}`: {}", self.variation, self.why)
    }
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
    /// Single factors that were not played.
    pub left_out: Vec<LeftOut>,
    /// Of the first seed, as on the sheet.
    pub overlays: Vec<Overlay>,
    /// Results of another version in the random combinations.
    pub before: Option<Before>,
    /// Cases that were there from an earlier run.
    pub found: u64,
    /// Why it stopped before all cases were played.
    pub stopped: Option<Stopped>,
}

impl Comparison {
    /// Statistics of the random combinations, by axis and controller; empty if none was played.
    #[must_use]
    pub fn judged(&self) -> Vec<Judged> {
        let axes = self.axes.iter().map(|axis| axis.config.name.as_str());
        axes.flat_map(|axis| {
            let kinds = self.options.kinds.iter();
            kinds.filter_map(move |kind| {
                let rows: Vec<&Row> = self.combined(axis, *kind).collect();
                Judged::of(axis, *kind, &rows, self.before.as_ref())
            })
        })
        .collect()
    }

    /// Rows of an axis, controller and move as on the sheet.
    fn nominal<'a>(
        &'a self,
        axis: &'a str,
        kind: Kind,
        motion: Move,
    ) -> impl Iterator<Item = &'a Row> {
        self.rows.iter().filter(move |r| {
            let c = &r.case;
            c.axis == axis
                && c.controller == kind
                && c.motion == motion
                && c.variation == Variation::Nominal
        })
    }

    /// Rows of random combinations of an axis and controller that are feasible, of the move that is judged.
    fn combined<'a>(&'a self, axis: &'a str, kind: Kind) -> impl Iterator<Item = &'a Row> {
        let judged = self.options.judged_move();
        self.rows.iter().filter(move |r| {
            let c = &r.case;
            c.axis == axis
                && c.controller == kind
                && Some(c.motion) == judged
                && c.feasible
                && matches!(c.variation, Variation::Drawn(_))
        })
    }
}

/// Folder of the campaigns, among the results.
const CAMPAIGN: &str = "campaign";

/// Plays all cases and writes report, figures, tables and `summary.json`. Cases that an earlier process of the same
/// program has finished are not repeated.
///
/// # Errors
/// [`CampaignError`] if an axis cannot be read or used, or a result cannot be drawn or written.
pub fn compare(
    options: &Options,
    settings: &Settings,
) -> Result<Finished<Comparison>, CampaignError> {
    let configs = configs(options)?;
    let (variations, left_out) = one_at_a_time(options, &configs);
    let before = options.against.as_deref();
    let before = before.map(|path| read_before(path, options.root, options.combinations));
    let before = before.transpose()?;
    let plans = plans::all(options, &variations)?;
    let mut campaigns = Vec::new();
    for plan in &plans {
        let cases = Cases::new(plan)?;
        let file = PlanFile::of(plan, cases.work_s());
        campaigns.push((cases, file));
    }
    let folder = settings.out.join(CAMPAIGN);
    let mut also: &[&str] = &[];
    for (cases, file) in &campaigns {
        // Cases of other options or another program go with the results that were made of them.
        if Store::is_of_another(&folder.join(&cases.plan().name), file)? {
            also = &[CAMPAIGN];
        }
    }
    let axes = options.axes.iter().map(Path::new);
    let reads: Vec<&Path> = axes.chain(options.against.as_deref()).collect();
    let job = Job::begin_with("compare", settings, &reads, also)?;

    for one in &left_out {
        job.progress.tell(&one.to_string());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .stack_size(STACK)
        .build()
        .map_err(|e| {
            StudyError::refused(format!("cannot start threads: {e}"), "try --threads 1")
        })?;
    let bound_s = pool.install(|| bounds::all(options, &configs, &job.progress))?;

    let mut results = results::Results::default();
    let (mut found, mut done, mut of) = (0, 0, 0);
    for (cases, file) in campaigns {
        let store = Store::create(&folder.join(&cases.plan().name), file, &settings.stop)?;
        let whole = RunOptions::whole(&settings.stop);
        let run_options = RunOptions {
            threads: match options.threads {
                0 => whole.threads,
                threads => threads,
            },
            program: options.program.clone(),
            ..whole
        };
        let (ran, rows) = run_in(&job, &store, &cases, &run_options)?;
        found += ran.found;
        done += rows.len() as u64;
        of += ran.of;
        results.add(options, &configs, cases.columns(), &rows);
    }
    let unplayed = results.unplayed(done);
    let wanted = overlays::wanted(options, &configs);
    let overlays = pool.install(|| overlays::all(options, &wanted, &job.progress))?;
    let stopped = job.progress.stopped(done, of, "cases");
    let curves = [overlays.len() as u64, wanted.len() as u64];
    let stopped = stopped.or_else(|| job.progress.stopped(curves[0], curves[1], "curves"));
    let axes = configs.into_iter().zip(bound_s);
    let axes: Vec<ComparedAxis> = axes
        .map(|(config, bound_s)| ComparedAxis { config, bound_s })
        .collect();
    let comparison = Comparison {
        options: options.clone(),
        rows: results.rows(&axes),
        axes,
        left_out,
        overlays: overlays.into_iter().flatten().collect(),
        before,
        found,
        stopped,
    };
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
    for config in &configs {
        for number in 0..options.combinations {
            ensure_playable(config, Variation::Drawn(options.root + number))?;
        }
    }
    Ok(configs)
}

/// The single factors that all axes can have, and the others.
fn one_at_a_time(options: &Options, configs: &[AxisConfig]) -> (Vec<Variation>, Vec<LeftOut>) {
    let (mut possible, mut left_out) = (Vec::new(), Vec::new());
    for variation in Variation::one_at_a_time(options.quick) {
        let mut refusals = configs
            .iter()
            .map(|config| variation.ensure_possible(config));
        match refusals.find_map(Result::err) {
            None => possible.push(variation),
            Some(refused) => left_out.push(LeftOut {
                variation,
                why: plain_text(&refused),
            }),
        }
    }
    (possible, left_out)
}

impl Comparison {
    /// Writes report, figures, tables and `summary.json`.
    fn write(self, job: Job, unplayed: Option<StudyError>) -> Finished<Self> {
        let stopped = self.stopped.clone();
        let judged = self.judged();
        let cases = Form {
            cases: &self.rows,
            judged: &judged,
            failure: unplayed.as_ref().map(ToString::to_string),
        };
        let summary = json(&cases, stopped.as_ref());
        job.keep::<()>(unplayed.map_or(Ok(()), Err));
        job.finish(self, summary, stopped, |job, comparison| {
            let folder = job.subfolder(CSV);
            let table =
                |folder: PathBuf| results::table(&folder.join("cases.csv"), &comparison.rows);
            job.keep(folder.and_then(table));
            let drawn = job.draw(charts::figures(comparison));
            (page::render(comparison, &drawn), drawn)
        })
    }
}
