//! Identifies a user's cylinder from measurements: `wheeleg identify`.
//!
//! A measurement ([`lab`]) holds the commands of the valves and the position of the piston. The plant is
//! fitted to its first part ([`fit`]) by factors on parameters of the axis file ([`free`]), and judged by the
//! rest. Every parameter gets an interval; parameters that the data does not determine are reported
//! ([`intervals`]), with the valve sequence that would determine most of them ([`experiment`]).

pub mod bench;
mod doubt;
pub mod experiment;
pub mod fit;
pub mod free;
pub mod intervals;
pub mod lab;
pub mod map;
mod noise;
mod page;
mod point;
mod predict;
mod wrong;

use std::path::Path;

use nalgebra::DMatrix;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::axis::Change;
use wheeleg_config::{AxisConfig, ParameterInfo};

pub use self::doubt::Doubt;
use self::experiment::Experiment;
use self::fit::{Exact, Fit, Point, Problem, trust};
use self::free::{COUNT, FREE, Logs};
use self::intervals::Interval;
use self::lab::Lab;
use self::map::Mapped;
pub use self::noise::{Noise, noise};
use self::predict::{Predicted, predict};
pub use self::wrong::{LabError, WrongCell, WrongCells};
use crate::StudyError;
use crate::study::schema::json;
use crate::study::{self, Finished, Job, Progress, Settings, Stopped};

/// Starts of the fit: the file, and others around it.
const STARTS: usize = 4;
/// Number of fits: the starts, the best of them with the unknowns of the measurement, and that with the noise
/// that it leaves.
const FITS: u64 = STARTS as u64 + 2;
/// If the rest of the measurement is missed by more than this many times the sensor's noise, the model does
/// not explain it.
const EXPLAINED: f64 = 3.0;

/// The identified axis, below the folder of the results.
pub const AXIS: &str = "axis.toml";
/// The next experiment.
pub const NEXT: &str = "next-experiment.csv";
/// Files of an identification in addition to those of every study.
const FILES: [&str; 2] = [AXIS, NEXT];

/// One factor.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Parameter {
    /// Name.
    pub name: &'static str,
    /// In words.
    pub words: &'static str,
    /// Parameters of the axis file that it multiplies.
    pub paths: &'static [&'static str],
    /// Factor on the file's value; 1 if that is kept.
    pub factor: f64,
    /// Smallest factor, 95 %.
    pub low: f64,
    /// Largest factor, 95 %.
    pub high: f64,
    /// Whether the data determine it; otherwise it comes from the trust in the file.
    pub determined: bool,
    /// Whether its interval can be trusted: the rest of the measurement is met.
    pub trusted: bool,
    /// Whether the file's value is kept, because the fitted one contradicts others of the axis file.
    pub kept: bool,
}

impl Parameter {
    /// Remark on its value, in words; empty if the data determine it.
    #[must_use]
    pub fn note(&self) -> &'static str {
        match (self.kept, self.determined, self.trusted) {
            (true, ..) => "kept: the fit's value contradicts the axis file",
            (false, false, _) => "not determined",
            (false, true, false) => "not to be trusted",
            (false, true, true) => "",
        }
    }
}

/// Errors of the plant against the measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Misses {
    /// Root mean square of the position's error in the fitted part \[mm\].
    pub fitted_mm: f64,
    /// The same in the rest, which was not used for the fit \[mm\].
    pub held_out_mm: f64,
}

/// Result of an identification.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The axis of the file.
    pub config: AxisConfig,
    /// The measurement.
    pub lab: Lab,
    /// Fitted ticks.
    pub ticks: usize,
    /// The fit, with the kept values.
    pub fit: Fit,
    /// All factors.
    pub parameters: Vec<Parameter>,
    /// Errors with the file's values.
    pub before: Misses,
    /// Errors with the factors.
    pub after: Misses,
    /// Noise of the position sensor by the axis file \[mm\].
    pub noise_mm: f64,
    /// What the measurement lacks; empty if the fit explains it.
    pub doubts: Vec<Doubt>,
    /// Parameters that the data do not determine.
    pub undetermined: Vec<String>,
    /// Next experiments, the most informative first.
    pub experiments: Vec<Experiment>,
    /// Stroke by the file and by the fit, at every sample.
    pub played: [Vec<Predicted>; 2],
    /// The identified axis.
    pub toml: String,
    /// Why it stopped before its end.
    pub stopped: Option<Stopped>,
}

