//! One cylinder with a user's own parameters: `wheeleg tune`.
//!
//! The axis file describes the cylinder on the bench. Its valves' delays are looked
//! for as a board does at start-up, the gains are derived, and step tests are played
//! with the board as it comes (defaults, calibrated to the sensor) and as it is
//! tuned. The tuned parameters are written as a section for a robot file.

mod feasible;
mod page;

use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;
use wheeleg_control::joint::{Correction, JointGains};
use wheeleg_protocol::param::JointParam;
use wheeleg_units::{Micros, PositionMm, VelocityMmS};

use crate::StudyError;
use crate::bench::commission::{commission, toml_lines, value};
use crate::bench::suite::{Factors, Rig};
use crate::bench::{Delays, Design, Grain, Kind, Supervision, design, design_with, identify};
use crate::compare::{Figures, MARGIN, Move, Played, axis_error, draw, save};
use wheeleg_config::AxisConfig;
use wheeleg_report::output;
use wheeleg_report::subfolder;

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

    /// The joints that it is for.
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
#[derive(Debug, Clone, Serialize)]
pub struct Test {
    /// Move.
    #[serde(rename = "move")]
    pub motion: Move,
    /// With the board's defaults.
    pub before: Figures,
    /// Tuned.
    pub after: Figures,
    /// What happened: before, after.
    #[serde(skip)]
    pub played: [Played; 2],
}

/// One parameter of the board.
#[derive(Debug, Clone, Serialize)]
pub struct Parameter {
    /// Name in the board's table.
    pub name: &'static str,
    /// Default of the board.
    pub before: f64,
    /// Tuned value.
    pub after: f64,
    /// The same as it travels on the wire.
    pub raw: i32,
    /// Unit.
    pub unit: &'static str,
    /// Meaning.
    #[serde(skip)]
    pub text: &'static str,
}

/// What tuning found.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// The axis.
    pub config: AxisConfig,
    /// Seed of the converter's noise.
    pub seed: u64,
    /// Force left over the load, at most 1000.
    pub margin: f64,
    /// How fine its valves are.
    pub grain: Grain,
    /// Delays found; `None` if the piston did not answer.
    pub delays: Option<Delays>,
    /// All tests.
    pub tests: Vec<Test>,
    /// All parameters that are set.
    pub parameters: Vec<Parameter>,
    /// Section for a robot file.
    pub toml: String,
}

/// Files that were written.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The page.
    pub report: PathBuf,
    /// Parameters for a robot file.
    pub parameters: PathBuf,
    /// What was found.
    pub tuned: Tuned,
}

/// A board as it comes, told no more than where its piston is and how long its
/// stroke.
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
    /// Tunes the axis of a file, or of a built-in name.
    ///
    /// # Errors
    /// [`StudyError`] if the file is wrong, or the axis cannot do what is asked: it
    /// names file, field, value and allowed range.
    pub fn new(file: &str, seed: u64, section: Section) -> Result<Self, StudyError> {
        let config = AxisConfig::load(file)?;
        let plant = &config.axis;
        feasible::check(file, plant)?;
        let failed = |e| axis_error(file, &e);
        let delays = identify(plant, plant, seed).map_err(|e| failed(e.into()))?;
        let after = design_with(plant, delays, Kind::Predictive);
        let before = defaults(&design(plant, Kind::Predictive));
        let list = commission(&after).map_err(failed)?;

        let bar = progress_bar(2 * Move::ALL.len() as u64);
        let runs: Vec<(Move, &Design)> = Move::ALL
            .into_iter()
            .flat_map(|motion| [(motion, &before), (motion, &after)])
            .collect();
        let played: Vec<Played> = runs
            .into_par_iter()
            .map(|(motion, design)| {
                let loaded = motion.plant(plant, plant);
                let mut rig = Rig::new(&loaded, design, seed)?;
                let played = motion.play(&mut rig, plant, loaded.load_n);
                bar.inc(1);
                played
            })
            .collect::<Result<_, _>>()
            .map_err(failed)?;
        bar.finish_and_clear();
        let mut played = played.into_iter();
        let tests = Move::ALL.into_iter().filter_map(|motion| {
            let pair = [played.next()?, played.next()?];
            Some(Test {
                motion,
                before: Figures::of(motion, &pair[0], None),
                after: Figures::of(motion, &pair[1], None),
                played: pair,
            })
        });
        let tests = tests.collect();
        let source = format!("DERIVED: wheeleg tune {}", config.name);
        Ok(Self {
            seed,
            margin: Factors::NONE.static_margin(plant).min(1e3),
            grain: Grain::of(plant),
            delays,
            tests,
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

    /// Moves that the board's supervision stopped, by name, of either column.
    #[must_use]
    pub fn stopped(&self, figures: fn(&Test) -> &Figures) -> Vec<&'static str> {
        let stopped = self
            .tests
            .iter()
            .filter(|test| figures(test).stopped == Some(true));
        stopped.map(|test| test.motion.name()).collect()
    }

    /// Summary as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        let valve = &self.config.axis.cylinder.fill_valve;
        let ms = |s: f64| (s * 1e6).round() * 1e-3;
        let summary = serde_json::json!({
            "axis": self.config.name,
            "seed": self.seed,
            "static_margin": self.margin,
            "least_margin": MARGIN,
            "valve_grain": self.grain,
            "advice": self.grain.advice(),
            "sheet_t_on_ms": ms(valve.t_on_s),
            "sheet_t_off_ms": ms(valve.t_off_s),
            "found_t_on_ms": self.delays.map(|d| ms(d.t_on_s)),
            "found_t_off_ms": self.delays.map(|d| ms(d.t_off_s)),
            "tests": self.tests,
            "parameters": self.parameters,
        });
        format!("{summary:#}\n")
    }

    /// Writes report, figures, `summary.json` and `node-parameters.toml` into
    /// `folder`; earlier results in it are set aside.
    ///
    /// # Errors
    /// [`StudyError`] if something cannot be drawn or written.
    pub fn write(self, folder: &Path) -> Result<Finished, StudyError> {
        output::prepare(folder)?;
        save(&folder.join("summary.json"), &self.to_json())?;
        let parameters = folder.join("node-parameters.toml");
        save(&parameters, &self.toml)?;
        let drawn = draw(&subfolder(folder, "figures")?, page::figures(&self))?;
        let report = folder.join("report.html");
        save(&report, &page::render(&self, &drawn)?)?;
        Ok(Finished {
            report,
            parameters,
            tuned: self,
        })
    }
}

fn progress_bar(length: u64) -> ProgressBar {
    // Draws on stderr, and only if that is a terminal.
    let bar = ProgressBar::new(length);
    let style = ProgressStyle::with_template("tune {wide_bar} {pos} of {len}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
