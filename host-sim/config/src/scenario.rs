//! A scenario: a robot, its task, its duration, and events during it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use wheeleg_master::argument;
use wheeleg_master::behaviour::{Behaviour, Behaviours};
use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::layer1::walk::WalkOrder;

use super::bars::{self, Bar};
use super::command;
use super::error::ConfigError;
use super::keys;
use super::params::{FieldSpec, ParameterInfo};
use super::quantity::{Dimension, pretty};
use super::reader::{Entry, FileKind, Reader};
use super::source::Source;
use super::terrain::{self, Files, Ground};
use crate::faults::FaultSpec;

/// A leg.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LegChoice {
    /// Left (joints 1 to 3).
    Left,
    /// Right (joints 4 to 6).
    Right,
}

/// Commands for the robot once it stands at its start pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Stand still.
    Stand,
    /// Square-wave gait of the robot's `[gait]`, one leg stepping, the other held.
    SquareWave {
        /// The stepping leg.
        leg: LegChoice,
    },
    /// Walk, until a command of an event changes or ends it.
    Walk(WalkOrder),
    /// Sinusoidal foot trajectory of the paper's section 6.
    Sinusoid {
        /// The moving leg.
        leg: LegChoice,
        /// Forward travel of the foot over the whole arch, m.
        length_m: f64,
        /// Height of the arch, m.
        height_m: f64,
        /// Angular rate of the sine's argument, rad/s (1/8 in the paper).
        rate_rad_s: f64,
    },
}

impl Motion {
    /// The leg that moves; the left one by default.
    #[must_use]
    pub const fn stepping_leg(&self) -> LegChoice {
        match self {
            Self::SquareWave { leg } | Self::Sinusoid { leg, .. } => *leg,
            Self::Stand | Self::Walk(_) => LegChoice::Left,
        }
    }
}

/// An event at a stated time.
#[derive(Debug, Clone, PartialEq)]
pub enum EventAction {
    /// The master stops sending, in mid-cycle, and never comes back.
    KillMaster,
    /// The E-stop is pressed.
    EStop,
    /// The operator clears latched faults.
    ClearFault,
    /// A user command is given to the dispatcher.
    Command(Command),
}

/// Origin of a value; two values that differ only in it are equal.
#[derive(Debug, Clone, Default)]
pub struct Origin<T>(pub T);

impl<T> PartialEq for Origin<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A timed event.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenarioEvent {
    /// When, in s of scenario time.
    pub at_s: f64,
    /// The action.
    pub action: EventAction,
    /// Its place among the events of its file; `None`: it does not come from a file.
    pub place: Origin<Option<usize>>,
}

/// The set of the paper's and the project's targets that judges a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetSet {
    /// Figs. 12–16: A19–A23, A25–A27.
    ThreeStep,
    /// Standing: no valve switching at rest.
    Stand,
    /// Master lost: safe states in time, latched.
    MasterLost,
    /// E-stop: safe states in time, latched.
    EStop,
    /// Sinusoid of the paper's section 6: A4–A12.
    Sinusoid,
    /// Side of the foot that touches.
    FootSide {
        /// Switch that must close first: bit 0 front, 1 back, 2 left, 3 right.
        bit: u8,
    },
    /// None.
    None,
}

/// A scenario file, checked and converted to SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Name, as in summaries and folder names.
    pub name: String,
    /// One-line description.
    pub description: String,
    /// Name or path of the robot.
    pub robot: String,
    /// Simulated time, s.
    pub duration_s: f64,
    /// Seed of all noise; `--seed` replaces it.
    pub seed: u64,
    /// Motion of the robot.
    pub motion: Motion,
    /// Behaviours of a walk that may act.
    pub behaviours: Behaviours,
    /// Events, in order of time.
    pub events: Vec<ScenarioEvent>,
    /// Ground below it.
    pub ground: Ground,
    /// Injected faults; those of the command line are added.
    pub faults: Vec<FaultSpec>,
    /// Targets that judge it.
    pub targets: TargetSet,
    /// Bars that judge its travel over the ground, in addition to the targets.
    pub bars: Vec<Bar>,
    /// Its file.
    pub source: Origin<Arc<Source>>,
}