/// Contents of `summary.json`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Summary<'a> {
    /// Name of the axis.
    axis: &'a str,
    /// Rows of the measurement.
    rows: usize,
    /// Length of the measurement \[s\].
    measured_s: f64,
    /// Length of the fitted part \[s\].
    fitted_s: f64,
    /// All factors.
    parameters: &'a [Parameter],
    /// Errors with the file's values.
    before: Misses,
    /// Errors with the identified axis.
    after: Misses,
    /// Noise of the position sensor by the axis file \[mm\].
    noise_mm: f64,
    /// Whether the rest of the measurement is met within three times the noise.
    explained: bool,
    /// Whether the file's own values explain it and the fitted ones do not: the measurement is too short, and
    /// no axis is written.
    worse_than_the_file: bool,
    /// What the measurement lacks, if its rest is not met: to be mended before the bench is doubted.
    doubts: &'a [Doubt],
    /// Parameters that the data do not determine.
    undetermined: &'a [String],
    /// The most informative next experiment, null if the plant can play none or the fit was stopped.
    next_experiment: Option<&'a str>,
}

impl study::Summary for Summary<'_> {
    const SCHEMA: &'static str = "wheeleg.identify/1";
}

/// Options.
#[derive(Debug, Clone)]
pub struct Options<'a> {
    /// The measurement.
    pub lab: &'a Path,
    /// Built-in axis or path of an axis file.
    pub axis: &'a str,
    /// Columns with another name or unit in the measurement.
    pub map: &'a [Mapped],
    /// Fraction of the measurement, at its end, that is held out from the fit, 0.1 to 0.9.
    pub hold_out: f64,
    /// Seed of the starts.
    pub seed: u64,
}

/// Identifies an axis, and writes report, figures, `summary.json`, [`AXIS`] and [`NEXT`].
///
/// # Errors
/// [`StudyError`] if a file is wrong, the plant cannot follow the measurement, or a result cannot be drawn or
/// written.
pub fn identify(
    options: &Options<'_>,
    settings: impl FnOnce(&str) -> Settings,
) -> Result<Finished<Identified>, StudyError> {
    let source = AxisConfig::source(options.axis)?;
    let config = AxisConfig::parse(&source.file, &source.text)?;
    let lab = Lab::load(options.lab, &config.axis, options.map)?;
    let reads = [options.lab, Path::new(options.axis)];
    let job = Job::begin_with("identify", &settings(&config.name), &reads, &FILES)?;
    let identified = Identified::of(config, lab, options, &job.progress)?;
    let toml = identified.rewritten(options)?;
    Ok(Identified { toml, ..identified }.write(job))
}

/// Starts of the fit.
fn starts(limits: &[[f64; 2]; COUNT], seed: u64) -> Vec<Point> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut all = vec![Point::of([0.0; COUNT])];
    all.extend((1..STARTS).map(|_| {
        Point::of(std::array::from_fn(|i| {
            let [low, high] = limits[i];
            (trust(i) * rng.random_range(-1.0..1.0)).clamp(low, high)
        }))
    }));
    all
}

