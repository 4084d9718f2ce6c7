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

use wheeleg_config::AxisConfig;
use wheeleg_report::results::CSV;
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{
    Before, Cases as Form, Judged, Move, Row, Variation, ensure_playable, load, read_before,
};
use wheeleg_studies::study::schema::json;
use wheeleg_studies::study::{Finished, Job, Progress, STACK, Settings, Stopped};

pub use overlays::Overlay;

use crate::{CampaignError, Cases, Options as RunOptions, PlanFile, Store, run, simulate};

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
    let before = options.against.as_deref();
    let before = before.map(|path| read_before(path, options.root, options.combinations));
    let before = before.transpose()?;
    let plans = plans::all(options)?;
    let mut campaigns = Vec::new();
    for plan in &plans {
        let cases = Cases::new(plan)?;
        let file = PlanFile::of(plan, cases.work_s());
        campaigns.push((cases, file));
    }
    let folder = settings.out.join(CAMPAIGN);
    let mut also: &[&str] = &[];
    for (cases, file) in &campaigns {
        match Store::ensure_not_of_another(&folder.join(&cases.plan().name), file) {
            Ok(()) => {}
            // Cases of other options or another program go with the results that were made of them.
            Err(CampaignError::Refused { .. }) => also = &[CAMPAIGN],
            Err(damaged) => return Err(damaged),
        }
    }
    let axes = options.axes.iter().map(Path::new);
    let reads: Vec<&Path> = axes.chain(options.against.as_deref()).collect();
    let job = Job::begin_with("compare", settings, &reads, also)?;

    let mut results = results::Results::default();
    let (mut done, mut of) = (0, 0);
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
        let one = |case: &_| simulate(case, None, &settings.stop);
        let ran = run(&store, &cases, &run_options, &one)?;
        for (path, why) in &ran.aside {
            let told = format!("set aside: {}: {why}", path.display());
            job.progress.tell(&told);
        }
        done += ran.found + ran.computed;
        of += ran.of;
        results.add(options, &configs, cases.columns(), &store.rows()?);
    }
    let stopped = job.progress.stopped(done, of, "cases");
    let unplayed = results.unplayed(done);
    let comparison = finished(options, configs, before, stopped, results, &job.progress)?;
    Ok(comparison.write(job, unplayed))
}

/// The comparison of these results, with bounds and overlays.
fn finished(
    options: &Options,
    configs: Vec<AxisConfig>,
    before: Option<Before>,
    stopped: Option<Stopped>,
    results: results::Results,
    progress: &Progress,
) -> Result<Comparison, CampaignError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .stack_size(STACK)
        .build()
        .map_err(|e| {
            StudyError::refused(format!("cannot start threads: {e}"), "try --threads 1")
        })?;
    let found = pool.install(|| bounds::all(options, &configs, progress))?;
    let overlays = pool.install(|| overlays::all(options, &configs, progress))?;
    let axes = configs.into_iter().zip(found);
    let axes: Vec<ComparedAxis> = axes
        .map(|(config, bound_s)| ComparedAxis { config, bound_s })
        .collect();
    let rows = results.rows(&axes);
    Ok(Comparison {
        options: options.clone(),
        axes,
        rows,
        overlays,
        before,
        stopped,
    })
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
    let drawn = (0..options.combinations).map(|k| Variation::Drawn(options.root.wrapping_add(k)));
    let one_at_a_time = Variation::one_at_a_time(options.quick).into_iter();
    let variations: Vec<Variation> = one_at_a_time.chain(drawn).collect();
    for config in &configs {
        for variation in &variations {
            ensure_playable(config, *variation)?;
        }
    }
    Ok(configs)
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