const TOP: [&str; 12] = keys::names(&keys::TOP);

/// Names of the sets of targets.
pub const TARGETS: [(&str, TargetSet); 10] = [
    ("three-step", TargetSet::ThreeStep),
    ("stand", TargetSet::Stand),
    ("master-lost", TargetSet::MasterLost),
    ("e-stop", TargetSet::EStop),
    ("sinusoid", TargetSet::Sinusoid),
    ("foot-front", TargetSet::FootSide { bit: 0 }),
    ("foot-back", TargetSet::FootSide { bit: 1 }),
    ("foot-left", TargetSet::FootSide { bit: 2 }),
    ("foot-right", TargetSet::FootSide { bit: 3 }),
    ("none", TargetSet::None),
];

const LEGS: [(&str, LegChoice); 2] = [("left", LegChoice::Left), ("right", LegChoice::Right)];

/// Longest run, s: 104 days. Beyond it a time in seconds no longer distinguishes nanoseconds (its 53 bits end
/// at 9.007e15 ns).
pub(crate) const MAX_DURATION_S: f64 = 9.0e6;

impl Scenario {
    /// All its files: its own, and those of its ground.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        let own = Path::new(&self.source.0.file);
        let ground = terrain::named_files(&self.source.0.text).into_iter();
        let beside = ground.map(|name| own.with_file_name("").join(name));
        std::iter::once(own.to_owned()).chain(beside).collect()
    }

    /// A reader of its text, to refuse a part of it, and the head of that message.
    fn reader(&self) -> Result<(Reader, String), ConfigError> {
        let Source { file, text } = &*self.source.0;
        let what = format!("the scenario file {file} is not usable");
        Ok((Reader::parse(&what, file, text, false)?, what))
    }

    /// A refusal of the section `[[terrain]]` of this number, from 0, with a remedy.
    #[must_use]
    pub fn refuse_ground(&self, section: usize, why: &str, allowed: &str) -> ConfigError {
        let (mut r, what) = match self.reader() {
            Ok(reader) => reader,
            Err(error) => return error,
        };
        let entry = r.entry("terrain", section);
        let message = format!("`{}` ({}): {why}", entry.path, entry.text());
        r.problem(
            Some(entry.span),
            message,
            "in its way",
            Some(allowed.to_owned()),
        );
        r.refusal(&what)
    }

    /// A refusal of the fault of this number, from 0, with a remedy; `None` if the file has no such fault.
    #[must_use]
    pub fn refuse_fault(&self, number: usize, why: &str, help: &str) -> Option<ConfigError> {
        let (mut r, what) = self.reader().ok()?;
        let top = r.table("")?;
        let (_, item) = top.get("faults")?;
        let span = item.as_array()?.get(number)?.span();
        let message = format!("`faults[{number}]`: {why}");
        r.problem(span, message, "cannot be", Some(help.to_owned()));
        Some(r.refusal(&what))
    }

    /// A refusal of the named robot, which is missing; `None` if the file names none.
    pub(crate) fn refuse_robot(&self, missing: &ConfigError) -> Option<ConfigError> {
        let (mut r, what) = self.reader().ok()?;
        let top = r.table("")?;
        let span = top.get("robot")?.1.span();
        let help = missing.problems().first()?.help_text().map(str::to_owned);
        let message = format!("`robot` = \"{}\": {missing}", self.robot);
        r.problem(span, message, "is not there", help);
        Some(r.refusal(&what))
    }

    /// Reads a scenario from TOML text; `file` is its path, for messages and for the data files
    /// beside it.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem found.
    pub fn parse(file: &str, text: &str) -> Result<Self, ConfigError> {
        Self::parse_listed(file, text).map(|(scenario, _)| scenario)
    }

    /// The same, with its quantities as written.
    pub(crate) fn parse_listed(
        file: &str,
        text: &str,
    ) -> Result<(Self, Vec<ParameterInfo>), ConfigError> {
        Self::parse_with(file, text, &Files::beside(file))
    }

    /// The same, with the data files elsewhere.
    pub(crate) fn parse_with(
        file: &str,
        text: &str,
        files: &Files<'_>,
    ) -> Result<(Self, Vec<ParameterInfo>), ConfigError> {
        let what = format!("the scenario file {file} is not usable");
        let mut r = Reader::parse(&what, file, text, false)?;
        r.ensure_kind(&what, FileKind::Scenario)?;
        let source = Source {
            file: file.to_owned(),
            text: text.to_owned(),
        };
        let scenario = read(&mut r, files, Origin(Arc::new(source)));
        r.finish(&what, scenario)
    }
}