/// The best of several fits, if there is any, and why they stopped.
///
/// # Errors
/// [`StudyError::Refused`] if the plant can play the measurement from none of the starts.
pub fn best(
    problem: &Problem<'_>,
    starts: &[Point],
    progress: &Progress,
) -> Result<(Fit, Option<Stopped>), StudyError> {
    let go_on = || !progress.is_stopped();
    let fits = progress.each("starts", starts, |start| {
        let fit = problem.fit(start, Exact::Roughly, &go_on);
        // A fit under way when the study was stopped has not come to its end.
        Ok::<_, StudyError>((fit, go_on()))
    })?;
    let done = fits.iter().flatten().filter(|(_, whole)| *whole).count();
    let stopped = progress.stopped(done as u64, FITS, "fits");
    let fits = fits.into_iter().flatten().filter_map(|(fit, _)| fit);
    let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost));
    // Stopped before the first: only the file's values are there.
    let file = || {
        starts
            .first()
            .and_then(|start| problem.fit(start, Exact::Roughly, &go_on))
    };
    let best = best
        .or_else(file)
        .ok_or_else(|| unplayed(problem, "the measurement", ""))?;
    Ok((best, stopped))
}

/// The error for a measurement that the plant of an axis cannot play.
fn unplayed(problem: &Problem<'_>, what: &str, why: &str) -> StudyError {
    let Problem { file, lab, .. } = problem;
    StudyError::refused(
        format!("the plant of {file} cannot follow {what} {}{why}", lab.file),
        format!("check stroke, mass, load and supply in {file} against the bench"),
    )
}

fn misses(lab: &Lab, predicted: &[Predicted], ticks: usize) -> Misses {
    let root = |fitted: bool| {
        let pairs = lab.samples.iter().zip(predicted);
        let (count, sum) = pairs
            .filter(|(sample, _)| (sample.tick < ticks) == fitted)
            .fold((0.0, 0.0), |(n, sum), (sample, predicted)| {
                let error_mm = (predicted.position_m - sample.position_m) * 1e3;
                (n + 1.0, sum + error_mm * error_mm)
            });
        (sum / f64::max(count, 1.0)).sqrt()
    };
    Misses {
        fitted_mm: root(true),
        held_out_mm: root(false),
    }
}

/// Whether the held-out part is met.
fn explains(misses: Misses, noise_mm: f64) -> bool {
    misses.held_out_mm <= EXPLAINED * noise_mm
}

/// A fit, and its information.
#[derive(Debug, Clone)]
pub struct Fitted<'a> {
    /// The problem, with the noise that the fit leaves.
    pub problem: Problem<'a>,
    /// The fit of all factors.
    pub fit: Fit,
    /// Interval of each factor.
    pub intervals: [Interval; COUNT],
    /// Information of the data about the logarithms.
    pub information: DMatrix<f64>,
    /// Why it stopped before all starts were tried.
    pub stopped: Option<Stopped>,
}

/// The fit of a measurement, with its information: used by the study and by its tests.
///
/// # Errors
/// As [`best`].
pub fn fitted<'a>(
    problem: &Problem<'a>,
    seed: u64,
    progress: &Progress,
) -> Result<Fitted<'a>, StudyError> {
    let channels = if bench::has_pressures(problem.lab) {
        3
    } else {
        1
    };
    let (first, stopped) = best(problem, &starts(&problem.limits, seed), progress)?;
    let go_on = || !progress.is_stopped();
    let refined =
        |of: &Problem<'_>, fit: Fit| of.fit(&fit.point, Exact::Fully, &go_on).unwrap_or(fit);
    let free = searched(problem, refined(problem, first), channels, progress);
    // The model's errors are noise to the fit: they do not overrule the file.
    let left = |of: &Problem<'_>, fit: &Fit| of.noise.left(fit.residuals.as_slice(), channels);
    let second = Problem {
        noise: left(problem, &free),
        ..*problem
    };
    let fit = refined(&second, free);
    let why = ": it leaves its range close to the best fit";
    let leaves = || unplayed(problem, "the measurement", why);
    let known = Problem {
        noise: left(&second, &fit),
        ..second
    };
    let jacobian = known.jacobian(&fit.point).ok_or_else(leaves)?;
    let information = intervals::information(&jacobian);
    let intervals = intervals::intervals(&information);
    Ok(Fitted {
        problem: known,
        fit,
        intervals,
        information,
        stopped,
    })
}

