//! Tunes one cylinder with a user's own parameters: `wheeleg tune`.
//!
//! The axis file describes the cylinder on the bench. Its valves' delays are searched for like on a board at
//! start-up, the gains are derived, and step tests are played with the untuned board (defaults, calibrated to
//! the sensor) and with the tuned one. The tuned parameters are written as a section for a robot file.

mod feasible;
mod judge;
mod page;

pub use judge::{Figure, Worse};

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_control::joint::{Correction, JointGains};
use wheeleg_protocol::param::JointParam;
use wheeleg_units::{Micros, PositionMm, VelocityMmS};

use crate::StudyError;
use crate::axis_sim::commission::{commission, toml_lines, value};
use crate::axis_sim::suite::Factors;
use crate::axis_sim::{
    Delays, Design, Kind, Supervision, ValveResolution, design, design_with, identify,
};
use crate::compare::{Figures, MARGIN, Move, Played, axis_error, play_from_power_up};
use crate::study::schema::json;
use crate::study::{self, Finished, Job, Progress, Settings, Stopped};
use wheeleg_config::AxisConfig;
use wheeleg_report::results::BOARD_PARAMETERS;

/// Section of a robot file that the parameters are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Section {
    /// All six joints.
    Joint,
    /// The yaw joints.
    Yaw,
    /// The horizontal joints.
    Horizontal,
    /// The vertical joints.
    Vertical,
}

impl Section {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Joint, Self::Yaw, Self::Horizontal, Self::Vertical];

    /// Its name in a robot file, without `node.`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Yaw => "yaw",
            Self::Horizontal => "horizontal",
            Self::Vertical => "vertical",
        }
    }

    /// Its joints.
    #[must_use]
    pub const fn doc(self) -> &'static str {
        match self {
            Self::Joint => "All six joints",
            Self::Yaw => "The yaw joints",
            Self::Horizontal => "The horizontal joints",
            Self::Vertical => "The vertical joints",
        }
    }
}

/// One test, before and after.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Test {
    /// Move.
    #[serde(rename = "move")]
    pub motion: Move,
    /// With the board's defaults.
    pub before: Figures,
    /// Tuned.
    pub after: Figures,
    /// Recordings: before, after.
    #[serde(skip)]
    pub played: [Played; 2],
}

/// One parameter of the board.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Parameter {
    /// Name in the board's table.
    pub name: &'static str,
    /// Default of the board.
    pub before: f64,
    /// Tuned value.
    pub after: f64,
    /// The same as sent on the wire.
    pub raw: i32,
    /// Unit.
    pub unit: &'static str,
    /// Meaning.
    #[serde(skip)]
    pub text: &'static str,
}

/// Results of tuning.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// The axis.
    pub config: AxisConfig,
    /// Seed of the ADC noise.
    pub seed: u64,
    /// Force left over the load, at most 1000.
    pub margin: f64,
    /// Resolution of its valves.
    pub valve_resolution: ValveResolution,
    /// Delays found; `None` if the piston did not answer.
    pub delays: Option<Delays>,
    /// All tests.
    pub tests: Vec<Test>,
    /// Figures that became worse; if there are any, the parameters are refused.
    pub worse: Vec<Worse>,
    /// All parameters that are set.
    pub parameters: Vec<Parameter>,
    /// Section for a robot file.
    pub toml: String,
    /// Why it stopped before all tests were played.
    pub stopped: Option<Stopped>,
}

/// Contents of `summary.json`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Summary<'a> {
    /// Name of the axis.
    axis: &'a str,
    /// Seed of the ADC noise, a whole number as text: JSON numbers are exact only up to 2^53.
    seed: String,
    /// Force left over the load, at most 1000 for no load.
    static_margin: f64,
    /// Smallest margin of an axis that can be tuned.
    least_margin: f64,
    /// Resolution of its valves.
    valve_resolution: ValveResolution,
    /// Remedy for valves that are too coarse.
    advice: Option<String>,
    /// Opening delay of the data sheet \[ms\].
    sheet_t_on_ms: f64,
    /// Closing delay of the data sheet \[ms\].
    sheet_t_off_ms: f64,
    /// Opening delay found \[ms\]; null if the piston did not answer.
    found_t_on_ms: Option<f64>,
    /// Closing delay found \[ms\]; null if the piston did not answer.
    found_t_off_ms: Option<f64>,
    /// Whether the parameters are written: no figure of any test became worse.
    accepted: bool,
    /// Figures that became worse.
    worse: &'a [Worse],
    /// The tests played before and after.
    tests: &'a [Test],
    /// All parameters that are set.
    parameters: &'a [Parameter],
}

impl study::Summary for Summary<'_> {
    const SCHEMA: &'static str = "wheeleg.tune/2";
}

/// Tunes an axis and writes report, figures, `summary.json` and [`BOARD_PARAMETERS`] into the folder that
/// `settings` derives from the axis's name.
///
/// # Errors
/// [`StudyError`] if the file is wrong, the axis cannot do what is asked for, or a result cannot be drawn or
/// written.
pub fn tune(
    file: &str,
    seed: u64,
    section: Section,
    settings: impl FnOnce(&str) -> Settings,
) -> Result<Finished<Tuned>, StudyError> {
    let config = load(file)?;
    let settings = settings(&config.name);
    // A refused axis costs no earlier results.
    let delays = delays(file, &config, seed)?;
    let job = Job::begin("tune", &settings, &[Path::new(file)])?;
    let tuned = Tuned::play(file, config, delays, (seed, section), &job.progress)?;
    Ok(tuned.write(job))
}