fn read(r: &mut Reader, files: &Files<'_>, source: Origin<Arc<Source>>) -> Option<Scenario> {
    let top = r.table("")?;
    r.reject_unknown(&top, &TOP);
    let name = r.name(&top, "name");
    let description = r.text(&top, "description");
    let robot = r.text(&top, "robot");
    let duration = r.required(
        &top,
        &FieldSpec::scalar(
            "duration",
            Dimension::Time,
            [0.01, MAX_DURATION_S],
            "simulated time",
        ),
    );
    let seed = match top.get("seed") {
        Some(_) => r.whole(&top, "seed", 0..=u64::MAX),
        None => {
            r.problem(
                None,
                "`seed` is missing".into(),
                "expected at the top of the file",
                Some("write `seed = 1`".into()),
            );
            None
        }
    };
    let targets = r.choice(&top, "targets", &TARGETS);
    let motion = motion(r);
    let behaviours = behaviours(r);
    let mut events: Vec<ScenarioEvent> = Vec::new();
    for i in 0..r.array_len("events") {
        let entry = r.entry("events", i);
        events.extend(
            event(r, &entry, duration).map(|(at_s, action)| ScenarioEvent {
                at_s,
                action,
                place: Origin(Some(i)),
            }),
        );
    }
    events.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    let ground = terrain::read(r, &TOP, files);
    let bars = bars::read(r, &TOP);
    let faults = r.texts(&top, "faults", |text| {
        let fault = text.parse::<FaultSpec>().map_err(|e| e.to_string())?;
        match duration.filter(|end_s| fault.from_s >= *end_s) {
            Some(end_s) => Err(format!(
                "the fault `{fault}` does nothing: the scenario ends at {end_s} s, before it \
                 could begin; allowed is a begin from 0 s to below {end_s} s"
            )),
            None => Ok(fault),
        }
    });
    Some(Scenario {
        name: name?,
        description: description?,
        robot: robot?,
        duration_s: duration?,
        seed: seed?,
        motion: motion?,
        behaviours,
        events,
        ground,
        faults,
        targets: targets?,
        bars,
        source,
    })
}

/// The behaviours that the section `[behaviours]` does not switch off.
fn behaviours(r: &mut Reader) -> Behaviours {
    let keys = keys::names(&keys::BEHAVIOURS);
    let Some(entry) = r.optional_table("behaviours", &keys) else {
        return Behaviours::ALL;
    };
    r.reject_misplaced(&entry, &keys, &TOP);
    let off = r.texts(&entry, "off", |text| {
        Behaviour::of_name(text).ok_or_else(|| {
            let names = Behaviour::ALL.map(Behaviour::name).join(", ");
            format!("`{text}` is not a behaviour; allowed: {names}")
        })
    });
    off.into_iter().fold(Behaviours::ALL, Behaviours::without)
}

#[derive(Clone, Copy)]
enum MotionKind {
    Stand,
    Walk,
    SquareWave,
    Sinusoid,
}