/// A fit that explains the fitted part. If the given one does not, it may be a local minimum: then the search begins again from
/// the file's values with ever more of the measurement. That needs measured pressures: the air of the start decides how
/// everything after it goes.
fn searched(problem: &Problem<'_>, found: Fit, channels: usize, progress: &Progress) -> Fit {
    if !bench::has_pressures(problem.lab) || found.position_error(channels) <= EXPLAINED {
        return found;
    }
    let go_on = || !progress.is_stopped();
    let other = problem.fit_growing(&Point::of([0.0; COUNT]), channels, &go_on);
    other.filter(|fit| fit.cost < found.cost).unwrap_or(found)
}

/// Changes of the axis file under these factors; `said` gives the source of each value.
fn changes(
    config: &AxisConfig,
    logs: &Logs,
    said: impl Fn(usize, &ParameterInfo) -> String,
) -> Vec<Change> {
    let mut changes = Vec::new();
    for (i, free) in FREE.iter().enumerate() {
        let parameters = config.parameters.iter();
        for info in parameters.filter(|info| free.paths.contains(&info.path.as_str())) {
            let value = info.value.first().map_or(0.0, |v| v * logs[i].exp());
            changes.push(Change {
                path: info.path.clone(),
                values: vec![value.clamp(info.min, info.max)],
                unit: info.unit.clone(),
                source: said(i, info),
            });
        }
    }
    changes
}

/// A fit that the program accepts in an axis file, and the factors held at the file's value for that: those
/// that contradict other values of the file.
fn accepted(
    fitted: &Fitted<'_>,
    config: &AxisConfig,
    progress: &Progress,
) -> Option<(Fit, Vec<usize>)> {
    let file = &config.source.file;
    let is_sound = |logs: &Logs| {
        let changes = changes(config, logs, |_, info| info.source.clone());
        let text = AxisConfig::rewritten(file, &config.source.text, &changes);
        text.is_ok_and(|text| AxisConfig::parse(file, &text).is_ok())
    };
    let mut fit = fitted.fit.clone();
    let mut refused = Vec::new();
    while !is_sound(&fit.point.logs) {
        let found = fit.point.logs;
        let moved: Vec<usize> = (0..COUNT).filter(|i| found[*i].abs() > 0.0).collect();
        if moved.is_empty() {
            break;
        }
        let alone = |i: &usize| {
            let mut logs = [0.0; COUNT];
            logs[*i] = found[*i];
            !is_sound(&logs)
        };
        let wrong: Vec<usize> = moved.iter().copied().filter(alone).collect();
        let mends = |i: &usize| {
            let mut logs = found;
            logs[*i] = 0.0;
            is_sound(&logs)
        };
        // Some contradict only each other: then one of them is held.
        let one = || moved.iter().copied().find(mends).unwrap_or(moved[0]);
        refused.extend(if wrong.is_empty() { vec![one()] } else { wrong });
        fit = fitted
            .problem
            .held(&fit.point, &refused, &|| !progress.is_stopped())?;
    }
    Some((fit, refused))
}

/// Text between the measurement that left a value open, and the earlier knowledge of it.
const UNDETERMINED: &str = " does not determine it; before: ";
/// Text before the measurement against which a value was kept.
const CONTRADICTS: &str = "; what fits ";

/// The source of a value before this measurement, without the additions of an earlier identification:
/// identified again and again, a file has them once.
struct Before<'a> {
    /// The value before any measurement left it open, with its unit.
    value: String,
    /// Its source.
    source: &'a str,
    /// The source as written, without the measurement it was kept against.
    whole: &'a str,
}