/// Reads an axis that can be tuned.
fn load(file: &str) -> Result<AxisConfig, StudyError> {
    let config = AxisConfig::load(file)?;
    feasible::check(&config)?;
    Ok(config)
}

/// The delays of its valves, searched for like on a board at start-up.
fn delays(file: &str, config: &AxisConfig, seed: u64) -> Result<Option<Delays>, StudyError> {
    let plant = &config.axis;
    identify(plant, plant, seed).map_err(|e| axis_error(file, &e))
}

/// A board with default settings, except for the piston's position sensor and its stroke.
fn defaults(tuned: &Design) -> Design {
    let supervision = JointParam::SlewRate.info().default;
    Design {
        gains: JointGains {
            stroke_max: tuned.gains.stroke_max,
            ..JointGains::default()
        },
        correction: Correction::Pd,
        sensor: tuned.sensor,
        supervision: Supervision {
            slew_rate: VelocityMmS::from_raw(supervision),
            following_error: PositionMm::from_raw(JointParam::FollowingError.info().default),
            following_time: Micros(1000 * JointParam::FollowingTime.info().default.unsigned_abs()),
        },
    }
}

impl Tuned {
    /// Plays the tests, until it is stopped.
    fn play(
        file: &str,
        config: AxisConfig,
        delays: Option<Delays>,
        (seed, section): (u64, Section),
        progress: &Progress,
    ) -> Result<Self, StudyError> {
        let plant = &config.axis;
        let failed = |e| axis_error(file, &e);
        let after = design_with(plant, delays, Kind::Predictive);
        let before = defaults(&design(plant, Kind::Predictive));
        let list = commission(&after).map_err(failed)?;

        let runs: Vec<(Move, &Design)> = Move::LEARNT
            .into_iter()
            .flat_map(|motion| [(motion, &before), (motion, &after)])
            .collect();
        let played = progress.each("tests", &runs, |&(motion, design)| {
            play_from_power_up(motion, [plant, plant], design, seed, 0).map_err(failed)
        })?;
        // A test that was played with only one of the two boards shows nothing.
        let mut played = played.into_iter();
        let tests = Move::LEARNT.into_iter().filter_map(|motion| {
            let (before, after) = (played.next()?, played.next()?);
            let pair = [before?, after?];
            Some(Test {
                motion,
                before: Figures::of(motion, &pair[0]),
                after: Figures::of(motion, &pair[1]),
                played: pair,
            })
        });
        let tests: Vec<Test> = tests.collect();
        let stopped = progress.stopped(tests.len() as u64, Move::LEARNT.len() as u64, "tests");
        let source = format!("DERIVED: wheeleg tune {}", config.name);
        Ok(Self {
            seed,
            margin: Factors::NONE.static_margin(plant).min(1e3),
            valve_resolution: ValveResolution::of(plant),
            delays,
            worse: judge::worse(&tests),
            tests,
            stopped,
            toml: format!(
                "# Joint board of the axis {}: derived from its data sheet, delays found at start-up.\n\
                 # For a robot file; what it does not name keeps the board's default.\n\
                 [node.{}]\n{}",
                config.name,
                section.name(),
                toml_lines(&list, &source)
            ),
            parameters: list
                .iter()
                .map(|(parameter, raw)| {
                    let row = parameter.info();
                    Parameter {
                        name: row.name,
                        before: value(row, row.default),
                        after: value(row, *raw),
                        raw: *raw,
                        unit: row.unit,
                        text: row.text,
                    }
                })
                .collect(),
            config,
        })
    }

    /// Whether the tuned board is at least as good as before in all tests, and all were played.
    #[must_use]
    pub fn is_accepted(&self) -> bool {
        self.worse.is_empty() && self.stopped.is_none()
    }

    /// Moves that the board's supervision stopped, by name, in either column.
    #[must_use]
    pub fn stopped(&self, figures: fn(&Test) -> &Figures) -> Vec<&'static str> {
        let stopped = self
            .tests
            .iter()
            .filter(|test| figures(test).stopped == Some(true));
        stopped.map(|test| test.motion.name()).collect()
    }

    /// Contents of `summary.json`.
    #[must_use]
    pub fn summary(&self) -> Summary<'_> {
        let valve = &self.config.axis.cylinder.fill_valve;
        let ms = |s: f64| (s * 1e6).round() * 1e-3;
        Summary {
            axis: &self.config.name,
            seed: self.seed.to_string(),
            static_margin: self.margin,
            least_margin: MARGIN,
            valve_resolution: self.valve_resolution,
            advice: self.valve_resolution.advice(),
            sheet_t_on_ms: ms(valve.t_on_s),
            sheet_t_off_ms: ms(valve.t_off_s),
            found_t_on_ms: self.delays.map(|d| ms(d.t_on_s)),
            found_t_off_ms: self.delays.map(|d| ms(d.t_off_s)),
            accepted: self.is_accepted(),
            worse: &self.worse,
            tests: &self.tests,
            parameters: &self.parameters,
        }
    }

    /// Writes report, figures, `summary.json` and [`BOARD_PARAMETERS`].
    fn write(self, job: Job) -> Finished<Self> {
        let stopped = self.stopped.clone();
        let summary = json(&self.summary(), stopped.as_ref());
        job.finish(self, summary, stopped, |job, tuned| {
            let drawn = job.draw(page::figures(tuned));
            let page = page::render(tuned, &drawn);
            // Drawing takes time in which the folder may be removed: this is written with the rest.
            if tuned.is_accepted() {
                job.keep(job.save(BOARD_PARAMETERS, &tuned.toml));
            }
            (page, drawn)
        })
    }
}