fn motion(r: &mut Reader) -> Option<Motion> {
    let Some(entry) = r.table("motion") else {
        r.problem(
            None,
            "section [motion] is missing".into(),
            "expected in this file",
            Some(
                "write `[motion]` and below it `kind = \"square-wave\"` and `leg = \"left\"`"
                    .into(),
            ),
        );
        return None;
    };
    let kinds = [
        ("stand", MotionKind::Stand),
        ("walk", MotionKind::Walk),
        ("square-wave", MotionKind::SquareWave),
        ("sinusoid", MotionKind::Sinusoid),
    ];
    match r.choice(&entry, "kind", &kinds)? {
        MotionKind::Stand => {
            r.reject_misplaced(&entry, &keys::names(&keys::STAND), &TOP);
            Some(Motion::Stand)
        }
        MotionKind::Walk => {
            r.reject_misplaced(&entry, &keys::names(&keys::WALK), &TOP);
            match command::arguments(r, &entry, CommandCode::Walk)? {
                Command::Walk(order) => Some(Motion::Walk(order)),
                _ => None,
            }
        }
        MotionKind::SquareWave => {
            r.reject_misplaced(&entry, &keys::names(&keys::SQUARE_WAVE), &TOP);
            let leg = r.choice(&entry, "leg", &LEGS)?;
            Some(Motion::SquareWave { leg })
        }
        MotionKind::Sinusoid => {
            r.reject_misplaced(&entry, &keys::names(&keys::SINUSOID), &TOP);
            let leg = r.choice(&entry, "leg", &LEGS);
            // The master's own ranges, with the names of this section.
            let length = FieldSpec {
                key: "length",
                ..command::spec(&argument::FORWARD)
            };
            let height = command::spec(&argument::HEIGHT);
            let rate = command::spec(&argument::RATE);
            let length = r.required(&entry, &length);
            let height = r.required(&entry, &height);
            let rate = r.required(&entry, &rate);
            Some(Motion::Sinusoid {
                leg: leg?,
                length_m: length?,
                height_m: height?,
                rate_rad_s: rate?,
            })
        }
    }
}

#[derive(Clone, Copy)]
enum ActionKind {
    KillMaster,
    EStop,
    ClearFault,
    Command,
}

fn event(r: &mut Reader, entry: &Entry, duration_s: Option<f64>) -> Option<(f64, EventAction)> {
    // Its range is the scenario's, without its end: see below.
    let at = FieldSpec::scalar(
        "at",
        Dimension::Time,
        [f64::MIN, f64::MAX],
        "time of the event, within the duration of the scenario",
    );
    let at_s = r.required(entry, &at);
    if let (Some(at_s), Some(end_s)) = (at_s, duration_s)
        && !(0.0..end_s).contains(&at_s)
    {
        r.problem(
            entry.get("at").map(|(key, item)| item.span().unwrap_or(key)),
            format!(
                "`{}.at` = {} s is out of range: allowed 0 s to below {} s, the end of the scenario",
                entry.path,
                pretty(at_s),
                pretty(end_s)
            ),
            "does nothing",
            (at_s >= 0.0)
                .then(|| "an event acts before the end: bring it forward, or raise `duration`".into()),
        );
    }
    let actions = [
        ("kill-master", ActionKind::KillMaster),
        ("e-stop", ActionKind::EStop),
        ("clear-fault", ActionKind::ClearFault),
        ("command", ActionKind::Command),
    ];
    let kind = r.choice(entry, "action", &actions)?;
    let action = if matches!(kind, ActionKind::Command) {
        EventAction::Command(command::read(r, entry, &TOP)?)
    } else {
        r.reject_misplaced(entry, &["at", "action"], &TOP);
        match kind {
            ActionKind::KillMaster => EventAction::KillMaster,
            ActionKind::EStop => EventAction::EStop,
            _ => EventAction::ClearFault,
        }
    };
    Some((at_s?, action))
}