impl<'a> Before<'a> {
    fn of(info: &'a ParameterInfo) -> Self {
        let (whole, _) = (info.source.split_once(CONTRADICTS)).unwrap_or((&info.source, ""));
        let earlier = whole.rsplit_once(UNDETERMINED);
        let earlier = earlier.and_then(|(_, before)| before.split_once(", "));
        match earlier {
            Some((value, source)) => Self {
                value: value.to_owned(),
                source,
                whole,
            },
            None => {
                let value = info.value.first().copied().unwrap_or(0.0);
                Self {
                    value: format!("{} {}", wheeleg_config::brief(value), info.unit),
                    source: whole,
                    whole,
                }
            }
        }
    }
}

/// The source of a value that a measurement leaves open.
fn left_open(lab: &str, info: &ParameterInfo) -> String {
    let Before { value, source, .. } = Before::of(info);
    format!("ASSUMED: {lab}{UNDETERMINED}{value}, {source}")
}

/// The source of a value that is kept, because the file may not have the fitted one.
fn kept_against(lab: &str, info: &ParameterInfo) -> String {
    let whole = Before::of(info).whole;
    format!("{whole}{CONTRADICTS}{lab} contradicts other values of this file")
}

impl Identified {
    fn of(
        config: AxisConfig,
        lab: Lab,
        options: &Options<'_>,
        progress: &Progress,
    ) -> Result<Self, StudyError> {
        let axis = &config.axis;
        let ticks = (lab.on_us.len() as f64 * (1.0 - options.hold_out)).round() as usize;
        let noise = noise(axis);
        let problem = Problem {
            file: &config.source.file,
            axis,
            lab: &lab,
            ticks,
            noise,
            limits: free::limits(&config),
        };
        let fitted = fitted(&problem, options.seed, progress)?;
        let (kept, refused) = accepted(&fitted, &config, progress)
            .ok_or_else(|| unplayed(&problem, "the measurement", ""))?;
        let Fitted {
            problem: measured,
            fit,
            intervals,
            information,
            stopped,
        } = fitted;
        let stopped = stopped.or_else(|| progress.stopped(FITS - 1, FITS, "fits"));
        let play = |point: &Point| {
            predict(axis, &lab, point, lab.on_us.len())
                .map_err(|e| unplayed(&problem, "the rest of the measurement", &format!(": {e}")))
        };
        let played = [play(&Point::of([0.0; COUNT]))?, play(&kept.point)?];
        let [before, after] = [0, 1].map(|i| misses(&lab, &played[i], ticks));
        let trusted = explains(after, noise.position_m * 1e3);
        let parameters = FREE.iter().enumerate().map(|(i, free)| {
            let factor = kept.point.logs[i].exp();
            let [low, high] = intervals[i].factors(fit.point.logs[i]);
            Parameter {
                name: free.name,
                words: free.words,
                paths: free.paths,
                factor,
                // Holding one moves the others, within their intervals as far as the plant is linear.
                low: low.min(factor),
                high: high.max(factor),
                determined: intervals[i].determined,
                trusted,
                kept: refused.contains(&i),
            }
        });
        Ok(Self {
            parameters: parameters.collect(),
            before,
            after,
            doubts: match trusted {
                true => Vec::new(),
                false => doubt::doubts(&lab, axis, noise.position_m),
            },
            noise_mm: noise.position_m * 1e3,
            undetermined: intervals::undetermined(&information),
            // A stopped fit is no basis for planning.
            experiments: if stopped.is_some() {
                Vec::new()
            } else {
                experiment::ranked(&measured, &kept.point, &information)
            },
            ticks,
            fit: kept,
            played,
            toml: String::new(),
            stopped,
            lab,
            config,
        })
    }

    /// Whether the rest of the measurement is explained.
    #[must_use]
    pub fn is_explained(&self) -> bool {
        explains(self.after, self.noise_mm)
    }

    /// Whether the file's own values explain the rest of the measurement and the fitted ones do not: the
    /// measurement is too short to add to the file.
    #[must_use]
    pub fn is_worse_than_the_file(&self) -> bool {
        !self.is_explained() && explains(self.before, self.noise_mm)
    }

    /// The axis file with the results.
    ///
    /// # Errors
    /// [`StudyError::Config`] if the program would not accept it.
    fn rewritten(&self, options: &Options<'_>) -> Result<String, StudyError> {
        let lab = options.lab.file_name().map(|name| name.to_string_lossy());
        let lab = lab.unwrap_or_default();
        let changes = changes(&self.config, &self.fit.point.logs, |i, info| {
            let parameter = &self.parameters[i];
            let in_unit = |factor: f64| {
                let value = info.value.first().map_or(0.0, |v| v * factor);
                wheeleg_config::brief(value)
            };
            match (parameter.kept, parameter.determined) {
                (false, true) => format!(
                    "IDENTIFIED from {lab}: {} to {} {} ({})",
                    in_unit(parameter.low),
                    in_unit(parameter.high),
                    info.unit,
                    match parameter.trusted {
                        true => "95 %",
                        false => "not to be trusted: the model does not match the held-out data",
                    }
                ),
                (false, false) => left_open(&lab, info),
                (true, _) => kept_against(&lab, info),
            }
        });
        let source = &self.config.source;
        let toml = AxisConfig::rewritten(&source.file, &source.text, &changes)?;
        AxisConfig::parse(AXIS, &toml)?;
        Ok(toml)
    }

    /// Contents of `summary.json`.
    #[must_use]
    pub fn summary(&self) -> Summary<'_> {
        Summary {
            axis: &self.config.name,
            rows: self.lab.samples.len(),
            measured_s: self.lab.on_us.len() as f64 * 1e-3,
            fitted_s: self.ticks as f64 * 1e-3,
            parameters: &self.parameters,
            before: self.before,
            after: self.after,
            noise_mm: self.noise_mm,
            explained: self.is_explained(),
            worse_than_the_file: self.is_worse_than_the_file(),
            doubts: &self.doubts,
            undetermined: &self.undetermined,
            next_experiment: self.experiments.first().map(|e| e.name),
        }
    }

    fn write(self, job: Job) -> Finished<Self> {
        let stopped = self.stopped.clone();
        let summary = json(&self.summary(), stopped.as_ref());
        job.finish(self, summary, stopped, |job, identified| {
            // Neither a stopped fit nor one that is worse than the file is a basis for further work.
            if identified.stopped.is_none() && !identified.is_worse_than_the_file() {
                job.keep(job.save(AXIS, &identified.toml));
            }
            if let Some(experiment) = identified.experiments.first() {
                job.keep(job.save(NEXT, &experiment::csv(experiment)));
            }
            let drawn = job.draw(page::figures(identified));
            (page::render(identified, &drawn), drawn)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If the written axis is identified again, any number of times and in any order, the source of each
    /// value is still given once.
    #[test]
    fn the_source_of_a_value_that_stays_open_does_not_grow() {
        let config = AxisConfig::load("bench-vq110u").expect("built in");
        let mut listed = config.parameters.iter();
        let info = listed.find(|info| info.path == "friction.coulomb");
        let mut info = info.expect("listed").clone();
        let own = info.source.clone();
        let was = format!("{} {}", info.value[0], info.unit);
        for lab in ["a.csv", "a.csv", "b, c.csv", "; what fits.csv", "a.csv"] {
            info.source = left_open(lab, &info);
            assert_eq!(
                info.source,
                format!("ASSUMED: {lab} does not determine it; before: {was}, {own}")
            );
            // A fit has changed the value.
            info.value[0] *= 1.1;
        }
        for lab in ["a.csv", "b.csv", "a.csv"] {
            info.source = kept_against(lab, &info);
        }
        let kept = info.source.clone();
        assert_eq!(kept.matches("contradicts").count(), 1, "{kept}");
        assert!(
            kept.contains(&own) && kept.contains("what fits a.csv"),
            "{kept}"
        );
        info.source = left_open("a.csv", &info);
        assert!(!info.source.contains("contradicts"), "{}", info.source);
        assert!(info.source.ends_with(&own), "{}", info.source);
    }
}
